"""Finite mobility: the dimension of the set of postures around one, not of its tangent space.

Closures may hold to the first order in directions in which nothing moves: the rank of their
Jacobian then promises freedoms that the mechanism does not have. So the set itself is measured.
Steps along the tangent space are closed by descent; what they became spans fewer directions, steps
along these are closed in turn, and so on until they stay as they are: then they lead along the set.
That is done beside the posture, since several branches may part at it.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin

from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.descend import descend
from closedchain.closure.solve.newton import Rows

AWAY = 0.2  # dimensionless: to postures at which the dimension is measured
NEAR = 0.01  # dimensionless: to those that measure it
PLACES = 10
FURTHER = 4  # places beside one of them
FARTHEST = 1.5  # times the step: what closes farther away may lie on another branch
SPANNED = 0.02  # share of the largest spread that may be a direction of the set
KEPT = 0.5  # share of a step along the set that is left when it is closed
ROUNDS = 4
FLAT = 1e-5  # share of the largest singular value: directions in which closures hold so far
CLOSED = 1e-9  # m or rad: where closures hold to the second order, postures are found no better


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
    return dimensions(Equations(mechanism, np.arange(mechanism.model.nv)), q)


def dimensions(equations: HeldEquations, q: np.ndarray) -> tuple[int, ...]:
    """Dimensions of the branches of solutions around one (nq,), some joints held as they are."""
    rng = np.random.default_rng(0)
    tangent = _tangent(equations, q)
    if not tangent.shape[1]:
        return (0,)
    directions = rng.standard_normal((PLACES, tangent.shape[1])) @ tangent.T
    _, places = _closed(equations, q, directions, AWAY)
    found = {_measured(equations, place, rng) for place in places}
    return tuple(sorted(found, reverse=True)) or (0,)


def _measured(equations: HeldEquations, q: np.ndarray, rng: np.random.Generator) -> int:
    """Dimension of the branch through a place, measured where fewer directions promise more.

    The place may be special still, as where one of two flat linkages has opened.
    """
    tangent = _tangent(equations, q)
    found = _dimension(equations, q, rng)
    if found == tangent.shape[1]:
        return found
    directions = rng.standard_normal((FURTHER, tangent.shape[1])) @ tangent.T
    _, places = _closed(equations, q, directions, AWAY)
    plainer = [p for p in places if _tangent(equations, p).shape[1] < tangent.shape[1]]
    return max([found, *(_measured(equations, place, rng) for place in plainer)])


def _dimension(equations: HeldEquations, q: np.ndarray, rng: np.random.Generator) -> int:
    """Dimension of the set of solutions next to one."""
    basis = _tangent(equations, q)
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
    m = equations.mechanism
    steps, found = [np.zeros((0, len(equations.free)))], []
    for direction in directions:
        begin = equations.move(q, step * direction / np.linalg.norm(direction))
        near = descend(equations, begin, evaluations=400)
        moved = pin.difference(m.model, q, near.q) / m.column_scale
        apart = moved[equations.free] / step
        if near.residual < CLOSED and np.linalg.norm(apart) < FARTHEST:
            steps.append(apart[None])
            found.append(near.q)
    return np.concatenate(steps), found
