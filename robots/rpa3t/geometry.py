"""Dimensions of the RPa(3R)2R+RPa mechanism and its points, from a posture.

Frame: origin O in the middle of A2 and A3, x from A2 to A3, y towards A1, z up. A posture is
``q = (x_C1, z_C1, beta)`` with the inputs ``theta``: arm 1 turns about +x from y, arms 2 and 3
about -y from x, beta is the angle of link 7 about z from x. Lengths are in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from closedchain.robots.dimensions import check_dimensions, with_dimensions

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]

HOME: tuple[float, float, float] = (0.1, -0.03, -0.6)
"""P at home, m: off the singular planes y = 0 and y = +-l7, in the working mode (1, 1, -1, 1)."""


@dataclass(frozen=True)
class Geometry:
    """Dimensions, m; the defaults are those of the paper's case study.

    Attributes
    ----------
    l1 : float
        Distance of A1, A2, A3 from O.
    l2 : float
        Half the distance of F1 and D3 on the platform.
    l3, l4 : float
        Arms A_i B_i and rods B_i C_i.
    l5 : float
        Half the distance of C1 and C2 on link 3'.
    l6 : float
        Heights C1 D1, E1 F1 and C3 D3.
    l7 : float
        Link 7, D1 E1.
    w4s, w4r : float
        Half widths of the parallelograms of legs 1 and 3; the paper prints none. P does not depend
        on them.
    """

    l1: float = 0.3
    l2: float = 0.07
    l3: float = 0.35
    l4: float = 0.8
    l5: float = 0.1
    l6: float = 0.01
    l7: float = 0.05
    w4s: float = 0.05
    w4r: float = 0.05

    def __post_init__(self) -> None:
        """Check that every length is finite and positive."""
        check_dimensions(self, "rpa3t")


def geometry(**overrides: float) -> Geometry:
    """Dimensions of the case study with single fields replaced [m].

    Raises
    ------
    DescriptionError
        Unknown field, or an impossible value.
    """
    return with_dimensions(Geometry, "rpa3t", overrides)


def split(triples: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the three entries (...) of triples (..., 3)."""
    array = np.asarray(triples, dtype=np.float64)
    return array[..., 0], array[..., 1], array[..., 2]


def stack(*columns: FloatArray | float) -> FloatArray:
    """Arrays (...) as the entries of one (..., n), broadcast against each other."""
    return np.stack(np.broadcast_arrays(*columns), axis=-1).astype(np.float64)


def tip(q: FloatArray, g: Geometry) -> FloatArray:
    """P (..., 3), m, of postures ``q`` (..., 3) [m, m, rad]: eq. (11), heights corrected."""
    x, z, beta = split(q)
    return stack(x + g.l7 * np.cos(beta) + g.l2, g.l7 * np.sin(beta), z + 2.0 * g.l6)


def points(q: FloatArray, theta: FloatArray, g: Geometry) -> dict[str, FloatArray]:
    """Named points (..., 3), m, of postures ``q`` (..., 3) and arm angles ``theta`` (..., 3).

    The coordinates before eqs (6) and (9), with z_F1 = z_D1 + l6, z_D3 = z_D1 + l6 and
    z_C3 = z_D3 - l6.
    """
    x, z, beta = split(q)
    t1, t2, t3 = split(theta)
    y_e, x_e = g.l7 * np.sin(beta), x + g.l7 * np.cos(beta)
    d, f = z + g.l6, z + 2.0 * g.l6
    zero = np.zeros_like(x)
    return {
        "A1": stack(zero, g.l1, 0.0),
        "A2": stack(zero - g.l1, 0.0, 0.0),
        "A3": stack(zero + g.l1, 0.0, 0.0),
        "B1": stack(zero, g.l1 + g.l3 * np.cos(t1), g.l3 * np.sin(t1)),
        "B2": stack(-g.l1 + g.l3 * np.cos(t2), 0.0, g.l3 * np.sin(t2)),
        "B3": stack(g.l1 + g.l3 * np.cos(t3), 0.0, g.l3 * np.sin(t3)),
        "C1": stack(x, 0.0, z),
        "C2": stack(x - 2.0 * g.l5, 0.0, z),
        "C3": stack(x_e + 2.0 * g.l2, y_e, d),
        "D1": stack(x, 0.0, d),
        "E1": stack(x_e, y_e, d),
        "F1": stack(x_e, y_e, f),
        "D3": stack(x_e + 2.0 * g.l2, y_e, f),
        "P": stack(x_e + g.l2, y_e, f),
    }


def residuals(q: FloatArray, theta: FloatArray, g: Geometry) -> FloatArray:
    """``|B_i C_i|^2 - l4^2`` (..., 3), m^2: zero on closed loops (eqs (6), (9), (12), (14))."""
    found = points(q, theta, g)
    gaps = [((found[f"C{i}"] - found[f"B{i}"]) ** 2).sum(axis=-1) for i in (1, 2, 3)]
    return stack(*gaps) - g.l4**2
