"""Inverse and direct position problems in closed form: 16 working modes, 4 assembly modes.

All functions are vectorised over leading axes. Modes that a pose does not have are marked, not
left out: their entries hold the nearest angle (arm and rod aligned), so that no NaN appears.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from .geometry import BoolArray, FloatArray, Geometry, split, stack, tip

WORKING_MODES: FloatArray = np.array(list(product((1.0, -1.0), repeat=4)))
"""Signs (16, 4) of (cos beta, B11, B22, B33); B is the serial Jacobian of :mod:`jacobians`."""
ASSEMBLY_MODES: FloatArray = np.array(list(product((1.0, -1.0), repeat=2)))
"""Signs (4, 2) of (M, sin beta), the factors of det A that separate them."""
for _constant in (WORKING_MODES, ASSEMBLY_MODES):
    _constant.setflags(write=False)

REACH = 1e-12
"""How far a cosine may exceed 1, and a squared distance 0 (of l4^2), from rounding."""


@dataclass(frozen=True, eq=False)
class InverseSolutions:
    """Postures with P given, one for each working mode; batch (...).

    Attributes
    ----------
    theta : ndarray (..., 16, 3)
        Inputs in (-pi, pi], rad.
    q : ndarray (..., 16, 3)
        (x_C1, z_C1, beta), m and rad.
    real : ndarray (..., 16) of bool
        Whether the mode exists. Two modes coincide where the sign that tells them apart is zero.
    modes : ndarray (16, 4)
        ``WORKING_MODES``.
    """

    theta: FloatArray
    q: FloatArray
    real: BoolArray
    modes: FloatArray


@dataclass(frozen=True, eq=False)
class DirectSolutions:
    """Postures with the inputs given, one for each assembly mode; batch (...).

    Attributes
    ----------
    q : ndarray (..., 4, 3)
        (x_C1, z_C1, beta), m and rad.
    position : ndarray (..., 4, 3)
        P, m.
    real : ndarray (..., 4) of bool
        Whether the mode exists.
    self_motion : ndarray (..., 4) of bool
        Whether beta is free with the inputs locked (kappa = 0 and b2 = 0); ``real`` is then False.
    modes : ndarray (4, 2)
        ``ASSEMBLY_MODES``.
    """

    q: FloatArray
    position: FloatArray
    real: BoolArray
    self_motion: BoolArray
    modes: FloatArray


def arm_planes(q: FloatArray, g: Geometry) -> tuple[FloatArray, FloatArray]:
    """Ends C_i seen from A_i: in the arm's plane (..., 3, 2) and across it (..., 3), m.

    The plane's axes are those between which theta_i is measured: (y, z) for leg 1, (x, z) for legs
    2 and 3.
    """
    x, z, beta = split(q)
    x3 = x + g.l7 * np.cos(beta) + 2.0 * g.l2 - g.l1
    along = [stack(-g.l1, z), stack(x - 2.0 * g.l5 + g.l1, z), stack(x3, z + g.l6)]
    across = stack(x, 0.0, g.l7 * np.sin(beta))
    return np.stack(np.broadcast_arrays(*along), axis=-2), across


def arm_angles(q: FloatArray, signs: FloatArray, g: Geometry) -> tuple[FloatArray, BoolArray]:
    """Arm angles of postures: eqs (13) and (15), corrected, without half-angle tangents.

    Parameters
    ----------
    q : ndarray (..., 3)
    signs : ndarray (..., 3)
        Signs of B11, B22, B33.

    Returns
    -------
    theta : ndarray (..., 3)
        rad, in (-pi, pi].
    real : ndarray (..., 3) of bool
        Whether the rod reaches the arm's circle.
    """
    along, across = arm_planes(q, g)
    squared = (along**2).sum(axis=-1)
    distance = np.sqrt(squared)
    apart = distance > 0.0  # else every angle or none is right
    cosine = (squared + across**2 + g.l3**2 - g.l4**2) / (2.0 * g.l3 * np.where(apart, distance, 1))
    real = apart & (np.abs(cosine) <= 1.0 + REACH)
    towards = np.arctan2(along[..., 1], along[..., 0])
    theta = towards + np.asarray(signs) * np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.arctan2(np.sin(theta), np.cos(theta)), np.asarray(real)


def inverse(position: FloatArray, g: Geometry) -> InverseSolutions:
    """All postures with P at ``position`` (..., 3), m (eqs (12) to (15), corrected).

    With sin beta = y / l7 either sign of cos beta may hold, and each arm may lie on either side:
    2 x 2 x 2 x 2 = 16. Legs 1 and 2 depend on the sign of cos beta, leg 3 does not, so that 0, 8 or
    16 modes are real.
    """
    x, y, z = split(position)
    sine = y / g.l7
    cosine = np.sqrt(np.clip((1.0 - sine) * (1.0 + sine), 0.0, None))
    cos_beta = cosine[..., None] * WORKING_MODES[:, 0]
    beta = np.arctan2(np.clip(sine, -1.0, 1.0)[..., None], cos_beta)
    q = stack(x[..., None] - g.l2 - g.l7 * cos_beta, z[..., None] - 2.0 * g.l6, beta)
    theta, reached = arm_angles(q, WORKING_MODES[:, 1:], g)
    real = reached.all(axis=-1) & (np.abs(sine) <= 1.0 + REACH)[..., None]
    return InverseSolutions(theta, q, np.asarray(real), WORKING_MODES)


def direct(theta: FloatArray, g: Geometry) -> DirectSolutions:
    """All postures with the arms at ``theta`` (..., 3), rad (eqs (6) to (11), corrected).

    C1 lies on two circles of the plane y = 0 (two points, mirrored about the line of their
    centres: the sign of M), then beta solves a2 cos beta = b2 (the sign of sin beta). A pair of
    solutions with opposite beta differs in the sign of y only.
    """
    t1, t2, t3 = split(theta)
    y_b1, z_b1 = g.l1 + g.l3 * np.cos(t1), g.l3 * np.sin(t1)
    centre = stack(-g.l1 + g.l3 * np.cos(t2) + 2.0 * g.l5, g.l3 * np.sin(t2) - z_b1)
    squared = (centre**2).sum(axis=-1)
    apart = squared > (REACH * g.l4) ** 2  # else a1 = b1 = 0 in eq. (7)
    distance = np.sqrt(np.where(apart, squared, 1.0))
    along = (squared - y_b1**2) / (2.0 * distance)
    height = g.l4**2 - y_b1**2 - along**2
    met = apart & (height >= -REACH * g.l4**2)
    across = np.sqrt(np.clip(height, 0.0, None))[..., None] * ASSEMBLY_MODES[:, 0]
    unit = centre / distance[..., None]
    x = along[..., None] * unit[..., :1] - across * unit[..., 1:]
    z = along[..., None] * unit[..., 1:] + across * unit[..., :1] + z_b1[..., None]
    # eq. (10)
    offset = x - (g.l1 + g.l3 * np.cos(t3))[..., None] + 2.0 * g.l2
    drop = z + g.l6 - (g.l3 * np.sin(t3))[..., None]
    a2 = 2.0 * g.l7 * offset
    b2 = g.l4**2 - g.l7**2 - offset**2 - drop**2
    rounding = REACH * g.l4**2
    regular = np.abs(a2) > rounding
    cosine = b2 / np.where(regular, a2, 1.0)
    real = met[..., None] & regular & (np.abs(cosine) <= 1.0 + REACH)
    free = met[..., None] & ~regular & (np.abs(b2) <= rounding)
    beta = ASSEMBLY_MODES[:, 1] * np.arccos(np.clip(cosine, -1.0, 1.0))
    q = stack(x, z, beta)
    return DirectSolutions(q, tip(q, g), np.asarray(real), np.asarray(free), ASSEMBLY_MODES)
