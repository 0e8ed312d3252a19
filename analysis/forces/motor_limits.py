"""What limits of motors mean for the joints that they move, from J = d motors / d joints."""

from __future__ import annotations

import numpy as np

TOGGLE = 1e-6  # distance from a toggle below which no inverse of J is worth having


def effort_limits(jacobian: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Least and largest effort (..., 2, k) of single joints for motor limits (2, k), J regular."""
    k = jacobian.shape[-1]
    # motor efforts for a unit effort of each joint: J^-T itself; callers keep off toggles
    needed = np.linalg.inv(jacobian).swapaxes(-1, -2)
    with np.errstate(divide="ignore"):
        up = np.where(needed > 0.0, limits[1][:, None], limits[0][:, None]) / needed
        down = np.where(needed > 0.0, limits[0][:, None], limits[1][:, None]) / needed
    still = needed == 0.0
    up, down = np.where(still, np.inf, up), np.where(still, -np.inf, down)
    found = np.stack([down.max(axis=-2), up.min(axis=-2)], axis=-2)
    return np.asarray(found.reshape(*jacobian.shape[:-2], 2, k))


def speed_limits(jacobian: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Largest speed (..., k) of single joints for motor speeds (m,)."""
    with np.errstate(divide="ignore"):
        return np.asarray((np.abs(limits)[:, None] / np.abs(jacobian)).min(axis=-2))


def toggle(jacobian: np.ndarray) -> np.ndarray:
    """Least singular value of J (..., m, k), dimensionless, or of its inverse."""
    s = np.linalg.svd(jacobian, compute_uv=False)
    return np.minimum(s[..., -1], 1.0 / np.maximum(s[..., 0], 1e-300))
