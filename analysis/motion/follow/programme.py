"""The linear programme of a whole path: rows for measures, limits, speeds and bending."""

from __future__ import annotations

from typing import Any

import numpy as np

from closedchain.analysis.motion.follow.bounding import TOLERANCE
from closedchain.analysis.motion.follow.objectives import InputSpeed, Objective, joint_rows
from closedchain.analysis.motion.follow.postures import Posture
from closedchain.analysis.motion.follow.problem import Problem

MEAN, BEND, PENALTY = 0.05, 1e-3, 1e3
"""Weights beside that of the smallest value: mean, bending of the null motion, excess."""


def programme(
    problem: Problem,
    objective: Objective,
    postures: tuple[Posture, ...],
    shape: np.ndarray,
    spline: np.ndarray,
    radius: float,
    hold_start: bool,
) -> np.ndarray | None:
    """Step (nodes, k) of the coefficients that raises the linearised path the most.

    Parameters
    ----------
    shape : (nodes, k) array
        Coefficients of all steps so far, which are to bend little.
    spline : (n, nodes) array
        Values of the splines at the samples.
    radius : float
        Largest coefficient of the step, dimensionless.

    Returns
    -------
    (nodes, k) array or None
        None where the solver fails; the bounds are elastic, so that a solution exists.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_matrix

    k, nodes, n = problem.freedoms, spline.shape[1], len(postures)
    rows = _Rows(k, spline, n)
    if isinstance(objective, InputSpeed):
        _speed_rows(problem, postures, rows)
    else:
        for i, (values, slopes) in enumerate(objective.numbers(problem, p) for p in postures):
            reach = radius * np.abs(slopes).sum(axis=1)
            for j in np.flatnonzero(values - reach <= (values + reach).min()):
                rows.measure({i: -slopes[j]}, float(values[j]), i)
    _limit_rows(problem, postures, rows, radius)
    shape_rows, bend_limits = _bend_rows(shape, rows)
    table = np.array(rows.table + shape_rows)
    limits = np.array([*rows.limits, *bend_limits])
    cost = np.zeros(rows.width)
    cost[rows.least] = -1.0
    cost[rows.each] = -MEAN / n
    cost[rows.slack] = PENALTY
    cost[rows.bends] = BEND
    most = np.full((nodes, k), radius)
    if hold_start:
        most[0] = 0.0
    bounds: list[tuple[float | None, float | None]] = [(-x, x) for x in most.ravel()]
    bounds += [(None, None)] * (1 + n) + [(0.0, None)] * (rows.width - nodes * k - 1 - n)
    found: Any = linprog(
        cost,
        csr_matrix(table),
        limits,
        bounds=bounds,
        method="highs",
        options={"primal_feasibility_tolerance": 1e-9},
    )
    if found.status != 0:
        return None
    return np.asarray(found.x[: nodes * k]).reshape(nodes, k)


class _Rows:
    """Rows of the linear programme: coefficients, least, each sample's least, slack, bends."""

    def __init__(self, k: int, spline: np.ndarray, n: int) -> None:
        """Lay out the unknowns."""
        self.k, self.spline = k, spline
        nodes = spline.shape[1]
        self.bent = max(nodes - 2, 0) * k
        self.least = nodes * k
        self.each = slice(self.least + 1, self.least + 1 + n)
        self.slack = self.least + 1 + n
        self.bends = slice(self.slack + 1, self.slack + 1 + self.bent)
        self.width = self.slack + 1 + self.bent
        self.table: list[np.ndarray] = []
        self.limits: list[float] = []
        for i in range(n):  # least <= each sample's
            row = np.zeros(self.width)
            row[self.least], row[self.least + 1 + i] = 1.0, -1.0
            self.table.append(row)
            self.limits.append(0.0)

    def row(self, parts: dict[int, np.ndarray]) -> np.ndarray:
        """Row that is sum_i parts[i] z_i in the coefficients."""
        row = np.zeros(self.width)
        for i, part in parts.items():
            row[: self.least] += np.multiply.outer(self.spline[i], part).ravel()
        return row

    def measure(self, parts: dict[int, np.ndarray], limit: float, sample: int) -> None:
        """each_sample + sum parts z <= limit."""
        row = self.row(parts)
        row[self.least + 1 + sample] = 1.0
        self.table.append(row)
        self.limits.append(limit)

    def bound(self, parts: dict[int, np.ndarray], limit: float) -> None:
        """Sum parts z - slack <= limit."""
        row = self.row(parts)
        row[self.slack] = -1.0
        self.table.append(row)
        self.limits.append(limit)


def _speed_rows(problem: Problem, postures: tuple[Posture, ...], rows: _Rows) -> None:
    """The negative speed of each input between samples is a number to be raised."""
    m = problem.mechanism
    unit = m.column_scale[m.input_v]
    steps = np.diff(problem.times[: len(postures)])
    for i, dt in enumerate(steps):
        a, b = postures[i], postures[i + 1]
        change = (b.q - a.q)[m.input_q] / unit / dt
        ahead = joint_rows(problem, m.input_v, b.basis) / unit[:, None] / dt
        behind = joint_rows(problem, m.input_v, a.basis) / unit[:, None] / dt
        for j in range(unit.size):
            for sign in (1.0, -1.0):
                rows.measure(
                    {i: -sign * behind[j], i + 1: sign * ahead[j]}, -sign * float(change[j]), i
                )
    last = len(steps)
    rows.measure({}, 0.0, last)  # no way begins at the last sample


def _limit_rows(
    problem: Problem, postures: tuple[Posture, ...], rows: _Rows, radius: float
) -> None:
    """Joint limits within reach of the step, and input speeds."""
    b, m = problem.bounds, problem.mechanism
    unit = m.column_scale[b.in_v]
    for i, p in enumerate(postures):
        along = joint_rows(problem, b.in_v, p.basis) / unit[:, None]
        reach = 2.0 * radius * np.abs(along).sum(axis=1)
        values = p.q[b.in_q]
        for sign, room in ((1.0, (b.upper - values) / unit), (-1.0, (values - b.lower) / unit)):
            for j in np.flatnonzero(room < reach):
                rows.bound({i: sign * along[j]}, float(room[j]))
    if b.speeds is None:
        return
    unit = m.column_scale[m.input_v]
    for i, dt in enumerate(np.diff(problem.times[: len(postures)])):
        here, there = postures[i], postures[i + 1]
        change = (there.q - here.q)[m.input_q] / unit
        ahead = joint_rows(problem, m.input_v, there.basis) / unit[:, None]
        behind = joint_rows(problem, m.input_v, here.basis) / unit[:, None]
        for j in np.flatnonzero(np.isfinite(b.speeds)):
            most = (1.0 - 0.5 * TOLERANCE) * float(b.speeds[j] * dt / unit[j])
            for sign in (1.0, -1.0):
                rows.bound(
                    {i: -sign * behind[j], i + 1: sign * ahead[j]},
                    most - sign * float(change[j]),
                )


def _bend_rows(shape: np.ndarray, rows: _Rows) -> tuple[list[np.ndarray], list[float]]:
    """Second differences of all coefficients so far are at most the bends, either sign."""
    table: list[np.ndarray] = []
    limits: list[float] = []
    for node in range(shape.shape[0] - 2):
        for column in range(rows.k):
            second = shape[node, column] - 2.0 * shape[node + 1, column] + shape[node + 2, column]
            for sign in (1.0, -1.0):
                row = np.zeros(rows.width)
                for offset, factor in enumerate((1.0, -2.0, 1.0)):
                    row[(node + offset) * rows.k + column] = sign * factor
                row[rows.bends.start + node * rows.k + column] = -1.0
                table.append(row)
                limits.append(-sign * float(second))
    return table, limits
