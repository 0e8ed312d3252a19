"""Positions of the reconfigurable 2(3-RUS): the inverse problem in closed form, all 64 modes.

For given platform and beta each leg is a four-bar in space that its two elbow postures solve, so
the inverse problem has 2^6 working modes. The direct problem is that of a 6-6 Stewart platform
with legs LB standing on the elbows B_i (beta enters through B_i only): 40 complex solutions, no
closed form. :func:`gaps` are its equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from .geometry import UP, FloatArray, Geometry, Pose

MODES: FloatArray = np.array(list(product((1, -1), repeat=6)), dtype=np.float64)
"""Working modes (64, 6): the sign kappa_i of each elbow; +1 is outward. Row 0 is the home mode."""
MODES.setflags(write=False)
STRETCHED = 1e-12
"""By how much ``reach`` may be negative from rounding where a leg is exactly stretched."""
OUTWARD = (1.0,) * 6
"""Mode of home: all elbows outward."""


@dataclass(frozen=True, eq=False)
class Legs:
    """The six legs at a posture; arrays have a batch (...), then the leg, then x y z.

    Attributes
    ----------
    beta, alpha : ndarray (...), (..., 6)
        Inputs [rad]; alpha of M1 counts from the reconfiguration link.
    A, B, C : ndarray (..., 6, 3)
        Joint centres [m]. Where ``reach`` is below 0, B is the elbow of the stretched leg that
        comes nearest to C.
    u, v, w : ndarray (..., 6, 3)
        Unit axes of the elbow's universal joint (u, then v), and direction of the rod.
    bend, swing : ndarray (..., 6)
        Angles of the universal joint [rad], about u and v: rod against arm in the leg's plane,
        and out of it. ``swing`` is positive away from u.
    reach : ndarray (..., 6)
        1 - |K / rho|: positive inside the leg's reach, 0 where arm and rod are stretched or
        folded, negative out of reach.
    """

    geometry: Geometry
    beta: FloatArray
    alpha: FloatArray
    A: FloatArray
    B: FloatArray
    C: FloatArray
    u: FloatArray
    v: FloatArray
    w: FloatArray
    bend: FloatArray
    swing: FloatArray
    reach: FloatArray

    @property
    def closed(self) -> np.ndarray:
        """Whether every leg reaches its C_i, (...) of bool."""
        return np.asarray((self.reach >= -STRETCHED).all(axis=-1))


def inverse(pose: Pose, beta: ArrayLike, geometry: Geometry, mode: ArrayLike = OUTWARD) -> Legs:
    """Solve every leg for given platform and reconfiguration angle in one working mode.

    With d = C - A, K = (|d|^2 + LA^2 - LB^2) / (2 LA) and rho the length of d in the leg's plane,
    the arm stands at atan2(d.y, d.r) + kappa acos(K / rho). Out of reach, where the arc cosine
    has no value, the arm points to C or away from it and ``reach`` is negative; nothing is NaN.

    Parameters
    ----------
    pose : Pose
        Platform, batch (...).
    beta : (...,) array
        [rad]
    mode : (..., 6) array
        Signs kappa; broadcast against the batch. ``mode=MODES[:, None]`` solves all 64 modes of a
        batch of one axis, ``mode=MODES`` those of a single pose.
    """
    c = pose.points(geometry.c_P)
    a = geometry.A(beta)
    d = c - a
    x, y = (d * geometry.radial).sum(axis=-1), d[..., 1]
    wanted = ((d * d).sum(axis=-1) + geometry.LA**2 - geometry.LB**2) / (2.0 * geometry.LA)
    rho = np.hypot(x, y)
    ratio = wanted / np.where(rho > 0.0, rho, np.finfo(float).tiny)
    lean = np.arccos(np.clip(ratio, -1.0, 1.0))
    absolute = np.arctan2(y, x) + np.asarray(mode, dtype=np.float64) * lean
    return _legs(c, beta, absolute, 1.0 - np.abs(ratio), geometry)


def posture(pose: Pose, alpha: ArrayLike, beta: ArrayLike, geometry: Geometry) -> Legs:
    """Legs for a platform pose and inputs that fit together, such as a solved direct problem.

    ``alpha`` (..., 6), ``beta`` (...,) [rad]. ``reach`` is 0 where :func:`gaps` vanish and
    negative elsewhere.
    """
    c = pose.points(geometry.c_P)
    absolute = geometry.absolute(alpha, beta)
    return _legs(c, beta, absolute, -np.abs(gaps(pose, alpha, beta, geometry)), geometry)


def gaps(pose: Pose, alpha: ArrayLike, beta: ArrayLike, geometry: Geometry) -> FloatArray:
    """Equations of the direct problem: |C_i - B_i| - LB, (..., 6) [m]."""
    rods = pose.points(geometry.c_P) - geometry.B(alpha, beta)
    return np.asarray(np.linalg.norm(rods, axis=-1) - geometry.LB)


def mode_of(legs: Legs) -> FloatArray:
    """Signs kappa (..., 6) of a posture: which side of the line A C' the elbow lies on.

    C' is C in the leg's plane; 0 where arm and rod are stretched or folded in that plane.
    """
    r = legs.geometry.radial
    arm, line = legs.B - legs.A, legs.C - legs.A
    cross = (line * r).sum(-1) * arm[..., 1] - line[..., 1] * (arm * r).sum(-1)
    return np.asarray(np.sign(cross))


def wrapped(angle: ArrayLike) -> FloatArray:
    """Angles in (-pi, pi]."""
    angle = np.asarray(angle, dtype=np.float64)
    return np.asarray(np.pi - np.mod(np.pi - angle, 2.0 * np.pi))


def _legs(
    c: FloatArray, beta: ArrayLike, absolute: FloatArray, reach: FloatArray, geometry: Geometry
) -> Legs:
    """Everything else about the legs from the arms' angles (..., 6) from the horizontal."""
    r, u = geometry.radial, geometry.tangent
    angle = absolute[..., None]
    a = geometry.A(beta)
    b = a + geometry.LA * (np.cos(angle) * r + np.sin(angle) * UP)
    rod = c - b
    x, y, z = (rod * r).sum(axis=-1), rod[..., 1], (rod * u).sum(axis=-1)
    phi, across = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    # u x w / |u x w|, but defined also where the rod is parallel to u
    v = np.cos(phi)[..., None] * UP - np.sin(phi)[..., None] * r
    shape = rod.shape
    return Legs(
        geometry=geometry,
        beta=np.broadcast_to(np.asarray(beta, dtype=np.float64), shape[:-2]),
        alpha=wrapped(absolute - geometry.carried(beta)),
        A=np.broadcast_to(a, shape),
        B=b,
        C=np.broadcast_to(c, shape),
        u=np.broadcast_to(u, shape),
        v=v,
        w=rod / np.linalg.norm(rod, axis=-1, keepdims=True),
        bend=wrapped(phi - absolute),
        swing=-across,
        reach=np.broadcast_to(reach, shape[:-1]),
    )
