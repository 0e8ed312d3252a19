"""Geometry of the linear Delta: three vertical rails at 0, 120 and 240 degrees.

Frame O-xyz is fixed to the base, z along the rails; o' is the platform's centre. Lengths in metres.
A leg is described in its plane: r_i points from the axis to its rail, s2_i = z x r_i is the common
direction of its two revolute axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from closedchain.robots.dimensions import check_dimensions
from closedchain.urdf.errors import DescriptionError

FloatArray: TypeAlias = NDArray[np.float64]

PHI: FloatArray = np.array([0.0, 2.0 * pi / 3.0, 4.0 * pi / 3.0])
"""Azimuths phi_i (3,) of the rails, rad."""
RADIAL: FloatArray = np.stack([np.cos(PHI), np.sin(PHI), np.zeros(3)], axis=1)
"""Outward unit vectors r_i (3, 3), frame O."""
AXIS: FloatArray = np.array([0.0, 0.0, 1.0])
"""Direction z = s1_i of all rails."""
TANGENT: FloatArray = np.cross(AXIS, RADIAL)
"""Revolute axes s2_i = z x r_i (3, 3), frame O."""
for _constant in (PHI, RADIAL, AXIS, TANGENT):
    _constant.setflags(write=False)


@dataclass(frozen=True)
class Geometry:
    """Dimensions, m; the defaults are those of the paper's numerical example.

    Attributes
    ----------
    a : float
        Radius |O A_i| of the circle of rails.
    b : float
        Length |B_i C_i| of the rods.
    c : float
        Radius |o' C_i| of the platform.
    t : float
        HALF the width of a parallelogram: eqs (9)-(12) put D, G at +t s2 and E, F at -t s2.
    """

    a: float = 0.4
    b: float = 0.5
    c: float = 0.2
    t: float = 0.05

    def __post_init__(self) -> None:
        """Check that every length is finite and positive."""
        check_dimensions(self, "linear Delta")

    @property
    def d(self) -> float:
        """Offset a - c, m: all that the position problem knows of a and c."""
        return self.a - self.c

    @property
    def A(self) -> FloatArray:
        """Points A_i (3, 3) of the rails in the base plane, m, frame O."""
        return self.a * RADIAL

    @property
    def C(self) -> FloatArray:
        """Points C_i (3, 3) of the platform from o', m: the vectors c_i, equal in every posture."""
        return self.c * RADIAL

    @property
    def inscribed_radius(self) -> float:
        """Radius b - |d|, m, of the largest circle about z within the reach: 0.3 m.

        The reach in x and y is that of three discs of radius b about d r_i, whatever z is. For
        a > c the circle touches it in the directions -r_i; negative where there is no reach.
        """
        return self.b - abs(self.d)


def points(positions: FloatArray, shape: tuple[int, ...], what: str) -> FloatArray:
    """Check an array of finite numbers whose last axes are ``shape``; return it as float.

    Raises
    ------
    DescriptionError
        Wrong shape, or entries that are not finite.
    """
    array = np.asarray(positions, dtype=np.float64)
    if array.shape[array.ndim - len(shape) :] != shape or array.ndim < len(shape):
        raise DescriptionError(f"{what} must have the shape (..., {shape}), not {array.shape}")
    if not np.isfinite(array).all():
        raise DescriptionError(f"{what} has entries that are not finite")
    return array
