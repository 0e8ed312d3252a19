"""Dimension of a set around a solution with degenerate equations, by small steps onto it."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.solve.solution_set import settle

STEP = 0.02  # dimensionless
KEPT = 0.3  # share of a step that must be left after it came back onto the set


def dimensions(system: Slice, z: np.ndarray, basis: np.ndarray) -> tuple[int, int]:
    """Dimension of the set around a point, and of its projection on the coordinates.

    A null space may be larger than the set: only what steps along it reach is counted.

    Parameters
    ----------
    z : (nq + k,) array
        A solution.
    basis : (nv + k, j) array
        Orthonormal; the null space of the equations there.
    """
    nv = system.mechanism.model.nv
    if not basis.shape[1]:
        return 0, 0
    # along the directions that change the coordinates most, and the others
    _, _, turned = np.linalg.svd(basis[nv:])
    reached = []
    for direction in (basis @ turned.T).T:
        for sign in (1.0, -1.0):
            there = settle(system, system.move(z, sign * STEP * direction))
            if there.good and system.residual(there.posture) < 1e-10:
                reached.append(system.difference(z, there.posture) / STEP)
    if not reached:
        return 0, 0
    steps = np.array(reached)
    return _rank(steps), _rank(steps[:, nv:])


def _rank(rows: np.ndarray) -> int:
    values = np.linalg.svd(rows, compute_uv=False)
    return int((values > KEPT).sum())
