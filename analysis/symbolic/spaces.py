"""Reciprocal screws in closed form, by Cramer's rule: no division, so no spurious poles.

Twists are (angular; linear at O), wrenches (force; moment about O), paired by the Klein form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from closedchain.analysis.symbolic.factors import primitive
from closedchain.analysis.symbolic.ring import Element, Ring, Vector, evaluate
from closedchain.closure.ranks import numerical_rank

Point = Mapping[str, float]


def pairing(ring: Ring, wrench: Vector, twist: Vector) -> Element:
    """Klein form: power of a wrench on a twist."""
    return ring.dot([*wrench[3:], *wrench[:3]], twist)


def swapped(vector: Vector) -> Vector:
    """Primal and dual part exchanged."""
    return [*vector[3:], *vector[:3]]


def numbers(ring: Ring, rows: Sequence[Vector], at: Point) -> np.ndarray:
    """Values (n, 6) of screws."""
    return np.array([[evaluate(ring, x, at) for x in row] for row in rows]).reshape(len(rows), -1)


def independent(ring: Ring, rows: Sequence[Vector], at: Point, scale: float) -> list[Vector]:
    """As many of the rows as are independent at a generic point, the simplest first."""
    order = sorted(range(len(rows)), key=lambda i: (_size(rows[i]), i))
    chosen: list[int] = []
    for i in order:
        trial = numbers(ring, [rows[k] for k in [*chosen, i]], at)
        trial = trial / np.repeat([1.0, scale], 3)
        if np.any(trial[-1]) and numerical_rank(trial).value == len(chosen) + 1:
            chosen.append(i)
    return [rows[i] for i in sorted(chosen)]


def reciprocal(ring: Ring, rows: Sequence[Vector], at: Point, scale: float) -> list[Vector]:
    """Basis of the screws reciprocal to all rows; entries have no common factor.

    Parameters
    ----------
    rows : twists or wrenches (n, 6)
    at : mapping
        Generic values that decide the rank.
    scale : float
        Length that makes moments dimensionless there.
    """
    rows = independent(ring, rows, at, scale)
    r = len(rows)
    if r == 0:
        return [[ring.one if i == j else ring.zero for i in range(6)] for j in range(6)]
    value = numbers(ring, rows, at) / np.repeat([1.0, scale], 3)
    best: tuple[tuple[int, ...], Element] | None = None
    for columns in combinations(range(6), r):
        if numerical_rank(value[:, list(columns)]).value < r:
            continue
        pivot = ring.det([[row[c] for c in columns] for row in rows])
        if best is None or _weight(pivot) < _weight(best[1]):
            best = columns, pivot
        if _weight(pivot) == (0, 1):
            break
    assert best is not None
    columns, pivot = best
    found = []
    for free in (c for c in range(6) if c not in columns):
        # rows . x = 0 with x[free] = pivot
        x = [ring.zero] * 6
        x[free] = pivot
        for k, column in enumerate(columns):
            replaced = [
                [row[free] if j == k else row[c] for j, c in enumerate(columns)] for row in rows
            ]
            x[column] = -ring.det(replaced)
        found.append(swapped(primitive(ring, x)[1]))
    return found


def _size(row: Vector) -> int:
    return sum(len(x) + sum(sum(m) for m in x) for x in row if x)


def _weight(element: Element) -> tuple[int, int]:
    """Degree and terms: constants first."""
    return max((sum(mono) for mono in element), default=0), len(element)
