"""Whole turns of revolute joints: postures that differ by them are one and the same."""

from __future__ import annotations

import numpy as np

from closedchain.closure.mechanism import Mechanism


def turning(mechanism: Mechanism) -> np.ndarray:
    """Which tangent coordinates are angles of joints with one freedom, (nv,) of bool."""
    single = np.zeros(mechanism.model.nv, dtype=bool)
    for joint in list(mechanism.model.joints)[1:]:
        if joint.nq == joint.nv == 1:
            single[joint.idx_v] = True
    return np.asarray(single & ~mechanism.translational)


def without_turns(v: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Motions (..., nv) [m, rad], whole turns of the ``angles`` (nv,) of bool left out."""
    return np.asarray(np.where(angles, v - 2.0 * np.pi * np.round(v / (2.0 * np.pi)), v))
