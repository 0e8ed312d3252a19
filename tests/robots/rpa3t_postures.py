"""Postures of rpa3t for its tests: as configurations, and samples of the singular sets."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

import closedchain as cc
from closedchain.robots import rpa3t

G = rpa3t.geometry()
DEFAULT = 2
"""Index of the working mode (1, 1, -1, 1) of home."""
BOX = np.array([[-0.10, 0.25], [-0.04, -0.02], [-0.75, -0.50]])
"""Where every factor keeps its sign in the default mode, m."""
WIDE = np.array([[-0.3, 0.5], [-0.05, 0.05], [-0.9, -0.3]])
"""Where all three kinds of surface pass, m."""

Posture = tuple[np.ndarray, np.ndarray]
"""(x_C1, z_C1, beta) [m, m, rad] and (theta1, theta2, theta3) [rad]."""


def configuration(m: cc.Mechanism, q: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Configuration (nq,) of a posture, with theta2 near home's (it crosses pi in normal work)."""
    out = np.array(m.home)
    for name, value in rpa3t.joint_values(q, theta, G).items():
        joint = m.model.joints[m.model.getJointId(name)]
        out[joint.idx_q] = value
    return out


def near(theta: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The same angles, each within half a turn of ``other``."""
    return np.asarray(other + (theta - other + np.pi) % (2.0 * np.pi) - np.pi)


def sample(box: np.ndarray, n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(box[:, 0], box[:, 1], (n, 3))


def _signs(rng: np.random.Generator) -> np.ndarray:
    return rng.choice([-1.0, 1.0], 3)


def _finish(q: np.ndarray, rng: np.random.Generator, n: int) -> list[Posture]:
    """The first n of postures (many, 3) that all legs reach, on random sides of the arms."""
    found: list[Posture] = []
    for posture in q:
        theta, real = rpa3t.arm_angles(posture, _signs(rng), G)
        if real.all():
            found.append((posture, theta))
        if len(found) == n:
            return found
    raise AssertionError(f"only {len(found)} of {n} postures found")


def _around(rng: np.random.Generator, beta: np.ndarray | float) -> np.ndarray:
    x, z = rng.uniform(-0.3, 0.5, 400), rng.uniform(-0.9, -0.3, 400)
    return np.stack(np.broadcast_arrays(x, z, beta), axis=-1)


def on_sin_beta(n: int, seed: int = 0) -> list[Posture]:
    rng = np.random.default_rng(seed)
    return _finish(_around(rng, rng.choice([0.0, np.pi], 400)), rng, n)


def on_cos_beta(n: int, seed: int = 0) -> list[Posture]:
    rng = np.random.default_rng(seed)
    return _finish(_around(rng, rng.choice([-0.5, 0.5], 400) * np.pi), rng, n)


def on_kappa(n: int, seed: int = 0) -> list[Posture]:
    """Postures of the self-motion; theta3 is given, not solved for."""
    rng = np.random.default_rng(seed)
    found: list[Posture] = []
    while len(found) < n:
        theta3, beta = rng.uniform(-1.2, 1.2), rng.uniform(-np.pi, np.pi)
        q = rpa3t.self_motion(theta3, beta, G)
        theta, real = rpa3t.arm_angles(q, _signs(rng), G)
        if real[:2].all():
            found.append((q, np.array([*theta[:2], theta3])))
    return found


def on_parallel_rods(n: int, seed: int = 0) -> list[Posture]:
    """M = 0, where legs 1 and 2 are about to come apart: roots of ``parallel_rods`` in theta2."""
    rng = np.random.default_rng(seed)
    found: list[Posture] = []
    while len(found) < n:
        theta1, theta3 = rng.uniform(-np.pi, np.pi, 2)
        grid = np.linspace(-np.pi, np.pi, 60)

        def gap(theta2: float, theta1: float = theta1) -> float:
            return float(rpa3t.parallel_rods(np.array([theta1, theta2, 0.0]), G))

        values = [gap(t) for t in grid]
        for i in np.flatnonzero(np.diff(np.sign(values))):
            theta2 = brentq(gap, grid[i], grid[i + 1], xtol=1e-15, rtol=1e-14)
            theta = np.array([theta1, theta2, theta3])
            # C1 is where the circles touch; the root is known to rounding only
            for off in (0.0, 1e-14, -1e-14):
                candidate = theta + np.array([0.0, off, 0.0])
                solved = rpa3t.direct(candidate, G)
                if solved.real.any():
                    found.append((solved.q[np.flatnonzero(solved.real)[0]], candidate))
                    break
    return found[:n]


def on_aligned(leg: int, n: int, seed: int = 0) -> list[Posture]:
    """s_leg = 0: arm and projected rod aligned, by the height of C1."""
    rng = np.random.default_rng(seed)
    x, beta = rng.uniform(-0.3, 0.5, 4000), rng.uniform(-np.pi, np.pi, 4000)
    fold = rng.choice([-1.0, 1.0], 4000)
    if leg == 1:
        far, aside, up = G.l3 + fold * np.sqrt(G.l4**2 - x**2), G.l1 + 0.0 * x, 0.0
    elif leg == 2:
        far, aside, up = G.l3 + fold * G.l4, x - 2 * G.l5 + G.l1, 0.0
    else:
        rod = np.sqrt(G.l4**2 - (G.l7 * np.sin(beta)) ** 2)
        far, aside, up = G.l3 + fold * rod, x + G.l7 * np.cos(beta) + 2 * G.l2 - G.l1, G.l6
    there = far**2 > aside**2
    z = -np.sqrt(np.where(there, far**2 - aside**2, 0.0)) - up
    return _finish(np.stack([x, z, beta], axis=-1)[there], rng, n)


def on_level_rods(n: int, seed: int = 0) -> list[Posture]:
    """z_C1 = z_B1: the rods of leg 1 are horizontal."""
    rng = np.random.default_rng(seed)
    found: list[Posture] = []
    while len(found) < n:
        theta1, beta = rng.uniform(-np.pi, np.pi, 2)
        x = np.sqrt(G.l4**2 - (G.l1 + G.l3 * np.cos(theta1)) ** 2)
        q = np.array([x, G.l3 * np.sin(theta1), beta])
        theta, real = rpa3t.arm_angles(q, _signs(rng), G)
        if real.all():
            found.append((q, np.array([theta1, *theta[1:]])))
    return found
