"""Closed postures around home, found once: where ranks, independent rows and pivots are judged."""

from __future__ import annotations

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import doubtful, null_space
from closedchain.closure.solve.descend import descend
from closedchain.closure.solve.leaving import left
from closedchain.closure.turns import SAME, way

COUNT = 8
SPREAD = 0.15  # dimensionless standard deviation of the guesses around home
STRIDE = 0.15  # dimensionless: along the motions of a posture that home is left for
NUDGE = 3e-7  # dimensionless: its square is below what counts as closed

_FOUND: WeakKeyDictionary[Mechanism, np.ndarray] = WeakKeyDictionary()


def closed_samples(mechanism: Mechanism) -> np.ndarray:
    """Home, then closed postures near it, (n, nq); the same every time, write-protected.

    Home is often special (symmetric, or singular), the others are not. Guesses that do not close
    are left out.

    Where closures hold to the second order, as in a flat linkage, descent falls back to home but
    for an error that no row shows, and ranks there are those of no posture. Then joints are pushed
    off home, one after the other, and samples are taken around where that leads. Where it leads
    nowhere else, as with all legs stretched, samples are home but for an error of that size: they
    stand for what slightly other sizes would have.

    Raises
    ------
    ClosureError
        Home is open.
    """
    if mechanism not in _FOUND:
        home = mechanism.closed_home()
        equations = Equations(mechanism, np.arange(mechanism.model.nv))
        found = list(_around(equations, home))
        if _fallen_back(equations, home, found):
            away = left(equations, home)
            beside = () if away is None else _beside(equations, away)
            found = list(beside) or list(_nudged(equations, home))
        samples = np.array([home, *found])
        samples.setflags(write=False)
        _FOUND[mechanism] = samples
    return _FOUND[mechanism]


def _around(equations: Equations, home: np.ndarray) -> Iterator[np.ndarray]:
    """Closed postures that guesses around home lead to."""
    mechanism, rng = equations.mechanism, np.random.default_rng(0)
    for _ in range(COUNT):
        v = SPREAD * rng.standard_normal(mechanism.model.nv) * mechanism.column_scale
        guess = pin.integrate(mechanism.model, home, v)
        near = descend(equations, guess) if mechanism.rows else None
        if near is None:
            yield guess
        elif near.closed:
            yield near.q


def _fallen_back(equations: Equations, home: np.ndarray, found: list[np.ndarray]) -> bool:
    """Whether closed postures are home but for rounding, though motions seem to lead off it."""
    if any(doubtful(equations.evaluate(q)[1]) for q in found):
        return True
    apart = [np.linalg.norm(way(equations.mechanism, home, q)) for q in found]
    motions = null_space(equations.evaluate(home)[1])[0]
    return motions.size > 0 and bool(max(apart, default=0.0) < SAME)


def _beside(equations: Equations, q: np.ndarray) -> Iterator[np.ndarray]:
    """A posture (nq,), and closed ones that steps along its motions lead to, of clear ranks."""
    if not doubtful(equations.evaluate(q)[1]):
        yield q
    for along in _directions(equations, q):
        near = descend(equations, equations.move(q, STRIDE * along))
        if near.closed and not doubtful(near.system):
            yield near.q


def _nudged(equations: Equations, home: np.ndarray) -> Iterator[np.ndarray]:
    """Home (nq,) but for an error along its motions that no row shows."""
    for along in _directions(equations, home):
        yield equations.move(home, NUDGE * along)


def _directions(equations: Equations, q: np.ndarray) -> Iterator[np.ndarray]:
    """Dimensionless unit steps (nv,) in which the closures hold to the first order."""
    rng, motions = np.random.default_rng(0), null_space(equations.evaluate(q)[1])[0]
    for _ in range(COUNT if motions.shape[1] else 0):
        along = motions @ rng.standard_normal(motions.shape[1])
        yield along / np.linalg.norm(along)
