"""Position kinematics of Eclipse and Eclipse-II: every working mode, every assembly mode.

Inverse: leg by leg. A spherical joint S at the signed distance ``rho = S.u`` from the central axis
needs ``r cos q_r = r_g - rho`` from a leg with a column; from the leg with the vertical guide, a
triangle with the sides ``r_g``, ``r`` and the distance from S to that guide's centre. Each leg has
two or four branches, told apart by the signs of ``rho`` and ``sin q_r``.

Direct: with the six carriages locked, each S runs on a circle about its hinge, and three points on
three circles with given distances have 16 complex solutions.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from closedchain.robots.elimination import CircleSolutions, three_points_on_circles

from .geometry import FloatArray, Geometry, Z, along, plate_points, wrapped

Signs: TypeAlias = tuple[int, int, int]

ROUNDING = 1e-12
"""How far beyond 1 a cosine may be and still count as reached."""


class Mode(NamedTuple):
    """Working mode: for legs a, b, c the signs of ``sin q_r`` and of ``rho = S.u``.

    ``q = (1, 1, 1)`` is every link lowered from its carriage, ``rho = (1, 1, 1)`` every column on
    its spherical joint's side of the central axis.
    """

    q: Signs
    rho: Signs

    @property
    def label(self) -> str:
        """Signs of q, such as "++-"; those of rho behind a slash unless all are positive."""
        q, rho = ("".join("+" if s > 0 else "-" for s in signs) for signs in self)
        return q if min(self.rho) > 0 else f"{q}/{rho}"


@dataclass(frozen=True, eq=False)
class InverseSolutions:
    """All working modes of the inverse problem for a batch of poses.

    Attributes
    ----------
    modes : tuple of Mode
        The M working modes; the first is links lowered, columns outside.
    inputs : ndarray (..., M, 6)
        th_a, th_b, th_c [rad], d_a (beta_a for Eclipse-II [rad]), d_b, d_c [m].
    q_r : ndarray (..., M, 3)
        Hinge angles, rad.
    exists : ndarray (..., M), bool
        Whether the mode reaches the pose; where not, the numbers are those of the closest posture.
    """

    modes: tuple[Mode, ...]
    inputs: FloatArray
    q_r: FloatArray
    exists: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Assembly:
    """A real solution of the direct problem.

    Attributes
    ----------
    position, rotation : ndarray (3,), (3, 3)
        Platform pose, m, world frame.
    q_r : ndarray (3,)
        Hinge angles, rad.
    mode : Mode
        The working mode that it belongs to (a vanishing sine or rho counts as positive).
    """

    position: FloatArray
    rotation: FloatArray
    q_r: FloatArray
    mode: Mode


@dataclass(frozen=True, eq=False)
class DirectSolutions:
    """All real assemblies for given inputs, and the complex count and status behind them."""

    assemblies: tuple[Assembly, ...]
    circles: CircleSolutions


def working_modes(g: Geometry) -> tuple[Mode, ...]:
    """Working modes of a geometry, links lowered and columns outside first.

    A link no longer than ``r_g`` cannot pass the central axis from its column, so ``rho`` is not
    negative: Eclipse then has 8 modes. The leg with the vertical guide can always have its column
    beyond the axis: Eclipse-II has 16 sets of joint values, in pairs at the same carriage points.
    """
    beyond = [bool(arc) or g.r > g.r_g for arc in g.arc]
    rho_signs = product(*((1, -1) if b else (1,) for b in beyond))
    return tuple(
        Mode((q[0], q[1], q[2]), (rho[0], rho[1], rho[2]))
        for rho in rho_signs
        for q in product((1, -1), repeat=3)
    )


def inverse(position: ArrayLike, rotation: ArrayLike, g: Geometry) -> InverseSolutions:
    """Inputs and hinge angles of platform poses in every working mode.

    Where S lies on the central axis the guide's angle is free; it is 0 then (pi for negative rho).

    Parameters
    ----------
    position : array_like (..., 3)
        P, m, world frame.
    rotation : array_like (..., 3, 3)
        Columns are the platform's axes in the world frame.
    g : Geometry
        Dimensions.
    """
    s = plate_points(position, rotation, g)[..., None, :, :]
    modes = working_modes(g)
    sign_q = np.array([mode.q for mode in modes], dtype=np.float64)
    sign_rho = np.array([mode.rho for mode in modes], dtype=np.float64)
    rho = sign_rho * np.hypot(s[..., 0], s[..., 1])
    theta = wrapped(np.arctan2(s[..., 1], s[..., 0]) + np.where(sign_rho < 0.0, np.pi, 0.0))
    cosine = (g.r_g - rho) / g.r
    if g.z_c is not None:
        up = s[..., 2] - g.z_c
        triangle = (g.r_g**2 + g.r**2 - rho**2 - up**2) / (2.0 * g.r_g * g.r)
        cosine = np.where(g.arc, triangle, cosine)
    q = sign_q * np.arccos(np.clip(cosine, -1.0, 1.0))
    slide = s[..., 2] + g.r * np.sin(q)
    if g.z_c is not None:
        inner = np.arctan2(-g.r * np.sin(q), g.r_g - g.r * np.cos(q))
        slide = np.where(g.arc, wrapped(np.arctan2(up, rho) - inner), slide)
    return InverseSolutions(
        modes=modes,
        inputs=np.concatenate([theta, slide], axis=-1),
        q_r=q,
        exists=np.asarray((np.abs(cosine) <= 1.0 + ROUNDING).all(axis=-1)),
    )


def carriages(inputs: ArrayLike, g: Geometry) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Hinges of the links, and the plane in which each link turns.

    Parameters
    ----------
    inputs : array_like (..., 6)
        As in :class:`InverseSolutions`.

    Returns
    -------
    hinge : ndarray (..., 3, 3)
        m, world frame.
    inward, below : ndarray (..., 3, 3)
        Unit vectors: ``S = hinge + r (cos q_r inward + sin q_r below)``; for a column -u and -z.
    """
    x = np.asarray(inputs, dtype=np.float64)
    if x.shape[-1:] != (6,) or not np.all(np.isfinite(x)):
        raise ValueError(f"expected six finite inputs, got {inputs!r}")
    u, slide = along(x[..., :3]), x[..., 3:, None]
    hinge = g.r_g * u + slide * Z
    inward, below = -u, np.broadcast_to(-Z, u.shape)
    if g.z_c is not None:
        arc = g.arc[:, None]
        out, up = np.cos(slide) * u + np.sin(slide) * Z, np.cos(slide) * Z - np.sin(slide) * u
        hinge = np.where(arc, g.z_c * Z + g.r_g * out, hinge)
        inward, below = np.where(arc, -out, inward), np.where(arc, -up, below)
    return hinge, inward, below


def joints_S(inputs: ArrayLike, q_r: ArrayLike, g: Geometry) -> FloatArray:
    """Tips of the links (..., 3, 3), m, world frame, for inputs (..., 6) and q_r (..., 3)."""
    hinge, inward, below = carriages(inputs, g)
    q = np.asarray(q_r, dtype=np.float64)[..., None]
    return np.asarray(hinge + g.r * (np.cos(q) * inward + np.sin(q) * below))


def plate_pose(points: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Position (..., 3) and rotation (..., 3, 3) of the plate through S_a, S_b, S_c (..., 3, 3).

    The rotation is orthonormal also where the three points are so only to rounding.
    """
    s = np.asarray(points, dtype=np.float64)
    position = s.mean(axis=-2)
    x, y = s[..., 0, :] - position, s[..., 1, :] - s[..., 2, :]
    z = np.cross(x, y)
    unit = [v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (x, y, z)]
    left, _, right = np.linalg.svd(np.stack(unit, axis=-1))
    return position, np.asarray(left @ right)


def direct(inputs: ArrayLike, g: Geometry) -> DirectSolutions:
    """All platform poses for six inputs, by an eliminant of degree 16 in ``exp(i q_ra)``.

    Parameters
    ----------
    inputs : array_like (6,)
        As in :class:`InverseSolutions`.
    g : Geometry
        Dimensions.
    """
    hinge, inward, below = carriages(inputs, g)
    if hinge.shape != (3, 3):
        raise ValueError("expected six inputs, not a batch")
    circles = three_points_on_circles(hinge, inward, below, np.full(3, g.r), np.full(3, g.side))
    x = np.asarray(inputs, dtype=np.float64)
    found = []
    for points, angles in zip(circles.points, circles.angles[circles.real].real, strict=True):
        position, rotation = plate_pose(points)
        q = wrapped(angles)
        rho = (points * along(x[:3])).sum(axis=-1)
        found.append(Assembly(position, rotation, q, Mode(_signs(np.sin(q)), _signs(rho))))
    return DirectSolutions(tuple(found), circles)


def _signs(values: FloatArray) -> Signs:
    a, b, c = (-1 if v < 0.0 else 1 for v in values)
    return a, b, c
