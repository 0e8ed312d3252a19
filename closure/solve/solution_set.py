"""Smooth equations whose solutions form a set: the way onto it, tangents, ranges of unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from closedchain.closure.solve.outcome import Ending, Outcome

SOLVED = 1e-12  # largest dimensionless row of a point on the set
RANK = 1e-9
SHARES = (1.0, 0.4, 0.15)  # of a step, until the largest row falls
SLOPE = 0.1  # share of the way to zero by which it has to


class SmoothEquations(Protocol):
    """Smooth equations whose solutions are traced; points are arrays, steps dimensionless.

    ``frame`` is whatever has to be held for the equations to be smooth around a point; None where
    nothing has to.
    """

    @property
    def size(self) -> int:
        """Number of unknowns."""

    def frame(self, z: np.ndarray) -> Any:
        """What is held around a point."""

    def evaluate(self, z: np.ndarray, frame: Any) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) and Jacobian (rows, size).

        Raises ``numpy.linalg.LinAlgError`` where the frame does not suit the point.
        """

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Point after a step (size,)."""

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Step (size,) from one point to another."""


@dataclass(frozen=True)
class Bound:
    """Range of one unknown: entry ``index`` of a point, ``column`` of a step, ``unit`` between.

    ``label`` says in public results what ends there; ``ending`` which kind of end it is.
    """

    index: int
    column: int
    unit: float
    lower: float
    upper: float
    label: str
    ending: Ending = Ending.EDGE

    def beyond(self, z: np.ndarray) -> float | None:
        """Value of the bound that a point lies beyond, or None."""
        slack = 1e-9 * self.unit
        if z[self.index] > self.upper + slack:
            return self.upper
        return self.lower if z[self.index] < self.lower - slack else None


def tangents(system: SmoothEquations, z: np.ndarray, tolerance: float = 1e-7) -> np.ndarray:
    """Orthonormal basis (size, dimension) of the solutions' tangent space at a point.

    Raises ``numpy.linalg.LinAlgError`` where not even a frame makes the equations regular.
    """
    _, jacobian = system.evaluate(z, system.frame(z))
    _, s, vt = np.linalg.svd(jacobian)
    rank = int(np.count_nonzero(s > tolerance * s[0]))
    return np.ascontiguousarray(vt[rank:].T)


def settle(
    system: SmoothEquations,
    z: np.ndarray,
    held: Sequence[tuple[Bound, float]] = (),
    *,
    longest: float = 0.3,
    iterations: int = 25,
    careful: bool = False,
) -> Outcome:
    """Solution near a point by damped Gauss-Newton steps of least norm.

    ``held`` adds rows: the unknown of a bound at a value. ``careful`` shortens steps until the
    largest row falls: for starts that are far away.
    """
    worst, last = np.inf, np.inf
    found = _evaluated(system, z)
    for _ in range(iterations):
        if found is None:  # not even a frame makes the equations regular here
            return Outcome.one(z, worst, None, Ending.SINGULAR)
        values, jacobian = found
        for bound, value in held:
            row = np.zeros((1, system.size))
            row[0, bound.column] = 1.0
            jacobian = np.vstack([jacobian, row])
            values = np.append(values, (z[bound.index] - value) / bound.unit)
        worst = float(np.abs(values).max(initial=0.0))
        # not far above it, a residual that does not fall is at rounding level
        if worst < SOLVED or (worst < 100.0 * SOLVED and worst >= 0.5 * last):
            return Outcome.one(z, worst, None, Ending.ARRIVED)
        last = worst
        step = -np.linalg.lstsq(jacobian, values, rcond=RANK)[0]
        size = float(np.linalg.norm(step))
        if not np.isfinite(size) or size < 1e-15:
            return Outcome.one(z, worst, None, Ending.OPEN)
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
        else:  # a least value that is not zero
            return Outcome.one(z, worst, None, Ending.OPEN)
        z = there
    return Outcome.one(z, worst, None, Ending.SLOW)


def _evaluated(system: SmoothEquations, z: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    try:
        return system.evaluate(z, system.frame(z))
    except np.linalg.LinAlgError:
        return None
