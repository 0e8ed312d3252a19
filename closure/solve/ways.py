"""Ways along branches, for many postures at once, past where a choice of independent rows fails."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from closedchain.closure.solve.control import SMALLEST
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import Way, follower_of
from closedchain.closure.solve.problem import POSE, Problem, independent_rows

HEALTHY = 1e-2
"""Share of the largest singular value at which a Jacobian is well away from losing rank."""

CHANGES = 8  # of the kept rows, on one way


def follow(
    problem: Problem,
    q: np.ndarray,
    begin: np.ndarray,
    end: np.ndarray,
    smallest: float = SMALLEST,
) -> Way:
    """Follow branches as ``Follower.run`` does, past postures where only the kept rows fail.

    Rows that are independent at the samples may depend on each other elsewhere though all rows
    together keep their rank. Where a way ends with the whole Jacobian well away from losing rank,
    rows that suit the posture are kept from there on. That depends on the posture alone.
    """
    way = follower_of(problem).run(q, begin, end, smallest)
    if not problem.redundant:
        return way
    kept = np.full(len(q), -1)
    for _ in range(CHANGES):
        stopped = np.flatnonzero((way.codes != Ending.ARRIVED.code) & way.started)
        rows = {int(i): choice for i, choice in _other_rows(problem, way.q, stopped, kept)}
        if not rows:
            break
        for choice in sorted(set(rows.values())):
            where = np.array([i for i, c in rows.items() if c == choice])
            other = problem.keeping(choice)
            here = _partway(problem, begin[where], end[where], way.reached[where])
            try:
                on = follower_of(other).run(way.q[where], here, end[where], smallest)
            except ArithmeticError:
                kept[where] = hash(choice)
                continue
            way = way.continued(where, on)
            kept[where] = hash(choice)
    return way


def _other_rows(
    problem: Problem, q: np.ndarray, which: np.ndarray, kept: np.ndarray
) -> Iterator[tuple[int, tuple[int, ...]]]:
    """Rows to keep at postures where all rows together are well away from losing rank."""
    rank = len(problem.kept)
    for i in which:
        matrix = problem.jacobian_at(q[i])
        s = np.linalg.svd(matrix, compute_uv=False)
        if s[rank - 1] > HEALTHY * s[0]:
            choice = independent_rows(matrix[None], rank)
            if choice != problem.kept and hash(choice) != kept[i]:
                yield int(i), choice


def _partway(problem: Problem, begin: np.ndarray, end: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Targets at shares (n,) of ways between targets (n, prescribed)."""
    there = begin + share[:, None] * (end - begin)
    p = len(problem.pinned)
    for i in range(len(problem.goals)):
        at = slice(p + POSE * i + 3, p + POSE * (i + 1))
        one, two = begin[:, at], end[:, at]
        side = np.where((one * two).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
        mixed = one + share[:, None] * (side * two - one)
        there[:, at] = mixed / np.sqrt((mixed**2).sum(axis=1))[:, None]
    return np.asarray(there)
