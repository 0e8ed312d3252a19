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

COUNT = 8
SPREAD = 0.15  # dimensionless standard deviation of the guesses around home
STRIDE = 0.15  # dimensionless: along the motions of a posture that home is left for

_FOUND: WeakKeyDictionary[Mechanism, np.ndarray] = WeakKeyDictionary()


def closed_samples(mechanism: Mechanism) -> np.ndarray:
    """Home, then closed postures near it, (n, nq); the same every time, write-protected.

    Home is often special (symmetric, or singular), the others are not. Guesses that do not close
    are left out.

    Where closures hold to the second order, as in a flat linkage, descent falls back to home but
    for an error that no row shows, and ranks there are those of no posture. Then joints are pushed
    off home, one after the other, and samples are taken around where that leads. Where it leads
    nowhere, as with all legs stretched, the postures beside home stay: they stand for those that
    slightly other sizes would have.

    Raises
    ------
    ClosureError
        Home is open.
    """
    if mechanism not in _FOUND:
        home = mechanism.closed_home()
        equations = Equations(mechanism, np.arange(mechanism.model.nv))
        found = list(_around(equations, home))
        if any(doubtful(equations.evaluate(q)[1]) for q in found):
            away = left(equations, home)
            beside = () if away is None else _beside(equations, away)
            found = [q for q in beside if not doubtful(equations.evaluate(q)[1])] or found
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


def _beside(equations: Equations, q: np.ndarray) -> Iterator[np.ndarray]:
    """A posture (nq,), and closed ones that steps along its motions lead to."""
    yield q
    rng, motions = np.random.default_rng(0), null_space(equations.evaluate(q)[1])[0]
    for _ in range(COUNT if motions.shape[1] else 0):
        along = motions @ rng.standard_normal(motions.shape[1])
        near = descend(equations, equations.move(q, STRIDE * along / np.linalg.norm(along)))
        if near.closed:
            yield near.q
