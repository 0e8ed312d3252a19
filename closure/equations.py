"""The equations that a position solver drives to zero: closures, then goals, dimensionless.

Rows are divided and columns multiplied by the mechanism's units (``length`` or 1), so that ranks,
steps and determinants mean the same for lengths and angles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.factors import Factors, Range
from closedchain.closure.task import Goal, goal_rows

RESIDUAL_TOLERANCE = 1e-12
"""Largest row [m or rad] of a posture that counts as closed."""


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
class Equations:
    """Closures and goals of a mechanism in the unknowns ``free`` (indices in v).

    ``within`` are limits (lower, upper) of q that steps are clipped to, if any.
    """

    mechanism: Mechanism
    free: np.ndarray
    goals: tuple[Goal, ...] = ()
    within: tuple[np.ndarray, np.ndarray] | None = field(default=None, repr=False)

    @cached_property
    def row_scale(self) -> np.ndarray:
        """Unit of each row, (rows,)."""
        if not self.goals:
            return self.mechanism.row_scale
        length = self.mechanism.length
        units = [np.where(g.translational, length, 1.0) for g in self.goals]
        return np.concatenate([self.mechanism.row_scale, *units])

    @cached_property
    def _scaling(self) -> np.ndarray:
        if not self.goals and self.free is self.mechanism.passive_v:
            return self.mechanism.passive_scaling
        return np.asfortranarray(self.mechanism.column_scale[self.free] / self.row_scale[:, None])

    def evaluate(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) [m, rad] and dimensionless Jacobian (rows, free) at ``q``."""
        values, jacobian = self.mechanism.workspace.evaluate(q)
        if self.goals:
            extra = [goal_rows(self.mechanism, g) for g in self.goals]
            values = np.concatenate([values, *(e[0] for e in extra)])
            jacobian = np.vstack([jacobian, *(e[1] for e in extra)])
        # columns are gathered, and stay, in the order in memory that LAPACK wants
        return values, jacobian.T.take(self.free, axis=0).T * self._scaling

    def residual(self, q: np.ndarray) -> np.ndarray:
        """Residual (rows,) [m, rad] alone at ``q``."""
        return self.evaluate(q)[0] if self.goals else self.mechanism.workspace.residual(q)

    def move(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Posture after a dimensionless step (free,) of the unknowns."""
        v = np.zeros(self.mechanism.model.nv)
        v[self.free] = step * self.mechanism.column_scale[self.free]
        q = pin.integrate(self.mechanism.model, q, v)
        return q if self.within is None else np.clip(q, *self.within)


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


FIRST_STEP = 0.5  # dimensionless: half the characteristic length, or half a radian
CONTRACTION = 0.3  # of successive steps: what Newton's method shows well inside its basin
QUADRATIC = 1e-6  # a step this small leaves an error at rounding level
ITERATIONS = 12


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
            return Corrected(
                q, closed, 1, count, refusal=None if closed < RESIDUAL_TOLERANCE else "step"
            )
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
        if size < QUADRATIC and closed < 0.1 * RESIDUAL_TOLERANCE:
            return Corrected(q, closed, sign, count, factors)
        if not size <= last_step:
            # below this size steps are rounding: a closed posture does not get any better
            rounding = size < 1e-9 and closed < RESIDUAL_TOLERANCE
            return Corrected(q, closed, sign, count, factors, None if rounding else "step")
        last_step = max(CONTRACTION * size, 1e-14)
        q = equations.move(q, step)
        if size < QUADRATIC:
            # the error left is of the order of size^2: one look at the residual settles it
            closed = largest(equations.residual(q))
            if closed < 0.1 * RESIDUAL_TOLERANCE:
                return Corrected(q, closed, sign, count, factors)
    return Corrected(q, closed, sign, count, factors, "slow")


def largest(values: np.ndarray) -> float:
    """Largest absolute entry; 0 for none."""
    if not values.size:
        return 0.0
    size = np.abs(values)
    return float(size[size.argmax()])
