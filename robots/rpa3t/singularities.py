"""Singular sets in closed form: surfaces in the workspace and in joint space, and the self-motion.

Each surface is given as a function that changes sign across it, so that a contour of its zero draws
it. ``branch`` is the sign of cos beta. Polynomials stand for both signs of an inner root.
"""

from __future__ import annotations

import numpy as np

from closedchain.urdf.errors import ClosureError

from .geometry import FloatArray, Geometry, split, stack
from .position import arm_planes


def inverse_surfaces(position: FloatArray, branch: float, g: Geometry) -> FloatArray:
    """Where arm i and the projection of rod i are aligned: (..., 3), one for each leg.

    ``4 l3^2 s_i^2`` at every posture with this P: positive inside the reach of leg i, zero where it
    is stretched or folded, negative beyond [m^4]. For leg 1 the zero set is
    ``l1^2 + z_C1^2 = (l3 +- sqrt(l4^2 - x_C1^2))^2``, and so on. P with |y| > l7 has no posture;
    y is taken as +-l7 there.
    """
    x, y, z = split(position)
    sine = np.clip(y / g.l7, -1.0, 1.0)
    cosine = branch * np.sqrt((1.0 - sine) * (1.0 + sine))
    q = stack(x - g.l2 - g.l7 * cosine, z - 2.0 * g.l6, np.arctan2(sine, cosine))
    along, across = arm_planes(q, g)
    squared = (along**2).sum(axis=-1)
    excess = squared + across**2 + g.l3**2 - g.l4**2
    return np.asarray(4.0 * g.l3**2 * squared - excess**2)


def output_surface(position: FloatArray, g: Geometry) -> FloatArray:
    """``l7^2 - y^2`` (...), m^2: zero on the planes y = +-l7, where cos beta = 0 (inverse)."""
    return np.asarray(g.l7**2 - split(position)[1] ** 2)


def kappa_surface(position: FloatArray, branch: float, g: Geometry) -> FloatArray:
    """Postures with kappa = 0 (direct, with a self-motion): (..., 2), m^2.

    ``(x + l2 - l1 - l7 cos beta)^2 + (z - l6 +- sqrt(l4^2 - l7^2))^2 - l3^2`` for both signs.
    """
    x, y, z = split(position)
    cosine = branch * np.sqrt(np.clip(g.l7**2 - y**2, 0.0, None))
    drop = _drop(g)
    aside = (x + g.l2 - g.l1 - cosine) ** 2 - g.l3**2
    return stack(aside + (z - g.l6 + drop) ** 2, aside + (z - g.l6 - drop) ** 2)


def parallel_rods(theta: FloatArray, g: Geometry) -> FloatArray:
    """``4 h^2 d^2`` (...), m^4, zero where M = 0 (direct): C1 lies h from the line of two centres.

    In joint space the set is ``(x_B2 + 2 l5)^2 + (z_B2 - z_B1)^2 = (l4 +- sqrt(l4^2 - y_B1^2))^2``.
    d is the distance of the centres of the two circles on which C1 lies, and the value equals
    4 M^2; it is negative where legs 1 and 2 cannot be assembled.
    """
    t1, t2, _ = split(theta)
    y_b1, z_b1 = g.l1 + g.l3 * np.cos(t1), g.l3 * np.sin(t1)
    centre = stack(-g.l1 + g.l3 * np.cos(t2) + 2.0 * g.l5, g.l3 * np.sin(t2) - z_b1)
    squared = (centre**2).sum(axis=-1)
    return np.asarray(4.0 * squared * (g.l4**2 - y_b1**2) - (squared - y_b1**2) ** 2)


def self_motion(
    theta3: FloatArray | float, beta: FloatArray | float, g: Geometry, *, below: bool = True
) -> FloatArray:
    """Postures q (..., 3) on which P runs around a circle of radius l7 with all inputs locked.

    kappa = 0 and b2 = 0: C1 lies so that C3 is at distance l4 from B3 for every beta.

    Parameters
    ----------
    theta3 : ndarray (...)
        rad; fixes C1.
    beta : ndarray (...)
        rad; where on the circle.
    below : bool
        Whether C3 hangs below B3.

    Raises
    ------
    ClosureError
        l4 < l7: no such posture.
    """
    drop = -_drop(g) if below else _drop(g)
    theta3 = np.asarray(theta3, dtype=np.float64)
    x = g.l1 - 2.0 * g.l2 + g.l3 * np.cos(theta3)
    return stack(x, g.l3 * np.sin(theta3) - g.l6 + drop, np.asarray(beta, dtype=np.float64))


def _drop(g: Geometry) -> float:
    """Height of C3 under B3 where the rod of leg 3 leaves beta free, m."""
    if g.l4 < g.l7:
        raise ClosureError(f"rod l4={g.l4:g} is shorter than link l7={g.l7:g}: kappa has no zeros")
    return float(np.sqrt(g.l4**2 - g.l7**2))
