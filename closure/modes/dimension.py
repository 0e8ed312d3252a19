"""Finite mobility: the dimension of the set of postures around one, not of its tangent space.

Closures may hold to the first order in directions in which nothing moves: the rank of their
Jacobian then promises freedoms that the mechanism does not have. So the set itself is measured.
Steps along the tangent space are closed by descent; what they became spans fewer directions, steps
along these are closed in turn, and so on until they stay as they are: then they lead along the set.
That is done beside the posture, since several branches may part at it.

Where closures hold to the second order all along a branch, what bends them tells the motions that
stay (deflation), and the steps are along these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pinocchio as pin

from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.deflate import deflated
from closedchain.closure.solve.descend import descend
from closedchain.closure.solve.leaving import left
from closedchain.closure.solve.newton import Rows

AWAY = 0.2  # dimensionless: to postures at which the dimension is measured
NEAR = 0.01  # dimensionless: to those that measure it
PLACES = 10
SHORT = 40  # evaluations after which it is tried whether a place may be found by deflation
MORE = 40  # where the posture is special: a branch may be the end of few steps
ALIKE = 3  # places of as many independent and bent rows that are measured
FURTHER = 12  # places beside one of them
RETURNED = 0.1  # times the step: what closes nearer is the posture itself
FARTHEST = 1.5  # times the step: what closes farther away may lie on another branch
SPANNED = 0.02  # share of the largest spread that may be a direction of the set
KEPT = 0.5  # share of a step along the set that is left when it is closed
ROUNDS = 4
FLAT = 1e-5  # share of the largest singular value: directions in which closures hold so far
CLOSED = 1e-9  # m or rad: where closures hold to the second order, postures are found no better
WEAK = 1e-3  # share of singular values that such postures may leave of none
BENT = 1e-5  # dimensionless curvature of closures that is none
GROWN, ROUNDING = 1e3, 1e-14  # times what rows are off: more than where they do not close
SHARP = 1e-11  # dimensionless row, and loss of rank, of postures found by deflation


class HeldEquations(Rows, Protocol):
    """Equations of a mechanism in some of its tangent coordinates."""

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism."""

    @property
    def free(self) -> np.ndarray:
        """Tangent coordinates that may change."""


def finite_dimensions(mechanism: Mechanism, q: np.ndarray) -> tuple[int, ...]:
    """Dimensions of the branches of closed postures around one (nq,), the largest first.

    A numerical measure, from random steps that are the same each time.
    """
    if not mechanism.rows:
        return (int(mechanism.model.nv),)
    equations = Equations(mechanism, np.arange(mechanism.model.nv))
    regular = _regular(equations, q)
    if regular is not None:
        return (regular,)
    pushed = left(equations, q)
    aside = () if pushed is None else (_plain(equations, pushed),)
    return _where_branches_part(equations, q, aside)


def dimensions(equations: HeldEquations, q: np.ndarray) -> tuple[int, ...]:
    """Dimensions of the branches of solutions around one (nq,), some joints held as they are."""
    regular = _regular(equations, q)
    return _where_branches_part(equations, q) if regular is None else (regular,)


def _regular(equations: HeldEquations, q: np.ndarray) -> int | None:
    """Dimension where all postures beside ``q`` (nq,) are of its kind, None where they are not."""
    if not _tangent(equations, q).shape[1]:
        return 0
    own = _sharp(equations, q)
    return own.basis.shape[1] if own is not None and _leads(equations, own) else None


def _where_branches_part(
    equations: HeldEquations, q: np.ndarray, aside: Sequence[_Place] = ()
) -> tuple[int, ...]:
    """Dimensions measured at places that steps lead to, and at those ``aside``."""
    rng = np.random.default_rng(0)
    tangent = _tangent(equations, q)
    found = {_measured(equations, place, rng) for place in aside}
    seen: Counter[tuple[int, int]] = Counter()
    returned = []
    for count in range(MORE):
        if count >= PLACES and not seen:
            break
        place = _reached(equations, q, rng.standard_normal(tangent.shape[1]) @ tangent.T)
        if place is None:
            continue
        if np.linalg.norm(_step(equations, q, place.q)) < RETURNED * AWAY:
            returned.append(place)
            continue
        seen[place.kind] += 1
        if seen[place.kind] <= ALIKE:
            found.add(_measured(equations, place, rng))
    if not found:
        found = {_measured(equations, place, rng) for place in returned}
    return tuple(sorted(found, reverse=True)) or (0,)


@dataclass(frozen=True, eq=False)
class _Place:
    """A posture (nq,), its tangent space (free, k), and the directions in which it may be left.

    ``sharp`` says that it was found by deflation, to rounding.
    """

    q: np.ndarray
    tangent: np.ndarray
    basis: np.ndarray
    sharp: bool

    @property
    def kind(self) -> tuple[int, int]:
        return self.tangent.shape[1], self.basis.shape[1]


def _reached(equations: HeldEquations, q: np.ndarray, direction: np.ndarray) -> _Place | None:
    """The place that a step in a direction (free,) leads to when it is closed."""
    begin = equations.move(q, AWAY * direction / np.linalg.norm(direction))
    place = _sharp(equations, descend(equations, begin, evaluations=SHORT).q)
    if place is not None and np.linalg.norm(_step(equations, q, place.q)) < FARTHEST * AWAY:
        return place
    closed = _closed(equations, q, direction[None], AWAY)[1]
    if not closed:
        return None
    return _sharp(equations, closed[0]) or _plain(equations, closed[0])


def _plain(equations: HeldEquations, q: np.ndarray) -> _Place:
    tangent = _tangent(equations, q)
    return _Place(q, tangent, tangent, sharp=False)


def _step(equations: HeldEquations, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Dimensionless motion (free,) from one posture to another."""
    m = equations.mechanism
    return np.asarray((pin.difference(m.model, one, two) / m.column_scale)[equations.free])


def _sharp(equations: HeldEquations, there: np.ndarray) -> _Place | None:
    """The place near a posture (nq,) all about which rows depend on each other as much.

    None where there is none, or branches may part there.
    """
    values, jacobian = equations.evaluate(there)
    s = np.linalg.svd(jacobian, compute_uv=False)
    rank = int((s > WEAK * s[0]).sum()) if s.size else 0
    if _grown(s[rank:], values / equations.row_scale):
        return None
    near = deflated(equations, there, rank, BENT)
    if near is None or near.open > SHARP or not near.alone():
        return None
    return _Place(near.q, near.motions, near.motions @ near.straight(), sharp=True)


def _grown(small: np.ndarray, rows: np.ndarray) -> bool:
    """Whether small singular values are more than rows (rows,) that are this open can feign.

    Where rows hold to the second order, they are open by the square of what these have grown.
    """
    off = float(np.abs(rows).max(initial=0.0)) + ROUNDING
    return float(small.max(initial=0.0)) ** 2 > GROWN * off


def _measured(equations: HeldEquations, place: _Place, rng: np.random.Generator) -> int:
    """Dimension of the branch through a place, measured where fewer directions promise more.

    The place may be special still, as where one of two flat linkages has opened.
    """
    known, count = place.tangent.shape[1], place.basis.shape[1]
    if place.sharp and _leads(equations, place):
        return count
    found = _dimension(equations, place, rng)
    if found == known:
        return found
    directions = rng.standard_normal((FURTHER, known)) @ place.tangent.T
    places = [_reached(equations, place.q, direction) for direction in directions]
    plainer = [p for p in places if p is not None and p.tangent.shape[1] < known]
    return max([found, *(_measured(equations, other, rng) for other in plainer)])


def _leads(equations: HeldEquations, place: _Place) -> bool:
    """Whether a step in every direction of the basis leads to a posture of the same kind."""
    rank = len(equations.free) - place.tangent.shape[1]
    for along in (*place.basis.T, *-place.basis.T):
        near = deflated(equations, equations.move(place.q, NEAR * along), rank, BENT)
        if near is None or near.open > SHARP:
            return False
        if near.straight().shape[1] != place.basis.shape[1]:
            return False
        if _step(equations, place.q, near.q) @ along < KEPT * NEAR:
            return False
    return True


def _dimension(equations: HeldEquations, place: _Place, rng: np.random.Generator) -> int:
    """Dimension of the set of solutions next to one."""
    q, basis = place.q, place.tangent
    for _ in range(ROUNDS):
        count = basis.shape[1]
        if not count:
            return 0
        mixed = rng.standard_normal((2 * count + 4, count)) @ basis.T
        steps, _ = _closed(equations, q, np.concatenate([basis.T, -basis.T, mixed]), NEAR)
        if len(steps) < count:
            return 0
        _, spread, directions = np.linalg.svd(steps)
        spanned = int((spread > SPANNED * max(spread[0], 1.0)).sum())
        kept, _ = _closed(equations, q, basis.T, NEAR)
        share = np.linalg.svd(kept @ basis, compute_uv=False) if len(kept) == count else np.zeros(0)
        if spanned == count and share.size == count and share.min() > KEPT:
            return count
        basis = directions[: min(spanned, count)].T
    return basis.shape[1]


def _tangent(equations: HeldEquations, q: np.ndarray) -> np.ndarray:
    """Directions (free, k) in which the closures hold to the first order."""
    _, s, vt = np.linalg.svd(equations.evaluate(q)[1])
    rank = int((s > FLAT * s[0]).sum()) if s.size else 0
    return np.asarray(vt[rank:].T)


def _closed(
    equations: HeldEquations, q: np.ndarray, directions: np.ndarray, step: float
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Where steps along directions (k, free) lead when they are closed.

    The steps (m, free) that are left, in units of ``step``, and the postures.
    """
    steps, found = [np.zeros((0, len(equations.free)))], []
    for direction in directions:
        begin = equations.move(q, step * direction / np.linalg.norm(direction))
        near = descend(equations, begin, evaluations=400)
        apart = _step(equations, q, near.q) / step
        if near.residual < CLOSED and np.linalg.norm(apart) < FARTHEST:
            steps.append(apart[None])
            found.append(near.q)
    return np.concatenate(steps), found
