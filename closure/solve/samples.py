"""Closed postures around home, found once: where ranks, independent rows and pivots are judged."""

from __future__ import annotations

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE, null_space
from closedchain.closure.solve.descend import descend
from closedchain.closure.turns import turning, without_turns

COUNT = 8
SPREAD = 0.15  # dimensionless standard deviation of the guesses around home
PUSH = 0.3  # dimensionless: of one coordinate off home
FARTHEST = 1.5  # dimensionless: what such a push may move altogether
STRIDE = 0.15  # dimensionless: along the motions of a posture that home is left for
DOUBT = 1e-5
"""Share of the largest singular value below which one may be made of the error of a posture."""

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
        if any(_doubtful(equations, q) for q in found):
            found = _away(equations, home) or found
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


def _doubtful(equations: Equations, q: np.ndarray) -> bool:
    """Whether a singular value may be zero at the posture that ``q`` (nq,) is but for rounding."""
    s = np.linalg.svd(equations.evaluate(q)[1], compute_uv=False)
    return bool(((s > RANK_TOLERANCE * s.max(initial=0.0)) & (s < DOUBT * s.max(initial=0.0))).any())


def _away(equations: Equations, home: np.ndarray) -> list[np.ndarray]:
    """Closed postures off home, with ranks that leave no doubt; none where nothing moves."""
    mechanism = equations.mechanism
    q = home
    for v in range(mechanism.model.nv):
        if abs(_moved(mechanism, home, q)[v]) < 0.5 * PUSH:
            q = _pushed(mechanism, q, v)
    if q is home:
        return []
    return [near for near in _beside(equations, q) if not _doubtful(equations, near)]


def _beside(equations: Equations, q: np.ndarray) -> Iterator[np.ndarray]:
    """A posture (nq,), and closed ones that steps along its motions lead to."""
    yield q
    rng, motions = np.random.default_rng(0), null_space(equations.evaluate(q)[1])[0]
    for _ in range(COUNT if motions.shape[1] else 0):
        along = motions @ rng.standard_normal(motions.shape[1])
        near = descend(equations, equations.move(q, STRIDE * along / np.linalg.norm(along)))
        if near.closed:
            yield near.q


def _pushed(mechanism: Mechanism, q: np.ndarray, v: int) -> np.ndarray:
    """Closed posture with one coordinate held off where it is in another, (nq,); if none, that."""
    model = mechanism.model
    held = Equations(mechanism, np.delete(np.arange(model.nv), v))
    for push in (PUSH, -PUSH):
        step = np.zeros(model.nv)
        step[v] = push * mechanism.column_scale[v]
        near = descend(held, pin.integrate(model, q, step))
        if near.closed and np.linalg.norm(_moved(mechanism, q, near.q)) < FARTHEST:
            return near.q
    return q


def _moved(mechanism: Mechanism, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Dimensionless motion (nv,) from one posture (nq,) to another, whole turns left out."""
    step = without_turns(pin.difference(mechanism.model, one, two), turning(mechanism))
    return np.asarray(step / mechanism.column_scale)
