"""Poses as (4, 4) matrices: from and to the origins, quaternions and axes that files write.

Kinematics proper is Pinocchio's, from ``closedchain.closure`` on. This is what reading and writing
a file needs: where things are while nothing moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from closedchain.urdf.description import Origin, Vector3

Quaternion = tuple[float, float, float, float]


def pose(
    rotation: np.ndarray | None = None, translation: Sequence[float] | np.ndarray = (0, 0, 0)
) -> np.ndarray:
    """Pose (4, 4) with a rotation (3, 3), none by default, and a translation [m]."""
    found = np.eye(4)
    if rotation is not None:
        found[:3, :3] = rotation
    found[:3, 3] = translation
    return found


def inverse(of: np.ndarray) -> np.ndarray:
    """Inverse of a pose."""
    turned = of[:3, :3].T
    return pose(turned, -turned @ of[:3, 3])


def pose_of(origin: Origin) -> np.ndarray:
    """Pose (4, 4) of an origin: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = origin.rpy
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return pose(rotation, origin.xyz)


def origin_of(found: np.ndarray) -> Origin:
    """Origin of a pose; exact to rounding at any pitch, a quarter turn included."""
    r = found[:3, :3]
    yaw = math.atan2(r[1, 0], r[0, 0])
    pitch = math.atan2(-r[2, 0], math.hypot(r[0, 0], r[1, 0]))
    # the roll that is left once the yaw is taken back: near a quarter turn of pitch yaw and roll
    # are ill-defined singly, but not together
    sine, cosine = math.sin(yaw), math.cos(yaw)
    roll = math.atan2(sine * r[0, 2] - cosine * r[1, 2], cosine * r[1, 1] - sine * r[0, 1])
    return Origin(vector(found[:3, 3]), vector((roll, pitch, yaw)))


def vector(values: Sequence[float] | np.ndarray) -> Vector3:
    """Three plain floats, without minus zeros."""
    x, y, z = (float(value) + 0.0 for value in values)
    return x, y, z


def turn(axis: Sequence[float] | np.ndarray, angle: float) -> np.ndarray:
    """Pose that turns by an angle [rad] about a unit axis through the origin."""
    x, y, z = axis
    s, c = math.sin(angle), math.cos(angle)
    d = 1.0 - c
    return pose(
        np.array(
            [
                [c + x * x * d, x * y * d - z * s, x * z * d + y * s],
                [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
                [z * x * d - y * s, z * y * d + x * s, c + z * z * d],
            ]
        )
    )


def of_quaternion(quaternion: Sequence[float]) -> np.ndarray:
    """Pose of a quaternion (w, x, y, z), which is normalised."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return pose(
        np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
    )


def quaternion_of(found: np.ndarray) -> Quaternion:
    """Unit quaternion (w, x, y, z) of a pose, w not negative.

    Of the four numbers the largest is found by a root and the others by it, so that none is lost.
    """
    r = found[:3, :3]
    squares = [
        1.0 + r[0, 0] + r[1, 1] + r[2, 2],
        1.0 + r[0, 0] - r[1, 1] - r[2, 2],
        1.0 - r[0, 0] + r[1, 1] - r[2, 2],
        1.0 - r[0, 0] - r[1, 1] + r[2, 2],
    ]
    largest = int(np.argmax(squares))
    products = np.array(
        [
            [squares[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], squares[1], r[1, 0] + r[0, 1], r[0, 2] + r[2, 0]],
            [r[0, 2] - r[2, 0], r[1, 0] + r[0, 1], squares[2], r[2, 1] + r[1, 2]],
            [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[2, 1] + r[1, 2], squares[3]],
        ]
    )[largest]
    products = products / np.linalg.norm(products)
    if products[0] < 0.0:
        products = -products
    w, x, y, z = (float(value) + 0.0 for value in products)
    return w, x, y, z


def z_along(axis: Sequence[float]) -> np.ndarray:
    """Pose that turns z by the least angle onto a unit axis; half a turn about x for -z."""
    x, y, z = (float(value) for value in axis)
    across = math.hypot(x, y)
    if across < 1e-15:
        return pose(np.diag([1.0, -1.0, -1.0])) if z < 0.0 else np.eye(4)
    return turn((-y / across, x / across, 0.0), math.atan2(across, z))


def direction(found: np.ndarray, axis: Sequence[float]) -> Vector3:
    """A direction of a frame along the axes that the frame's pose is given in."""
    return vector(found[:3, :3] @ np.asarray(axis, dtype=float))
