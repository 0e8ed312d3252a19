"""The experiments of section 6: periodic inputs, drilling three holes, milling a hexagon.

The paper prints the periodic inputs, and of the two tasks only that they are done with a vertical
tool and one locked leg: the places, depths and times used here are choices of this project.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .geometry import NORMAL, FloatArray, Geometry, Pose
from .position import leg_lengths, stage1, stage2

HOLE_RADIUS, HOLE_ANGLES = 0.04, (90.0, 210.0, 330.0)
"""Circle of the three holes, m, and their angles from x towards z, degrees."""
APPROACH, HOLE_DEPTH, HEXAGON_DEPTH = -1.0, -1.03, -1.02
"""Heights of the tip, m, frame A: between cuts, at the bottom of a hole, along the hexagon."""
HEXAGON_RADIUS = 0.04
"""Circumradius of the hexagon, m."""
STEP_HOLE_DEPTH, STEP_HEIGHT, STEP_RADIUS = -1.15, -0.8, 0.06
"""Task on a step, m, frame A: bottom of its hole; height and circumradius of its hexagon."""


@dataclass(frozen=True, eq=False)
class InputMotion:
    """Inputs over time: ``times`` (n,), s; ``inputs``, ``rates``, ``accelerations`` (n, 6), m."""

    times: FloatArray
    inputs: FloatArray
    rates: FloatArray
    accelerations: FloatArray


@dataclass(frozen=True, eq=False)
class Assemblies:
    """Assemblies along a path.

    Attributes
    ----------
    coupler, platform : Pose
        Frame A, batch (n).
    inputs : ndarray (n, 6)
        q1..q6, m.
    converged : ndarray (n,)
        Whether the row closes to rounding; what does not is the last iterate.
    """

    coupler: Pose
    platform: Pose
    inputs: FloatArray
    converged: np.ndarray


def periodic(times: ArrayLike, geometry: Geometry) -> InputMotion:
    """Periodic inputs of section 6 at ``times`` (n,), s, from home's lengths."""
    t = np.atleast_1d(np.asarray(times, dtype=np.float64))
    sin, cos, sin2, cos2 = np.sin(t), np.cos(t), np.sin(2.0 * t), np.cos(2.0 * t)
    single = np.array([-0.01, 0.0125, 0.0, 0.0, 0.075, 0.0])  # sin t
    double = np.array([0.0, 0.0, 0.015, 0.1, 0.0, 0.0]) / 2.0  # sin t cos t
    square = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.125])  # sin^2 t
    home = leg_lengths(geometry.home_coupler, geometry.home_platform, geometry)
    outer = np.multiply.outer
    return InputMotion(
        times=t,
        inputs=home + outer(sin, single) + outer(sin2, double) + outer(sin**2, square),
        rates=outer(cos, single) + outer(2.0 * cos2, double) + outer(sin2, square),
        accelerations=outer(-sin, single) + outer(-4.0 * sin2, double) + outer(2 * cos2, square),
    )


def follow_inputs(inputs: FloatArray, geometry: Geometry) -> Assemblies:
    """Closed-form assemblies of inputs (n, 6), m, on the branch that starts nearest to home.

    Of all solutions of each stage (eqs (2)-(8)) the one whose points are nearest to those of the
    row before is taken; rows must therefore be close to each other.

    Raises
    ------
    ValueError
        A stage without real solution, or with two that are about equally near.
    """
    before = geometry.home_coupler, geometry.home_platform
    found: list[tuple[Pose, Pose]] = []
    for row, q in enumerate(np.asarray(inputs, dtype=np.float64)):
        coupler = _nearest(stage1(q[:3], geometry).poses, before[0], geometry.s_B, row)
        platforms = stage2(coupler, q[3:], geometry).poses
        before = coupler, _nearest(platforms, before[1], geometry.c_C, row)
        found.append(before)
    coupler, platform = (_batch([pair[k] for pair in found]) for k in (0, 1))
    reached = leg_lengths(coupler, platform, geometry)
    return Assemblies(coupler, platform, reached, np.abs(reached - inputs).max(axis=-1) < 1e-10)


def tip(platform: Pose, geometry: Geometry) -> FloatArray:
    """Tool tip T (..., 3), m, frame A."""
    return platform.points(geometry.tip_C[None])[..., 0, :]


def tilt(pose: Pose) -> FloatArray:
    """Angle (...) between the body's normal and the base's, rad."""
    return np.asarray(np.arccos(np.clip(pose.rotation[..., 1, 1], -1.0, 1.0)))


def torsion(pose: Pose) -> FloatArray:
    """Rotation (...) about the base normal that is left without the tilt, rad: 2 atan2(q_y, w)."""
    r = pose.rotation
    # of 4 w (w, q_y); the quotient needs no quaternion and no branch
    return np.asarray(
        2.0 * np.arctan2(r[..., 0, 2] - r[..., 2, 0], 1.0 + np.trace(r, axis1=-2, axis2=-1))
    )


def drill_waypoints() -> FloatArray:
    """Tip at the corners of the drilling task (11, 3), m, frame A: home, three holes, home."""
    corners = [(0.0, APPROACH, 0.0)]
    for x, z in _on_circle(HOLE_RADIUS, HOLE_ANGLES):
        corners += [(x, APPROACH, z), (x, HOLE_DEPTH, z), (x, APPROACH, z)]
    return np.array([*corners, corners[0]])


def hexagon_waypoints() -> FloatArray:
    """Tip at the corners of the milling task (11, 3), m, frame A: home, down, around, up, home."""
    around = _on_circle(HEXAGON_RADIUS, [90.0 + 60.0 * k for k in range(7)])
    cut = [(x, HEXAGON_DEPTH, z) for x, z in around]
    x, z = around[0]
    above, home = (x, APPROACH, z), (0.0, APPROACH, 0.0)
    return np.array([home, above, *cut, above, home])


def step_waypoints() -> FloatArray:
    """Tip at the corners of a task on a step (13, 3), m, frame A: a deep hole, a raised hexagon.

    A choice of this project. With q1, q2 or q3 locked at home's length the coupler cannot rise with
    the tool, and the second stage is pressed flat: each of these locks ends the task at a
    singularity. With all six legs it is done clear of any.
    """
    corners = [(0.0, APPROACH, 0.0), (0.0, STEP_HOLE_DEPTH, 0.0), (0.0, STEP_HEIGHT, 0.0)]
    angles = [90.0 + 60.0 * k for k in range(7)]
    corners += [(x, STEP_HEIGHT, z) for x, z in _on_circle(STEP_RADIUS, angles)]
    return np.array([*corners, corners[2], corners[1], corners[0]])


def rest_to_rest(
    waypoints: FloatArray, *, seconds: float = 1.0, samples: int = 20
) -> tuple[FloatArray, FloatArray]:
    """Straight lines between waypoints (k, 3), resting at each: times (n,), points (n, 3).

    Each takes ``seconds`` and is cut into ``samples`` steps; the way along it is the quintic
    10 s^3 - 15 s^4 + 6 s^5 of the time.
    """
    s = np.arange(samples) / samples
    way = (s**3 * (10.0 - 15.0 * s + 6.0 * s * s))[:, None]
    pieces = [a + way * (b - a) for a, b in pairwise(waypoints)]
    points = np.concatenate([*pieces, waypoints[-1:]])
    return np.asarray(seconds / samples * np.arange(len(points))), np.asarray(points)


def vertical_tool(tips: FloatArray, geometry: Geometry, *, q3: float | None = None) -> Assemblies:
    """Assemblies with the tool vertical (R_AC = I), the tip at ``tips`` (n, 3) and q3 locked.

    With the coupler's quaternion along (1, a, 0, c), the second stage turns back by the same
    rotation; both lateral offsets are the quadratic (a^2 - c^2, -2 a c) of it [eq. (2)]. Left are
    the three closure equations p_C = p_B + R_B d and |S3 R3| = q3 for a, c and the heights of the
    two stages: Newton's method, regular at home, from the linear estimate of the tilt.

    Parameters
    ----------
    tips : ndarray (n, 3)
        Tool tip, m, frame A.
    geometry : Geometry
        Dimensions.
    q3 : float, optional
        Length of the locked leg, m; home's by default.
    """
    targets = np.asarray(tips, dtype=np.float64) - geometry.tip_C
    home = leg_lengths(geometry.home_coupler, geometry.home_platform, geometry)
    length = float(home[2]) if q3 is None else q3
    drop = geometry.height_platform - geometry.height_coupler
    x = np.stack(
        [
            0.5 * targets[:, 2] / drop,
            -0.5 * targets[:, 0] / drop,
            np.full(len(targets), geometry.height_coupler),
            np.full(len(targets), drop),
        ],
        axis=-1,
    )
    for _ in range(30):
        value = _closure(x.astype(np.complex128), targets, length, geometry)[0].real
        columns = [
            _closure(x + 1e-30j * unit, targets, length, geometry)[0].imag / 1e-30
            for unit in np.eye(4)  # complex step: the equations are analytic
        ]
        step = (np.linalg.pinv(np.stack(columns, axis=-1)) @ value[..., None])[..., 0]
        x = x - step / np.maximum(1.0, 2.0 * np.abs(step).max(axis=-1, keepdims=True))
        if np.abs(step).max(initial=0.0) < 1e-15:
            break
    residual, rotation, position = _closure(x.astype(np.complex128), targets, length, geometry)
    coupler = Pose(np.ascontiguousarray(rotation.real), position.real)
    platform = Pose(np.broadcast_to(np.eye(3), rotation.shape), targets)
    inputs = leg_lengths(coupler, platform, geometry)
    return Assemblies(coupler, platform, inputs, np.abs(residual).max(axis=-1) < 1e-13)


def _closure(
    x: NDArray[np.complex128], targets: FloatArray, length: float, geometry: Geometry
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
    """Residuals (n, 4), m and m^2, coupler rotation (n, 3, 3) and position (n, 3)."""
    a, c, height, drop = np.moveaxis(x, -1, 0)
    norm = 1.0 + a * a + c * c
    rows = [
        [1.0 + a * a - c * c, -2.0 * c, 2.0 * a * c],
        [2.0 * c, 1.0 - a * a - c * c, -2.0 * a],
        [2.0 * a * c, 2.0 * a, 1.0 - a * a + c * c],
    ]
    rotation = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2) / norm[:, None, None]
    lateral = np.stack([a * a - c * c, 0.0 * a, -2.0 * a * c], axis=-1) / norm[:, None]
    position = geometry.radius_S * lateral + height[:, None] * NORMAL
    along = geometry.radius_S4 * lateral + drop[:, None] * NORMAL
    gap = position + np.einsum("nij,nj->ni", rotation, along) - targets
    leg = position + rotation @ geometry.s_B[2] - geometry.R[2]
    locked = (leg * leg).sum(axis=-1) - length**2
    return np.concatenate([gap, locked[:, None]], axis=-1), rotation, position


def _nearest(poses: tuple[Pose, ...], before: Pose, points: FloatArray, row: int) -> Pose:
    gaps = [np.abs(pose.points(points) - before.points(points)).max() for pose in poses]
    order = np.argsort(gaps)
    if len(order) == 0:
        raise ValueError(f"row {row} of the inputs has no real assembly")
    if len(order) > 1 and not gaps[order[1]] > 2.0 * gaps[order[0]]:
        raise ValueError(f"row {row} of the inputs is too far from the row before: two assemblies")
    return poses[order[0]]


def _batch(poses: list[Pose]) -> Pose:
    return Pose(np.array([p.rotation for p in poses]), np.array([p.position for p in poses]))


def _on_circle(radius: float, degrees: ArrayLike) -> list[tuple[float, float]]:
    angles = np.radians(degrees)
    return [(float(radius * np.cos(f)), float(radius * np.sin(f))) for f in angles]
