"""Screws of the legs and the velocity equation Jx^T Delta V = J'q qdot_beta + Jq qdot_alpha (5).

A screw is (s; P x s) about O: unit direction s, moment of a line through P. The velocity state is
V = (omega; v_O), v_O being the velocity of the platform's point that lies at O; that of P is
v_P = v_O + omega x P.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.urdf.errors import ClosureError

from .geometry import FloatArray
from .position import Legs

SINGULAR = 1e-7
"""Share of LA below which a lever counts as zero: at the edge of reach rounding leaves 1e-8."""


@dataclass(frozen=True, eq=False)
class LegScrews:
    """Screws of the legs; the last axis is the screw.

    Attributes
    ----------
    links : ndarray (..., 3, 6)
        $r of legs 1 to 3.
    joints : ndarray (6, ..., 6, 6)
        ``joints[n - 1]`` holds $n of all six legs, n = 1 ... 6.
    virtual : ndarray (..., 3, 6)
        $f of legs 4 to 6.
    """

    links: FloatArray
    joints: FloatArray
    virtual: FloatArray


def screw(direction: FloatArray, point: FloatArray) -> FloatArray:
    """Line screws (..., 6) of directions (..., 3) through points (..., 3) [m]."""
    return np.concatenate(np.broadcast_arrays(direction, np.cross(point, direction)), axis=-1)


def klein(a: FloatArray, b: FloatArray) -> FloatArray:
    """Klein form {a; b} of screws (..., 6): each one's direction on the other's moment."""
    return np.asarray((a[..., :3] * b[..., 3:]).sum(-1) + (a[..., 3:] * b[..., :3]).sum(-1))


def leg_screws(legs: Legs) -> LegScrews:
    """All screws of section 3.1, in the base frame about O."""
    u, v, w = legs.u, legs.v, legs.w
    f = np.broadcast_to(legs.geometry.F, legs.A[..., :3, :].shape)
    joints = [(u, legs.A), (u, legs.B), (v, legs.B), (u, legs.C), (v, legs.C), (w, legs.C)]
    return LegScrews(
        links=screw(u[..., :3, :], f),
        joints=np.stack([screw(s, p) for s, p in joints]),
        virtual=np.concatenate([np.zeros_like(w[..., 3:, :]), w[..., 3:, :]], axis=-1),
    )


def j_x(legs: Legs) -> FloatArray:
    """Direct Jacobian (..., 6, 6): the columns are $6_i, the rods' lines."""
    return np.ascontiguousarray(np.swapaxes(screw(legs.w, legs.C), -1, -2))


def j_q(legs: Legs) -> FloatArray:
    """Diagonal (..., 6) of Jq: {$1; $6} = w.(u x (B - A)) [m]."""
    return np.asarray((legs.w * np.cross(legs.u, legs.B - legs.A)).sum(axis=-1))


def j_beta(legs: Legs) -> FloatArray:
    """First three diagonal entries (..., 3) of J'q: {$r; $6} = w.(u x (B - F)) [m].

    The paper fills J'q up with three ones, which multiply zero rates.
    """
    arm = legs.B[..., :3, :] - legs.geometry.F
    return np.asarray((legs.w[..., :3, :] * np.cross(legs.u[..., :3, :], arm)).sum(axis=-1))


def j_inputs(legs: Legs) -> FloatArray:
    """Right side of (5) for the inputs (alpha1 ... alpha6, beta): matrix (..., 6, 7) [m]."""
    diagonal = j_q(legs)[..., None] * np.eye(6)
    turning = np.concatenate([j_beta(legs), np.zeros_like(legs.reach[..., 3:])], axis=-1)
    return np.concatenate([diagonal, turning[..., None]], axis=-1)


def det_jx(legs: Legs) -> FloatArray:
    """Signed det Jx (...,) [m^3]: zero at the direct singularities."""
    return np.asarray(np.linalg.det(j_x(legs)))


def platform_rates(legs: Legs) -> FloatArray:
    """Jx^T Delta as a matrix (..., 6, 6) acting on V = (omega; v_O): rows (moment, direction)."""
    columns = j_x(legs)
    return np.ascontiguousarray(
        np.swapaxes(np.concatenate([columns[..., 3:, :], columns[..., :3, :]], axis=-2), -1, -2)
    )


def input_rates(legs: Legs, state: ArrayLike, beta_rate: ArrayLike) -> FloatArray:
    """Rates of alpha (..., 6) [rad/s] for V (..., 6) about O and the rate of beta (...,), eq (5).

    Raises
    ------
    ClosureError
        A leg is stretched or folded, Jq = 0: its rate is not determined.
    """
    v = np.asarray(state, dtype=np.float64)
    pushed = (platform_rates(legs) @ v[..., None])[..., 0]
    turning = j_inputs(legs)[..., 6] * np.asarray(beta_rate, dtype=np.float64)[..., None]
    lever = j_q(legs)
    dead = np.abs(lever) < SINGULAR * legs.geometry.LA
    if dead.any():
        names = ", ".join(f"alpha{i + 1}" for i in np.unique(np.nonzero(dead)[-1]))
        raise ClosureError(f"Jq = 0: stretched or folded legs leave the rates of {names} open")
    return np.asarray((pushed - turning) / lever)


def state_at_origin(omega: ArrayLike, v_P: ArrayLike, position: ArrayLike) -> FloatArray:
    """V = (omega; v_O) (..., 6) from the angular velocity and the velocity of P."""
    turn, arm = np.asarray(omega, dtype=np.float64), np.asarray(position, dtype=np.float64)
    v_origin = np.asarray(v_P, dtype=np.float64) - np.cross(turn, arm)
    return np.concatenate([np.broadcast_to(turn, v_origin.shape), v_origin], axis=-1)


def stage_sigma(legs: Legs) -> FloatArray:
    """Third singular values (..., 2) of the rods' screws of M1 and of M2.

    0 where three rods of one stage are coplanar and meet in one point or are parallel.
    """
    columns = j_x(legs)
    stages = np.stack([columns[..., :3], columns[..., 3:]], axis=-3)
    return np.asarray(np.linalg.svd(stages, compute_uv=False)[..., 2])
