"""Residuals and Jacobians of many postures as arrays, for tests and small use."""

from __future__ import annotations

import numpy as np

from closedchain.closure.batch.compiled import entry
from closedchain.closure.batch.kinematics import identity_first, place_tree
from closedchain.closure.batch.rows import closure_rows
from closedchain.closure.batch.tables import Tables


@entry
def evaluate(
    t: Tables,
    column: np.ndarray,
    postures: np.ndarray,
    jacobian: bool,
    values: np.ndarray,
    matrices: np.ndarray,
) -> None:
    """Residuals (n, rows) and, with ``jacobian``, K (n, rows, nv) of postures (n, nq) [m, rad]."""
    pose = np.empty((t.joints.shape[0], 12))
    work = np.empty((6, 12))
    none = np.empty((0, 0))
    identity_first(pose)
    for i in range(postures.shape[0]):
        place_tree(t, postures[i], pose)
        matrix = matrices[i] if jacobian else none
        closure_rows(t, postures[i], pose, values[i], matrix, column, jacobian, work)
        for r in range(t.row_unit.shape[0]):
            values[i, r] *= t.row_unit[r]
            if jacobian:
                for v in range(t.column_unit.shape[0]):
                    matrix[r, v] *= t.row_unit[r] / t.column_unit[v]
