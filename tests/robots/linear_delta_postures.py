"""Postures of the linear Delta from its closed forms, as configurations. No tests here."""

from __future__ import annotations

from typing import Any

import numpy as np

import closedchain as cc
from closedchain.robots import linear_delta as ld

G = ld.Geometry()
SEED = 20130228


def rods(p: Any, sides: Any = (1, 1, 1), geometry: ld.Geometry = G) -> np.ndarray:
    """Unit rod vectors (..., 3, 3) with o' at ``p``, in the working mode ``sides``."""
    p = np.asarray(p, dtype=float)
    return ld.rods(p, ld.sliders(p, geometry, np.asarray(sides)), geometry)


def translation(vector: Any) -> np.ndarray:
    """Six-vector (linear; angular) of a pure translation."""
    vector = np.asarray(vector, dtype=float)
    return np.concatenate([vector, np.zeros(vector.shape)], axis=-1)


def configuration(
    mechanism: cc.Mechanism, p: Any, sides: Any, geometry: ld.Geometry = G
) -> np.ndarray:
    """Configuration (nq,) with o' at ``p`` (3,) in the working mode ``sides`` (3,)."""
    heights = ld.sliders(np.asarray(p, dtype=float), geometry, np.asarray(sides, dtype=float))
    swing, tilt = ld.leg_angles(ld.rods(p, heights, geometry))
    q = np.array(mechanism.home)
    model = mechanism.model
    for i in range(3):
        values = {"P": heights[i], "B": swing[i], "C": -swing[i]}
        values |= {"D": tilt[i], "E": tilt[i], "G": -tilt[i]}
        for letter, value in values.items():
            name = f"leg{i + 1}_{letter}"
            if model.existJointName(name):
                q[model.joints[model.getJointId(name)].idx_q] = value
    return q


def rods_at(mechanism: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    """Unit rod vectors (3, 3) read off a posture's named points."""
    ends = [mechanism.point(q, f"C{i}") - mechanism.point(q, f"B{i}") for i in (1, 2, 3)]
    return np.array([rod / np.linalg.norm(rod) for rod in ends])


def random_positions(count: int, seed: int = SEED, radius: float = 0.25) -> np.ndarray:
    """Platform centres (count, 3) within the reach, at most ``radius`` from the axis."""
    rng = np.random.default_rng(seed)
    r, angle = radius * np.sqrt(rng.uniform(size=count)), rng.uniform(0.0, 2.0 * np.pi, count)
    return np.stack([r * np.cos(angle), r * np.sin(angle), rng.uniform(-0.75, -0.45, count)], -1)
