"""Many complex paths followed together: predictor and corrector, a step length for each.

A path moves all that is prescribed of a problem straight from one place to another, through
complex values, where with probability one nothing is singular before the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from closedchain.closure.modes.newton_steps import NewtonSteps
from closedchain.closure.modes.places import Place

FIRST, SMALLEST, LARGEST = 0.02, 1e-8, 0.25  # steps along a path
SHORT = 0.01  # relative: largest first correction of an accepted step
AIM = 0.003  # the first correction that is aimed at
CONTRACTION = 0.25
ITERATIONS = 4
SOLVED = 1e-10  # relative correction of a solution
MOST_STEPS = 800
SHIFT = 1e-6  # of the path parameter: for slopes along it
FAR = 1e6  # dimensionless: lengths beyond are at infinity
HIGH = 16.0  # imaginary part of an angle beyond which it is
ON_THE_WAY = (1e3, 8.0)  # the same for paths that stop


class Tracked(Protocol):
    """Square equations whose solutions can be followed.

    ``own`` are the numbers of a posture that are unknown, ``newton`` gives Newton's steps.
    """

    @property
    def own(self) -> np.ndarray:
        """Positions of the unknown numbers."""
        ...

    @property
    def newton(self) -> NewtonSteps:
        """Newton's steps."""
        ...

    def size(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Sizes (n,) of steps (n, k) at postures."""
        ...

    def settle(self, q: np.ndarray, targets: np.ndarray) -> None:
        """Write into postures (n, nq) what targets prescribe of them, quaternions of unit size."""
        ...

    def far(self, q: np.ndarray, length: float, high: float) -> np.ndarray:
        """Which postures have lengths, or imaginary parts of angles, beyond bounds, (n,)."""
        ...


@dataclass(frozen=True, eq=False)
class Arrived:
    """Ends of paths: postures (n, nq), and whether each arrived (n,), or went to infinity (n,)."""

    q: np.ndarray
    good: np.ndarray
    infinite: np.ndarray


def between(
    block: Tracked, one: Place, two: Place, q: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Postures with what is prescribed at shares t (n,) of the way set; and the targets there."""
    s = t[:, None]
    targets = (1.0 - s) * one.targets + s * two.targets
    posture = (1.0 - s) * one.given + s * two.given
    posture[:, block.own] = q[:, block.own]
    block.settle(posture, targets)
    return posture, targets


def track(block: Tracked, one: Place, two: Place, q: np.ndarray) -> Arrived:
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
        # the predictor's error grows as the fourth power of the step
        ratio = (AIM / np.maximum(first[accepted], 1e-9)) ** 0.25
        step[j] = np.minimum(np.clip(ratio, 0.5, 2.0) * h[accepted], LARGEST)
        step[i[~accepted]] = 0.4 * h[~accepted]
        arrived = j[t[j] == 1.0]
        good[arrived], running[arrived] = True, False
        lost = block.far(q[i], FAR, HIGH) | (step[i] < SMALLEST)
        lost &= ~good[i]
        if lost.any():
            infinite[i[lost]] = block.far(q[i[lost]], *ON_THE_WAY)
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


def _slope(block: Tracked, one: Place, two: Place, q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Slopes (n, m) of the block's numbers along paths: Newton's steps from beside them."""
    n = len(q)
    shares = np.concatenate([t - SHIFT, t + SHIFT])
    twice = np.concatenate([np.arange(n)] * 2)
    here = between(block, one.take(twice), two.take(twice), q[twice], shares)
    moved, _ = block.newton.at(*here)
    return np.asarray((moved[n:] - moved[:n]) / (2.0 * SHIFT))


def _corrected(
    block: Tracked, one: Place, two: Place, q: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton's method at shares t (n,): postures, which are solved, sizes of first corrections."""
    q, targets = between(block, one, two, q, t)
    last = np.full(len(q), np.inf)
    first = np.full(len(q), np.inf)
    solved, bad = np.zeros(len(q), dtype=bool), np.zeros(len(q), dtype=bool)
    for count in range(ITERATIONS):
        i = np.flatnonzero(~solved & ~bad)
        if not i.size:
            break
        moved, step = block.newton.at(q[i], targets[i])
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
