"""What is timed, for each robot: functions of this package, and peers on the same problem."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

import closedchain as cc
from benchmarks.following import WORK, Direct, Follower, follow, targets_from
from benchmarks.timing import Row, median_seconds

OURS = "closedchain"
STEP = 2e-3  # m, of every input
RESIDUAL_JACOBIAN = "residual + Jacobian"


@dataclass(frozen=True)
class Peer:
    """A tool beside ours: the package that it needs and the class that follows inputs."""

    tool: str
    package: str
    module: str
    name: str

    def load(self) -> type[Follower]:
        return getattr(importlib.import_module(f"benchmarks.{self.module}"), self.name)


PEERS = (
    Peer("scipy least_squares (lm)", "scipy", "scipy_peer", "LeastSquares"),
    Peer("scipy SLSQP", "scipy", "scipy_peer", "Slsqp"),
    Peer("MuJoCo, Gauss-Newton", "mujoco", "mujoco_peer", "MuJoCo"),
    Peer("Drake, Gauss-Newton", "pydrake", "drake_peer", "Drake"),
)


@dataclass(frozen=True)
class Case:
    """A robot, and how far its inputs start from home [m], since home may be a special posture."""

    robot: str
    offset: tuple[float, ...]

    def start(self) -> tuple[cc.Mechanism, np.ndarray]:
        """Mechanism and closed posture away from home."""
        m = cc.load(self.robot)
        found = cc.direct(m, m.input_values(m.home) + np.array(self.offset)).raise_if_failed()
        return m, found.q


CASES = (
    Case("d1", (0.03, -0.015, 0.0, 0.02, 0.01, -0.02)),
    Case("linear_delta", (0.03, -0.02, 0.01)),
)


def rows(case: Case, repeats: int) -> Iterator[Row]:
    """All measurements of a robot; peers take a tenth of the steps."""
    m, q = case.start()
    few = max(5, repeats // 10)
    targets = targets_from(m.input_values(q), STEP, repeats)
    yield from _direct(case.robot, m, q, targets, few)
    yield from _jacobians(case.robot, m, q, repeats)
    yield from _ours(case.robot, m, q, repeats, few)
    yield _track(case.robot, m, q, targets[:few])


def _direct(
    robot: str, m: cc.Mechanism, q: np.ndarray, targets: np.ndarray, few: int
) -> Iterator[Row]:
    ours = Direct(m, q)
    follow(robot, OURS, ours, targets[:few], np.zeros(3))  # to warm up; its last tip is the truth
    tip = ours.tip()
    ours = Direct(m, q)
    end = cc.direct(m, targets[-1], guess=q).raise_if_failed()
    yield follow(robot, OURS, ours, targets, m.point(end.q, m.required_task().tip))
    for peer in PEERS:
        if find_spec(peer.package) is None:
            yield Row(robot, WORK, peer.tool, note="not installed")
            continue
        yield follow(robot, peer.tool, peer.load()(m, q), targets[:few], tip)


def _jacobians(robot: str, m: cc.Mechanism, q: np.ndarray, repeats: int) -> Iterator[Row]:
    closed = float(np.abs(cc.residual(m, q)).max())
    yield Row(
        robot,
        RESIDUAL_JACOBIAN,
        OURS,
        median_seconds(lambda _: m.workspace.evaluate(q), repeats),
        closed,
    )
    for peer in PEERS[2:]:
        tool = peer.tool.split(",")[0]
        if find_spec(peer.package) is None:
            yield Row(robot, RESIDUAL_JACOBIAN, tool, note="not installed")
            continue
        theirs = peer.load()(m, q)
        seconds = median_seconds(lambda _, it=theirs: it.evaluate(), repeats)  # type: ignore[attr-defined, misc]
        yield Row(robot, RESIDUAL_JACOBIAN, tool, seconds, theirs.residual())


def _ours(robot: str, m: cc.Mechanism, q: np.ndarray, repeats: int, few: int) -> Iterator[Row]:
    """Functions that no peer has."""
    rng = np.random.default_rng(1)
    n = len(m.inputs)
    velocities, accelerations = rng.standard_normal(n), rng.standard_normal(n)
    inputs, pose = m.input_values(q), m.pose(cc.direct(m, m.input_values(q) + 2e-4, guess=q).q)
    posed = cc.inverse(m, pose, q).raise_if_failed().residual
    homed = cc.direct(m, inputs).raise_if_failed().residual
    closed = float(np.abs(cc.residual(m, q)).max())
    works = (
        ("direct from home", lambda _: cc.direct(m, inputs), repeats, homed),
        ("inverse, warm", lambda _: cc.inverse(m, pose, q), few, posed),
        ("velocity equation", lambda _: cc.velocity(m, q), few, closed),
        ("acceleration", lambda _: cc.acceleration(m, q, velocities, accelerations), few, closed),
        ("classify", lambda _: cc.classify(m, q), few, closed),
    )
    for work, call, count, residual in works:
        yield Row(robot, work, OURS, median_seconds(call, count), residual)


def _track(robot: str, m: cc.Mechanism, q: np.ndarray, targets: np.ndarray) -> Row:
    """One sample of a path with velocities and accelerations, 10 ms a sample."""
    times = 0.01 * np.arange(len(targets))
    found = cc.track(m, targets, times=times, start=q).raise_if_stopped()
    seconds = median_seconds(lambda _: cc.track(m, targets, times=times, start=q), 3)
    work = "track with rates, a sample"
    return Row(robot, work, OURS, seconds / len(targets), float(found.residual.max()))


def map_rate(cells: int) -> Row:
    """Seconds for a cell of D1's map q1 x q2, positions, singular values and labels included."""
    m = cc.load("d1")
    h = m.input_values(m.home)
    axes = {n: np.linspace(h[i] - 0.06, h[i] + 0.06, cells) for i, n in enumerate(("q1", "q2"))}
    begin = time.perf_counter()
    cc.singularity_map(m, axes, progress=False)
    seconds = (time.perf_counter() - begin) / cells**2
    return Row("d1", f"map cell ({cells} x {cells})", OURS, seconds)
