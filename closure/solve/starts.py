"""Starts around a posture, for descents that have to leave it: the same ones every time."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism

RESTARTS = 12
SPREAD = 0.05
"""Dimensionless standard deviation of the first of them; number i has i times that."""

TURNED = 24  # starts with every angle anywhere
SLID = 1.0  # dimensionless standard deviation of slides in these


def scattered(
    mechanism: Mechanism, start: np.ndarray, free: np.ndarray | None = None
) -> list[np.ndarray]:
    """The start and the same starts around it each time, wider and wider.

    ``free`` are the tangent coordinates that may differ, all by default.
    """
    rng = np.random.default_rng(0)
    starts = [start]
    for i in range(RESTARTS):
        v = rng.standard_normal(mechanism.model.nv) * mechanism.column_scale
        starts.append(_moved(mechanism, start, SPREAD * (1 + i) * v, free))
    return starts


def turned(mechanism: Mechanism, start: np.ndarray, free: np.ndarray) -> list[np.ndarray]:
    """The same starts each time with the free angles anywhere, and slides around the start.

    A body whose place is given decides the angles of a leg up to whole turns, and often twice; the
    way from the guess to either may lead through a posture where descent ends.
    """
    rng = np.random.default_rng(1)
    slides = mechanism.translational
    starts = []
    for _ in range(TURNED):
        angles = rng.uniform(-np.pi, np.pi, mechanism.model.nv)
        lengths = SLID * rng.standard_normal(mechanism.model.nv) * mechanism.length
        starts.append(_moved(mechanism, start, np.where(slides, lengths, angles), free))
    return starts


def _moved(
    mechanism: Mechanism, start: np.ndarray, v: np.ndarray, free: np.ndarray | None
) -> np.ndarray:
    if free is not None:
        held = np.ones(v.size, dtype=bool)
        held[free] = False
        v = np.where(held, 0.0, v)
    return np.asarray(pin.integrate(mechanism.model, start, v))
