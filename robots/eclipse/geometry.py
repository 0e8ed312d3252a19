"""Nominal geometry of Eclipse and Eclipse-II: three PPRS legs on one circular guide.

World frame: origin at the centre of the horizontal guide, z up. Leg j at the guide's angle
``theta_j`` has the basis ``u`` (from the axis to its column), ``t = z x u``, ``z``. Platform frame:
origin P at the centre of the plate, S_a on its x axis. Metres and radians; the paper has cm.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import pi, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from closedchain.robots.dimensions import check_dimensions

FloatArray: TypeAlias = NDArray[np.float64]

PHASES: FloatArray = np.array([0.0, 2.0 * pi / 3.0, -2.0 * pi / 3.0])
"""Azimuths (3,) of S_a, S_b, S_c in the platform frame, rad (section 3.2)."""
Z: FloatArray = np.array([0.0, 0.0, 1.0])
PHASES.setflags(write=False)
Z.setflags(write=False)


@dataclass(frozen=True)
class Geometry:
    """Dimensions, m; the defaults are those of section 5.

    Attributes
    ----------
    r_g : float
        Radius of the horizontal circular guide, and of the vertical one of Eclipse-II.
    r : float
        Length of the links, from their hinge to the spherical joint.
    a : float
        Circumradius of the plate; its side is ``a sqrt(3)``.
    z_c : float or None
        Height of the centre of leg a's vertical circular guide, which lies on the central axis
        (Eclipse-II; the paper leaves it open). None: leg a has a column as b and c (Eclipse).
    """

    r_g: float = 0.20
    r: float = 0.20
    a: float = 0.10
    z_c: float | None = None

    def __post_init__(self) -> None:
        """Check that every length is finite and every size positive."""
        check_dimensions(self, "Eclipse", positive={f.name for f in fields(self)} - {"z_c"})

    @property
    def arc(self) -> NDArray[np.bool_]:
        """Which legs (3,) have a vertical circular guide instead of a column."""
        return np.array([self.z_c is not None, False, False])

    @property
    def plate(self) -> FloatArray:
        """S_a, S_b, S_c (3, 3), m, platform frame."""
        return self.a * np.stack([np.cos(PHASES), np.sin(PHASES), np.zeros(3)], axis=-1)

    @property
    def side(self) -> float:
        """Side of the plate, m."""
        return sqrt(3.0) * self.a

    def arc_length(self, angle: ArrayLike) -> FloatArray:
        """Arc length ``L = r_g angle``, m, that the paper measures along its circular guides."""
        return np.asarray(self.r_g * np.asarray(angle, dtype=np.float64))

    def arc_angle(self, length: ArrayLike) -> FloatArray:
        """Angle ``L / r_g``, rad, of an arc length, m."""
        return np.asarray(np.asarray(length, dtype=np.float64) / self.r_g)


ECLIPSE = Geometry()
ECLIPSE2 = Geometry(z_c=0.0)


def wrapped(angle: ArrayLike) -> FloatArray:
    """Angles modulo a turn, in (-pi, pi]."""
    return np.asarray(pi - np.mod(pi - np.asarray(angle, dtype=np.float64), 2.0 * pi))


def along(angle: ArrayLike) -> FloatArray:
    """Horizontal unit vectors ``u(angle)`` (..., 3)."""
    x = np.asarray(angle, dtype=np.float64)
    return np.stack([np.cos(x), np.sin(x), np.zeros_like(x)], axis=-1)


def plate_points(position: ArrayLike, rotation: ArrayLike, g: Geometry) -> FloatArray:
    """Spherical joints S_a, S_b, S_c (..., 3, 3), m, world frame, of platform poses.

    Parameters
    ----------
    position : array_like (..., 3)
        P, m, world frame.
    rotation : array_like (..., 3, 3)
        Columns are the platform's axes in the world frame.
    """
    p, rot = np.asarray(position, dtype=np.float64), np.asarray(rotation, dtype=np.float64)
    if p.shape[-1:] != (3,) or rot.shape[-2:] != (3, 3):
        raise ValueError(f"expected a position (..., 3) and a rotation (..., 3, 3), got {p.shape}")
    return np.asarray(g.plate @ np.swapaxes(rot, -1, -2) + p[..., None, :])
