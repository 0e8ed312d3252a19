"""What the paper prints, kept to be compared with what is true. Nothing else uses this module.

Lengths in metres throughout; the paper's (16) and (17) are in centimetres, so that their constants
are the case study's dimensions in that unit.
"""

from __future__ import annotations

import numpy as np

from .geometry import FloatArray, Geometry, split, stack

_CM = 0.01


def arm_angle(leg: int, q: FloatArray, sign: float, g: Geometry) -> FloatArray:
    """Eqs (13) and (15) with g_i, h_i as printed: theta_i (...), rad; the root must be real.

    Parameters
    ----------
    leg : 1, 2 or 3
    q : ndarray (..., 3)
    sign : +1 or -1
        Before the root.
    """
    x, z, beta = split(q)
    near, far = (g.l1 - g.l3) ** 2 - g.l4**2, (g.l1 + g.l3) ** 2 - g.l4**2
    if leg == 1:
        rest = x**2 + z**2
        below, above = far + rest, near + rest
    elif leg == 2:
        x2 = x - 2.0 * g.l5
        rest = x2**2 + z**2
        below, above = far + rest + 2 * x2 * (g.l1 + g.l3), near + rest + 2 * x2 * (g.l1 - g.l3)
    else:
        z = z + g.l6
        rest = (g.l7 * np.sin(beta)) ** 2 + z**2
        below, above = near + rest, far + rest
    root = np.sqrt(4.0 * z**2 * g.l3**2 - below * above)
    return np.asarray(2.0 * np.arctan((2.0 * g.l3 * z + sign * root) / below))


def parallel_factors(q: FloatArray, theta: FloatArray) -> FloatArray:
    """Factors of (16) (..., 4), cm: sin(beta), 35 cos(theta3) - x + 16, x, 35 sin(theta2) - z."""
    x, z, beta = split(np.asarray(q) / [_CM, _CM, 1.0])
    _, t2, t3 = split(theta)
    return stack(np.sin(beta), 35.0 * np.cos(t3) - x + 16.0, x, 35.0 * np.sin(t2) - z)


def serial_factors(q: FloatArray, theta: FloatArray) -> FloatArray:
    """Factors of (17) (..., 4), cm^2; the last is cos(beta)."""
    x, z, beta = split(np.asarray(q) / [_CM, _CM, 1.0])
    t1, t2, t3 = split(theta)
    return stack(
        -2100.0 * np.sin(t1) - 70.0 * z * np.cos(t1),
        1400.0 * np.sin(t2) - 70.0 * z * np.cos(t2),
        (350.0 * np.cos(beta) + 70.0 * x - 1120.0) * np.sin(t3) - 70.0 * z * np.cos(t3),
        np.cos(beta),
    )


def heights(q: FloatArray, g: Geometry) -> dict[str, FloatArray]:
    """z (...), m, of F1, D3 and P as the text before (9) and (11) gives them: all equal to z_D1."""
    z = split(q)[1] + g.l6
    return {"F1": z, "D3": z, "P": z}
