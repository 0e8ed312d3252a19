"""The numerical example: a platform on a circle that rises steadily, and what the sliders do.

As printed it cannot be followed: its circle is wider than the reach. ``V1`` and ``V2`` are variants
of it that can. The source's velocity disagrees with its acceleration; here the acceleration is kept
and velocity and position are its integrals.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, pi

import numpy as np

from closedchain.urdf.errors import DescriptionError

from .acceleration import slider_accelerations
from .geometry import FloatArray, Geometry
from .position import MODES, rods, sliders
from .screws import slider_rates


@dataclass(frozen=True)
class Trajectory:
    """Helix about z: a = amax (cos, sin, 0) of 2 pi t / T, with its exact integrals v and p.

    Attributes
    ----------
    amax : float
        Centripetal acceleration, m/s^2.
    T : float
        Duration of one turn, s.
    vz : float
        Vertical velocity, m/s.
    z0 : float
        Height of o' at t = 0, m.
    """

    amax: float
    T: float
    vz: float
    z0: float = -0.6

    def __post_init__(self) -> None:
        """Check that the numbers are finite and the turn lasts."""
        if not all(isfinite(x) for x in (self.amax, self.T, self.vz, self.z0)) or self.T <= 0.0:
            raise DescriptionError(f"trajectory needs finite numbers and T above 0 s: {self}")

    @property
    def radius(self) -> float:
        """Radius amax T^2 / (4 pi^2) of the circle, m."""
        return self.amax * self.T**2 / (4.0 * pi**2)

    def position(self, time: FloatArray) -> FloatArray:
        """Position of o' (..., 3) [m] at times (...) [s]."""
        angle = 2.0 * pi * np.asarray(time, dtype=np.float64) / self.T
        height = self.z0 + self.vz * np.asarray(time, dtype=np.float64)
        return np.stack([-self.radius * np.cos(angle), -self.radius * np.sin(angle), height], -1)

    def velocity(self, time: FloatArray) -> FloatArray:
        """Velocity of o' (..., 3) [m/s]."""
        angle = 2.0 * pi * np.asarray(time, dtype=np.float64) / self.T
        speed = self.amax * self.T / (2.0 * pi)
        vertical = np.full(angle.shape, self.vz)
        return np.stack([speed * np.sin(angle), -speed * np.cos(angle), vertical], axis=-1)

    def acceleration(self, time: FloatArray) -> FloatArray:
        """Acceleration of o' (..., 3) [m/s^2]."""
        angle = 2.0 * pi * np.asarray(time, dtype=np.float64) / self.T
        return np.stack(
            [self.amax * np.cos(angle), self.amax * np.sin(angle), np.zeros(angle.shape)], axis=-1
        )

    def fits(self, geometry: Geometry) -> bool:
        """Whether the whole circle is within the reach: then every start on it works."""
        return self.radius < geometry.inscribed_radius


PRINTED = Trajectory(amax=1.0, T=5.0, vz=1.0)
"""The source's numbers: radius 0.633 m, out of reach."""
V1 = Trajectory(amax=1.0, T=2.0, vz=1.0)
"""Closest to the source: the turn takes 2 s, radius 0.101 m, rails of 2.1 m."""
V2 = Trajectory(amax=0.25, T=5.0, vz=0.05)
"""A turn in 5 s: radius 0.158 m, rails of 0.4 m."""


@dataclass(frozen=True, eq=False)
class History:
    """Sliders along a trajectory: time (n,) [s]; q, qdot, qddot (n, 3) [m, m/s, m/s^2]."""

    time: FloatArray
    q: FloatArray
    qdot: FloatArray
    qddot: FloatArray


def history(
    trajectory: Trajectory,
    time: FloatArray,
    geometry: Geometry,
    sides: FloatArray = MODES[0],
) -> History:
    """Slider positions, velocities and accelerations in one working mode.

    Raises
    ------
    ClosureError
        A pose on the way is out of reach, or a rod is horizontal there.
    """
    time = np.asarray(time, dtype=np.float64)
    p, v = trajectory.position(time), trajectory.velocity(time)
    q = sliders(p, geometry, sides)
    bhat = rods(p, q, geometry)
    qddot = slider_accelerations(bhat, v, trajectory.acceleration(time), geometry)
    return History(time, q, slider_rates(bhat, v), qddot)
