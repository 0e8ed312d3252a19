"""Postures of rus6 from its closed forms, as configurations of the mechanism. No tests here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

import closedchain as cc
from closedchain.robots.rus6 import OUTWARD, Geometry, Legs, Pose, geometry, inverse, rotation_ypr

G = geometry()
INWARD_M1 = (-1.0, -1.0, -1.0, 1.0, 1.0, 1.0)
ALIGNED = {"theta4": G.theta1, "psi1": G.theta1, "psi4": G.theta1}
SEED = 20161110


def configuration(mechanism: cc.Mechanism, pose: Pose, legs: Legs) -> np.ndarray:
    """Configuration (nq,) with the platform at ``pose`` and the legs as the closed form says."""
    q = np.array(mechanism.home)
    model = mechanism.model

    def put(joint: str, value: Any) -> None:
        if model.existJointName(joint):
            at = model.joints[model.getJointId(joint)]
            q[at.idx_q : at.idx_q + at.nq] = value

    put("platform_pose", pin.SE3ToXYZQUAT(pin.SE3(pose.rotation, pose.position)))
    for i in range(6):
        put(f"leg{i + 1}_A", legs.alpha[i])
        put(f"leg{i + 1}_U1", legs.bend[i])
        put(f"leg{i + 1}_U2", legs.swing[i])
        put(f"leg{i + 1}_F", legs.beta)
    return q


def at(
    mechanism: cc.Mechanism,
    pose: Pose,
    beta: float = 0.0,
    mode: Any = OUTWARD,
    g: Geometry = G,
) -> tuple[np.ndarray, Legs]:
    """Configuration and legs of a pose in a working mode."""
    legs = inverse(pose, beta, g, mode)
    return configuration(mechanism, pose, legs), legs


def on_axis(height: float, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> Pose:
    """Pose with P on the axis y."""
    return Pose(rotation_ypr(yaw, pitch, roll), np.array([0.0, height, 0.0]))


def stored(entry: Mapping[str, Any]) -> tuple[Pose, float, Any]:
    """Pose, beta and mode of an entry of the reference file."""
    return Pose(np.array(entry["R"]), np.array(entry["P"])), entry["beta"], entry["kappa"]


def random_poses(n: int, seed: int = SEED, share: float = 1.0) -> tuple[Pose, np.ndarray]:
    """Poses (n,) and angles beta (n,) in the box around home that is free of singularities."""
    rng = np.random.default_rng(seed)
    p = share * rng.uniform(-0.06, 0.06, (n, 3)) + [0.0, -0.55, 0.0]
    turns = share * np.radians(12.0) * rng.uniform(-1.0, 1.0, (3, n))
    beta = share * np.radians(30.0) * rng.uniform(-1.0, 1.0, n)
    return Pose(rotation_ypr(*turns), p), beta


def one(pose: Pose, i: int) -> Pose:
    """Pose number ``i`` of a batch."""
    return Pose(pose.rotation[i], pose.position[i])
