"""Screws, network matrices and determinants of the paper (eqs 2, 5, 12, 16-19).

Here, as in the paper, a screw is (angular; linear at O). The spherical joint is written as three
hinges x, y, z, which start in the frame of the link (x towards the column, y along t at theta = 0)
and end in the platform frame turned by the leg's phase. Circular joints are per radian.

The hinges bring in a factor cos q_y that is no property of the robot (see ``singularities``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from .geometry import PHASES, FloatArray, Geometry, Z
from .position import carriages, joints_S


def revolute_screw(axis: ArrayLike, point: ArrayLike) -> FloatArray:
    """Screw (..., 6) of a hinge: unit axis and its moment ``s_0 x s`` about O (eq. 2, h = 0)."""
    s, p = np.broadcast_arrays(np.asarray(axis, dtype=float), np.asarray(point, dtype=float))
    return np.concatenate([s, np.cross(p, s)], axis=-1)


def link_frames(inputs: ArrayLike, q_r: ArrayLike, g: Geometry) -> FloatArray:
    """Axes (..., 3, 3, 3) of the three links: x from S to the hinge, y along t, as columns."""
    _, inward, below = carriages(inputs, g)
    q = np.asarray(q_r, dtype=np.float64)[..., None]
    x = -(np.cos(q) * inward + np.sin(q) * below)
    z = np.sin(q) * inward - np.cos(q) * below
    return np.stack([x, np.cross(z, x), z], axis=-1)


def wrist_angles(
    inputs: ArrayLike, q_r: ArrayLike, rotation: ArrayLike, g: Geometry, offset: float = 0.0
) -> FloatArray:
    """Angles q_x, q_y, q_z (..., 3 legs, 3), rad, that three hinges at S would have.

    Parameters
    ----------
    inputs, q_r : array_like (..., 6), (..., 3)
        As in :class:`closedchain.robots.eclipse.InverseSolutions`.
    rotation : array_like (..., 3, 3)
        Platform's axes in the world frame.
    offset : float
        Angle about the link's y at which the hinges start, rad; it moves the gimbal lock.
    """
    turned = np.asarray(rotation)[..., None, :, :] @ _about_z(PHASES)
    start = link_frames(inputs, q_r, g) @ _about_y(offset)
    w = np.swapaxes(start, -1, -2) @ turned
    q_y = np.arcsin(np.clip(w[..., 0, 2], -1.0, 1.0))
    q_x = np.arctan2(-w[..., 1, 2], w[..., 2, 2])
    return np.stack([q_x, q_y, np.arctan2(-w[..., 0, 1], w[..., 0, 0])], axis=-1)


def leg_pose(
    inputs: ArrayLike, q_r: ArrayLike, wrist: ArrayLike, g: Geometry, offset: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Platform pose that each leg's joints give: positions (3, 3), m, rotations (3, 3, 3).

    The product of the legs' displacements (eq. 12). Where the loops are open the three differ.
    """
    frames = link_frames(inputs, q_r, g) @ _about_y(offset)
    turned = frames @ Rotation.from_euler("XYZ", np.asarray(wrist)).as_matrix()
    rotation = turned @ _about_z(-PHASES)
    position = joints_S(inputs, q_r, g) - np.einsum("jab,jb->ja", rotation, g.plate)
    return position, rotation


def leg_screws(
    inputs: ArrayLike, q_r: ArrayLike, wrist: ArrayLike, g: Geometry, offset: float = 0.0
) -> FloatArray:
    """``M_a, M_b, M_c`` (3, 6, 6) of eq. 16: columns p_c, p_v (p_h), r, x, y, z."""
    hinge, _, _ = carriages(inputs, g)
    s, frames = joints_S(inputs, q_r, g), link_frames(inputs, q_r, g)
    tangent = frames[:, :, 1]
    columns = np.zeros((3, 6, 6))
    columns[:, 2, 0] = 1.0
    columns[:, 5, 1] = 1.0
    if g.z_c is not None:
        columns[0, :, 1] = revolute_screw(-tangent[0], g.z_c * Z)
    columns[:, :, 2] = revolute_screw(-tangent, hinge)
    turned = frames @ _about_y(offset)
    angles = np.asarray(wrist, dtype=np.float64)
    for k, axis in enumerate("XYZ"):
        columns[:, :, 3 + k] = revolute_screw(turned[:, :, k], s)
        turned = turned @ Rotation.from_euler(axis, angles[:, k, None]).as_matrix()
    return columns


def virtual_screws(position: ArrayLike, angles: ArrayLike) -> FloatArray:
    """Screws (6, 6) of the 3P3R virtual chain, ``M_1j`` of eq. 16: px, py, pz, rx, ry, rz.

    The same for the three legs: a phase about the last axis does not move that axis.
    """
    p = np.asarray(position, dtype=np.float64)
    columns = np.zeros((6, 6))
    columns[3:, :3] = np.eye(3)
    turned = np.eye(3)
    for k, axis in enumerate("XYZ"):
        columns[:, 3 + k] = revolute_screw(turned[:, k], p)
        turned = turned @ Rotation.from_euler(axis, np.asarray(angles)[k]).as_matrix()
    return columns


def network(legs: FloatArray) -> FloatArray:
    """Network matrix N (12, 18) of the circuits a-b and a-c without virtual chain (eq. 5)."""
    m_a, m_b, m_c = legs
    zero = np.zeros((6, 6))
    return np.block([[m_a, -m_b, zero], [m_a, zero, -m_c]])


def determinant_column(q_r: ArrayLike, q_y: ArrayLike, g: Geometry) -> FloatArray:
    """Determinant of ``M_j`` for a leg with a column, m^2 (eq. 17)."""
    q, y = np.asarray(q_r, dtype=float), np.asarray(q_y, dtype=float)
    return np.asarray(g.r * (-g.r_g + g.r * np.cos(q)) * np.cos(y) * np.sin(q))


def determinant_arc(beta: ArrayLike, q_r: ArrayLike, q_y: ArrayLike, g: Geometry) -> FloatArray:
    """Determinant of ``M_a`` of Eclipse-II, m^3, with ``beta = L_a / r_g`` (eq. 18)."""
    b, q = np.asarray(beta, dtype=float), np.asarray(q_r, dtype=float)
    inner = -g.r_g * np.cos(b) + g.r * np.cos(q + b)
    return np.asarray(g.r_g * g.r * inner * np.cos(np.asarray(q_y)) * np.sin(q))


def determinant_virtual(phi_y: ArrayLike) -> FloatArray:
    """Determinant of ``M_1j`` (eq. 19): gimbal lock of the virtual chain, nothing of the robot."""
    return np.asarray(-np.cos(np.asarray(phi_y, dtype=np.float64)))


def _about_z(angle: ArrayLike) -> FloatArray:
    return _about(angle, "Z")


def _about_y(angle: ArrayLike) -> FloatArray:
    return _about(angle, "Y")


def _about(angle: ArrayLike, axis: str) -> FloatArray:
    x = np.asarray(angle, dtype=np.float64)
    flat = Rotation.from_euler(axis, x.reshape(-1, 1)).as_matrix()
    return np.asarray(flat.reshape(*x.shape, 3, 3))
