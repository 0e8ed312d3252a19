"""Closed postures around home, found once: where ranks, independent rows and pivots are judged."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.descend import descend

COUNT = 8
SPREAD = 0.15  # dimensionless standard deviation of the guesses around home

_FOUND: WeakKeyDictionary[Mechanism, np.ndarray] = WeakKeyDictionary()


def closed_samples(mechanism: Mechanism) -> np.ndarray:
    """Home, then closed postures near it, (n, nq); the same every time, write-protected.

    Home is often special (symmetric, or singular), the others are not. Guesses that do not close
    are left out.

    Raises
    ------
    ClosureError
        Home is open.
    """
    if mechanism not in _FOUND:
        rng = np.random.default_rng(0)
        model, found = mechanism.model, [mechanism.closed_home()]
        equations = Equations(mechanism, np.arange(model.nv))
        for _ in range(COUNT):
            v = SPREAD * rng.standard_normal(model.nv) * mechanism.column_scale
            guess = pin.integrate(model, mechanism.home, v)
            near = descend(equations, guess) if mechanism.rows else None
            if near is None:
                found.append(guess)
            elif near.closed:
                found.append(near.q)
        samples = np.array(found)
        samples.setflags(write=False)
        _FOUND[mechanism] = samples
    return _FOUND[mechanism]
