"""Geometry of the reconfigurable 2(3-RUS): two coaxial 3-RUS stages on one platform.

Frame: origin O at the centre of F1 F2 F3, y up, azimuths from x towards z. Legs 1 to 3 are the
stage M1, whose feet A_i lie at the end of links F_i A_i turned by the common angle beta; legs 4 to
6 are the stage M2. Lengths in metres, angles in radians. Symbols are those of the source.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from closedchain.robots.dimensions import check_dimensions, with_dimensions

FloatArray: TypeAlias = NDArray[np.float64]

UP: FloatArray = np.array([0.0, 1.0, 0.0])
"""The axis y of both stages."""
UP.setflags(write=False)
_POSITIVE = ("Rf", "Rr", "R2", "r", "LA", "LB")
_THIRDS = 2.0 * pi / 3.0 * np.arange(3)


@dataclass(frozen=True)
class Geometry:
    """Dimensions of the robot; the paper prints none, the defaults are a choice.

    Attributes
    ----------
    Rf, Rr, R2 : float
        Radius of F1..F3, length of the reconfiguration links, radius of A4..A6 [m].
    H : float
        Depth of A4..A6 below F1..F3 [m]; negative puts them above.
    h, r : float
        Height of C1..C3 over C4..C6, and the radius of both triangles [m].
    LA, LB : float
        Arms A_i B_i and rods B_i C_i [m].
    theta1, theta4 : float
        Azimuth of leg 1 and of leg 4 [rad]; the legs of a stage are 120 degrees apart.
    psi1, psi4 : float
        Azimuth of C1 and of C4 on the platform [rad]; equal for a prism.
    height : float
        P_y at home [m].
    """

    Rf: float = 0.20
    Rr: float = 0.08
    R2: float = 0.30
    H: float = 0.10
    h: float = 0.10
    r: float = 0.18
    LA: float = 0.20
    LB: float = 0.50
    theta1: float = -pi / 6.0
    theta4: float = pi / 6.0
    psi1: float = 0.0
    psi4: float = 0.0
    height: float = -0.55

    def __post_init__(self) -> None:
        """Check that every field is finite and every length positive."""
        check_dimensions(self, "rus6", positive=_POSITIVE)

    @property
    def theta(self) -> FloatArray:
        """Azimuths of the six legs (6,) [rad]."""
        return np.concatenate([self.theta1 + _THIRDS, self.theta4 + _THIRDS])

    @property
    def psi(self) -> FloatArray:
        """Azimuths of C1..C6 on the platform (6,) [rad]."""
        return np.concatenate([self.psi1 + _THIRDS, self.psi4 + _THIRDS])

    @property
    def radial(self) -> FloatArray:
        """Outward unit vectors r_i (6, 3) of the legs' vertical planes."""
        return _on_circle(self.theta)

    @property
    def tangent(self) -> FloatArray:
        """Unit axes u_i = r_i x y (6, 3) of the revolute joints at F_i and A_i."""
        return np.cross(self.radial, UP)

    @property
    def F(self) -> FloatArray:
        """Joints F1..F3 (3, 3) of the reconfiguration links [m]."""
        return self.Rf * self.radial[:3]

    @property
    def c_P(self) -> FloatArray:
        """Spherical joints C1..C6 (6, 3) in the platform's frame at P [m]."""
        heights = np.array([self.h] * 3 + [0.0] * 3)
        return self.r * _on_circle(self.psi) + heights[:, None] * UP

    @property
    def home(self) -> Pose:
        """Home pose of the platform."""
        return Pose(np.eye(3), self.height * UP)

    def A(self, beta: ArrayLike) -> FloatArray:
        """Revolute joints A1..A6 (..., 6, 3) [m] at reconfiguration angles beta (...,) [rad]."""
        angle = np.asarray(beta, dtype=np.float64)[..., None, None]
        first = self.F + self.Rr * (np.cos(angle) * self.radial[:3] + np.sin(angle) * UP)
        second = self.R2 * self.radial[3:] - self.H * UP
        return np.concatenate([first, np.broadcast_to(second, first.shape)], axis=-2)

    def B(self, alpha: ArrayLike, beta: ArrayLike) -> FloatArray:
        """Elbows B1..B6 (..., 6, 3) [m].

        ``alpha`` (..., 6) [rad] are the inputs: those of M1 count from the reconfiguration link,
        those of M2 from the outward horizontal, both positive upwards.
        """
        a = self.absolute(alpha, beta)[..., None]
        return self.A(beta) + self.LA * (np.cos(a) * self.radial + np.sin(a) * UP)

    def absolute(self, alpha: ArrayLike, beta: ArrayLike) -> FloatArray:
        """Angles (..., 6) [rad] of the arms from the outward horizontal."""
        return np.asarray(alpha, dtype=np.float64) + self.carried(beta)

    @staticmethod
    def carried(beta: ArrayLike) -> FloatArray:
        """Angles (..., 6) [rad] by which beta (...,) turns the legs: beta for M1, 0 for M2."""
        m1 = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        return np.asarray(beta, dtype=np.float64)[..., None] * m1


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of the platform; leading axes, if any, are a batch.

    Attributes
    ----------
    rotation : ndarray (..., 3, 3)
        Columns are the platform's axes in the base frame.
    position : ndarray (..., 3)
        P [m], base frame.
    """

    rotation: FloatArray
    position: FloatArray

    def points(self, body_points: FloatArray) -> FloatArray:
        """Points (n, 3) of the platform's frame [m] in the base frame: (..., n, 3)."""
        moved = body_points @ np.swapaxes(self.rotation, -1, -2)
        return np.asarray(moved + self.position[..., None, :], dtype=np.float64)


def geometry(**overrides: float) -> Geometry:
    """Geometry with single fields replaced [m, rad].

    Raises
    ------
    DescriptionError
        Unknown field, or an impossible value.
    """
    return with_dimensions(Geometry, "rus6", overrides)


def rotation_ypr(yaw: ArrayLike, pitch: ArrayLike = 0.0, roll: ArrayLike = 0.0) -> FloatArray:
    """Rotations Ry(yaw) Rz(pitch) Rx(roll), (..., 3, 3), of angles (...,) [rad], y being up.

    A positive yaw is right-handed about y: it takes x towards -z, against the azimuths.
    """
    yaw, pitch, roll = np.broadcast_arrays(
        *(np.asarray(a, dtype=float) for a in (yaw, pitch, roll))
    )
    turn = np.eye(3)
    for angle, axis in ((yaw, 1), (pitch, 2), (roll, 0)):
        turn = turn @ _turn(angle, axis)
    return turn


def _turn(angle: FloatArray, axis: int) -> FloatArray:
    """Rotations (..., 3, 3) about a coordinate axis."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((*angle.shape, 3, 3))
    out[..., axis, axis] = 1.0
    out[..., j, j] = out[..., k, k] = np.cos(angle)
    out[..., k, j] = np.sin(angle)
    out[..., j, k] = -np.sin(angle)
    return out


def _on_circle(azimuth: FloatArray) -> FloatArray:
    """Unit vectors (n, 3) at azimuths (n,) from x towards z."""
    return np.stack([np.cos(azimuth), np.zeros_like(azimuth), np.sin(azimuth)], axis=-1)
