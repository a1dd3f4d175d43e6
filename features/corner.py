"""Intersection of two fitted lines and its covariance (section IV.B.2 of the paper)."""

import math

import numpy as np
from numba import njit

from features.feature import Line, LineForm
from features.line_fit import (
    CENTER,
    COV_SLOPE_INTERCEPT,
    FORM,
    INTERCEPT,
    LINE_FIELDS,
    POLAR,
    SLOPE,
    VAR_INTERCEPT,
    VAR_SLOPE,
    X_ON_Y,
)
from features.se2 import Array


@njit(cache=True, error_model="numpy")
def intersect_kernel(line_a, line_b, position, cov):
    """Fill the intersection of two line rows, shape (2,), and its covariance, shape (2, 2); False if parallel.

    Polar lines by eq. 36-39; case a (eq. 40-42), case b (eq. 43-45, case a with the axes exchanged), case c
    (eq. 46-48); Jacobians eq. M8.
    """
    jacobian = np.empty((2, 4))
    vertical_a = line_a[FORM] == X_ON_Y
    if line_a[FORM] == POLAR:
        alpha_a, r_a, alpha_b, r_b = line_a[SLOPE], line_a[INTERCEPT], line_b[SLOPE], line_b[INTERCEPT]
        determinant = math.sin(alpha_b - alpha_a)
        if determinant == 0.0:
            return False
        cos_a, sin_a, cos_b, sin_b = math.cos(alpha_a), math.sin(alpha_a), math.cos(alpha_b), math.sin(alpha_b)
        x = (r_a * sin_b - r_b * sin_a) / determinant
        y = (r_b * cos_a - r_a * cos_b) / determinant
        # A line turns about the foot of its normal: the corner moves along the other line.
        along_a = y * cos_a - x * sin_a
        along_b = y * cos_b - x * sin_b
        jacobian[0, 0] = -along_a * sin_b / determinant
        jacobian[1, 0] = along_a * cos_b / determinant
        jacobian[0, 1] = sin_b / determinant
        jacobian[1, 1] = -cos_b / determinant
        jacobian[0, 2] = along_b * sin_a / determinant
        jacobian[1, 2] = -along_b * cos_a / determinant
        jacobian[0, 3] = -sin_a / determinant
        jacobian[1, 3] = cos_a / determinant
        position[0] = x
        position[1] = y
    elif line_a[FORM] == line_b[FORM]:
        difference = line_b[SLOPE] - line_a[SLOPE]
        if difference == 0.0:
            return False
        m_a = line_a[SLOPE]
        m_b = line_b[SLOPE]
        u = (m_b * line_b[CENTER] - m_a * line_a[CENTER] + line_a[INTERCEPT] - line_b[INTERCEPT]) / difference
        v = (
            m_a * m_b * (line_b[CENTER] - line_a[CENTER]) + m_b * line_a[INTERCEPT] - m_a * line_b[INTERCEPT]
        ) / difference
        arm_a = u - line_a[CENTER]
        arm_b = u - line_b[CENTER]
        row_u = 1 if vertical_a else 0
        row_v = 1 - row_u
        jacobian[row_u, 0] = arm_a / difference
        jacobian[row_u, 1] = 1.0 / difference
        jacobian[row_u, 2] = -arm_b / difference
        jacobian[row_u, 3] = -1.0 / difference
        jacobian[row_v, 0] = m_b * arm_a / difference
        jacobian[row_v, 1] = m_b / difference
        jacobian[row_v, 2] = -m_a * arm_b / difference
        jacobian[row_v, 3] = -m_a / difference
        position[row_u] = u
        position[row_v] = v
    else:
        flat, steep = (line_b, line_a) if vertical_a else (line_a, line_b)
        columns = (2, 0) if vertical_a else (0, 2)
        m = flat[SLOPE]
        s = steep[SLOPE]
        difference = 1.0 - m * s
        if difference == 0.0:
            return False
        x = (-m * s * flat[CENTER] + s * flat[INTERCEPT] - s * steep[CENTER] + steep[INTERCEPT]) / difference
        y = (-m * s * steep[CENTER] + m * steep[INTERCEPT] - m * flat[CENTER] + flat[INTERCEPT]) / difference
        arm_flat = x - flat[CENTER]
        arm_steep = y - steep[CENTER]
        jacobian[0, columns[0]] = s * arm_flat / difference
        jacobian[0, columns[0] + 1] = s / difference
        jacobian[0, columns[1]] = arm_steep / difference
        jacobian[0, columns[1] + 1] = 1.0 / difference
        jacobian[1, columns[0]] = arm_flat / difference
        jacobian[1, columns[0] + 1] = 1.0 / difference
        jacobian[1, columns[1]] = m * arm_steep / difference
        jacobian[1, columns[1] + 1] = m / difference
        position[0] = x
        position[1] = y
    for i in range(2):
        for j in range(2):
            cov[i, j] = (
                jacobian[i, 0] * jacobian[j, 0] * line_a[VAR_SLOPE]
                + jacobian[i, 1] * jacobian[j, 1] * line_a[VAR_INTERCEPT]
                + (jacobian[i, 0] * jacobian[j, 1] + jacobian[i, 1] * jacobian[j, 0]) * line_a[COV_SLOPE_INTERCEPT]
                + jacobian[i, 2] * jacobian[j, 2] * line_b[VAR_SLOPE]
                + jacobian[i, 3] * jacobian[j, 3] * line_b[VAR_INTERCEPT]
                + (jacobian[i, 2] * jacobian[j, 3] + jacobian[i, 3] * jacobian[j, 2]) * line_b[COV_SLOPE_INTERCEPT]
            )
    return True


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
    if not intersect_kernel(_row(line_a), _row(line_b), position, cov):
        raise ValueError("parallel lines have no intersection")
    return position, cov


def _row(line: Line) -> Array:
    row = np.zeros(LINE_FIELDS)
    row[FORM] = line.form
    row[SLOPE], row[INTERCEPT] = line.params
    row[CENTER] = line.center
    row[VAR_SLOPE] = line.cov[0, 0]
    row[VAR_INTERCEPT] = line.cov[1, 1]
    row[COV_SLOPE_INTERCEPT] = line.cov[0, 1]
    return row
