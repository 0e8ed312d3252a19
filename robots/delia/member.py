"""A member of the DeLiA family and its joint values for given poses of coupler and platform."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from closedchain.robots.d1.geometry import NORMAL, RADIAL, FloatArray, Geometry, Pose
from closedchain.robots.delia_choices import CHOICES

from .legs import DRIVEN, Sizes, joint_values

_FEET: FloatArray = np.stack(
    [RADIAL, np.tile(NORMAL, (3, 1)), np.cross(RADIAL, NORMAL)], axis=-1
)  # columns x (radial), y (up), z (tangential) of each foot frame


@dataclass(frozen=True, eq=False)
class JointValues:
    """Joint values of all legs, [m or rad], shape (...) each.

    Attributes
    ----------
    joints : mapping
        By joint name, such as ``leg1_P`` or ``passive2_R``.
    inputs : ndarray (..., 6)
        q1..q6.
    reachable : ndarray (...)
        Whether every leg reaches its tip.
    """

    joints: Mapping[str, FloatArray]
    inputs: FloatArray
    reachable: np.ndarray


@dataclass(frozen=True)
class Member:
    """Legs and sizes; the defaults are D1, with links for the legs that D1 has not.

    Attributes
    ----------
    coupler, passive, outer : str
        Legs base to coupler, coupler to platform, base to platform.
    geometry : Geometry
        Feet, tips and home heights, as of D1.
    coupler_links, passive_links, outer_links : Sizes
        Lengths of links, m.
    """

    coupler: str = "RPS"
    passive: str = "RPS"
    outer: str = "UPS"
    geometry: Geometry = field(default_factory=Geometry)
    coupler_links: Sizes = field(default_factory=lambda: Sizes(0.0, 0.2, 0.4))
    passive_links: Sizes = field(default_factory=lambda: Sizes(0.0, 0.12, 0.19))
    outer_links: Sizes = field(default_factory=lambda: Sizes(0.04, 0.18, 0.45))

    def __post_init__(self) -> None:
        """Refuse legs that make no member, by name."""
        for role, choice in CHOICES.items():
            choice.check(role, getattr(self, role))

    def joint_values(self, coupler: Pose, platform: Pose, *, mode: int = -1) -> JointValues:
        """Joint values that hold a coupler pose and a platform pose.

        The poses must keep S1..S3 and S4..S6 in the planes of their feet, as every pose found by
        ``closedchain.robots.d1`` does; this is not checked.

        Parameters
        ----------
        coupler, platform : Pose
            In frame A, batch (...).
        mode : {-1, +1}
            Working mode of all legs, see :func:`joint_values` of ``legs``.
        """
        g = self.geometry
        tips = platform.points(g.c_C)
        in_coupler = (tips - coupler.position[..., None, :]) @ coupler.rotation
        rows = (
            ("leg", 1, self.coupler, self.coupler_links, coupler.points(g.s_B) - g.R),
            ("passive", 1, self.passive, self.passive_links, in_coupler - g.r_B),
            ("leg", 4, self.outer, self.outer_links, tips - g.U),
        )
        joints: dict[str, FloatArray] = {}
        inputs: list[FloatArray] = []
        reachable = np.array(True)
        for name, number, leg, sizes, vectors in rows:
            for i in range(3):
                found = joint_values(leg, vectors[..., i, :] @ _FEET[i], sizes, mode=mode)
                joints |= {f"{name}{number + i}_{j}": v for j, v in found.joints.items()}
                reachable = reachable & found.reachable
                if name == "leg":
                    inputs.append(found.joints[DRIVEN[leg]])
        return JointValues(MappingProxyType(joints), np.stack(inputs, axis=-1), reachable)
