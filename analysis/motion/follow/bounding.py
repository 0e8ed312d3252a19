"""Joint limits and input speeds along a step: how far they are passed, and steps that keep them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.motion.follow.objectives import joint_rows
from closedchain.analysis.motion.follow.postures import Posture
from closedchain.analysis.motion.follow.problem import Problem

TOLERANCE = 1e-6
"""Dimensionless excess over a limit, or share of a speed limit, that is none."""


@dataclass(frozen=True)
class Excess:
    """The bound that is passed the furthest: joint, value, limit; a speed or a value."""

    name: str
    value: float
    limit: float
    speed: bool
    angle: bool


def excess(problem: Problem, q: np.ndarray, before: np.ndarray | None, i: int) -> Excess | None:
    """Worst bound passed at a posture that follows posture ``before``, at sample i; None if none.

    Speeds are means from sample to sample.
    """
    if not problem.enforced:
        return None
    bounds, m = problem.bounds, problem.mechanism
    found: list[tuple[float, Excess]] = []
    values = q[bounds.in_q]
    over = np.maximum(bounds.lower - values, values - bounds.upper)
    over = over / m.column_scale[bounds.in_v]
    if over.size and over.max() > TOLERANCE:
        b = int(over.argmax())
        low = values[b] < bounds.lower[b]
        limit = float((bounds.lower if low else bounds.upper)[b])
        angle = not m.translational[bounds.in_v[b]]
        found.append(
            (float(over[b]), Excess(bounds.names[b], float(values[b]), limit, False, angle))
        )
    if before is not None and bounds.speeds is not None:
        dt = float(problem.times[i + 1] - problem.times[i])
        speeds = np.abs((q - before)[m.input_q]) / dt
        share = speeds / bounds.speeds - 1.0
        if share.max() > TOLERANCE:
            n = int(share.argmax())
            angle = not m.translational[m.input_v[n]]
            text = Excess(m.inputs[n], float(speeds[n]), float(bounds.speeds[n]), True, angle)
            found.append((float(share[n]), text))
    return max(found, key=lambda pair: pair[0])[1] if found else None


def rows_of(
    problem: Problem, at: Posture, before: np.ndarray | None, i: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounds on a step z along the basis: lower <= rows z <= upper, dimensionless."""
    bounds, m = problem.bounds, problem.mechanism
    unit = m.column_scale[bounds.in_v]
    values = at.q[bounds.in_q]
    rows = [joint_rows(problem, bounds.in_v, at.basis) / unit[:, None]]
    lower, upper = [(bounds.lower - values) / unit], [(bounds.upper - values) / unit]
    if before is not None and bounds.speeds is not None:
        unit = m.column_scale[m.input_v]
        steps = float(problem.times[i + 1] - problem.times[i])
        most = (1.0 - 0.5 * TOLERANCE) * bounds.speeds * steps / unit
        change = (at.q - before)[m.input_q] / unit
        rows.append(joint_rows(problem, m.input_v, at.basis) / unit[:, None])
        lower.append(-most - change)
        upper.append(most - change)
    return np.concatenate(rows), np.concatenate(lower), np.concatenate(upper)


def within(
    problem: Problem, at: Posture, wanted: np.ndarray, before: np.ndarray | None, i: int
) -> np.ndarray | None:
    """Step (k,) nearest to the wanted one among those that pass the bounds the least.

    None where the linear programme behind it fails.
    """
    if not problem.enforced:
        return wanted
    rows, lower, upper = rows_of(problem, at, before, i)
    inside = rows @ wanted
    if ((inside >= lower) & (inside <= upper)).all():
        return wanted
    from scipy.optimize import linprog

    k = wanted.size
    # unknowns: step, excess, distance to the wanted step; the excess weighs heavily
    one, zero, eye = np.ones((len(rows), 1)), np.zeros((len(rows), 1)), np.eye(k)
    table = np.vstack(
        [
            np.hstack([rows, -one, zero]),
            np.hstack([-rows, -one, zero]),
            np.hstack([eye, np.zeros((k, 1)), -np.ones((k, 1))]),
            np.hstack([-eye, np.zeros((k, 1)), -np.ones((k, 1))]),
        ]
    )
    limits = np.concatenate([upper, -lower, wanted, -wanted])
    finite = np.isfinite(limits)
    found = linprog(
        np.concatenate([np.zeros(k), [1e4, 1.0]]),
        table[finite],
        limits[finite],
        bounds=[(-0.5, 0.5)] * k + [(0.0, None)] * 2,
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10},
    )
    return np.asarray(found.x[:k]) if found.status == 0 else None
