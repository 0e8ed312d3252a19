"""Following one branch of solutions while a prescribed quantity moves from 0 to 1.

The path is cut into sub-steps until Newton's method, warm-started, contracts fast and the sign of
the determinant stays: a step that would land on another branch is refused, not taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedchain.closure.solve.factors import Factors, Range
from closedchain.closure.solve.newton import Corrected, Rows, correct

SMALLEST_STEP = 1e-6

At = Callable[[np.ndarray, float], tuple[Rows, np.ndarray]]
"""From the last posture and the new path parameter: the equations and the start of Newton."""


@dataclass(frozen=True)
class Followed:
    """Where following ended: parameter reached (1 = all the way), posture, evaluations, why."""

    reached: float
    last: Corrected
    evaluations: int
    refusal: str | None


def follow(
    at: At,
    start: Corrected,
    smallest: float = SMALLEST_STEP,
    longest: float = 1.0,
    *,
    careful: bool = False,
) -> Followed:
    """Follow the branch of ``start`` (parameter 0) as far as steps of ``smallest`` lead.

    ``longest`` keeps a step from leaping to where the equations look the same again, such as a
    full turn further; ``smallest`` is a share of it. ``careful`` refuses steps over which a square
    Jacobian changes so much that it may be singular in between.
    """
    reached, last, step = 0.0, start, longest
    evaluations, refusal = start.evaluations, None
    while reached < 1.0 and step >= smallest * longest:
        to = min(1.0, reached + step)
        equations, q = at(last.q, to)
        trial = correct(equations, q, start.branch, last.factors)
        evaluations += trial.evaluations
        far = careful and _far(last.factors, trial.factors)
        if trial.refusal is None and not far:
            reached, last, step, refusal = to, trial, min(longest, 2.0 * step), None
        else:
            step *= 0.5
            refusal = trial.refusal or "far"
    return Followed(reached, last, evaluations, refusal)


def _far(one: Factors | Range | None, two: Factors | Range | None) -> bool:
    """Whether a singular matrix may lie between two square ones; ``correct`` asks for others."""
    return isinstance(one, Factors) and isinstance(two, Factors) and one.left_by(two)
