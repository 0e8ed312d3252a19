"""Ways along branches, many at once, past where only a choice of rows or pivots fails."""

from __future__ import annotations

import numpy as np

from closedchain.closure.solve.alone import follow_alone, healthy
from closedchain.closure.solve.control import CLOSED, SMALLEST
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import Way, follower_of
from closedchain.closure.solve.problem import POSE, Problem

ARRIVED = Ending.ARRIVED.code


def follow(
    problem: Problem,
    q: np.ndarray,
    begin: np.ndarray,
    end: np.ndarray,
    smallest: float = SMALLEST,
) -> Way:
    """Follow branches as ``Follower.run`` does, and go on where that alone has to stop.

    Rows that are independent at the samples may depend on each other elsewhere though all rows
    together keep their rank, and pivots that are large there may vanish. Where a way ends, or does
    not begin, with the Jacobian of all rows well away from losing rank, it goes on by LAPACK, with
    all rows. Determinants keep their value from before.
    """
    way = follower_of(problem).run(q, begin, end, smallest)
    codes, reached, postures = way.codes.copy(), way.reached.copy(), way.q.copy()
    started = way.started.copy()
    for i in _strayed(problem, way, end):
        # from the start: the kept rows took another branch on the way, where they alone fail
        postures[i], reached[i], codes[i] = q[i], 0.0, Ending.STUCK.code
    for i in np.flatnonzero(codes != ARRIVED):
        if not healthy(problem, postures[i]):
            continue
        here = partway(problem, begin[i], end[i], float(reached[i]))
        last, share = follow_alone(problem, postures[i], here, end[i], smallest)
        if share > 0.0:
            postures[i], started[i] = last, True
            reached[i] = 1.0 if share == 1.0 else reached[i] + (1.0 - reached[i]) * share
            codes[i] = ARRIVED if share == 1.0 else codes[i]
    return Way(postures, reached, codes, way.det, way.evaluations, started)


def _strayed(problem: Problem, way: Way, end: np.ndarray) -> np.ndarray:
    """Ways (k,) that arrived with the kept rows closed and others open."""
    arrived = way.codes == ARRIVED
    if not problem.redundant or not arrived.any():
        return np.zeros(0, dtype=int)
    (largest, *_) = follower_of(problem).check.run(np.concatenate([way.q.T, end.T]))
    return np.flatnonzero(arrived & ~(largest < CLOSED))


def partway(
    problem: Problem, begin: np.ndarray, end: np.ndarray, share: float | np.ndarray
) -> np.ndarray:
    """Targets (..., prescribed) at shares (...) of ways between two."""
    share = np.asarray(share)[..., None]
    there = begin + share * (end - begin)
    p = len(problem.pinned)
    for i in range(len(problem.goals)):
        at = slice(p + POSE * i + 3, p + POSE * (i + 1))
        one, two = begin[..., at], end[..., at]
        side = np.where((one * two).sum(axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
        mixed = one + share * (side * two - one)
        there[..., at] = mixed / np.sqrt((mixed * mixed).sum(axis=-1, keepdims=True))
    return np.asarray(there)
