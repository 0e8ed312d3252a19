"""Postures from many random starts, with an estimate of what was not met.

Every mode that there is has its share of the starts. How often each was hit tells how much may be
unseen: the share of hits on modes that were hit once is about the share of the unseen ones
[Good1953]_, and these are at least f1 (f1 - 1) / (2 (f2 + 1)), with f1 and f2 modes hit once and
twice [Chao1984]_.

[Good1953]_ I. J. Good, The population frequencies of species and the estimation of population
parameters, Biometrika 40, 1953.
[Chao1984]_ A. Chao, Nonparametric estimation of the number of classes in a population, Scandinavian
Journal of Statistics 11, 1984.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.shapes import Shapes, groups
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.problem import Problem
from closedchain.closure.solve.search import search
from closedchain.closure.turns import tied

BATCH = 256
ENOUGH = 4  # hits of every mode, after which nothing more is sought
LEAST = 1024  # starts at least
MOST = 20_000

KEPT = 48  # postures that do not settle

GOOD = (Ending.ARRIVED.code, Ending.LIMIT.code)


@dataclass(frozen=True, eq=False)
class Starts:
    """How many random starts at most, and their seed."""

    most: int = MOST
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Sought:
    """What many starts led to.

    Attributes
    ----------
    q : (n, nq) array
        A posture of each shape: within limits where one that was hit is, near home.
    hits : (n,) int array
    starts : int
    unsettled : (k, nq) array
        Postures that are nearly closed and that Newton's method refuses: singular ones, maybe.
    """

    q: np.ndarray
    hits: np.ndarray
    starts: int
    unsettled: np.ndarray

    @property
    def unseen(self) -> float:
        """Least estimate of how many modes were not met."""
        once, twice = (int((self.hits == k).sum()) for k in (1, 2))
        return once * (once - 1) / (2.0 * (twice + 1))

    @property
    def share(self) -> float:
        """Share of the hits that fell on modes hit once."""
        return float((self.hits == 1).sum() / max(int(self.hits.sum()), 1))


def sought(
    problem: Problem,
    shapes: Shapes,
    targets: np.ndarray,
    *,
    starts: Starts | None = None,
    report: Callable[[str, int], None] | None = None,
) -> Sought:
    """Closed postures at targets (prescribed,), from home and random starts."""
    wanted = starts or Starts()
    m, rng = problem.mechanism, np.random.default_rng(wanted.seed)
    q = np.zeros((0, m.model.nq))
    hits, gone = np.zeros(0, dtype=int), 0
    begin, unsettled = m.home[None], np.zeros((0, m.model.nq))
    while gone < wanted.most:
        begin = np.concatenate([begin, random_starts(m, rng, BATCH - len(begin) % BATCH)])
        found = search(problem, np.repeat(targets[None], len(begin), axis=0), begin[:, None])
        good = np.isin(found.codes, GOOD)
        left = found.q[found.codes == Ending.SLOW.code]
        unsettled = np.concatenate([unsettled, left])[:KEPT]
        gone += len(begin)
        q, hits = _counted(shapes, q, hits, found.q[good])
        begin = begin[:0]
        if report is not None:
            report("searching", len(q))
        if gone >= LEAST and len(q) and hits.min() >= ENOUGH:
            break
        if gone >= MOST // 4 and not len(q):
            break
    return Sought(q, hits, gone, unsettled)


def closed_postures(
    problem: Problem, targets: np.ndarray, starts: Starts, count: int
) -> np.ndarray:
    """Some closed postures (at most ``count``, nq) at targets, whatever their shapes."""
    m, rng = problem.mechanism, np.random.default_rng(starts.seed)
    found = np.zeros((0, m.model.nq))
    for _ in range(max(1, min(starts.most, LEAST) // BATCH)):
        begin = random_starts(m, rng, BATCH)
        end = search(problem, np.repeat(targets[None], BATCH, axis=0), begin[:, None])
        found = np.concatenate([found, end.q[np.isin(end.codes, GOOD)]])
        if len(found) >= count:
            break
    return found[:count]


def _counted(
    shapes: Shapes, q: np.ndarray, hits: np.ndarray, more: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Known modes with their hits after more postures were found."""
    if not len(more):
        return q, hits
    every = np.concatenate([q, more])
    weight = np.concatenate([hits, np.ones(len(more), dtype=int)])
    group = groups(shapes.of(every))
    count = int(group.max()) + 1
    first = chosen(shapes.mechanism, every, group)
    return every[first], np.bincount(group, weights=weight, minlength=count).astype(int)


def chosen(mechanism: Mechanism, q: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Of each group the posture within limits, or nearest to them; then the nearest to home."""
    q = unwound(mechanism, q)
    low, high = mechanism.limits
    beyond = np.maximum(np.maximum(low - q, q - high), 0.0).max(axis=1)
    beyond[beyond < 1e-9] = 0.0
    away = np.abs(q - mechanism.home).max(axis=1)
    order = np.lexsort((away, beyond, group))
    _, first = np.unique(group[order], return_index=True)
    return np.asarray(order[first])


def unwound(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Postures (n, nq) with angles moved by whole turns to within limits, next to home.

    Angles that relations tie count their turns, and stay.
    """
    found, model = np.array(q), mechanism.model
    counting = tied(mechanism)
    low, high = mechanism.limits
    turn = 2.0 * np.pi
    for j in range(1, model.njoints):
        i, v = model.idx_qs[j], model.idx_vs[j]
        if model.nqs[j] != 1 or mechanism.translational[v] or counting[v]:
            continue
        x = found[:, i]
        x = mechanism.home[i] + (x - mechanism.home[i] + np.pi) % turn - np.pi
        x = np.where((x > high[i]) & (x - turn >= low[i] - 1e-9), x - turn, x)
        found[:, i] = np.where((x < low[i]) & (x + turn <= high[i] + 1e-9), x + turn, x)
    return found


def random_starts(mechanism: Mechanism, rng: np.random.Generator, count: int) -> np.ndarray:
    """Postures (count, nq) far and wide: any angle within limits, lengths about home's."""
    model = mechanism.model
    low, high = mechanism.limits
    q = np.zeros((count, model.nq))
    for j in range(1, model.njoints):
        i, v = model.idx_qs[j], model.idx_vs[j]
        if model.nqs[j] == 1:
            home = mechanism.home[i]
            if not mechanism.translational[v]:
                q[:, i] = rng.uniform(max(low[i], home - np.pi), min(high[i], home + np.pi), count)
            elif np.isfinite([low[i], high[i]]).all():
                q[:, i] = rng.uniform(low[i], high[i], count)
            else:
                spread = mechanism.length * rng.standard_normal(count)
                q[:, i] = np.clip(home + spread, low[i], high[i])
            continue
        place = mechanism.home[i : i + 3]
        q[:, i : i + 3] = place + mechanism.length * rng.standard_normal((count, 3))
        turn = rng.standard_normal((count, 4))
        q[:, i + 3 : i + 7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    return q
