# pyright: standard
"""Cosine and sine of many directions at once."""

import numpy as np
from numba import f8

from features.compiled import READ_ONLY, kernel

MAX_ANGLE = 1e6
"""Angles stay below this [rad], so that the reduction to [-pi/4, pi/4] is exact: fewer than 2^20 quarter turns."""

_QUARTERS_PER_RADIAN = 2.0 / np.pi
_QUARTER_1 = 1.57079632673412561417e00
_QUARTER_2 = 6.07710050630396597660e-11
_QUARTER_3 = 2.02226624879595063154e-21
"""pi / 2 in three parts (of fdlibm); the first two have 33 bits, so that their products with a whole number below 2^20
are exact."""


@kernel(READ_ONLY, f8, f8[::1], f8[::1])
def sincos(angles, offset, cosines, sines):
    """Fill ``cosines`` and ``sines`` of ``angles + offset``; return whether all angles are within :data:`MAX_ANGLE`.

    Each value is within two units in the last place.

    Cody-Waite reduction by quarters of a turn, then the minimax polynomials of fdlibm (``k_sin.c``, ``k_cos.c``) for
    [-pi/4, pi/4]. The loop has no branch and no call of libm, so that the compiler makes vector code of it.
    """
    outside = 0
    for i in range(angles.size):
        angle = angles[i] + offset
        outside |= not abs(angle) < MAX_ANGLE
        quarters = np.rint(angle * _QUARTERS_PER_RADIAN)
        x = ((angle - quarters * _QUARTER_1) - quarters * _QUARTER_2) - quarters * _QUARTER_3
        z = x * x
        sine = x + x * z * (
            -1.66666666666666324348e-01
            + z * (8.33333333332248946124e-03
            + z * (-1.98412698298579493134e-04
            + z * (2.75573137070700676789e-06
            + z * (-2.50507602534068634195e-08
            + z * 1.58969099521155010221e-10))))
        )  # fmt: skip
        cosine = 1.0 - 0.5 * z + z * z * (
            4.16666666666666019037e-02
            + z * (-1.38888888888741095749e-03
            + z * (2.48015872894767294178e-05
            + z * (-2.75573143513906633035e-07
            + z * (2.08757232129817482790e-09
            + z * -1.13596475577881948265e-11))))
        )  # fmt: skip
        # Quarter 0: (c, s); 1: (-s, c); 2: (-c, -s); 3: (s, -c).
        half = 0.5 * quarters
        odd = half != np.floor(half)
        c = sine if odd else cosine
        s = cosine if odd else sine
        phase = 0.25 * quarters - np.floor(0.25 * quarters)
        cosines[i] = -c if abs(phase - 0.375) < 0.25 else c
        sines[i] = -s if phase >= 0.5 else s
    return outside == 0
