"""Levenberg-Marquardt on the configuration manifold with rank-revealing steps.

For starts that are not near: it never leaves the least-squares descent, truncates singular
directions, and ends at a solution or at the closest posture it can find.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.ranks import RANK_TOLERANCE
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.newton import Rows

OPEN = 1e-16  # squared scaled residual below which a posture may still be closing


@dataclass(frozen=True)
class Descent:
    """Where the descent ended: posture, residual rows, dimensionless Jacobian, evaluations."""

    q: np.ndarray
    values: np.ndarray
    system: np.ndarray
    evaluations: int

    @property
    def residual(self) -> float:
        """Largest absolute row [m or rad]."""
        return float(np.abs(self.values).max()) if self.values.size else 0.0

    @property
    def closed(self) -> bool:
        """Whether the residual is below the tolerance."""
        return self.residual < CLOSED


def descend(
    equations: Rows,
    q: np.ndarray,
    *,
    radius: float = 0.5,
    evaluations: int = 200,
    settle: float = 1e-10,
    floor: float = RANK_TOLERANCE,
) -> Descent:
    """Minimise the scaled residual from ``q``; ``radius`` limits the first step (dimensionless).

    Stops at an open posture once the linear model promises to lower the squared residual by less
    than the share ``settle``: no closed posture is near then. Directions with a singular value
    below the share ``floor`` of the largest stay still.
    """
    values, matrix = equations.evaluate(q)
    scaled = values / equations.row_scale
    cost = float(scaled @ scaled)
    count = 1
    while count < evaluations and cost > 0.0 and matrix.size:
        u, s, vt = np.linalg.svd(matrix, full_matrices=False)
        step_in_v = _bounded_step(s, u.T @ scaled, radius, floor)
        step = vt.T @ step_in_v
        size = float(np.linalg.norm(step))
        if size < 1e-15 or radius < 1e-14:
            break
        model = scaled + matrix @ step
        predicted = cost - float(model @ model)
        if predicted < settle * cost and cost > OPEN:
            break
        q_new = equations.move(q, step)
        values_new, matrix_new = equations.evaluate(q_new)
        scaled_new = values_new / equations.row_scale
        cost_new = float(scaled_new @ scaled_new)
        count += 1
        share = (cost - cost_new) / predicted if predicted > 0.0 else -1.0
        if share < 0.25:
            radius = 0.25 * size
        elif share > 0.75:
            radius = max(radius, 2.5 * size)
        if cost_new >= cost:
            if cost < 1e-24:  # rounding: nothing left to gain
                break
            continue
        q, values, matrix, scaled, cost = q_new, values_new, matrix_new, scaled_new, cost_new
    return Descent(q, values, matrix, count)


def _bounded_step(s: np.ndarray, target: np.ndarray, radius: float, floor: float) -> np.ndarray:
    """Damped step in the right singular basis, no longer than ``radius``.

    -s c / (s^2 + mu) with the smallest mu >= 0 that keeps the bound; directions below the share
    ``floor`` of the largest stay still.
    """
    keep = s > floor * s[0]
    step = np.zeros_like(s)
    step[keep] = -target[keep] / s[keep]
    if np.linalg.norm(step) <= radius:
        return step
    low, high = 0.0, float(s[0] * np.linalg.norm(target) / radius)
    for _ in range(60):
        mu = float(np.sqrt(low * high)) if low > 0.0 else 1e-3 * high
        step = np.where(keep, -s * target / (s**2 + mu), 0.0)
        size = float(np.linalg.norm(step))
        if 0.9 * radius <= size <= radius:
            break
        if size > radius:
            low = mu
        else:
            high = mu
            if low == 0.0 and mu < 1e-18:
                break
    return step
