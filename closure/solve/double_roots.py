"""Closed postures at a fold, as well as they can be known.

At a double root, such as a leg that is stretched to just the reach that is asked for, rows grow
with the square of the error along the direction in which the Jacobian vanishes: rows of 1e-16 tell
the posture to 1e-8 only, and Newton's method halves the error each step, no more. The Jacobian
itself tells the place to rounding, since it grows with the error and not with its square. So the
root of W^T J V is sought, W and V the singular vectors that vanish there, a pair for each leg that
is stretched, on the postures where all other rows hold. It counts where the rows hold there as
well as before, and change on the way by no more than they are off and their rounding.
"""

from __future__ import annotations

import numpy as np

from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.descend import Descent
from closedchain.closure.solve.newton import Rows

VANISHING = 1e-5
"""Share of the largest singular value below which one may vanish at a double root nearby."""

GONE = (
    1e-13  # share below which it vanishes for good: rows or unknowns to spare, or the fold itself
)
LOOK = 1e-4  # dimensionless: how far away the slopes of W^T J V are taken
ROUNDING = 2e-15  # rows [m or rad] that are zero
SAFETY = 4.0  # times what rows are off
CORRECTIONS = 4
CHORDS = 3  # steps to the root: errors shrink by the share LOOK each time
LEAST_SLOPE = 1e-3


def at_fold(equations: Rows, found: Descent) -> Descent:
    """The double root beside a closed posture, or the posture itself where there is none."""
    u, s, vt = np.linalg.svd(found.system, full_matrices=False)
    if not s.size:
        return found
    small = (s > GONE * s[0]) & (s < VANISHING * s[0])
    if not small.any():
        return found
    left, right, floor = u[:, small], vt[small].T, VANISHING * float(s[0])

    def at(distances: np.ndarray) -> Descent:
        """Posture that far along the vanishing directions, where all other rows hold."""
        q = equations.move(found.q, right @ distances)
        for _ in range(CORRECTIONS):
            values, matrix = equations.evaluate(q)
            q = equations.move(q, _corrected(values / equations.row_scale, matrix, floor, right))
        return Descent(q, *equations.evaluate(q), CORRECTIONS + 1)

    def vanishing(there: Descent) -> np.ndarray:
        return np.asarray(left.T @ there.system @ right).ravel()

    here, count = vanishing(found), right.shape[1]
    slopes = [(vanishing(at(LOOK * along)) - here) / LOOK for along in np.eye(count)]
    to_root = np.linalg.pinv(np.array(slopes).T, rcond=LEAST_SLOPE)
    place, best = np.zeros(count), found
    for _ in range(CHORDS):
        place = place - to_root @ vanishing(best)
        if not np.linalg.norm(place) < LOOK:  # no root this near
            return found
        best = at(place)
    rounding = SAFETY * (min(found.residual, CLOSED) + ROUNDING)
    if best.residual > max(found.residual, ROUNDING):
        return found
    if np.linalg.norm(here) * np.linalg.norm(place) > rounding:  # told apart by the rows
        return found
    looks = (CHORDS + count) * (CORRECTIONS + 1)
    return Descent(best.q, best.values, best.system, found.evaluations + looks)


def _corrected(
    scaled: np.ndarray, matrix: np.ndarray, floor: float, right: np.ndarray
) -> np.ndarray:
    """Newton step of least norm for all rows but the vanishing ones, across their directions."""
    u, s, vt = np.linalg.svd(matrix, full_matrices=False)
    keep = s > floor
    step = -vt[keep].T @ ((u[:, keep].T @ scaled) / s[keep])
    return np.asarray(step - right @ (right.T @ step))
