"""One step along a one-dimensional solution set: along a parabola, then back across the tangent.

A point costs one evaluation and one LU factorisation for each step of the corrector: the last
factors, of [J; t] at the point itself, give the next tangent, the sign of the determinant and, by
inverse iteration, the smallest singular value. Singular vectors are computed where that one is
small, where the frame is renewed, and where rows depend on each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from closedchain.closure.solve.factors import Factors, largest
from closedchain.closure.solve.solution_set import RANK, SOLVED, SmoothEquations

TURN = 0.25  # rad: largest change of the tangent in a step
SMALLEST = 1e-6  # dimensionless step below which the curve counts as ended
DEPENDENT = 1e-10  # largest row of a point on the set, for rows that are not independent there
CONTRACTION = 0.4  # of successive corrector steps
ITERATIONS = 8
ROUNDING = 1e-14  # largest row that rounding leaves: steps from smaller ones are noise
KEPT = 4  # points for which a frame is kept
SMALL = 1e-5  # of the largest entry: a smallest singular value that wants a closer look


@dataclass(frozen=True, eq=False)
class Here:
    """A point of the path with the equations' frame, tangent, and what is told from it.

    ``squeeze`` (size - 1, rows) combines rows that depend on each other; ``weak`` (size - 1,) is
    the left singular vector of the smallest singular value ``least``; ``bend`` (size,) is how the
    tangent turned by the way to here.
    """

    z: np.ndarray
    frame: Any
    squeeze: np.ndarray | None
    tangent: np.ndarray
    sign: int
    least: float
    weak: np.ndarray
    bend: np.ndarray
    age: int = 0


def at(system: SmoothEquations, z: np.ndarray, towards: np.ndarray) -> Here | None:
    """Frame, tangent and orientation at a point, from singular vectors.

    None where the tangent is not unique, and where not even the frame makes the equations regular.
    """
    frame = system.frame(z)
    try:
        _, jacobian = system.evaluate(z, frame)
    except np.linalg.LinAlgError:
        return None
    u, s, vt = np.linalg.svd(jacobian)
    rank = system.size - 1
    if len(s) < rank or (rank and s[rank - 1] < RANK * s[0]):
        return None
    tangent = vt[-1]
    tangent = tangent * (1.0 if tangent @ towards >= 0.0 else -1.0)
    squeeze, weak = None, u[:, rank - 1] if rank else np.zeros(0)
    if jacobian.shape[0] != rank:  # more rows than their rank: dependent, yet consistent
        squeeze = u[:, :rank].T
        jacobian, weak = squeeze @ jacobian, squeeze @ weak
    sign = Factors.of(np.vstack([jacobian, tangent])).sign
    smallest = float(s[rank - 1]) if rank else 1.0
    return Here(z, frame, squeeze, tangent, sign, smallest, weak, np.zeros(system.size))


def across(
    system: SmoothEquations, here: Here, z: np.ndarray, h: float
) -> tuple[np.ndarray, Factors, float] | None:
    """Newton's method across the tangent of ``here``, or None.

    Returns the point, the factors of [J; t] there with the tangent t of ``here``, and the size of
    the first step.
    """
    first, last = 0.0, np.inf
    for count in range(ITERATIONS):
        try:
            values, jacobian = system.evaluate(z, here.frame)
        except np.linalg.LinAlgError:
            return None  # the frame does not suit the point any more
        every = worst = largest(values)
        if here.squeeze is not None:
            values, jacobian = here.squeeze @ values, here.squeeze @ jacobian
            worst = largest(values)
        factors = Factors.of(np.concatenate([jacobian, here.tangent[None]]))
        if worst < SOLVED and every >= DEPENDENT:
            return None  # rows taken for dependent must vanish with the others
        if factors.sign == 0:
            return (z, factors, first) if worst < SOLVED else None
        step = factors.step(np.append(values, 0.0))
        size = math.sqrt(step @ step)
        if worst < SOLVED:  # the last step takes out what is more than rounding
            return (system.move(z, step) if worst > ROUNDING else z), factors, first
        if not size <= min(max(CONTRACTION * last, 1e-11), 0.5 * h + 1e-9):
            return None
        first, last = (size, size) if count == 0 else (first, size)
        z = system.move(z, step)
    return None


def onward(
    system: SmoothEquations, here: Here, h: float
) -> tuple[tuple[np.ndarray, bool, Here | None] | None, float, float]:
    """One step, as long as it can be up to h; its length, and by how much the next may grow.

    The step gives the point, whether the determinant's sign changed, and what is there: None where
    the tangent is not unique.
    """
    step, grow = None, 1.0
    while step is None and h * grow >= SMALLEST:
        h *= grow
        step, grow = _step(system, here, h)
        if step is None and here.age and here.frame is not None:  # it may be to blame
            fresh = at(system, here.z, here.tangent)
            here, grow = (here, grow) if fresh is None else (fresh, 1.0)
    if step is None:
        return None, h, grow
    z, factors, tangent = step
    flip = factors.sign * here.sign < 0
    bend = (tangent * float(here.tangent @ tangent) - here.tangent) / h  # at right angles to it
    there: Here | None = None
    if here.squeeze is None and (here.frame is None or here.age < KEPT):
        weak, least = _weakest(factors, here.weak, tangent)
        if least > SMALL * largest(factors.matrix):
            age = here.age + 1
            there = Here(z, here.frame, None, tangent, factors.sign, least, weak, bend, age)
    if there is None:
        there = at(system, z, tangent)
        there = None if there is None else replace(there, bend=bend)
    return (z, flip, there), h, grow


def _step(
    system: SmoothEquations, here: Here, h: float
) -> tuple[tuple[np.ndarray, Factors, np.ndarray] | None, float]:
    """Point a step of length h further with factors and tangent, or None; the next step's factor.

    Steps are as short as they would have to be along the tangent alone.
    """
    aside = 0.5 * h * h * here.bend
    found = across(system, here, system.move(here.z, h * here.tangent + aside), h)
    if found is None:
        return None, 0.5
    z, factors, first = found
    if factors.sign == 0:
        return None, 0.7
    tangent = _tangent(factors)
    turn = math.acos(min(1.0, float(tangent @ here.tangent)))
    if turn > TURN:
        return None, max(0.2, 0.7 * TURN / turn)
    miss = max(first, math.sqrt(aside @ aside))
    strain = max(turn / (0.6 * TURN), miss / h / 0.05, 0.25)
    return (z, factors, tangent), min(max(1.0 / strain, 0.5), 2.0)


def _tangent(factors: Factors) -> np.ndarray:
    """Tangent from the factors of [J; t] with t nearby."""
    target = np.zeros(len(factors.pivots))
    target[-1] = 1.0
    tangent = factors.solve(target)
    return np.asarray(tangent / math.sqrt(tangent @ tangent))


def _weakest(factors: Factors, weak: np.ndarray, tangent: np.ndarray) -> tuple[np.ndarray, float]:
    """Left singular vector and smallest singular value of J, by a step of inverse iteration.

    [J; t]^-1 (w, 0) less its part along the tangent is J^+ w, for any t that is not normal to it.
    """
    if not weak.size:
        return weak, 1.0
    x = factors.solve(np.append(weak, 0.0))
    x -= (x @ tangent) * tangent
    y = factors.solve(x, transposed=True)[:-1]
    size = math.sqrt(y @ y)
    least = math.sqrt(1.0 / size) if 0.0 < size < np.inf else 0.0
    return (y / size if least else weak), least
