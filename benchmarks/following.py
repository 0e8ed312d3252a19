"""The position problems that all tools solve, step by step from the last posture.

Direct: the inputs are given. Inverse: the pose of the tip is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

import closedchain as cc
from benchmarks.timing import Row

GOAL = 1e-13
"""Residual [m, rad] at which Gauss-Newton stops; ``cc.direct`` goes on to the same one."""
OPEN = 1e-6
"""Residual [m, rad] above which a posture is no solution at all."""
DIRECT, INVERSE = "direct, warm", "inverse, warm"
BLOCK = 10  # steps between looks at the clock


class Follower(Protocol):
    """A tool that keeps a mechanism closed while its inputs, or its tip, move."""

    def step(self, target: np.ndarray) -> None:
        """Close the loops with the inputs at ``target`` (n_inputs,), from the last posture."""

    def reach(self, target: pin.SE3) -> None:
        """Close the loops with the tip at ``target`` in the outputs, from the last posture."""

    def residual(self) -> float:
        """Largest closure row [m, rad] of the present posture, by the tool's own account."""

    def tip(self) -> np.ndarray:
        """World position (3,) [m] of the tip."""


class Ours:
    """This package."""

    def __init__(self, m: cc.Mechanism, q: np.ndarray) -> None:
        self.m, self.last = m, cc.direct(m, m.input_values(q), guess=q)

    def step(self, target: np.ndarray) -> None:
        self.last = cc.direct(self.m, target, guess=self.last.q)

    def reach(self, target: pin.SE3) -> None:
        self.last = cc.inverse(self.m, target, self.last.q)

    def residual(self) -> float:
        return float(np.abs(cc.residual(self.m, self.last.raise_if_failed().q)).max())

    def tip(self) -> np.ndarray:
        return self.m.point(self.last.q, self.m.required_task().tip)


@dataclass(frozen=True, eq=False)
class Course:
    """A path to follow: inputs, or poses of the tip, and where the tip is then (n, 3)."""

    robot: str
    work: str
    targets: Sequence[Any]
    tips: np.ndarray

    def first(self, count: int) -> Course:
        """Return the course that has the first targets only."""
        return Course(self.robot, self.work, self.targets[:count], self.tips[:count])


def courses(robot: str, m: cc.Mechanism, q: np.ndarray, step: float, count: int) -> list[Course]:
    """Direct and inverse paths of ``count`` steps through the same postures."""
    targets = inputs_from(m.input_values(q), step, count)
    poses, here = [], q
    for target in targets:
        here = cc.direct(m, target, guess=here).raise_if_failed().q
        poses.append(m.pose(here))
    tips = np.array([pose.translation for pose in poses])
    return [Course(robot, DIRECT, targets, tips), Course(robot, INVERSE, poses, tips)]


def inputs_from(inputs: np.ndarray, step: float, count: int) -> np.ndarray:
    """Inputs (count, n_inputs) that all move by ``step`` at a time, to and fro from ``inputs``.

    Each turns after its own number of steps, so that a path stays near and yet does not repeat.
    """
    there = 4 + np.arange(inputs.size)
    phase = np.arange(1, count + 1)[:, None] % (2 * there)
    return np.asarray(inputs + step * np.minimum(phase, 2 * there - phase))


def follow(tool: str, make: Callable[[], Follower], course: Course) -> Row:
    """Check every posture of a course in one run, then time blocks of its steps in another.

    The time is the least mean over blocks. A tool that leaves the loops open, or the tip
    elsewhere, has none: the note says what it reports.
    """
    follower, worst = make(), 0.0
    move = follower.step if course.work == DIRECT else follower.reach
    for target in course.targets:
        move(target)
        worst = max(worst, follower.residual())
    error = float(np.linalg.norm(follower.tip() - course.tips[-1]))
    about = (course.robot, course.work, tool)
    if not max(worst, error) < OPEN:
        note = f"not solved: {getattr(follower, 'message', 'no message')}"
        return Row(*about, None, worst, error, note)
    follower = make()
    move = follower.step if course.work == DIRECT else follower.reach
    times = []
    for a in range(0, len(course.targets) - BLOCK + 1, BLOCK):
        block = course.targets[a : a + BLOCK]
        begin = time.process_time()
        for target in block:
            move(target)
        times.append((time.process_time() - begin) / BLOCK)
    return Row(*about, min(times), worst, error)


# -- for tools that give gaps, Jacobians and poses ------------------------------------------------


def tip_rows(
    outputs: Sequence[str], target: pin.SE3, here: pin.SE3, jacobian: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (d,) [m, rad] and their Jacobian (d, nv) for the outputs of a tip.

    ``jacobian`` (6, nv): linear, then angular, along the world's axes. Three rotations are a
    rotation vector, two the direction of the tip's third axis.
    """
    linear = ["xyz".index(n) for n in outputs if n in "xyz"]
    turns = ["xyz".index(n[1]) for n in outputs if n not in "xyz"]
    values, rows = [(here.translation - target.translation)[linear]], [jacobian[linear]]
    if len(turns) == 3:
        values.append(pin.log3(here.rotation @ target.rotation.T))
        rows.append(jacobian[3:])  # to first order in what is left
    elif len(turns) == 2:
        (third,) = {0, 1, 2} - set(turns)
        axis, wanted = here.rotation[:, third], target.rotation[:, turns].T
        values.append(wanted @ axis)
        rows.append(np.cross(axis, wanted) @ jacobian[3:])
    return np.concatenate(values), np.vstack(rows)


def gauss_newton(
    evaluate: Callable[[], tuple[np.ndarray, np.ndarray]],
    move: Callable[[np.ndarray], None],
    most: int = 20,
) -> None:
    """Drive the residual of ``evaluate`` to zero by full steps of the unknowns, to ``GOAL``."""
    for _ in range(most):
        values, jacobian = evaluate()
        if np.abs(values).max() < GOAL:
            return
        square = jacobian.shape[0] == jacobian.shape[1]
        if square:
            move(np.linalg.solve(jacobian, -values))
        else:
            move(np.linalg.lstsq(jacobian, -values, rcond=1e-9)[0])
