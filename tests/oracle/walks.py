"""Postures, and grids filled by walking with ``closure.solve.continuation``. No tests here."""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin

import closedchain as cc
from closedchain.closure.chart import Chart
from closedchain.closure.charting import straight
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.solve.continuation import follow
from closedchain.closure.solve.newton import correct

UNSEEN, OK, JOINT_LIMIT = -1, 0, 3


def anywhere(m: cc.Mechanism, count: int, seed: int = 0) -> np.ndarray:
    """Open postures (count, nq) all over the configuration space."""
    rng = np.random.default_rng(seed)
    steps = rng.uniform(-2.0, 2.0, (count, m.model.nv))
    return np.array([pin.integrate(m.model, m.home, v) for v in steps])


def closed(m: cc.Mechanism, count: int, seed: int = 0, spread: float = 0.3) -> np.ndarray:
    """Closed postures (count, nq) around home."""
    rng = np.random.default_rng(seed)
    found: list[np.ndarray] = []
    for _ in range(20 * count):
        v = spread * rng.standard_normal(m.model.nv) * m.column_scale
        s = cc.close(m, guess=pin.integrate(m.model, m.home, v))
        if s.converged:
            found.append(s.q)
        if len(found) == count:
            return np.array(found)
    raise AssertionError(f"only {len(found)} of {count} postures of {m.name} closed")


def cells(chart: Chart, half: float, count: int) -> np.ndarray:
    """Coordinates (count, ..., k) of a block around the chart's start, ``half`` in its units."""
    axes = [
        np.linspace(c - half * unit, c + half * unit, count)
        for c, unit in zip(chart.values(chart.start), chart.scale, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def walk(chart: Chart, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reach a block from its middle with ``closure.solve.continuation``: what ``flood`` does."""
    m, shape = chart.mechanism, values.shape[:-1]
    status = np.full(shape, UNSEEN, dtype=np.int8)
    q = np.zeros((*shape, m.model.nq))
    middle = tuple(n // 2 for n in shape)
    status[middle] = OK
    first = correct(chart.equations(values[middle]), chart.pinned(chart.start, values[middle]))
    assert first.refusal is None
    q[middle] = first.q
    queue = deque([(middle, first)])
    while queue:
        cell, here = queue.popleft()
        for axis in range(len(shape)):
            for step in (-1, 1):
                beside = list(cell)
                beside[axis] += step
                key = tuple(beside)
                if not 0 <= beside[axis] < shape[axis] or status[key] != UNSEEN:
                    continue
                path = follow(straight(chart, values[cell], values[key]), here, 1e-4)
                if path.refusal is not None:
                    continue
                status[key] = JOINT_LIMIT if beyond_limits(m, path.last.q) else OK
                if status[key] == OK:
                    q[key] = path.last.q
                    queue.append((key, path.last))
    return status, q
