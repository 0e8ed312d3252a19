"""Screws in Pluecker coordinates: the algebra of the papers, vectorised.

A screw is an array (..., 6) of a primal part s and a dual part s_O, in this order, which is that of
the papers and not Pinocchio's. For a twist s is the angular velocity [rad/s] and s_O the linear
velocity [m/s] of the point of the body that is at O; for a wrench s is the force [N] and s_O its
moment about O [N m]. Leading axes are batch axes and broadcast. O is the world's origin unless a
function says otherwise.

[Gallardo2010]_ J. Gallardo-Alvarado, DeLiA: a new family of redundant robot manipulators, 2010,
section 5.1; signs lost in print are restored.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.ranks import RANK_TOLERANCE, Rank, null_space
from closedchain.urdf.errors import ClosureError

_SWAP = np.array([3, 4, 5, 0, 1, 2])


def screw(primal: ArrayLike, dual: ArrayLike) -> np.ndarray:
    """Join a primal and a dual part, (..., 3) each, to a screw (..., 6)."""
    s, s_o = np.broadcast_arrays(_parts(primal, 3, "primal part"), _parts(dual, 3, "dual part"))
    return np.concatenate([s, s_o], axis=-1)


def helical(axis: ArrayLike, point: ArrayLike, pitch: ArrayLike) -> np.ndarray:
    """Unit screw (..., 6) of a helical joint: (s, P x s + h s), [Gallardo2010]_ eq. (12).

    Parameters
    ----------
    axis : (..., 3), of any length but zero
    point : (..., 3), any point P of the axis [m]
    pitch : (...), travel h a radian [m/rad]
    """
    s = _unit(axis)
    h = np.asarray(pitch, dtype=float)[..., None]
    return screw(s, np.cross(_parts(point, 3, "point"), s) + h * s)


def revolute(axis: ArrayLike, point: ArrayLike) -> np.ndarray:
    """Unit screw (..., 6) of a revolute joint, or of a force along a line: (s, P x s)."""
    return helical(axis, point, 0.0)


def prismatic(axis: ArrayLike) -> np.ndarray:
    """Unit screw (..., 6) of infinite pitch, a prismatic joint or a pure couple: (0, s)."""
    s = _unit(axis)
    return screw(np.zeros_like(s), s)


def klein(one: ArrayLike, two: ArrayLike) -> np.ndarray:
    """Klein form {1; 2} = s1 . s2_O + s2 . s1_O, (...): power of a wrench on a twist.

    Two screws are reciprocal where it is zero. It does not depend on O.
    """
    a, b = _screws(one), _screws(two)
    return np.asarray((a * b[..., _SWAP]).sum(axis=-1))


def killing(one: ArrayLike, two: ArrayLike) -> np.ndarray:
    """Killing form (1; 2) = s1 . s2, (...)."""
    return np.asarray((_screws(one)[..., :3] * _screws(two)[..., :3]).sum(axis=-1))


def lie(one: ArrayLike, two: ArrayLike) -> np.ndarray:
    """Lie product [1 2] = (s1 x s2, s1 x s2_O - s2 x s1_O), (..., 6).

    The minus sign is missing in [Gallardo2010]_ section 5.1; without it [1 1] is not zero.
    """
    a, b = _screws(one), _screws(two)
    dual = np.cross(a[..., :3], b[..., 3:]) - np.cross(b[..., :3], a[..., 3:])
    return screw(np.cross(a[..., :3], b[..., :3]), dual)


def pitch(of: ArrayLike) -> np.ndarray:
    """Pitch s . s_O / s . s, (...) [m/rad]; infinite for a screw without primal part."""
    a = _screws(of)
    square = killing(a, a)
    product = (a[..., :3] * a[..., 3:]).sum(axis=-1)
    infinite = square == 0.0
    return np.where(infinite, np.inf, product / np.where(infinite, 1.0, square))


def axis(of: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Direction (..., 3) and the axis point (..., 3) nearest to O.

    A screw of infinite pitch has a direction and no place: its point is O.

    Raises
    ------
    ClosureError
        The zero screw.
    """
    a = _screws(of)
    square = killing(a, a)[..., None]
    infinite = square == 0.0
    direction = _unit(np.where(infinite, a[..., 3:], a[..., :3]))
    point = np.cross(a[..., :3], a[..., 3:]) / np.where(infinite, 1.0, square)
    return direction, point


def shifted(of: ArrayLike, to: ArrayLike) -> np.ndarray:
    """Same screw (..., 6) with the dual part at the point ``to`` (..., 3): s_O' = s_O + s x OO'."""
    a = _screws(of)
    return screw(a[..., :3], a[..., 3:] + np.cross(a[..., :3], _parts(to, 3, "point")))


def transformed(of: ArrayLike, pose: pin.SE3) -> np.ndarray:
    """Screw (..., 6) given in a frame, expressed in the frame in which ``pose`` is given."""
    a = _screws(of)
    s = a[..., :3] @ pose.rotation.T
    return screw(s, a[..., 3:] @ pose.rotation.T + np.cross(pose.translation, s))


def reciprocal(
    system: ArrayLike, *, length: float = 1.0, tolerance: float = RANK_TOLERANCE
) -> tuple[np.ndarray, Rank]:
    """Screws reciprocal to all screws of a system.

    Parameters
    ----------
    system : (n, 6) array
    length : float
        Characteristic length [m] that makes dual parts dimensionless for the rank decision.
    tolerance : float
        Share of the largest singular value that counts as zero.

    Returns
    -------
    (6 - rank, 6) array, Rank
        A basis, orthonormal in dimensionless form, and the rank of the system with its gap.
    """
    a = _screws(system)
    if a.ndim != 2:
        raise ClosureError(f"a screw system must have shape (n, 6), got {a.shape}")
    unit = np.repeat([1.0, length], 3)
    basis, rank = null_space((a / unit)[:, _SWAP], tolerance)
    return basis.T * unit, rank


def from_motion(motion: pin.Motion) -> np.ndarray:
    """Screw (6,) of a Pinocchio twist, whose order is (linear, angular), at the same point."""
    return np.array(motion.vector)[_SWAP]


def to_motion(twist: ArrayLike) -> pin.Motion:
    """Pinocchio twist of a screw (6,) at the same point."""
    return pin.Motion(_screws(twist)[_SWAP])


def from_force(wrench: pin.Force) -> np.ndarray:
    """Screw (6,) of a Pinocchio wrench: force, then moment, in both."""
    return np.array(wrench.vector)


def to_force(wrench: ArrayLike) -> pin.Force:
    """Pinocchio wrench of a screw (6,) at the same point."""
    return pin.Force(np.array(_screws(wrench)))


def _parts(values: ArrayLike, size: int, what: str) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.ndim == 0 or array.shape[-1] != size or not np.isfinite(array).all():
        raise ClosureError(f"{what} must be finite with shape (..., {size}), got {array.shape}")
    return array


def _screws(values: ArrayLike) -> np.ndarray:
    return _parts(values, 6, "a screw")


def _unit(direction: ArrayLike) -> np.ndarray:
    vector = _parts(direction, 3, "an axis")
    norm = np.linalg.norm(vector, axis=-1, keepdims=True)
    if (norm == 0.0).any():
        raise ClosureError("an axis must not be zero")
    return np.asarray(vector / norm)
