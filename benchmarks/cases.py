"""Single calls: functions of this package, and peers on the same problem."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

import closedchain as cc
from benchmarks.following import Course, Follower, Ours, courses, follow
from benchmarks.placo_peer import follow_with_placo
from benchmarks.robots import three_rps
from benchmarks.timing import OURS, Row, a_call

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
    Peer("scipy least_squares", "scipy", "scipy_peer", "LeastSquares"),
    Peer("scipy SLSQP", "scipy", "scipy_peer", "Slsqp"),
    Peer("MuJoCo, Gauss-Newton", "mujoco", "mujoco_peer", "MuJoCo"),
    Peer("Drake, Gauss-Newton", "pydrake", "drake_peer", "Drake"),
)
MODELS = PEERS[2:]  # tools with a model of their own in this process


@dataclass(frozen=True)
class Case:
    """A robot, and how far its inputs start from home [m], since home may be a special posture."""

    robot: str
    make: Callable[[], cc.Mechanism]
    offset: tuple[float, ...]

    def start(self) -> tuple[cc.Mechanism, np.ndarray]:
        """Mechanism and closed posture away from home."""
        m = self.make()
        found = cc.direct(m, m.input_values(m.home) + np.array(self.offset)).raise_if_failed()
        return m, found.q


CASES = (
    Case("3-RPS", three_rps, (0.03, -0.02, 0.01)),
    Case("d1", lambda: cc.load("d1"), (0.03, -0.015, 0.0, 0.02, 0.01, -0.02)),
    Case("linear_delta", lambda: cc.load("linear_delta"), (0.03, -0.02, 0.01)),
)


def rows(case: Case, repeats: int) -> Iterator[Row]:
    """All measurements of a robot; peers take a tenth of the steps."""
    m, q = case.start()
    few = max(20, repeats // 10)
    for course in courses(case.robot, m, q, STEP, repeats):
        yield from _position(m, q, course, course.first(few))
    yield from _jacobians(case.robot, m, q, repeats)
    yield from _ours(case.robot, m, q, repeats)
    yield _track(case.robot, m, q, repeats)


def _position(m: cc.Mechanism, q: np.ndarray, course: Course, short: Course) -> Iterator[Row]:
    yield follow(OURS, lambda: Ours(m, q), course)
    for peer in PEERS:
        if find_spec(peer.package) is None:
            yield Row(course.robot, course.work, peer.tool, note="not installed")
            continue
        kind = peer.load()
        yield follow(peer.tool, lambda kind=kind: kind(m, q), short)  # type: ignore[misc, call-arg]
    yield follow_with_placo(m, q, short)


def _jacobians(robot: str, m: cc.Mechanism, q: np.ndarray, repeats: int) -> Iterator[Row]:
    closed = float(np.abs(cc.residual(m, q)).max())
    ours = a_call(lambda: m.workspace.evaluate(q), repeats)
    yield Row(robot, RESIDUAL_JACOBIAN, OURS, ours, closed, note="Pinocchio's")
    for peer in MODELS:
        tool = peer.tool.split(",")[0]
        if find_spec(peer.package) is None:
            yield Row(robot, RESIDUAL_JACOBIAN, tool, note="not installed")
            continue
        theirs = peer.load()(m, q)  # type: ignore[call-arg]
        seconds = a_call(theirs.evaluate, repeats)  # type: ignore[attr-defined]
        yield Row(robot, RESIDUAL_JACOBIAN, tool, seconds, theirs.residual())


def _ours(robot: str, m: cc.Mechanism, q: np.ndarray, repeats: int) -> Iterator[Row]:
    """Functions that no peer has."""
    rng = np.random.default_rng(1)
    n = len(m.inputs)
    velocities, accelerations = rng.standard_normal(n), rng.standard_normal(n)
    inputs = m.input_values(q)
    homed = cc.direct(m, inputs).raise_if_failed().residual
    closed = float(np.abs(cc.residual(m, q)).max())
    works = (
        ("direct from home", lambda: cc.direct(m, inputs), homed),
        ("velocity equation", lambda: cc.velocity(m, q), closed),
        ("acceleration", lambda: cc.acceleration(m, q, velocities, accelerations), closed),
        ("classify", lambda: cc.classify(m, q), closed),
    )
    for work, call, residual in works:
        yield Row(robot, work, OURS, a_call(call, max(20, repeats // 10)), residual)


def _track(robot: str, m: cc.Mechanism, q: np.ndarray, repeats: int) -> Row:
    """One sample of a path with velocities and accelerations, 10 ms a sample."""
    (course, _) = courses(robot, m, q, STEP, max(20, repeats // 10))
    targets = np.array(course.targets)
    times = 0.01 * np.arange(len(targets))
    found = cc.track(m, targets, times=times, start=q).raise_if_stopped()
    seconds = a_call(lambda: cc.track(m, targets, times=times, start=q), 3, block=1)
    work = "track with rates, a sample"
    return Row(robot, work, OURS, seconds / len(targets), float(found.residual.max()))
