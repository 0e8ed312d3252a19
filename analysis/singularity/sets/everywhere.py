"""Whether a whole slice is singular: evidence from generic postures, in its range and beyond."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.singularity.classify import classify
from closedchain.analysis.singularity.sets.lattice import Lattice

INSIDE = 12  # cells of the range that are classified
BEYOND = (0.03, 0.1)  # of the coordinates' units: how far out the slice is looked at
WAYS = 6  # from the middle of the branch, to each


def singular_throughout(lattice: Lattice, kind: str) -> bool:
    """Whether postures of the branch, drawn in its range and led to beyond it, are all singular.

    In small enough a range around a singular posture all singular values are small, whatever the
    slice. A slice is a smooth family, and singular everywhere where generic postures of it are.
    """
    cells = lattice.cells
    if not len(cells):
        return False
    inside = lattice.q[tuple(cells[np.linspace(0, len(cells) - 1, INSIDE).astype(int)].T)]
    mechanism, outputs = lattice.chart.mechanism, lattice.outputs
    return all(kind in classify(mechanism, q, outputs).kinds for q in (*inside, *_outside(lattice)))


def _outside(lattice: Lattice) -> np.ndarray:
    """Postures (n, nq) beyond the range, where ways from its middle arrive."""
    cells = lattice.cells
    middle = cells[np.abs(cells - cells.mean(axis=0)).sum(axis=1).argmin()][None]
    ways = np.random.default_rng(0).standard_normal((WAYS, middle.shape[1]))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    steps = np.concatenate([size * ways for size in BEYOND]) * lattice.chart.scale
    start = np.repeat(lattice.q[tuple(middle.T)], len(steps), axis=0)
    postures, gone = lattice.follow(start, lattice.place(middle) + steps)
    return np.asarray(postures[gone == 1.0])
