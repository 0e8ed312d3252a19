"""Velocities and accelerations of D1 by screws, section 5 of the source with its slips mended.

A twist is ``(omega; v_O)`` and an accelerator its time derivative, ``(alpha; a_O - omega x v_O)``
(eqs (13), (15)): angular part first, about the origin O of frame A, in frame A, rad and m. Arrays
are vectorised over leading batch axes of the poses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .geometry import TANGENT, FloatArray, Geometry, Pose
from .screws import j1, j2, scaled_screws

SINGULAR = 1e-9
"""Smallest singular value of the scaled J1 or J2 at which the twists count as undetermined."""


@dataclass(frozen=True, eq=False)
class Motion:
    """First and second order motion of coupler (A to B) and platform (A to C).

    Attributes
    ----------
    V_AB, V_AC, A_AB, A_AC : ndarray (..., 6)
        Twists [rad/s, m/s] and accelerators [rad/s^2, m/s^2].
    regular : ndarray (...)
        Whether J1 and J2 are; elsewhere the numbers are least-squares ones and mean nothing.
    """

    V_AB: FloatArray
    V_AC: FloatArray
    A_AB: FloatArray
    A_AC: FloatArray
    regular: np.ndarray


def motion(
    coupler: Pose, platform: Pose, geometry: Geometry, qd: ArrayLike, qdd: ArrayLike
) -> Motion:
    """Motion for rates ``qd`` and accelerations ``qdd`` (..., 6) of the legs, m/s and m/s^2.

    Eqs (22) and (27) for the twists, (34) and (35) for the accelerators. Corrected: the fourth row
    of (34) is reciprocal to the second limb, and in (35) each row to its own limb; as printed some
    repeat the first.
    """
    rates, seconds = (np.asarray(x, dtype=np.float64) for x in (qd, qdd))
    first, second = j1(coupler, geometry), j2(coupler, platform, geometry)
    lines = np.swapaxes(first, -1, -2)  # t_1, leg_1, t_2, ...
    legs, tangents = np.split(np.swapaxes(second, -1, -2), 2, axis=-2)

    right = np.zeros(lines.shape[:-1])
    right[..., 1::2] = rates[..., :3]
    v_ab = _from_klein(first, right)  # (22)
    passive = klein(tangents, v_ab[..., None, :])  # (26)
    v_ac = _from_klein(second, np.concatenate([rates[..., 3:], passive], axis=-1))  # (25), (27)
    v_bc = v_ac - v_ab  # (18)

    limbs = limb_screws(coupler, platform, geometry)
    lie_ab, lie_bc, lie_ac = (
        _lie_screws(screws, twist) for screws, twist in zip(limbs, (v_ab, v_bc, v_ac), strict=True)
    )
    right = klein(lines, np.repeat(lie_ab, 2, axis=-2))
    right[..., 1::2] += seconds[..., :3]
    a_ab = _from_klein(first, right)  # (34)
    carried = (a_ab + lie(v_ab, v_bc))[..., None, :]
    active = seconds[..., 3:] + klein(legs, lie_ac)
    passive = klein(tangents, carried + lie_bc)
    a_ac = _from_klein(second, np.concatenate([active, passive], axis=-1))  # (31), (35)

    scaled = scaled_screws(coupler, platform, geometry)[:2]
    smallest = [np.linalg.svd(j, compute_uv=False)[..., -1] for j in scaled]
    return Motion(v_ab, v_ac, a_ab, a_ac, np.minimum(*smallest) > SINGULAR)


def limb_screws(
    coupler: Pose, platform: Pose, geometry: Geometry
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Screws of the limbs AB, BC and AC, (..., limb, screw, 6) each, eq. (20).

    RPS limbs (AB, BC): the auxiliary prismatic joint along the revolute axis, which never moves,
    then R, P and three revolutes for S, along the revolute axis, the leg and their normal. UPS
    limbs (AC) have six real screws and no auxiliary one: two of U, P, three of S.
    """
    s, s4 = coupler.points(geometry.s_B), platform.points(geometry.c_C)
    tangents = TANGENT @ np.swapaxes(coupler.rotation, -1, -2)
    return (
        _rps(np.broadcast_to(geometry.R, s.shape), np.broadcast_to(TANGENT, s.shape), s),
        _rps(coupler.points(geometry.r_B), tangents, s4),
        _ups(np.broadcast_to(geometry.U, s4.shape), np.broadcast_to(TANGENT, s4.shape), s4),
    )


def limb_rates(screws: FloatArray, twist: FloatArray) -> FloatArray:
    """Joint rates (..., limb, 6) of limbs whose last body has a twist (..., 6), eqs (19), (21)."""
    twists = np.broadcast_to(twist[..., None, :], screws.shape[:-1])
    return _solved(np.swapaxes(screws, -1, -2), twists)


def klein(one: FloatArray, two: FloatArray) -> FloatArray:
    """Klein form (...) of screws (..., 6), section 5.1."""
    return np.asarray((one[..., :3] * two[..., 3:] + one[..., 3:] * two[..., :3]).sum(axis=-1))


def lie(one: FloatArray, two: FloatArray) -> FloatArray:
    """Lie product (..., 6) of screws, section 5.1 with the minus sign lost in print."""
    dual = np.cross(one[..., :3], two[..., 3:]) - np.cross(two[..., :3], one[..., 3:])
    return np.concatenate([np.cross(one[..., :3], two[..., :3]), dual], axis=-1)


def _lie_screws(screws: FloatArray, twist: FloatArray) -> FloatArray:
    """Lie screws (..., limb, 6): each joint's twist with the sum of those behind it, (17), (33)."""
    moving = limb_rates(screws, twist)[..., None] * screws
    behind = np.flip(np.cumsum(np.flip(moving, axis=-2), axis=-2), axis=-2) - moving
    return np.asarray(lie(moving, behind).sum(axis=-2))


def _from_klein(lines: FloatArray, right: FloatArray) -> FloatArray:
    """Screw (..., 6) whose Klein forms with the columns of J are ``right``: J^T Delta V = right."""
    return _solved(np.swapaxes(np.roll(lines, 3, axis=-2), -1, -2), right)  # Delta of eq. (24)


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    return np.asarray((np.linalg.pinv(matrix) @ right[..., None])[..., 0])


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _revolute(axis: FloatArray, point: FloatArray) -> FloatArray:
    return np.concatenate([axis, np.cross(point, axis)], axis=-1)


def _prismatic(axis: FloatArray) -> FloatArray:
    return np.concatenate([np.zeros_like(axis), axis], axis=-1)


def _rps(foot: FloatArray, axis: FloatArray, tip: FloatArray) -> FloatArray:
    leg = _unit(tip - foot)
    ball = [_revolute(a, tip) for a in (axis, leg, _unit(np.cross(axis, leg)))]
    return np.stack([_prismatic(axis), _revolute(axis, foot), _prismatic(leg), *ball], axis=-2)


def _ups(foot: FloatArray, axis: FloatArray, tip: FloatArray) -> FloatArray:
    leg = _unit(tip - foot)
    second = _unit(np.cross(axis, leg))
    ball = [_revolute(a, tip) for a in (second, leg, np.cross(leg, second))]
    cross = [_revolute(axis, foot), _revolute(second, foot)]
    return np.stack([*cross, _prismatic(leg), *ball], axis=-2)
