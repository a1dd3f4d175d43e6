# pyright: standard
"""Intersection of two fitted lines and its covariance (section IV.B.2 of the paper)."""

import math

import numpy as np
from numba import f8
from numpy.typing import NDArray

from features.compiled import inner, kernel
from features.feature import LINE_RECORD, Line, LineForm
from features.fitting.fit_kernels import LINE, POLAR, X_ON_Y
from features.se2 import Array


@inner()
def intersect_kernel(line_a, line_b, position, cov):
    """Fill the intersection of two line records, shape (2,), and its covariance, shape (2, 2); False if parallel.

    Polar lines by eq. 36-39; case a (eq. 40-42), case b (eq. 43-45, case a with the axes exchanged), case c
    (eq. 46-48); Jacobians eq. M8: per parameter the derivative of the corner, a column of them.
    """
    first_a, second_a = line_a.params[0], line_a.params[1]
    first_b, second_b = line_b.params[0], line_b.params[1]
    if line_a.form == POLAR:
        determinant = math.sin(first_b - first_a)
        if determinant == 0.0:
            return False
        cos_a, sin_a, cos_b, sin_b = math.cos(first_a), math.sin(first_a), math.cos(first_b), math.sin(first_b)
        x = (second_a * sin_b - second_b * sin_a) / determinant
        y = (second_b * cos_a - second_a * cos_b) / determinant
        # A line turns about the foot of its normal: the corner moves along the other line.
        arm_a = x * sin_a - y * cos_a
        arm_b = x * sin_b - y * cos_b
        along_a = (-sin_a / determinant, cos_a / determinant)
        along_b = (sin_b / determinant, -cos_b / determinant)
        position[0], position[1] = x, y
        _propagate(line_a, line_b, arm_a, along_b, arm_b, along_a, cov)
    elif line_a.form == line_b.form:
        difference = first_b - first_a
        if difference == 0.0:
            return False
        u = (first_b * line_b.center - first_a * line_a.center + second_a - second_b) / difference
        v = (first_a * first_b * (line_b.center - line_a.center) + first_b * second_a - first_a * second_b) / difference
        along_a = (-1.0 / difference, -first_a / difference)
        along_b = (1.0 / difference, first_b / difference)
        position[0], position[1] = u, v
        if line_a.form == X_ON_Y:
            position[0], position[1] = v, u
            along_a = (along_a[1], along_a[0])
            along_b = (along_b[1], along_b[0])
        _propagate(line_a, line_b, u - line_a.center, along_b, u - line_b.center, along_a, cov)
    else:
        flat, steep = (line_b, line_a) if line_a.form == X_ON_Y else (line_a, line_b)
        m = flat.params[0]
        s = steep.params[0]
        b = flat.params[1]
        h = steep.params[1]
        difference = 1.0 - m * s
        if difference == 0.0:
            return False
        x = (-m * s * flat.center + s * b - s * steep.center + h) / difference
        y = (-m * s * steep.center + m * h - m * flat.center + b) / difference
        along_flat = (1.0 / difference, m / difference)
        along_steep = (s / difference, 1.0 / difference)
        position[0], position[1] = x, y
        _propagate(flat, steep, x - flat.center, along_steep, y - steep.center, along_flat, cov)
    return True


@inner(inline="always")
def _propagate(line_a, line_b, arm_a, shift_a, arm_b, shift_b, cov):
    """Fill the covariance of an intersection.

    It shifts by ``shift_a`` as the second parameter of line a grows and by ``arm_a`` times that as the first one does.
    """
    var_a = arm_a * arm_a * line_a.cov[0, 0] + 2.0 * arm_a * line_a.cov[0, 1] + line_a.cov[1, 1]
    var_b = arm_b * arm_b * line_b.cov[0, 0] + 2.0 * arm_b * line_b.cov[0, 1] + line_b.cov[1, 1]
    for i in range(2):
        for j in range(2):
            cov[i, j] = shift_a[i] * shift_a[j] * var_a + shift_b[i] * shift_b[j] * var_b


@kernel(LINE, LINE, f8[::1], f8[:, ::1])
def _intersect_lines(line_a, line_b, position, cov):
    return intersect_kernel(line_a, line_b, position, cov)


def intersect(line_a: Line, line_b: Line) -> tuple[Array, Array]:
    """Intersect two lines: position, shape (2,) [m], and covariance, shape (2, 2) [m^2] (eq. 36-48).

    Raises
    ------
    ValueError
        The lines are parallel, or one of them is polar and the other is not.
    """
    if (line_a.form == LineForm.POLAR) != (line_b.form == LineForm.POLAR):
        raise ValueError("a polar line and a regression line: fit both by the same method")
    position, cov = np.empty(2), np.empty((2, 2))
    records = _records(line_a, line_b)
    if not _intersect_lines(records[0], records[1], position, cov):
        raise ValueError("parallel lines have no intersection")
    return position, cov


def _records(*lines: Line) -> NDArray[np.void]:
    records = np.empty(len(lines), LINE_RECORD)
    for record, line in zip(records, lines, strict=True):
        record["form"], record["center"] = line.form, line.center
        record["params"], record["cov"] = line.params, line.cov
    return records
