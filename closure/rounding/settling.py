"""Postures that close as well as rounded numbers let them, and their spread along the motions.

Rows that would depend on each other are then independent by a little, and a Newton step that took
them for so would fly off. The rank is therefore given: the strongest directions are closed, and the
rest of the rows is what rounding leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.equations import Equations
from closedchain.closure.rounding.sensitivity import Sensitivity

STEPS = 30
STRIDE = 1.2
"""Largest dimensionless change of a joint from one posture of a spread to the next."""

_SETTLED, _ROUNDING = 1e-14, 1e-10  # steps that are none, and that may be no better than rounding


@dataclass(frozen=True)
class Settled:
    """A posture with the strongest directions closed.

    Attributes
    ----------
    q : (nq,) array
    rank : int
    rows : (rows,) array
        Dimensionless rows there.
    spare : (rows, rows - rank) array
        Orthonormal directions of the rows that are left open.
    motions : (nv, nv - rank) array
        Orthonormal dimensionless motions that keep the strongest directions closed.
    values : (min(rows, nv),) array
        Singular values of the Jacobian.
    """

    q: np.ndarray
    rank: int
    rows: np.ndarray
    spare: np.ndarray
    motions: np.ndarray
    values: np.ndarray

    @property
    def size(self) -> float:
        """Size that singular values are judged by: 1, or that of the largest."""
        return max(1.0, float(self.values.max(initial=0.0)))

    @property
    def open(self) -> float:
        """Largest dimensionless row."""
        return float(np.abs(self.rows).max(initial=0.0))

    @property
    def left(self) -> np.ndarray:
        """Rows (k,) in the directions that are left open."""
        return np.asarray(self.spare.T @ self.rows)

    def by_numbers(self, sensitivity: Sensitivity) -> np.ndarray:
        """Derivative (k, n) of ``left`` by numbers."""
        return np.asarray(self.spare.T @ sensitivity.at(self.q))


@dataclass(frozen=True)
class Along:
    """How postures are looked for where motions lead as far as the rank promises.

    Attributes
    ----------
    rank : int
        Independent rows.
    tolerance : float
        Dimensionless size of what rounding may leave open.
    noise : float
        What derivatives by numbers may be off.
    """

    rank: int
    tolerance: float
    noise: float = 1e-14

    def settled(self, equations: Equations, q: np.ndarray, rank: int) -> Settled | None:
        """The posture near ``q`` (nq,) with so many directions closed; None if there is none."""
        return settled(equations, q, rank)

    def spread(
        self, equations: Equations, start: np.ndarray, count: int, seed: int = 0
    ) -> list[Settled]:
        """The start (nq,) and up to ``count`` postures along the motions; the same always."""
        return spread(equations, start, self.rank, self.tolerance, count, seed)


def settled(equations: Equations, q: np.ndarray, rank: int) -> Settled | None:
    """Close the strongest ``rank`` directions by Gauss-Newton from ``q`` (nq,); None if not."""
    last = np.inf
    for _ in range(STEPS):
        values, matrix = equations.evaluate(q)
        rows = values / equations.row_scale
        u, s, vt = np.linalg.svd(matrix, full_matrices=True)
        step = -vt[:rank].T @ ((u[:, :rank].T @ rows) / s[:rank])
        size = float(np.linalg.norm(step))
        if not size < 3.0 or (size > 2.0 * last and size > _ROUNDING):
            return None
        if size < _SETTLED or (size < _ROUNDING and size > 0.3 * last):
            return Settled(q, rank, rows, u[:, rank:], vt[rank:].T, s)
        last = max(size, 1e-13)
        q = equations.move(q, step)
    return None


def spread(
    equations: Equations, start: np.ndarray, rank: int, tolerance: float, count: int, seed: int = 0
) -> list[Settled]:
    """The start, then ``count`` postures along the motions away from it, settled; the same always.

    Postures whose rows stay open by more than the dimensionless ``tolerance`` are left out, and
    where there are enough others those that are so special that rows hold to the tolerance though
    no motion leads there: the square of a small singular value is what they miss. Empty where the
    start does not settle.
    """
    first = settled(equations, start, rank)
    if first is None or first.open > tolerance:
        return []
    found, rng = [first], np.random.default_rng(seed)
    if not first.motions.shape[1]:
        return found
    for _ in range(3 * count):
        if len(found) > count:
            break
        base = found[int(rng.integers(max(0, len(found) - 3), len(found)))]
        along = base.motions @ rng.standard_normal(base.motions.shape[1])
        along *= STRIDE * rng.uniform(0.2, 1.0) / max(float(np.abs(along).max()), 1e-12)
        near = settled(equations, equations.move(base.q, along), rank)
        if near is not None and near.open <= tolerance:
            found.append(near)
    plain = [spot for spot in found[1:] if not rank or spot.values[rank - 1] > np.sqrt(tolerance)]
    return [first, *plain] if 2 * len(plain) > count else found
