"""Newton's method onto a solution set: to a nearby point of it, or across its tangent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

SOLVED = 1e-12  # largest dimensionless row of a point on the set
DEPENDENT = 1e-10  # the same for rows that are no longer independent on the set
CONTRACTION = 0.4  # of successive corrector steps
ITERATIONS = 8
RANK = 1e-9
SHARES = (1.0, 0.4, 0.15)  # of a step, until the largest row falls
SLOPE = 0.1  # share of the way to zero by which it has to


class System(Protocol):
    """Smooth equations whose solutions are traced; points are arrays, steps dimensionless.

    ``frame`` is whatever has to be held for the equations to be smooth around a point.
    """

    @property
    def size(self) -> int:
        """Number of unknowns."""

    def frame(self, z: np.ndarray) -> Any:
        """What is held around a point."""

    def evaluate(self, z: np.ndarray, frame: Any) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) and Jacobian (rows, size)."""

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Point after a step (size,)."""

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Step (size,) from one point to another."""


@dataclass(frozen=True)
class Bound:
    """Range of one unknown: entry ``index`` of a point, ``column`` of a step, ``unit`` between."""

    index: int
    column: int
    unit: float
    lower: float
    upper: float
    label: str

    def beyond(self, z: np.ndarray) -> float | None:
        """Value of the bound that a point lies beyond, or None."""
        slack = 1e-9 * self.unit
        if z[self.index] > self.upper + slack:
            return self.upper
        return self.lower if z[self.index] < self.lower - slack else None


@dataclass(eq=False)
class Here:
    """A point of the path with the equations' frame, tangent, and what is told from it."""

    z: np.ndarray
    frame: Any
    squeeze: np.ndarray | None
    tangent: np.ndarray
    sign: float
    least: float


def settle(
    system: System,
    z: np.ndarray,
    held: Sequence[tuple[Bound, float]] = (),
    *,
    longest: float = 0.3,
    iterations: int = 25,
    tolerance: float = SOLVED,
    careful: bool = False,
) -> np.ndarray | None:
    """Solution near a point by damped Gauss-Newton steps of least norm, or None.

    ``held`` adds rows: the unknown of a bound at a value. ``careful`` shortens steps until the
    largest row falls: for starts that are far away.
    """
    last = np.inf
    found = _evaluated(system, z)
    for _ in range(iterations):
        if found is None:
            return None  # not even a frame makes the equations regular here
        values, jacobian = found
        for bound, value in held:
            row = np.zeros((1, system.size))
            row[0, bound.column] = 1.0
            jacobian = np.vstack([jacobian, row])
            values = np.append(values, (z[bound.index] - value) / bound.unit)
        worst = float(np.abs(values).max(initial=0.0))
        if worst < tolerance:
            return z
        if worst < 100.0 * tolerance and worst >= 0.5 * last:
            return z  # at rounding level
        last = worst
        step = -np.linalg.lstsq(jacobian, values, rcond=RANK)[0]
        size = float(np.linalg.norm(step))
        if not np.isfinite(size) or size < 1e-15:
            return None
        step *= min(1.0, longest / size)
        if not careful:
            z = system.move(z, step)
            found = _evaluated(system, z)
            continue
        for share in SHARES:
            there = system.move(z, share * step)
            found = _evaluated(system, there)
            if (
                found is not None
                and np.abs(found[0]).max(initial=0.0) < (1.0 - SLOPE * share) * worst
            ):
                break
        else:
            return None  # a least value that is not zero
        z = there
    return None


def _evaluated(system: System, z: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    try:
        return system.evaluate(z, system.frame(z))
    except np.linalg.LinAlgError:
        return None


def correct_across(
    system: System, here: Here, z: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Newton's method across the tangent of ``here``; point, Jacobian, first step; or None."""
    first = last = np.inf
    for count in range(ITERATIONS):
        try:
            values, jacobian = system.evaluate(z, here.frame)
        except np.linalg.LinAlgError:
            return None  # the frame does not suit the point any more
        every = float(np.abs(values).max(initial=0.0))
        if here.squeeze is not None:
            values, jacobian = here.squeeze @ values, here.squeeze @ jacobian
        worst = float(np.abs(values).max(initial=0.0))
        if worst < SOLVED:
            # rows taken for dependent must vanish with the others
            solved = every < DEPENDENT
            return (z, jacobian, 0.0 if count == 0 else first) if solved else None
        square = np.vstack([jacobian, here.tangent])
        try:
            step = -np.linalg.solve(square, np.append(values, 0.0))
        except np.linalg.LinAlgError:
            return None
        size = float(np.linalg.norm(step))
        if not np.isfinite(size) or size > max(CONTRACTION * last, 1e-11) or size > 0.5 * h + 1e-9:
            return None
        first, last = (size, size) if count == 0 else (first, size)
        z = system.move(z, step)
    return None
