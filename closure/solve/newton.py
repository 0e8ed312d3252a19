"""Newton's method from nearby, by LAPACK, for any equations: where no machine code suits them.

The rules are those of ``control``, for one posture, with all rows and with pivoting.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from closedchain.closure.solve.control import CLOSED, CONTRACTION, FIRST_STEP, ITERATIONS
from closedchain.closure.solve.factors import Factors, Range


class Rows(Protocol):
    """Equations at postures: ``Equations``, or ``closure.solve.system.System``."""

    @property
    def row_scale(self) -> np.ndarray:
        """Unit of each row, (rows,)."""

    def evaluate(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) [m, rad] and dimensionless Jacobian (rows, unknowns)."""

    def residual(self, q: np.ndarray) -> np.ndarray:
        """Residual (rows,) [m, rad] alone."""

    def move(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Posture after a dimensionless step (unknowns,)."""


@dataclass(frozen=True, eq=False)
class Corrected:
    """Outcome of Newton's method from nearby: the posture, or why it was refused.

    ``branch`` is the sign of the determinant at the last Jacobian, None for systems that are not
    square; ``factors`` are those of that Jacobian.
    """

    q: np.ndarray
    residual: float
    branch: int | None
    evaluations: int
    factors: Factors | Range | None = None
    refusal: str | None = None


QUADRATIC = 1e-6  # a step this small leaves an error at rounding level


def correct(
    equations: Rows,
    q: np.ndarray,
    branch: int | None = None,
    chord: Factors | Range | None = None,
) -> Corrected:
    """Newton's method from a nearby posture that must not change branch.

    Refuses when the first step is large, when steps do not shrink fast, when the system is
    singular, or when the sign of its determinant differs from ``branch`` (where it is not square:
    when its Jacobian is far from that of ``chord``): in each case the basin of another solution
    may be near. With ``chord``, factors from nearby, the first step costs a residual only.
    """
    last_step, count = FIRST_STEP, 0
    if chord is not None:
        count = 1
        step = chord.step(equations.residual(q) / equations.row_scale)
        size = math.sqrt(step @ step)
        if not size <= last_step:
            return Corrected(q, math.inf, chord.sign, count, refusal="step")
        last_step = max(CONTRACTION * size, 1e-14)
        q = equations.move(q, step)
    factors: Factors | Range | None = None
    sign = None
    while count < ITERATIONS:
        count += 1
        values, matrix = equations.evaluate(q)
        scaled = values / equations.row_scale
        if not matrix.size:
            closed = largest(values)
            return Corrected(q, closed, 1, count, refusal=None if closed < CLOSED else "step")
        if matrix.shape[0] != matrix.shape[1]:
            factors = Range.of(matrix)
            if isinstance(chord, Range) and chord.left_by(factors):
                return Corrected(q, largest(values), None, count, factors, "far")
        else:
            factors = Factors.of(matrix)
            sign = factors.sign
            if sign == 0 or sign == -(branch or 0):
                why = "sign" if sign else "singular"
                return Corrected(q, largest(values), sign, count, factors, why)
        step = factors.step(scaled)
        size = math.sqrt(step @ step)
        closed = largest(values)
        if size < QUADRATIC and closed < 0.1 * CLOSED:
            return Corrected(q, closed, sign, count, factors)
        if not size <= last_step:
            # below this size steps are rounding: a closed posture does not get any better
            rounding = size < 1e-9 and closed < CLOSED
            return Corrected(q, closed, sign, count, factors, None if rounding else "step")
        last_step = max(CONTRACTION * size, 1e-14)
        q = equations.move(q, step)
        if size < QUADRATIC:
            # the error left is of the order of size^2: one look at the residual settles it
            closed = largest(equations.residual(q))
            if closed < 0.1 * CLOSED:
                return Corrected(q, closed, sign, count, factors)
    return Corrected(q, closed, sign, count, factors, "slow")


def largest(values: np.ndarray) -> float:
    """Largest absolute entry; 0 for none."""
    if not values.size:
        return 0.0
    size = np.abs(values)
    return float(size[size.argmax()])
