"""The trajectory of eq. (20) in metres: an ellipse in x y, a wave in z, constant orientation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from .geometry import FloatArray

ANGLES: FloatArray = np.array([0.5, 0.0, 0.1])
"""phi_x, phi_y, phi_z (3,), rad, of the virtual chain: R = Rx(phi_x) Ry(phi_y) Rz(phi_z)."""
ANGLES.setflags(write=False)
TIMES: FloatArray = np.linspace(0.0, 1.0, 101)
"""0 <= t <= 1 in steps of 0.01 (101,), s."""
TIMES.setflags(write=False)


def position(t: ArrayLike) -> FloatArray:
    """P (..., 3), m, at times t (...), s."""
    x = 2.0 * np.pi * np.asarray(t, dtype=np.float64)
    return np.stack([0.05 * np.cos(x), 0.03 * np.sin(x), 0.10 + 0.01 * np.sin(3.0 * x)], axis=-1)


def velocity(t: ArrayLike) -> FloatArray:
    """Velocity of P (..., 3), m/s; the platform does not turn."""
    w = 2.0 * np.pi
    x = w * np.asarray(t, dtype=np.float64)
    rates = [-0.05 * np.sin(x), 0.03 * np.cos(x), 0.03 * np.cos(3.0 * x)]
    return np.asarray(w * np.stack(rates, axis=-1))


def rotation() -> FloatArray:
    """The constant rotation (3, 3) of the platform."""
    return np.asarray(Rotation.from_euler("XYZ", ANGLES).as_matrix())
