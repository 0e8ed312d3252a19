"""Closed postures around home, found once: where ranks, independent rows and pivots are judged."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.descend import descend
from closedchain.closure.turns import turning, without_turns

COUNT = 8
SPREAD = 0.15  # dimensionless standard deviation of the guesses around home
PUSH = 0.3  # dimensionless: off home, where nothing closes beside it
FARTHEST = 1.5  # dimensionless: of such a posture from home
BESIDE = 0.01  # dimensionless: nearer to home a posture is no other than home
"""Where closures hold to the second order, as in a flat linkage, postures beside home close to
rounding that are none, and ranks there are neither home's nor those of a branch."""

_FOUND: WeakKeyDictionary[Mechanism, np.ndarray] = WeakKeyDictionary()


def closed_samples(mechanism: Mechanism) -> np.ndarray:
    """Home, then closed postures near it, (n, nq); the same every time, write-protected.

    Home is often special (symmetric, or singular), the others are not. Guesses that do not close,
    or close at home, are left out.

    Raises
    ------
    ClosureError
        Home is open.
    """
    if mechanism not in _FOUND:
        home = mechanism.closed_home()
        found = _around(mechanism) or _pushed(mechanism)
        samples = np.array([home, *found])
        samples.setflags(write=False)
        _FOUND[mechanism] = samples
    return _FOUND[mechanism]


def _around(mechanism: Mechanism) -> list[np.ndarray]:
    """Closed postures that guesses around home lead to."""
    rng = np.random.default_rng(0)
    model, found = mechanism.model, []
    equations = Equations(mechanism, np.arange(model.nv))
    for _ in range(COUNT):
        v = SPREAD * rng.standard_normal(model.nv) * mechanism.column_scale
        guess = pin.integrate(model, mechanism.home, v)
        near = descend(equations, guess) if mechanism.rows else None
        if near is None:
            found.append(guess)
        elif near.closed and _apart(mechanism, near.q) > BESIDE:
            found.append(near.q)
    return found


def _pushed(mechanism: Mechanism) -> list[np.ndarray]:
    """Closed postures with one coordinate held off home: where descent falls back to home."""
    model, found = mechanism.model, []
    for v in range(model.nv):
        others = np.delete(np.arange(model.nv), v)
        for push in (PUSH, -PUSH):
            step = np.zeros(model.nv)
            step[v] = push * mechanism.column_scale[v]
            guess = pin.integrate(model, mechanism.home, step)
            near = descend(Equations(mechanism, others), guess)
            if near.closed and _apart(mechanism, near.q) < FARTHEST:
                found.append(near.q)
    return found[:COUNT]


def _apart(mechanism: Mechanism, q: np.ndarray) -> float:
    """Dimensionless distance of a posture (nq,) from home, whole turns left out."""
    step = without_turns(pin.difference(mechanism.model, mechanism.home, q), turning(mechanism))
    return float(np.linalg.norm(step / mechanism.column_scale))
