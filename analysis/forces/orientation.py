"""Determinants along a motion that change sign where a singularity is passed.

The basis N of the closed motions turns steadily from posture to posture. Then det [K; N^T], with
independent rows of K, changes sign where K loses a rank, and the determinant of the inputs' rates
on N where the inputs stop driving the motions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.forces.plant import Plant


@dataclass(frozen=True, eq=False)
class Signs:
    """A basis (nv, n) of the closed motions, and determinants by kind of singularity."""

    basis: np.ndarray
    values: Mapping[str, float]


def signs(plant: Plant, q: np.ndarray, last: Signs | None) -> Signs | None:
    """Determinants at a posture, oriented as at the last one; None where nothing can move."""
    m = plant.mechanism
    here = plant.fit(q, np.zeros(m.model.nv))
    basis, side = here.basis, here.side
    if not basis.shape[1]:
        return None
    if last is not None and np.linalg.det(last.basis.T @ basis) < 0.0:
        basis, side = np.hstack([-basis[:, :1], basis[:, 1:]]), -side
    values = {}
    if basis.shape[1] == len(m.inputs):
        values["direct"] = float(np.linalg.det(basis[m.input_v]))
    if m.rows:
        values["constraint"] = side
    return Signs(basis, values)
