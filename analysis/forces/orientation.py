"""Determinants along a motion that change sign where a singularity is passed.

The basis Z of the closed motions turns steadily from posture to posture. Then det [K; Z^T],
with independent rows of K, changes sign where K loses a rank, and the determinant of the inputs'
rates on Z where the inputs stop driving the motions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.forces.forward_dynamics import Plant
from closedchain.closure.generic import dimensionless_jacobian
from closedchain.closure.solve.problem import problem_of


@dataclass(frozen=True, eq=False)
class Signs:
    """A basis (nv, n) of the closed motions, and determinants by kind of singularity."""

    basis: np.ndarray
    values: Mapping[str, float]


def signs(plant: Plant, q: np.ndarray, last: Signs | None) -> Signs | None:
    """Determinants at a posture, oriented as at the last one; None where nothing can move."""
    m = plant.mechanism
    basis = plant.closed(q).basis
    if not basis.shape[1]:
        return None
    if last is not None and np.linalg.det(last.basis.T @ basis) < 0.0:
        basis = basis * np.array([-1.0, *([1.0] * (basis.shape[1] - 1))])
    values = {}
    if basis.shape[1] == len(m.inputs):
        values["direct"] = float(np.linalg.det(basis[m.input_v]))
    if m.rows:
        kept = dimensionless_jacobian(m, q)[list(problem_of(m).kept)]
        values["constraint"] = float(np.linalg.det(np.vstack([kept, basis.T])))
    return Signs(basis, values)
