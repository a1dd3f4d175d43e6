"""Intersection of two fitted lines and its covariance (section IV.B.2 of the paper)."""

import numpy as np
from numba import njit

from features.feature import Line
from features.line_fit import (
    CENTER,
    COV_SLOPE_INTERCEPT,
    INTERCEPT,
    LINE_FIELDS,
    SLOPE,
    VAR_INTERCEPT,
    VAR_SLOPE,
    VERTICAL,
)
from features.se2 import Array


@njit(cache=True)
def intersect_kernel(line_a, line_b, position, cov):
    """Fill the intersection of two line rows, shape (2,), and its covariance, shape (2, 2); False if parallel.

    Case a (eq. 40-42), case b (eq. 43-45, case a with the axes exchanged) and case c (eq. 46-48); Jacobians eq. M8.
    """
    vertical_a = line_a[VERTICAL] > 0.5
    vertical_b = line_b[VERTICAL] > 0.5
    jacobian = np.empty((2, 4))
    if vertical_a == vertical_b:
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
    """Intersect two lines: position, shape (2,) [m], and covariance, shape (2, 2) [m^2] (eq. 40-48).

    Raises
    ------
    ValueError
        The lines are parallel.
    """
    position, cov = np.empty(2), np.empty((2, 2))
    if not intersect_kernel(_row(line_a), _row(line_b), position, cov):
        raise ValueError("parallel lines have no intersection")
    return position, cov


def _row(line: Line) -> Array:
    row = np.zeros(LINE_FIELDS)
    row[VERTICAL] = line.vertical
    row[SLOPE] = line.slope
    row[INTERCEPT] = line.intercept
    row[CENTER] = line.center
    row[VAR_SLOPE] = line.cov[0, 0]
    row[VAR_INTERCEPT] = line.cov[1, 1]
    row[COV_SLOPE_INTERCEPT] = line.cov[0, 1]
    return row
