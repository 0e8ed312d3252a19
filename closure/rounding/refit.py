"""The exact mechanism that rounded numbers stand for: the nearest in units of their last digits.

Rows of an overconstrained mechanism depend on each other in every posture only for special numbers
(parallel axes, equal lengths, axes through one point), and rounding makes these a little less
special. The numbers are moved, by least squares, until the rows that should depend on the others
vanish with them at many postures, spread over the motions. What is special need not be known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.rounding.attempts import Attempt
from closedchain.closure.rounding.parts import Part
from closedchain.closure.rounding.sensitivity import Sensitivity
from closedchain.urdf.description import Description
from closedchain.urdf.digits import with_numbers

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


class Spot(Protocol):
    """A posture that is closed as well as numbers let it: ``Settled`` or ``Bent``."""

    @property
    def q(self) -> np.ndarray:
        """Posture (nq,)."""

    @property
    def rank(self) -> int:
        """Rows that are to be independent there."""

    @property
    def values(self) -> np.ndarray:
        """Singular values (min(rows, nv),) of the Jacobian."""

    @property
    def size(self) -> float:
        """Size that singular values are judged by."""

    @property
    def open(self) -> float:
        """Largest dimensionless row."""

    @property
    def left(self) -> np.ndarray:
        """What no change of the posture closes (k,)."""

    def by_numbers(self, sensitivity: Sensitivity) -> np.ndarray:
        """Derivative (k, n) of ``left`` by numbers."""


class Search(Protocol):
    """How such postures are looked for: ``Along`` motions or ``Around`` a posture."""

    @property
    def tolerance(self) -> float:
        """Dimensionless size of what rounding may leave open."""

    @property
    def noise(self) -> float:
        """What derivatives by numbers may be off."""

    def settled(self, equations: Equations, q: np.ndarray, rank: int) -> Spot | None:
        """The one near ``q`` (nq,)."""

    def spread(
        self, equations: Equations, start: np.ndarray, count: int, seed: int = 0
    ) -> Sequence[Spot]:
        """Up to ``count`` beside a posture (nq,), the same always."""


@dataclass(frozen=True, eq=False)
class Movable:
    """What may change, and to what end.

    Attributes
    ----------
    part : Part
    build : callable
        Mechanism, home as stated, of a description.
    attempt : Attempt
        The numbers, how easily each moves, and the relations that are to hold beside the rows.
    search : Search
        How postures are looked for.
    """

    part: Part
    build: Build
    attempt: Attempt
    search: Search


@dataclass(frozen=True, eq=False)
class _State:
    """A mechanism, the values (n,) of its numbers, and the postures looked at.

    ``related`` are rows of relations, with their derivative by all numbers.
    """

    mechanism: Mechanism
    values: np.ndarray
    spots: Sequence[Spot]
    related: tuple[np.ndarray, np.ndarray]

    @property
    def worst(self) -> float:
        return max(_worst(self.spots), float(np.abs(self.related[0]).max(initial=0.0)))


def refit(
    movable: Movable, mechanism: Mechanism, start: np.ndarray, spots: Sequence[Spot]
) -> Mechanism | None:
    """Move numbers until rows beyond the rank depend on the others; None where they do not come to.

    ``spots`` are postures of the ``mechanism``, closed to the tolerance, from ``start`` (nq,).
    """
    values = np.array([number.value for number in movable.attempt.numbers])
    search = movable.search
    for seed in range(1, ROUNDS + 1):
        found = _descended(movable, mechanism, values, spots)
        if found is None or found.worst > NEARLY:
            return None
        fitted = found.worst <= FAIR
        if fitted:
            mechanism, values = found.mechanism, found.values
        # where they do not, numbers may fit in two ways that meet here: again, elsewhere
        equations = movable.part.equations(movable.part.alone(mechanism))
        fresh = search.spread(equations, start, POSTURES, seed)
        if not fresh:
            return None
        if fitted and _worst(fresh) < FAIR:
            return mechanism
        spots = [*found.spots, *fresh] if fitted else fresh
    return None


def _descended(
    movable: Movable, mechanism: Mechanism, values: np.ndarray, spots: Sequence[Spot]
) -> _State | None:
    """Levenberg-Marquardt with a damping that goes with the last change of the numbers.

    That keeps it quadratic although the numbers that fit are many, and some of the directions that
    should not matter do, by a little, until all fits.
    """
    moving = np.flatnonzero(movable.attempt.weights > 0.0)
    scale = movable.attempt.weights[moving] / movable.attempt.weights.max(initial=0.0)
    here = _state(movable, mechanism, values, spots)
    if here is None:
        return None
    size, stalled = movable.search.tolerance, 0
    for _ in range(STEPS):
        if here.worst < EXACT or not moving.size or stalled >= ENOUGH:
            break
        step = _step(movable, here, scale, max(DAMPING * size, movable.search.noise))
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
    moving = np.flatnonzero(movable.attempt.weights > 0.0)
    by_number = Sensitivity(
        movable.part.alone(here.mechanism), [movable.attempt.numbers[i] for i in moving]
    )
    related, slopes = here.related
    left = np.concatenate([related, *(spot.left for spot in here.spots)])
    rows = [slopes[:, moving], *(spot.by_numbers(by_number) for spot in here.spots)]
    matrix = np.vstack(rows) * scale
    # least |matrix y - left|^2 + |damping y|^2, by orthogonal factors of the smaller side
    if matrix.shape[0] >= matrix.shape[1]:
        whole = np.vstack([matrix, damping * np.eye(matrix.shape[1])])
        q, r = np.linalg.qr(whole)
        return np.linalg.solve(r, q[: left.size].T @ left)
    whole = np.vstack([matrix.T, damping * np.eye(left.size)])
    q, r = np.linalg.qr(whole)
    return np.asarray(q[: matrix.shape[1]] @ np.linalg.solve(r.T, left))


def _moved(movable: Movable, here: _State, values: np.ndarray) -> _State | None:
    """The mechanism with other values; None where one is out of reach or postures are lost."""
    begun = np.array([number.value for number in movable.attempt.numbers])
    if (np.abs(values - begun) > movable.attempt.reach).any():
        return None
    described = with_numbers(here.mechanism.description, movable.attempt.numbers, values)
    return _state(movable, movable.build(described), values, here.spots)


def _state(
    movable: Movable, mechanism: Mechanism, values: np.ndarray, spots: Sequence[Spot]
) -> _State | None:
    """The postures of ``spots`` found again with these numbers; None where too many are lost."""
    equations = movable.part.equations(movable.part.alone(mechanism))
    tried = (movable.search.settled(equations, spot.q, spot.rank) for spot in spots)
    found = [spot for spot in tried if spot is not None]
    if len(found) <= MOST * len(spots):
        return None
    return _State(mechanism, values, found, movable.attempt.relations.at(mechanism.description))


def _worst(spots: Sequence[Spot]) -> float:
    return max(spot.open for spot in spots)
