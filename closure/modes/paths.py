"""Many complex paths followed together: predictor and corrector, a step length for each.

A path moves all that is prescribed of a problem straight from one place to another, through
complex values, where with probability one nothing is singular before the end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.modes.blocks import Block
from closedchain.closure.modes.complex_equations import normalised
from closedchain.closure.modes.places import Place
from closedchain.closure.solve.problem import POSE

FIRST, SMALLEST, LARGEST = 0.02, 1e-8, 0.25  # steps along a path
SHORT = 0.01  # relative: largest first correction of an accepted step
GROWING = 0.05  # share of that below which the next step is longer
CONTRACTION = 0.25
ITERATIONS = 4
SOLVED = 1e-10  # relative correction of a solution
MOST_STEPS = 2000
SHIFT = 1e-6  # of the path parameter: for slopes along it
FAR = 1e4  # dimensionless: lengths beyond are at infinity
HIGH = 14.0  # imaginary part of an angle beyond which it is


@dataclass(frozen=True, eq=False)
class Arrived:
    """Ends of paths: postures (n, nq), and whether each arrived (n,), or went to infinity (n,)."""

    q: np.ndarray
    good: np.ndarray
    infinite: np.ndarray


def between(block: Block, one: Place, two: Place, q: np.ndarray, t: np.ndarray) -> _Here:
    """What is prescribed at shares t (n,) of the way; postures with it set, quaternions of unit size."""
    equations = block.equations
    s = t[:, None]
    targets = (1.0 - s) * one.targets + s * two.targets
    p = len(equations.problem.pinned)
    for i in range(len(equations.problem.goals)):
        at = slice(p + POSE * i + 3, p + POSE * (i + 1))
        targets[:, at] = normalised(targets[:, at])
    posture = (1.0 - s) * one.given + s * two.given
    posture[:, block.own] = q[:, block.own]
    posture[:, equations.problem.pinned_q] = targets[:, :p]
    model = equations.problem.mechanism.model
    for j in range(1, model.njoints):
        if model.nqs[j] == 7:
            at = slice(model.idx_qs[j] + 3, model.idx_qs[j] + 7)
            posture[:, at] = normalised(posture[:, at])
    return _Here(posture, targets)


@dataclass(frozen=True, eq=False)
class _Here:
    q: np.ndarray
    targets: np.ndarray


def track(block: Block, one: Place, two: Place, q: np.ndarray) -> Arrived:
    """Follow paths from solutions (n, nq) at one place to another."""
    n, own = len(q), block.own
    q = q.astype(complex)
    t, step = np.zeros(n), np.full(n, FIRST)
    running = np.ones(n, dtype=bool)
    good, infinite = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    here = q[:, own].T.copy().T
    slope = np.zeros_like(here)
    before, slope_before, length = here.copy(), np.zeros_like(here), np.zeros(n)
    fresh = np.ones(n, dtype=bool)
    for _ in range(MOST_STEPS):
        i = np.flatnonzero(running)
        if not i.size:
            break
        j = i[fresh[i]]
        if j.size:
            slope[j] = _slope(block, one.take(j), two.take(j), q[j], t[j])
        h = np.minimum(step[i], 1.0 - t[i])
        end = t[i] + h
        end[1.0 - end < 1e-14] = 1.0
        trial = q[i]
        trial[:, own] = _ahead(
            here[i], slope[i], before[i], slope_before[i], length[i, None], h[:, None]
        )
        trial, solved, first = _corrected(block, one.take(i), two.take(i), trial, end)
        accepted = solved & (first < SHORT)
        j = i[accepted]
        before[j], slope_before[j], length[j] = here[j], slope[j], h[accepted]
        q[j], t[j] = trial[accepted], end[accepted]
        here[j] = q[j][:, own]
        fresh[i] = accepted
        grow = first[accepted] < GROWING * SHORT
        step[j] = np.where(grow, np.minimum(2.0 * h[accepted], LARGEST), h[accepted])
        step[i[~accepted]] = 0.4 * h[~accepted]
        arrived = j[t[j] == 1.0]
        good[arrived], running[arrived] = True, False
        away = far(block, q[i])
        lost = away | (step[i] < SMALLEST)
        lost &= ~good[i]
        infinite[i[lost]] = away[lost]
        running[i[lost]] = False
    return Arrived(q, good, infinite)


def _ahead(
    x: np.ndarray,
    slope: np.ndarray,
    before: np.ndarray,
    slope_before: np.ndarray,
    length: np.ndarray,
    h: np.ndarray,
) -> np.ndarray:
    """Numbers (n, m) a step h ahead, on the cubic through here and the point before.

    Without a point before (length 0) along the slope.
    """
    known = length > 0.0
    size = np.where(known, length, 1.0)
    mean = (x - before) / size
    cubic = (slope_before + slope - 2.0 * mean) / (size * size)
    square = (slope - mean) / size + cubic * size
    bend = np.where(known, (square + cubic * h) * (h * h), 0.0)
    return np.asarray(x + h * slope + bend)


def _slope(block: Block, one: Place, two: Place, q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Slopes (n, m) of the block's numbers along paths: Newton's steps from beside them."""
    n = len(q)
    shares = np.concatenate([t - SHIFT, t + SHIFT])
    twice = np.concatenate([np.arange(n)] * 2)
    here = between(block, one.take(twice), two.take(twice), q[twice], shares)
    moved, _ = block.newton.at(here.q, here.targets)
    return np.asarray((moved[n:] - moved[:n]) / (2.0 * SHIFT))


def _corrected(
    block: Block, one: Place, two: Place, q: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton's method at shares t (n,): postures, which are solved, sizes of first corrections."""
    here = between(block, one, two, q, t)
    q, last = here.q, np.full(len(q), np.inf)
    first = np.full(len(q), np.inf)
    solved, bad = np.zeros(len(q), dtype=bool), np.zeros(len(q), dtype=bool)
    for count in range(ITERATIONS):
        i = np.flatnonzero(~solved & ~bad)
        if not i.size:
            break
        moved, step = block.newton.at(q[i], here.targets[i])
        size = block.size(q[i], step)
        if count == 0:
            first[i] = size
        bad[i] = (size > CONTRACTION * last[i]) & (size > SOLVED)
        bad[i] |= size > SHORT
        fine = ~bad[i]
        q[np.ix_(i[fine], block.own)] = moved[fine]
        last[i] = size
        solved[i] = fine & (size < SOLVED)
        # quadratic convergence: the next correction would be below rounding
        solved[i] |= fine & (size < 1e-6) & (count > 0)
    return q, solved, first


def far(block: Block, q: np.ndarray) -> np.ndarray:
    """Which postures (n, nq) have left all bounds, (n,) of bool."""
    part = q[:, block.own]
    lengths, angles, others = _bounded(block)
    m = block.equations.problem.mechanism
    found = ~np.isfinite(part).all(axis=1)
    found |= (np.abs(part[:, lengths]) > FAR * m.length).any(axis=1)
    found |= (np.abs(part[:, angles].imag) > HIGH).any(axis=1)
    found |= (np.abs(part[:, others]) > FAR).any(axis=1)
    return np.asarray(found)


def _bounded(block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which of the block's numbers are lengths, angles, and parts of quaternions."""
    m = block.equations.problem.mechanism
    model = m.model
    kind = np.zeros(model.nq, dtype=int)
    for j in range(1, model.njoints):
        first = model.idx_qs[j]
        if model.nqs[j] == 1:
            kind[first] = 0 if m.translational[model.idx_vs[j]] else 1
        else:
            kind[first + 3 : first + 7] = 2
    return tuple(np.flatnonzero(kind[block.own] == k) for k in range(3))  # type: ignore[return-value]
