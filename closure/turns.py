"""Whole turns of revolute joints: postures that differ by them are one and the same."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Coupling
from closedchain.closure.mechanism import Mechanism


def turning(mechanism: Mechanism) -> np.ndarray:
    """Which tangent coordinates are angles of joints with one freedom, (nv,) of bool."""
    single = np.zeros(mechanism.model.nv, dtype=bool)
    for joint in list(mechanism.model.joints)[1:]:
        if joint.nq == joint.nv == 1:
            single[joint.idx_v] = True
    return np.asarray(single & ~mechanism.translational)


def tied(mechanism: Mechanism) -> np.ndarray:
    """Which tangent coordinates mimics and relations tie, (nv,) of bool: these count turns."""
    found = np.zeros(mechanism.model.nv, dtype=bool)
    for closure in mechanism.closures:
        if isinstance(closure, Coupling):
            found[[part.v for part in closure.joints]] = True
    return found


def without_turns(v: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Motions (..., nv) [m, rad], whole turns of the ``angles`` (nv,) of bool left out."""
    return np.asarray(np.where(angles, v - 2.0 * np.pi * np.round(v / (2.0 * np.pi)), v))


def way(mechanism: Mechanism, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Dimensionless motion (nv,) from one posture (nq,) to another, whole turns left out."""
    step = without_turns(pin.difference(mechanism.model, one, two), turning(mechanism))
    return np.asarray(step / mechanism.column_scale)


SAME = 1e-6
"""Dimensionless difference below which postures that branches lead to are one and the same."""


def same_postures(mechanism: Mechanism, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Which postures (n, nq) are the others (n, nq), up to whole turns and rounding, (n,) bool."""
    apart = two - one
    unit = np.ones(mechanism.model.nq)
    turns = turning(mechanism)
    for joint in list(mechanism.model.joints)[1:]:
        at = slice(joint.idx_q, joint.idx_q + joint.nq)
        if joint.nq == joint.nv:
            unit[at] = mechanism.column_scale[joint.idx_v : joint.idx_v + joint.nv]
            angles = turns[joint.idx_v : joint.idx_v + joint.nv]
            apart[:, at] = without_turns(apart[:, at], angles)
        elif joint.nq == 7:
            turn = slice(at.start + 3, at.stop)
            unit[at.start : at.start + 3] = mechanism.length
            # quaternions of either sign say the same
            sense = np.where((one[:, turn] * two[:, turn]).sum(axis=1) < 0.0, -1.0, 1.0)
            apart[:, turn] = sense[:, None] * two[:, turn] - one[:, turn]
    return np.asarray((np.abs(apart) <= SAME * unit).all(axis=1))
