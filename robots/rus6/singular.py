"""Postures with chosen singular legs, and roots of any factor along a path.

Which factor vanishes where, corrected from section 3.2 of the source:

* Jq,i = 0: in the leg's plane the rod is parallel to the arm (or is at right angles to the plane).
  Arm and rod are collinear only where the whole leg lies in that plane.
* J'q,i = 0: in the leg's plane the rod's line passes through F_i, wherever A_i is. The arm need
  not be parallel to it, so Jq,i need not vanish.
* det Jx = 0: the six rods' lines are dependent.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from .geometry import UP, FloatArray, Geometry, Pose


def stretched_tip(
    geometry: Geometry, leg: int, beta: ArrayLike, arm: ArrayLike, swing: ArrayLike, fold: ArrayLike
) -> FloatArray:
    """Points C_leg (..., 3) [m] at which Jq,leg = 0; all of them, by three parameters.

    Parameters
    ----------
    leg : int
        0 to 5.
    beta, arm, swing : (...,) arrays
        Reconfiguration angle, the arm's angle from the horizontal, and the angle between rod and
        the leg's plane [rad].
    fold : (...,) array
        +1 extends the rod along the arm, -1 folds it back.
    """
    beta, arm, swing, fold = (np.asarray(a, dtype=float) for a in (beta, arm, swing, fold))
    along = _direction(geometry, leg, arm)
    rod = np.cos(swing)[..., None] * along * fold[..., None]
    out = np.sin(swing)[..., None] * geometry.tangent[leg]
    return geometry.A(beta)[..., leg, :] + geometry.LA * along + geometry.LB * (rod + out)


def idle_beta_tip(
    geometry: Geometry,
    leg: int,
    beta: ArrayLike,
    line: ArrayLike,
    swing: ArrayLike,
    sides: tuple[int, int] = (1, 1),
) -> FloatArray:
    """Points C_leg (..., 3) [m] at which J'q,leg = 0: the rod's moment about F_leg's axis is zero.

    In the leg's plane B and C' lie on a line through F at the angle ``line``. B is where that line
    meets the circle of radius LA about A.

    Parameters
    ----------
    leg : int
        0 to 2 (stage M1).
    beta, line, swing : (...,) arrays
        Reconfiguration angle, direction of the line from the horizontal, angle between rod and
        the leg's plane [rad].
    sides : pair of +-1
        Which of the two meeting points B is, and whether C' lies ahead of B or behind.

    Raises
    ------
    ValueError
        A line that misses the circle, which needs LA < Rr.
    """
    beta, line, swing = (np.asarray(a, dtype=float) for a in (beta, line, swing))
    along = _direction(geometry, leg, line)
    offset = geometry.Rr * np.sin(line - beta)
    if np.any(np.abs(offset) > geometry.LA):
        raise ValueError("the line through F misses the circle of the arm")
    reach = geometry.Rr * np.cos(line - beta) + sides[0] * np.sqrt(geometry.LA**2 - offset**2)
    rod = sides[1] * geometry.LB * np.cos(swing)
    out = geometry.LB * np.sin(swing)[..., None] * geometry.tangent[leg]
    return geometry.F[leg] + (reach + rod)[..., None] * along + out


def pose_with_tip(geometry: Geometry, leg: int, tip: ArrayLike, rotation: ArrayLike) -> Pose:
    """Pose of given rotation (..., 3, 3) that puts C_leg at ``tip`` (..., 3) [m]."""
    turn = np.asarray(rotation, dtype=np.float64)
    return Pose(turn, np.asarray(tip, dtype=np.float64) - turn @ geometry.c_P[leg])


def stretched_heights(geometry: Geometry, leg: int, beta: float = 0.0) -> FloatArray:
    """Heights P_y (k,) [m] on the axis, R = 1, at which Jq,leg = 0, rising.

    C' stands at the distance LA + LB' or |LA - LB'| from A, LB' being the rod in the leg's plane.
    """
    offset = geometry.c_P[leg] - geometry.A(beta)[leg]
    across = offset @ geometry.tangent[leg]
    x = offset @ geometry.radial[leg]
    if abs(across) > geometry.LB:
        return np.zeros(0)
    rod = np.sqrt(geometry.LB**2 - across**2)
    heights = [
        sign * np.sqrt(radius**2 - x**2) - offset[1]
        for radius in {geometry.LA + rod, abs(geometry.LA - rod)}
        if radius >= abs(x)
        for sign in (1.0, -1.0)
    ]
    return np.sort(np.array(heights))


def pencil_margin(geometry: Geometry, beta: ArrayLike) -> FloatArray:
    """LB + r - (LA + R), (..., 2) [m], for M1 (R = Rf + Rr cos beta) and M2 (R = R2).

    Positive values keep the symmetric stage, level and centred, from having its rods in one
    horizontal plane. They rule out no other direct singularity, although the paper says so.
    """
    angle = np.asarray(beta, dtype=np.float64)
    radii = np.stack(
        [geometry.Rf + geometry.Rr * np.cos(angle), np.full_like(angle, geometry.R2)], axis=-1
    )
    return np.asarray(geometry.LB + geometry.r - geometry.LA - radii)


def roots(function: Callable[[FloatArray], FloatArray], samples: ArrayLike) -> FloatArray:
    """Roots (k,) of a vectorised function of one number, one for each sign change in ``samples``.

    The function maps (n,) to (n,), for instance a factor along a path of the platform.
    """

    def one(x: float) -> float:
        return float(function(np.array([x]))[0])

    t = np.asarray(samples, dtype=np.float64)
    sign = np.sign(function(t))
    found = list(t[sign == 0.0])
    for i in np.flatnonzero(sign[:-1] * sign[1:] < 0.0):
        found.append(brentq(one, t[i], t[i + 1], xtol=1e-15, rtol=8.9e-16))
    return np.sort(np.array(found, dtype=np.float64))


def _direction(geometry: Geometry, leg: int, angle: FloatArray) -> FloatArray:
    """Unit vectors (..., 3) in a leg's plane at ``angle`` from the outward horizontal."""
    return np.asarray(
        np.cos(angle)[..., None] * geometry.radial[leg] + np.sin(angle)[..., None] * UP
    )
