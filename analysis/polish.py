"""Bringing a posture onto a singular set: closure = 0 and the kinds' smallest singular values = 0.

The measure of a kind is sigma = u^T A v, u and v the singular vectors of its smallest singular
value. With u and v held, its derivative along a step is u^T dA v, so Newton's method on closure
and measures together converges fast wherever the singular value is simple.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.singularities import row_combination
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE
from closedchain.closure.task import task_jacobian

CLOSED = 1e-10  # residual [m, rad] and measure of a polished point
_ITERATIONS = 25
_STEP = 1e-6  # of the central differences of u^T A v: only the speed of convergence rests on it
_LARGEST = 0.3  # dimensionless length of a Newton step


@dataclass(frozen=True, eq=False)
class Measured:
    """A dimensionless matrix at a posture, for one kind of singularity."""

    kind: str
    outputs: tuple[str, ...]

    def matrix(self, mechanism: Mechanism, q: np.ndarray, combine: np.ndarray) -> np.ndarray:
        """K_p for "direct", [K; J] for "inverse", rows combined by ``combine`` (r, rows)."""
        closures = combine @ _scaled_rows(mechanism, q)[1]
        if self.kind == "direct":
            return closures[:, mechanism.passive_v]
        units = np.array([mechanism.length if n in "xyz" else 1.0 for n in self.outputs])
        task = task_jacobian(mechanism, q, self.outputs)
        return np.vstack([closures, task * mechanism.column_scale / units[:, None]])

    def is_square(self, mechanism: Mechanism) -> bool:
        """Whether the determinant exists: a curve in two coordinates needs one equation."""
        home = mechanism.home
        combine = row_combination(mechanism, _scaled_rows(mechanism, home)[1])
        rows, columns = self.matrix(mechanism, home, combine).shape
        return rows == columns


def _scaled_rows(mechanism: Mechanism, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Dimensionless residual (rows,) and K (rows, nv)."""
    values, jacobian = mechanism.workspace.evaluate(q)
    unit = mechanism.row_scale
    return values / unit, jacobian * mechanism.column_scale / unit[:, None]


def polish(
    mechanism: Mechanism, q: np.ndarray, measured: Sequence[Measured], varying: Sequence[int]
) -> np.ndarray | None:
    """Closed posture near ``q`` where every measure vanishes, or None.

    Parameters
    ----------
    q : (nq,) array
    measured : one or two kinds
    varying : indices in v of the inputs that may change; the other inputs stay

    Returns
    -------
    (nq,) array or None
        None where Newton's method does not settle: the singular value is not simple there, or no
        singular posture is near.
    """
    free = np.concatenate([np.array(varying, dtype=int), mechanism.passive_v])
    unit = mechanism.column_scale[free]
    for _ in range(_ITERATIONS):
        values, closures = _scaled_rows(mechanism, q)
        # held during the step: what its change adds to u^T A v vanishes with A v
        combine = row_combination(mechanism, closures)
        rows = combine @ closures[:, free]
        sigmas = []
        for measure in measured:
            u, s, vt = np.linalg.svd(measure.matrix(mechanism, q, combine))
            sigmas.append(s[-1])
            ends = u[:, -1], vt[-1]
            rows = np.vstack([rows, _gradient(mechanism, q, measure, combine, *ends, free, unit)])
        target = np.concatenate([values, sigmas])
        if np.abs(target).max() < 1e-2 * CLOSED:
            return q
        reduced = np.concatenate([combine @ values, sigmas])
        step = -np.linalg.lstsq(rows, reduced, rcond=RANK_TOLERANCE)[0]
        size = float(np.linalg.norm(step))
        step *= min(1.0, _LARGEST / size) if size > 0.0 else 1.0
        v = np.zeros(mechanism.model.nv)
        v[free] = step * unit
        q = pin.integrate(mechanism.model, q, v)
        if size < 1e-13:
            break
    return q if np.abs(target).max() < CLOSED else None


def _gradient(
    mechanism: Mechanism,
    q: np.ndarray,
    measure: Measured,
    combine: np.ndarray,
    u: np.ndarray,
    v: np.ndarray,
    free: np.ndarray,
    unit: np.ndarray,
) -> np.ndarray:
    """Derivative (free,) of u^T A v along each dimensionless free direction."""
    gradient = np.empty(free.size)
    tangent = np.zeros(mechanism.model.nv)
    for i, (column, size) in enumerate(zip(free, unit, strict=True)):
        tangent[column] = _STEP * size
        ahead = pin.integrate(mechanism.model, q, tangent)
        tangent[column] = -_STEP * size
        behind = pin.integrate(mechanism.model, q, tangent)
        tangent[column] = 0.0
        change = measure.matrix(mechanism, ahead, combine) - measure.matrix(
            mechanism, behind, combine
        )
        gradient[i] = u @ change @ v / (2.0 * _STEP)
    return gradient
