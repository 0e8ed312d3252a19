"""Square systems of equations whose complex solutions are followed, and Newton's step in them.

Rows, Jacobian, sparse elimination and the posture after the step are one tape. Its order of pivots
is chosen at random complex postures. Where a posture meets a small pivot all the same, what the
step leaves of the linear equations tells; LAPACK solves them instead, or paths go more slowly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedchain.closure.modes.complex_equations import normalised
from closedchain.closure.modes.places import Place
from closedchain.closure.solve.problem import POSE
from closedchain.closure.tape.elimination import eliminate
from closedchain.closure.tape.expression import Expr, Graph, Tape

Slow = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Numbers:
    """What the numbers of a posture are.

    Attributes
    ----------
    count : int
        Of a posture.
    own : (m,) int array
        Those that are unknown; the others are prescribed.
    unit : float
        Characteristic length [m].
    lengths, angles, others : tuple of int
        Which of the unknown ones are lengths, angles, and without a unit.
    turns : tuple of int
        Where unit quaternions begin.
    pinned : tuple of int
        Which ones the first targets are.
    poses : tuple of int
        Where quaternions begin among the targets.
    """

    count: int
    own: np.ndarray
    unit: float
    lengths: tuple[int, ...]
    angles: tuple[int, ...]
    others: tuple[int, ...]
    turns: tuple[int, ...]
    pinned: tuple[int, ...]
    poses: tuple[int, ...]

    def settle(self, q: np.ndarray, targets: np.ndarray) -> None:
        """Write into postures (n, count) what targets pin; unit quaternions everywhere."""
        for i in self.poses:
            targets[:, i : i + 4] = normalised(targets[:, i : i + 4])
        q[:, self.pinned] = targets[:, : len(self.pinned)]
        for i in self.turns:
            q[:, i : i + 4] = normalised(q[:, i : i + 4])

    def between(
        self, one: Place, two: Place, q: np.ndarray, t: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Postures (n, count) with what is prescribed at shares t (n,) of the way; targets there.

        The unknown numbers are those of ``q`` (n, count).
        """
        s = t[:, None]
        targets = (1.0 - s) * one.targets + s * two.targets
        posture = (1.0 - s) * one.given + s * two.given
        posture[:, self.own] = q[:, self.own]
        self.settle(posture, targets)
        return posture, targets

    def far(self, q: np.ndarray, length: float, high: float) -> np.ndarray:
        """Which postures have unknown numbers, or imaginary parts of angles, beyond bounds, (n,).

        Lengths count in characteristic ones.
        """
        found = ~np.isfinite(q[:, self.own]).all(axis=1)
        found |= (np.abs(q[:, self.lengths]) > length * self.unit).any(axis=1)
        found |= (np.abs(q[:, self.angles].imag) > high).any(axis=1)
        found |= (np.abs(q[:, self.others]) > length).any(axis=1)
        return np.asarray(found)

    def growth(self, q: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Largest growth (n,) with slopes (n, m): relative, that of angles as it is."""
        unit = np.ones(len(self.own))
        unit[np.isin(self.own, self.lengths)] = self.unit
        size = unit + np.abs(q[:, self.own])
        size[:, np.isin(self.own, self.angles)] = 1.0
        return np.asarray((np.abs(slope) / size).max(axis=1, initial=0.0))


@dataclass(frozen=True, eq=False)
class System:
    """As many equations as unknowns.

    Attributes
    ----------
    numbers : Numbers
    prescribed : int
        How many targets there are.
    tape : Tape
        Newton's step on real numbers. Inputs: posture, targets. Outputs: the unknown numbers after
        the step, the step, and a weighted sum of the rows, before and after, as the linear
        equations have them.
    relative : mapping of int to (int, float)
        Components of the step that count relative to a number of the posture, in a unit.
    slow : callable, optional
        The same step for postures (n, count) and targets (n, prescribed) by LAPACK: postures
        (n, count) and steps (n, size). Without it, paths take shorter steps past small pivots.
    """

    numbers: Numbers
    prescribed: int
    tape: Tape
    relative: dict[int, tuple[int, float]]
    slow: Slow | None = None

    @property
    def size(self) -> int:
        """Components of a step."""
        return len(self.tape.outputs) - len(self.numbers.own) - 2


def sizes(relative: dict[int, tuple[int, float]], q: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Largest component (n,) of steps (n, k) from postures (n, count); as ``System.relative``."""
    found = np.abs(step)
    for component, (number, unit) in relative.items():
        found[:, component] /= np.sqrt(1.0 + np.abs(q[:, number] / unit) ** 2)
    largest = found.max(axis=1, initial=0.0)
    return np.where(np.isfinite(largest), largest, np.inf)


@dataclass(frozen=True, eq=False)
class Linear:
    """Square equations with their derivatives, as expressions.

    ``entries`` are the derivatives of each value by the unknowns, those that are not always zero.
    """

    values: list[Expr]
    entries: list[dict[int, Expr]]
    unknown: list[int]


def solved(
    g: Graph, linear: Linear, samples: np.ndarray
) -> tuple[dict[int, Expr], tuple[Expr, Expr]]:
    """Newton's step by unknown, and weighted sums of the values before and after it.

    Pivots are chosen at samples (inputs, n).

    Raises
    ------
    ArithmeticError
        The rows are dependent at the samples.
    """
    step = eliminate(g, linear.entries, linear.unknown, samples).solve([-v for v in linear.values])
    weights = 1.0 + 0.5 * np.sin(np.arange(1, len(linear.values) + 1))
    before, after = g.constant(0.0), g.constant(0.0)
    for weight, value, row in zip(weights, linear.values, linear.entries, strict=True):
        left = value
        for v, entry in row.items():
            left = left + entry * step[v]
        before, after = before + float(weight) * value, after + float(weight) * left
    return step, (before, after)


def quaternions_of_targets(pins: int, goals: int) -> tuple[int, ...]:
    """Where quaternions begin among targets: values of joints, then poses."""
    return tuple(pins + POSE * i + 3 for i in range(goals))
