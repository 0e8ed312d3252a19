"""Where the velocity equation bhat_i.v = bhat_i.z qdot_i degenerates, in closed form.

* type 1 (inverse): a rod is horizontal, bhat_i.z = 0; its slider may rest while o' moves.
* type 2 (direct): the rods are coplanar, det[bhat_1 bhat_2 bhat_3] = 0; o' may move with all
  sliders at rest, along the normal of their plane.

Frame O; vectorised over a leading batch axis.
"""

from __future__ import annotations

import numpy as np

from closedchain.urdf.errors import ClosureError

from .geometry import RADIAL, TANGENT, FloatArray, Geometry

COPLANAR = 1e-6
"""Volume of the unit rods below which they span a plane, for ``free_direction``."""


def inverse_factors(bhat: FloatArray) -> FloatArray:
    """Vertical components bhat_i.z (..., 3): the diagonal of J_a; zero at type 1."""
    return np.asarray(bhat[..., 2])


def direct_factor(bhat: FloatArray) -> FloatArray:
    """Signed volume det[bhat_1 bhat_2 bhat_3] (...) of the unit rods; zero at type 2.

    With all sliders on one side of the platform it never vanishes for a != c. Coplanar rods would
    end on half a great circle, whose shadow on the base plane is half an ellipse, cut along its
    major axis: of three points on it, the middle one sees the others at a right angle or more. But
    the shadows of the rods' ends are the corners of an equilateral triangle.
    """
    return np.asarray(np.linalg.det(bhat))


def collapse_factors(bhat: FloatArray) -> FloatArray:
    """1 - (s2_i.bhat_i)^2 (..., 3): zero where a parallelogram collapses onto its bars.

    That needs a horizontal rod, so it is a part of type 1.
    """
    return np.asarray(1.0 - (bhat * TANGENT).sum(axis=-1) ** 2)


def free_direction(bhat: FloatArray) -> FloatArray:
    """Unit velocity (3,) of o' with all sliders at rest, for coplanar rods ``bhat`` (3, 3).

    Raises
    ------
    ClosureError
        The rods are not coplanar: there is none.
    """
    if abs(float(direct_factor(bhat))) > COPLANAR:
        raise ClosureError("the rods are not coplanar: o' is at rest when the sliders are")
    return np.asarray(np.linalg.svd(bhat)[2][-1])


def opposed_rods(geometry: Geometry, i: int, j: int, z: float = 0.0) -> FloatArray:
    """Platform centre (3,) where rods i and j (0, 1, 2) are opposed, bhat_i = -bhat_j.

    With the sliders i and j on different sides this is a direct singularity whatever leg k does:
    o' is above the middle of d r_i and d r_j.
    """
    middle = 0.5 * geometry.d * (RADIAL[i] + RADIAL[j])
    return np.array([middle[0], middle[1], z])


def horizontal_rod(geometry: Geometry, i: int, azimuth: float, z: float = 0.0) -> FloatArray:
    """Platform centre (3,) where rod i (0, 1, 2) is horizontal and points along ``azimuth`` [rad].

    Whether the other legs reach it is another matter: see ``position.margins``.
    """
    bhat = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    centre = geometry.d * RADIAL[i] + geometry.b * bhat
    return np.array([centre[0], centre[1], z])
