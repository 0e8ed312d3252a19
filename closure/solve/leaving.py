"""Postures off a special one: joints are pushed, one after the other, and the loops closed again.

Where closures hold to the second order, as in a flat linkage, descent from beside a posture falls
back to it, or to where rows are as small as its error squared. With one joint held aside it cannot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin

from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE
from closedchain.closure.solve.descend import Descent, descend
from closedchain.closure.turns import way

PUSH = 0.3  # dimensionless: of one coordinate
FARTHEST = 1.5  # dimensionless: what such a push may move altogether


def left(
    equations: Equations,
    q: np.ndarray,
    closed: Callable[[Descent], bool] = lambda found: found.closed,
    floor: float = RANK_TOLERANCE,
) -> np.ndarray | None:
    """Posture (nq,) off ``q`` (nq,) in every coordinate that can be pushed; None if none can.

    ``closed`` says which ends of a descent count, ``floor`` is that of ``descend``.
    """
    here = q
    for v in equations.free:
        if abs(way(equations.mechanism, q, here)[v]) >= 0.5 * PUSH:
            continue  # carried along by those before
        held = replace(equations, free=equations.free[equations.free != v])
        for push in (PUSH, -PUSH):
            near = descend(held, _with_step(equations.mechanism, here, v, push), floor=floor)
            moved = way(equations.mechanism, here, near.q)
            if closed(near) and np.linalg.norm(moved) < FARTHEST:
                here = near.q
                break
    return None if here is q else here


def _with_step(mechanism: Mechanism, q: np.ndarray, v: int, size: float) -> np.ndarray:
    step = np.zeros(mechanism.model.nv)
    step[v] = size * mechanism.column_scale[v]
    return np.asarray(pin.integrate(mechanism.model, q, step))
