"""The position problem that all tools solve: follow given inputs step by step, warm-started."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

import closedchain as cc
from benchmarks.timing import Row

GOAL = 1e-13
"""Residual [m, rad] at which Gauss-Newton stops; ``cc.direct`` goes on to the same one."""
OPEN = 1e-6
"""Residual [m, rad] above which a posture is no solution at all."""
WORK = "direct, warm"


class Follower(Protocol):
    """A tool that keeps a mechanism closed while its inputs move."""

    def step(self, target: np.ndarray) -> None:
        """Close the loops with the inputs at ``target`` (n_inputs,), from the last posture."""

    def residual(self) -> float:
        """Largest closure row [m, rad] of the present posture, by the tool's own account."""

    def tip(self) -> np.ndarray:
        """World position (3,) [m] of the tip."""


class Direct:
    """This package."""

    def __init__(self, m: cc.Mechanism, q: np.ndarray) -> None:
        self.m, self.last = m, cc.direct(m, m.input_values(q), guess=q)

    def step(self, target: np.ndarray) -> None:
        self.last = cc.direct(self.m, target, guess=self.last.q)

    def residual(self) -> float:
        return float(np.abs(cc.residual(self.m, self.last.raise_if_failed().q)).max())

    def tip(self) -> np.ndarray:
        return self.m.point(self.last.q, self.m.required_task().tip)


def targets_from(inputs: np.ndarray, step: float, count: int) -> np.ndarray:
    """Inputs (count, n_inputs) that all move by ``step`` at a time, to and fro from ``inputs``.

    Each turns after its own number of steps, so that a path stays near and yet does not repeat.
    """
    there = 4 + np.arange(inputs.size)
    phase = np.arange(1, count + 1)[:, None] % (2 * there)
    return np.asarray(inputs + step * np.minimum(phase, 2 * there - phase))


def follow(
    robot: str, tool: str, follower: Follower, targets: np.ndarray, true_tip: np.ndarray
) -> Row:
    """Time each step; check each posture outside the timed part.

    A tool that leaves the loops open has no time: the note says what it reports.
    """
    times, worst = [], 0.0
    for target in targets:
        begin = time.perf_counter()
        follower.step(target)
        times.append(time.perf_counter() - begin)
        worst = max(worst, follower.residual())
    error = float(np.linalg.norm(follower.tip() - true_tip))
    if worst > OPEN:
        note = f"not closed: {getattr(follower, 'message', 'no message')}"
        return Row(robot, WORK, tool, None, worst, error, note)
    return Row(robot, WORK, tool, statistics.median(times), worst, error)


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
