"""Screw matrices J1 (eq. 23), J2 (eq. 28) and J3 of D1, and the planes behind them.

A screw is a column ``(s; P x s)``: unit direction ``s`` of a line through ``P``, moment about the
reference point (the origin O of frame A, or ``about``), divided by ``length`` where that is given.
Everything is expressed in frame A and vectorised over leading batch axes of the poses.
"""

from __future__ import annotations

import numpy as np

from .geometry import NORMAL, TANGENT, FloatArray, Geometry, Pose

LENGTH_B = 0.1
"""Length, m, that scales J1 and J3 (taken about the coupler's centre)."""
LENGTH_C = 0.18
"""Length, m, that scales J2 (taken about the platform's centre)."""


def _columns(
    s: FloatArray, points: FloatArray, about: FloatArray | None, length: float
) -> FloatArray:
    """Screws (..., 6, n) of directions (..., n, 3) through points (..., n, 3)."""
    arm = points if about is None else points - np.asarray(about)[..., None, :]
    rows = np.concatenate([s, np.cross(arm, s) / length], axis=-1)
    return np.ascontiguousarray(np.swapaxes(rows, -1, -2))


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True), dtype=np.float64)


def _lines(
    coupler: Pose, platform: Pose, geometry: Geometry
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """S4..S6, UPS leg directions, constraint directions through them, all (..., 3, 3)."""
    s4 = platform.points(geometry.c_C)
    tangents = TANGENT @ np.swapaxes(coupler.rotation, -1, -2)
    return s4, _unit(s4 - geometry.U), tangents


def j1(
    coupler: Pose, geometry: Geometry, *, about: FloatArray | None = None, length: float = 1.0
) -> FloatArray:
    """Active Jacobian of stage 1: ``[3$4_1, 4$5_1, 3$4_2, ...]`` (eq. 23).

    Parameters
    ----------
    coupler : Pose
        Coupler in frame A, batch (...).
    geometry : Geometry
        Dimensions.
    about : ndarray (..., 3), optional
        Reference point of the moments, m, frame A; O if omitted.
    length : float
        Divides the moments, m.

    Returns
    -------
    ndarray (..., 6, 6)
        Columns: constraint line ``t_i`` and leg line of limb i, both through ``S_i``.
    """
    s = coupler.points(geometry.s_B)
    legs = _unit(s - geometry.R)
    directions = np.stack([np.broadcast_to(TANGENT, s.shape), legs], axis=-2)
    shape = (*s.shape[:-2], 6, 3)
    return _columns(directions.reshape(shape), np.repeat(s, 2, axis=-2), about, length)


def j2(
    coupler: Pose,
    platform: Pose,
    geometry: Geometry,
    *,
    about: FloatArray | None = None,
    length: float = 1.0,
) -> FloatArray:
    """Active Jacobian of the platform: ``[16$17_1..3, 9$10_1..3]`` (eq. 28).

    Parameters as :func:`j1`, with the platform's pose.

    Returns
    -------
    ndarray (..., 6, 6)
        Columns: UPS leg lines, then the constraint lines ``R_B t_i``, through ``S_{i+3}``.
    """
    s4, legs, tangents = _lines(coupler, platform, geometry)
    return _columns(
        np.concatenate([legs, tangents], axis=-2),
        np.concatenate([s4, s4], axis=-2),
        about,
        length,
    )


def j3(
    coupler: Pose,
    platform: Pose,
    geometry: Geometry,
    *,
    about: FloatArray | None = None,
    length: float = 1.0,
) -> FloatArray:
    """Constraint lines on the coupler, ``[3$4_1..3, 9$10_1..3]``; needs no leg lengths.

    Singular exactly where the platform's twist does not determine the coupler's (inverse
    kinematics of the whole robot). Parameters as :func:`j2`.

    Returns
    -------
    ndarray (..., 6, 6)
        Columns: ``t_i`` through ``S_i``, then ``R_B t_i`` through ``S_{i+3}``.
    """
    s = coupler.points(geometry.s_B)
    s4, _, tangents = _lines(coupler, platform, geometry)
    return _columns(
        np.concatenate([np.broadcast_to(TANGENT, s.shape), tangents], axis=-2),
        np.concatenate([s, s4], axis=-2),
        about,
        length,
    )


def scaled_screws(
    coupler: Pose, platform: Pose, geometry: Geometry
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """J1 and J3 about the coupler's centre (0.1 m), J2 about the platform's (0.18 m).

    Dimensionless, (..., 6, 6) each; their determinants and singular values do not depend on the
    origin of frame A.
    """
    p_b, p_c = coupler.position, platform.position
    return (
        j1(coupler, geometry, about=p_b, length=LENGTH_B),
        j2(coupler, platform, geometry, about=p_c, length=LENGTH_C),
        j3(coupler, platform, geometry, about=p_b, length=LENGTH_B),
    )


def _planes(
    points: FloatArray, tangents: FloatArray, legs: FloatArray, normal: FloatArray
) -> FloatArray:
    """Planes (..., 4, 4): rows ``(n, -n.P)`` of (t_i, leg_i) and of the three points."""
    n = np.concatenate([np.cross(tangents, legs), normal[..., None, :]], axis=-2)
    p = np.concatenate([points, points[..., :1, :]], axis=-2)
    return np.concatenate([n, -(n * p).sum(axis=-1, keepdims=True)], axis=-1)


def planes1(coupler: Pose, geometry: Geometry) -> FloatArray:
    """Planes of stage 1 (..., 4, 4), rows ``(n, -n.P)``, m in the last column.

    Rows 1..3 contain ``t_i`` and the leg (normal ``t_i x leg_i``), row 4 is S1 S2 S3. Stage 1 is
    singular exactly where the four planes share a point: with the moments of J1 divided by L and
    the triangle's area A, ``det J1 = (2 A / L^3) det planes``.
    """
    s = coupler.points(geometry.s_B)
    tangents = np.broadcast_to(TANGENT, s.shape)
    return _planes(s, tangents, _unit(s - geometry.R), coupler.rotation @ NORMAL)


def planes2(coupler: Pose, platform: Pose, geometry: Geometry) -> FloatArray:
    """Planes of stage 2 (..., 4, 4), as :func:`planes1` with UPS legs, R_B t_i and S4 S5 S6."""
    s4, legs, tangents = _lines(coupler, platform, geometry)
    return _planes(s4, tangents, legs, platform.rotation @ NORMAL)
