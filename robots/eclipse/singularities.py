"""Velocity equation ``Jx V = Jq rates`` of the six driven joints, and its singular sets.

With the carriages of leg j locked, S_j moves along neither the tangent ``t_j`` nor the link
``l_j``: forces along these two lines through S_j do no work on the passive pairs. Their six lines
are the rows of Jx. Jq is diagonal: ``rho_j`` for the horizontal guide and ``-sin q_r`` for the
slide (times ``r_g`` on the vertical guide).

Type 1: ``rho_j = 0`` (S_j on the central axis) or ``sin q_rj = 0`` (the link square to its slide).
Type 2: the three planes (t_j, l_j) through S_j and the plane of the plate share a point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from .geometry import FloatArray, Geometry, Z, along
from .position import carriages, inverse, joints_S


def reciprocal_lines(
    inputs: ArrayLike, q_r: ArrayLike, g: Geometry
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """S, unit tangents t and unit link directions l (hinge to S), each (..., 3, 3)."""
    s = joints_S(inputs, q_r, g)
    hinge, _, _ = carriages(inputs, g)
    t = np.cross(Z, along(np.asarray(inputs, dtype=np.float64)[..., :3]))
    return s, t, (s - hinge) / g.r


def platform_jacobian(
    inputs: ArrayLike,
    q_r: ArrayLike,
    g: Geometry,
    *,
    about: ArrayLike | None = None,
    length: float = 1.0,
) -> FloatArray:
    """Jx (..., 6, 6): rows t_a, t_b, t_c, l_a, l_b, l_c on the twist (linear, angular).

    Parameters
    ----------
    inputs, q_r : array_like (..., 6), (..., 3)
        As in :class:`closedchain.robots.eclipse.InverseSolutions`.
    about : array_like (..., 3), optional
        Point whose velocity is the linear part, m, world frame; P if omitted.
    length : float
        Divides the moments, m: 1 for a twist in m/s and rad/s, ``g.a`` for determinants.
    """
    s, t, link = reciprocal_lines(inputs, q_r, g)
    point = s.mean(axis=-2) if about is None else np.asarray(about, dtype=np.float64)
    arm = s - point[..., None, :]
    force = np.concatenate([t, link], axis=-2)
    moment = np.cross(np.concatenate([arm, arm], axis=-2), force) / length
    return np.concatenate([force, moment], axis=-1)


def actuator_jacobian(inputs: ArrayLike, q_r: ArrayLike, g: Geometry) -> FloatArray:
    """Diagonal (..., 6) of Jq: ``rho_j`` [m], then ``-sin q_r`` (times ``r_g`` [m] on an arc)."""
    x, q = np.asarray(inputs, dtype=np.float64), np.asarray(q_r, dtype=np.float64)
    rho = (joints_S(x, q, g) * along(x[..., :3])).sum(axis=-1)
    return np.concatenate([rho, -np.sin(q) * np.where(g.arc, g.r_g, 1.0)], axis=-1)


def direct_determinant(inputs: ArrayLike, q_r: ArrayLike, g: Geometry) -> FloatArray:
    """Dimensionless det Jx (...): about P, moments divided by ``a``; zero exactly at type 2."""
    return np.asarray(np.linalg.det(platform_jacobian(inputs, q_r, g, length=g.a)))


def four_planes(inputs: ArrayLike, q_r: ArrayLike, g: Geometry) -> FloatArray:
    """Planes (..., 4, 4), rows ``(n, -n.S)``: (t_j, l_j) through S_j for a, b, c, and the plate.

    With the moments of Jx divided by L, ``det Jx = -(2 area / L^3) det planes`` (plus if twists are
    written angular first): type 2 exactly where the four planes share a point, at infinity
    included. The last column is in m.
    """
    s, t, link = reciprocal_lines(inputs, q_r, g)
    plate = np.cross(s[..., 1, :] - s[..., 0, :], s[..., 2, :] - s[..., 0, :])
    plate = plate / np.linalg.norm(plate, axis=-1, keepdims=True)
    n = np.concatenate([np.cross(t, link), plate[..., None, :]], axis=-2)
    p = np.concatenate([s, s[..., :1, :]], axis=-2)
    return np.concatenate([n, -(n * p).sum(axis=-1, keepdims=True)], axis=-1)


def tilted(azimuth: float, tilt: ArrayLike) -> FloatArray:
    """Rotations (..., 3, 3) that lower the direction at ``azimuth`` by ``tilt``, rad, no torsion.

    ``Rz(azimuth) Ry(tilt) Rz(-azimuth)``.
    """
    x = np.asarray(tilt, dtype=np.float64)
    vector = x.reshape(-1, 1) * np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.asarray(Rotation.from_rotvec(vector).as_matrix().reshape(*x.shape, 3, 3))


def first_direct_tilt(
    azimuth: float, g: Geometry, height: float = 0.10, *, samples: int = 901
) -> float | None:
    """Smallest tilt, rad, in (0, pi/2] at which P = (0, 0, height) meets type 2, or None.

    Links lowered, columns outside. A zero of even order between two samples is not seen.
    """
    position = np.array([0.0, 0.0, height])

    def determinant(tilt: ArrayLike) -> FloatArray:
        rotation = tilted(azimuth, tilt)
        found = inverse(np.broadcast_to(position, rotation.shape[:-1]), rotation, g)
        return direct_determinant(found.inputs[..., 0, :], found.q_r[..., 0, :], g)

    grid = np.linspace(0.0, np.pi / 2.0, samples)
    values = determinant(grid)
    change = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))
    if not change.size:
        return None
    k = int(change[0])
    return float(brentq(lambda x: float(determinant(x)), grid[k], grid[k + 1], xtol=1e-15))
