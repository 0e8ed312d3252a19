"""Postures of Eclipse and Eclipse-II that several tests look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import closedchain as cc
from closedchain.robots.eclipse import Geometry, InverseSolutions, Mode, inverse

load = cache(cc.load)  # the rank that classification needs is sampled once a mechanism
LOWERED = Mode((1, 1, 1), (1, 1, 1))


def posture(
    m: cc.Mechanism, position: Any, rotation: Any, inputs: Any, q_r: Sequence[float]
) -> np.ndarray:
    """Configuration (nq,) of the mechanism with the numbers of the closed forms."""
    q = m.home.copy()
    q[m.input_q] = inputs
    for leg, value in zip("abc", q_r, strict=True):
        q[m.model.joints[m.model.getJointId(f"{leg}_R")].idx_q] = value
    start = m.model.joints[m.model.getJointId("platform_pose")].idx_q
    q[start : start + 3] = position
    q[start + 3 : start + 7] = pin.Quaternion(np.array(rotation)).normalized().coeffs()
    return q


def random_poses(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) and rotations (n, 3, 3) around home that every mode reaches."""
    rng = np.random.default_rng(seed)
    position = np.array([0.0, 0.0, 0.12]) + rng.uniform(-1, 1, (n, 3)) * [0.04, 0.04, 0.06]
    vector = rng.normal(size=(n, 3))
    vector *= rng.uniform(0.0, 0.5, (n, 1)) / np.linalg.norm(vector, axis=1, keepdims=True)
    return position, Rotation.from_rotvec(vector).as_matrix()


def of_mode(found: InverseSolutions, mode: Mode = LOWERED) -> tuple[np.ndarray, np.ndarray]:
    """Inputs (..., 6) and hinge angles (..., 3) of one mode."""
    k = found.modes.index(mode)
    return found.inputs[..., k, :], found.q_r[..., k, :]


@dataclass(frozen=True)
class Case:
    """A singular posture: sizes in m, platform pose, the kinds that it must show."""

    name: str
    robot: str
    sizes: Mapping[str, float]
    position: tuple[float, float, float]
    rotation: np.ndarray
    kinds: frozenset[str]

    @property
    def geometry(self) -> Geometry:
        """Its dimensions."""
        return Geometry(**self.sizes, z_c=0.0 if self.robot == "eclipse2" else None)

    def load(self) -> tuple[cc.Mechanism, np.ndarray]:
        """The mechanism and its configuration there, links lowered and columns outside.

        A stretched leg is known from the pose only to the root of the rounding: it is made
        straight, and the rest closed again.
        """
        m = load(self.robot, **self.sizes)
        inputs, q_r = of_mode(inverse(self.position, self.rotation, self.geometry))
        straight = np.where(np.abs(np.sin(q_r)) < 1e-7, np.round(q_r / np.pi) * np.pi, q_r)
        guess = posture(m, self.position, self.rotation, inputs, straight)
        return m, cc.close(m, guess).raise_if_failed().q


def about_y(angle: float) -> np.ndarray:
    return Rotation.from_euler("y", angle).as_matrix()


def with_S_a(at: Sequence[float], tilt: float) -> tuple[float, float, float]:
    """P of a platform turned by ``tilt`` about y whose S_a is at ``at``, plate of 0.1 m."""
    x, y, z = np.array(at) - about_y(tilt) @ [0.1, 0.0, 0.0]
    return float(x), float(y), float(z)


def _case(name: str, robot: str, position: Any, tilt: float, kinds: str, **sizes: float) -> Case:
    return Case(name, robot, sizes, position, about_y(tilt), frozenset(kinds.split()))


_CENTRE = (0.0, 0.0, 0.1)
CASES = (
    _case("T1a", "eclipse", _CENTRE, np.pi / 2, "inverse"),
    _case("T1b", "eclipse", with_S_a((0.05, 0, 0.1), 0.3), 0.3, "inverse", r=0.15),
    _case("T1c", "eclipse", with_S_a((0, 0, 0.1), 0.3), 0.3, "inverse", r=0.25),
    _case("T1d", "eclipse", with_S_a((0.4, 0, 0.1), 0.3), 0.3, "inverse"),
    _case("T1e", "eclipse2", with_S_a((0, 0, 0.15), 0.3), 0.3, "inverse"),
    _case("T1f", "eclipse2", with_S_a((0.2 * 3**0.5, 0, 0.2), 0.3), 0.3, "inverse"),
    _case("T2a", "eclipse", _CENTRE, -np.arccos(2 / 3), "direct"),
    _case("T2b", "eclipse", _CENTRE, np.radians(69.97861650127), "direct"),
    _case("T3a", "eclipse", (-0.1, 0, 0.1), 0.0, "direct inverse"),
    _case("T3b", "eclipse", (-0.08, 0, 0.04), -np.arccos(0.8), "direct inverse", r=0.25),
    _case(
        "T3c",
        "eclipse2",
        (-0.1 * np.sqrt(1 - 0.375**2), 0, 0.1125),
        -np.arcsin(0.375),
        "direct inverse",
    ),
)
