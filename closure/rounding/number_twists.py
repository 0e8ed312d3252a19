"""How frames and axes move with the numbers that they are written with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from closedchain.closure.tree import se3
from closedchain.urdf.description import Origin


def across(axis: np.ndarray, index: int) -> np.ndarray:
    """Change (3,) of a unit vector per change of its component x, y or z (0 to 2)."""
    unit = np.eye(3)[index]
    return np.asarray(unit - axis * axis[index])


def of_origin(origin: Origin, indices: Sequence[int]) -> np.ndarray:
    """Twists (6, n) of a frame, in itself, by x y z roll pitch yaw (0 to 5) of its origin.

    R = Rz(yaw) Ry(pitch) Rx(roll): roll turns about the frame's own x, yaw about the parent's z.
    """
    turn = se3(origin).rotation
    yaw = origin.rpy[2]
    rates = np.array(
        [
            [1.0, 0.0, 0.0],
            turn.T @ [-np.sin(yaw), np.cos(yaw), 0.0],
            turn.T @ [0.0, 0.0, 1.0],
        ]
    ).T
    whole = np.zeros((6, 6))
    whole[:3, :3] = turn.T
    whole[3:, 3:] = rates
    return whole[:, list(indices)]
