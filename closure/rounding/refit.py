"""The exact mechanism that rounded numbers stand for: the nearest in units of their last digits.

Rows of an overconstrained mechanism depend on each other in every posture only for special numbers
(parallel axes, equal lengths, axes through one point), and rounding makes these a little less
special. The numbers are moved, by least squares, until the rows that should depend on the others
vanish with them at many postures, spread over the motions. What is special need not be known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.rounding.parts import Part
from closedchain.closure.rounding.sensitivity import Sensitivity
from closedchain.closure.rounding.settling import Settled, settled, spread
from closedchain.urdf.description import Description
from closedchain.urdf.digits import Number, with_numbers

POSTURES = 20
ROUNDS, STEPS = 4, 25
DAMPING = 3.0
"""Share of the last change of the numbers below which a direction's effect is not believed."""

ENOUGH = 3  # steps in vain
MOST = 0.7  # share of the postures that have to settle again
EXACT, GOOD, FAIR = 2e-14, 2e-13, 5e-13
"""Largest dimensionless row that is sought at the postures that numbers are fitted to, below which
slow progress is no longer worth a step, and that is accepted: below what counts as closed."""

NEARLY = 1e-9  # dimensionless row from which other postures are worth a try

Build = Callable[[Description], Mechanism]


@dataclass(frozen=True, eq=False)
class Movable:
    """What may change, and to what end.

    Attributes
    ----------
    part : Part
    build : callable
        Mechanism, home as stated, of a description.
    numbers : tuple of Number
    weights : (n,) array
        How easily each number moves, such as the unit of its last digit; 0 for those that stay.
    rank : int
        Rows that are to stay independent.
    tolerance : float
        Dimensionless size of what rounding may leave open.
    """

    part: Part
    build: Build
    numbers: tuple[Number, ...]
    weights: np.ndarray
    rank: int
    tolerance: float


@dataclass(frozen=True, eq=False)
class _State:
    """A mechanism, the values (n,) of its numbers, and the postures looked at."""

    mechanism: Mechanism
    values: np.ndarray
    spots: list[Settled]

    @property
    def worst(self) -> float:
        return _worst(self.spots)


def refit(
    movable: Movable, mechanism: Mechanism, postures: Sequence[np.ndarray]
) -> Mechanism | None:
    """Move numbers until rows beyond the rank depend on the others; None where they do not come to.

    ``postures`` (nq,) lie along the motions of the ``mechanism``, closed to the tolerance.
    """
    values = np.array([number.value for number in movable.numbers])
    part, start = movable.part, postures[0]
    for seed in range(1, ROUNDS + 1):
        found = _descended(movable, mechanism, values, postures)
        if found is None or found.worst > NEARLY:
            return None
        if found.worst > FAIR:  # numbers may fit in two ways that meet here: again, elsewhere
            equations = part.equations(part.alone(mechanism))
            again = spread(equations, start, movable.rank, movable.tolerance, POSTURES, seed)
            if not again:
                return None
            postures = [spot.q for spot in again]
            continue
        mechanism, values = found.mechanism, found.values
        start = found.spots[0].q
        equations = part.equations(part.alone(mechanism))
        fresh = spread(equations, start, movable.rank, movable.tolerance, POSTURES, seed)
        if not fresh:
            return None
        if _worst(fresh) < FAIR:
            return mechanism
        postures = [spot.q for spot in (*found.spots, *fresh)]
    return None


def _descended(
    movable: Movable, mechanism: Mechanism, values: np.ndarray, postures: Sequence[np.ndarray]
) -> _State | None:
    """Levenberg-Marquardt with a damping that goes with the last change of the numbers.

    That keeps it quadratic although the numbers that fit are many, and some of the directions that
    should not matter do, by a little, until all fits.
    """
    moving = np.flatnonzero(movable.weights > 0.0)
    scale = movable.weights[moving] / movable.weights.max(initial=0.0)
    spots = _settled(movable, mechanism, postures)
    if spots is None:
        return None
    here = _State(mechanism, values, spots)
    size, stalled = movable.tolerance, 0
    for _ in range(STEPS):
        if here.worst < EXACT or not moving.size or stalled >= ENOUGH:
            break
        step = _step(movable, here, scale, DAMPING * size)
        tried = here.values.copy()
        tried[moving] -= scale * step
        there = _moved(movable, here, tried)
        if there is None or there.worst >= here.worst:
            size, stalled = 10.0 * size, ENOUGH if here.worst < GOOD else stalled + 1
            continue
        size = float(np.linalg.norm(step))
        stalled = ENOUGH if here.worst < GOOD and there.worst > 0.5 * here.worst else 0
        here = there
    return here


def _step(movable: Movable, here: _State, scale: np.ndarray, damping: float) -> np.ndarray:
    """Damped least change (m,) of the moving numbers that closes what is left open."""
    chosen = [movable.numbers[i] for i in np.flatnonzero(movable.weights > 0.0)]
    left = np.concatenate([spot.spare.T @ spot.rows for spot in here.spots])
    by_number = Sensitivity(movable.part.alone(here.mechanism), chosen)
    matrix = np.vstack([spot.spare.T @ by_number.at(spot.q) * scale for spot in here.spots])
    # least |matrix y - left|^2 + |damping y|^2, by orthogonal factors of the smaller side
    if matrix.shape[0] >= matrix.shape[1]:
        whole = np.vstack([matrix, damping * np.eye(matrix.shape[1])])
        q, r = np.linalg.qr(whole)
        return np.linalg.solve(r, q[: left.size].T @ left)
    whole = np.vstack([matrix.T, damping * np.eye(left.size)])
    q, r = np.linalg.qr(whole)
    return np.asarray(q[: matrix.shape[1]] @ np.linalg.solve(r.T, left))


def _moved(movable: Movable, here: _State, values: np.ndarray) -> _State | None:
    described = with_numbers(here.mechanism.description, movable.numbers, values)
    mechanism = movable.build(described)
    spots = _settled(movable, mechanism, [spot.q for spot in here.spots])
    return None if spots is None else _State(mechanism, values, spots)


def _settled(
    movable: Movable, mechanism: Mechanism, postures: Sequence[np.ndarray]
) -> list[Settled] | None:
    equations = movable.part.equations(movable.part.alone(mechanism))
    found = (settled(equations, q, movable.rank) for q in postures)
    spots = [spot for spot in found if spot is not None]
    return spots if len(spots) > MOST * len(postures) else None


def _worst(spots: Sequence[Settled]) -> float:
    return max(spot.open for spot in spots)
