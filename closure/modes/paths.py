"""Many complex paths followed together: predictor and corrector, a step length for each.

A path moves all that is prescribed of a problem straight from one place to another, through
complex values, where with probability one nothing is singular before the end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from closedchain.closure.modes.complex_equations import ComplexEquations, normalised
from closedchain.closure.solve.problem import POSE
from closedchain.closure.solve.square_systems import solutions

FIRST, SMALLEST, LARGEST = 0.05, 1e-8, 0.25  # steps along a path
SHORT = 0.03  # dimensionless: largest first correction of an accepted step
CONTRACTION = 0.25
ITERATIONS = 4
SOLVED = 1e-10  # dimensionless correction of a solution
MOST_STEPS = 2000
SHIFT = 1e-6  # of the path parameter: for the slope of what is prescribed
FAR = 1e4  # dimensionless: lengths beyond are at infinity
HIGH = 14.0  # imaginary part of an angle beyond which it is


@dataclass(frozen=True, eq=False)
class Place:
    """What is prescribed of a block of equations, for one path or for each.

    Attributes
    ----------
    targets : (prescribed,) or (n, prescribed) complex array
    given : (nq,) or (n, nq) complex array
        Postures whose coordinates outside of the block are prescribed.
    """

    targets: np.ndarray
    given: np.ndarray

    def take(self, which: np.ndarray) -> Place:
        """Place of some of the paths."""
        one, two = self.targets, self.given
        return replace(
            self,
            targets=one if one.ndim == 1 else one[which],
            given=two if two.ndim == 1 else two[which],
        )


@dataclass(frozen=True, eq=False)
class Block:
    """Rows and unknowns of the equations that are solved together, the others held.

    ``rows`` are positions among the kept rows, ``columns`` among the unknowns, as many; ``own`` are
    the numbers of q that these unknowns change, and ``also`` the rows beside the kept ones, which
    are to be met, too.
    """

    equations: ComplexEquations
    rows: np.ndarray
    columns: np.ndarray
    own: np.ndarray
    also: np.ndarray

    def at(self, q: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (n, k) and Jacobian (n, k, k)."""
        values, jacobian = self.equations.at(q, targets)
        return values[:, self.rows], jacobian[:, self.rows][:, :, self.columns]

    def moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Postures after steps (n, k) of the block's unknowns."""
        whole = np.zeros((len(q), self.equations.size), dtype=complex)
        whole[:, self.columns] = step
        return self.equations.moved(q, whole)


@dataclass(frozen=True, eq=False)
class Arrived:
    """Ends of paths: postures (n, nq), and whether each arrived (n,), or went to infinity (n,)."""

    q: np.ndarray
    good: np.ndarray
    infinite: np.ndarray


def between(block: Block, one: Place, two: Place, q: np.ndarray, t: np.ndarray) -> _Here:
    """What is prescribed at shares t (n,) of the way, and postures with it set."""
    equations = block.equations
    s = t[:, None]
    targets = (1.0 - s) * one.targets + s * two.targets
    p = len(equations.problem.pinned)
    for i in range(len(equations.problem.goals)):
        at = slice(p + POSE * i + 3, p + POSE * (i + 1))
        targets[:, at] = normalised(targets[:, at])
    given = (1.0 - s) * one.given + s * two.given
    model = equations.problem.mechanism.model
    for j in range(1, model.njoints):
        if model.nqs[j] == 7:
            at = slice(model.idx_qs[j] + 3, model.idx_qs[j] + 7)
            given[:, at] = normalised(given[:, at])
    posture = given
    posture[:, block.own] = q[:, block.own]
    posture[:, equations.problem.pinned_q] = targets[:, :p]
    return _Here(posture, targets)


@dataclass(frozen=True, eq=False)
class _Here:
    q: np.ndarray
    targets: np.ndarray


def track(block: Block, one: Place, two: Place, q: np.ndarray) -> Arrived:
    """Follow paths from solutions (n, nq) at one place to another."""
    n, k = len(q), len(block.columns)
    q = q.astype(complex)
    t, step = np.zeros(n), np.full(n, FIRST)
    running = np.ones(n, dtype=bool)
    good, infinite = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    before = np.zeros((n, k), dtype=complex)  # slope of the step before, and its length
    length = np.zeros(n)
    slope = np.zeros((n, k), dtype=complex)
    fresh = np.ones(n, dtype=bool)
    for _ in range(MOST_STEPS):
        i = np.flatnonzero(running)
        if not i.size:
            break
        a, b = one.take(i), two.take(i)
        some = fresh[i]
        if some.any():
            j = i[some]
            slope[j] = _slope(block, one.take(j), two.take(j), q[j], t[j])
        h = np.minimum(step[i], 1.0 - t[i])
        # second order, from the slopes here and a step before
        bend = np.where(
            length[i, None] > 0.0,
            (slope[i] - before[i]) / np.maximum(length[i], 1e-300)[:, None],
            0.0,
        )
        guess = h[:, None] * slope[i] + 0.5 * (h * h)[:, None] * bend
        end = t[i] + h
        end[1.0 - end < 1e-14] = 1.0
        trial, solved, first = _corrected(block, a, b, block.moved(q[i], guess), end)
        accepted = solved & (first < SHORT)
        j = i[accepted]
        before[j], length[j] = slope[j], h[accepted]
        q[j], t[j] = trial[accepted], end[accepted]
        fresh[i] = accepted
        grow = first[accepted] < 0.1 * SHORT
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


def _slope(block: Block, one: Place, two: Place, q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Slopes (n, k) of the unknowns along paths."""
    here = between(block, one, two, q, t)
    ahead = between(block, one, two, q, t + SHIFT)
    values, jacobian = block.at(here.q, here.targets)
    later, _ = block.at(ahead.q, ahead.targets)
    return -solutions(jacobian, ((later - values) / SHIFT)[:, :, None])[:, :, 0]


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
        values, jacobian = block.at(q[i], here.targets[i])
        correction = -solutions(jacobian, values[:, :, None])[:, :, 0]
        size = np.abs(correction).max(axis=1, initial=0.0)
        size[~np.isfinite(size)] = np.inf
        if count == 0:
            first[i] = size
        bad[i] = (size > CONTRACTION * last[i]) & (size > SOLVED)
        bad[i] |= size > 2.0 * SHORT
        fine = ~bad[i]
        q[i[fine]] = block.moved(q[i[fine]], correction[fine])
        last[i] = size
        solved[i] = fine & (size < SOLVED)
        # quadratic convergence: the next correction would be below rounding
        solved[i] |= fine & (size < 1e-6) & (count > 0)
    return q, solved, first


def far(block: Block, q: np.ndarray) -> np.ndarray:
    """Which postures (n, nq) have left all bounds, (n,) of bool."""
    m = block.equations.problem.mechanism
    model = m.model
    found = ~np.isfinite(q).all(axis=1)
    for j in range(1, model.njoints):
        at = slice(model.idx_qs[j], model.idx_qs[j] + model.nqs[j])
        if model.nqs[j] == 1:
            if m.translational[model.idx_vs[j]]:
                found |= np.abs(q[:, at.start]) > FAR * m.length
            else:
                found |= np.abs(q[:, at.start].imag) > HIGH
        else:
            found |= (np.abs(q[:, at.start : at.start + 3]) > FAR * m.length).any(axis=1)
            found |= (np.abs(q[:, at.start + 3 : at.stop]) > FAR).any(axis=1)
    return np.asarray(found)
