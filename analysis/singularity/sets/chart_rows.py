"""Rows that tie postures to the coordinates of a chart, and their derivatives by both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from closedchain.analysis.singularity.sets.postures_at import OnTape
from closedchain.closure.chart import TILTS, Chart
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.tape.derivative import forward
from closedchain.closure.tape.expression import Expr
from closedchain.closure.tape.machine import compiled
from closedchain.closure.tape.rows import Kinematics, kinematics
from closedchain.closure.tape.vectors import Matrix, add, dot, matmul, rotation, scale
from closedchain.urdf.description import OUTPUTS

Rows = tuple[np.ndarray, np.ndarray, np.ndarray]

SMALL = 1e-6
"""Square of an angle [rad] below which a rotation is written as a power series."""


@dataclass(frozen=True, eq=False)
class ChartRows:
    """Machine code for the rows of a chart: pinned joints, then components of the tip's pose.

    Attributes
    ----------
    chart : Chart
        Whatever values it holds, and whichever of its coordinates vary.
    """

    chart: Chart

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Coordinates that the rows depend on: joints, then all of the tip's pose."""
        chart = self.chart
        if not chart.outputs:
            return chart.joints
        return (*chart.joints, *"xyz", *(TILTS if chart.tilting else OUTPUTS[3:]))

    def run(self, q: np.ndarray, coordinates: np.ndarray) -> Rows:
        """Values (p,), derivatives by q (p, nv) and by coordinates (p, len(names)).

        Dimensionless. ``coordinates`` in the order of ``names``; for one or for many.
        """
        chart, some = self.chart, q.shape[:-1]
        rows, nv = len(chart.joints) + len(chart.outputs), chart.mechanism.model.nv
        numbers = self._code(q, coordinates)
        first, second = rows, rows + rows * nv
        return (
            numbers[..., :first],
            numbers[..., first:second].reshape(*some, rows, nv),
            numbers[..., second:].reshape(*some, rows, len(self.names)),
        )

    @cached_property
    def _code(self) -> OnTape:
        chart, model = self.chart, self.chart.mechanism.model
        k = kinematics(chart.mechanism)
        g, zero = k.graph, k.graph.constant(0.0)
        c = g.inputs(model.nq, len(self.names))
        values: list[Expr] = []
        by_q: list[list[Expr]] = []
        for at, v, wanted in zip(chart.pinned_q, chart.pinned_v, c, strict=False):
            values.append((k.q[at] - wanted) * float(1.0 / chart.mechanism.column_scale[v]))
            by_q.append([g.constant(float(i == v)) for i in range(model.nv)])
        if chart.outputs:
            tip = chart.mechanism.required_task().tip
            outputs = [OUTPUTS.index(name) for name in chart.outputs]
            goal = k.goal(tip, outputs, self._target(k, c[len(chart.joints) :]))
            values += goal.values
            entries = [k.own(row) for row in goal.entries]
            by_q += [[row.get(v, zero) for v in range(model.nv)] for row in entries]
        units = [chart.mechanism.length if chart.unit(n) == "m" else 1.0 for n in self.names]
        by_c = [forward(g, values, {model.nq + i: u}) for i, u in enumerate(units)]
        out = values + [x for row in by_q for x in row]
        out += [column[i] for i in range(len(values)) for column in by_c]
        return OnTape(compiled(g.tape(out, model.nq + len(c))))

    def _target(self, k: Kinematics, c: Sequence[Expr]) -> tuple[Matrix, list[Expr]]:
        """Pose of the tip, its origin in lengths, for x y z and three rotation coordinates."""
        chart, g = self.chart, k.graph
        if chart.tilting:
            first, second, tool = chart.tip_axes
            tilt, azimuth, torsion = c[3:]
            lean = add(
                scale(azimuth.cos(), [float(x) for x in second]),
                scale(-azimuth.sin(), [float(x) for x in first]),
            )
            turn: Matrix = matmul(about(lean, tilt), about([float(x) for x in tool], torsion))
        else:
            turn = turned(c[3:])
        home = [[g.constant(x) for x in row] for row in chart.home_pose.rotation]
        return matmul(home, turn), scale(1.0 / chart.mechanism.length, c[:3])


def about(axis: Sequence[Expr | float], angle: Expr) -> Matrix:
    """Rotation about a unit axis."""
    sine = (0.5 * angle).sin()
    return rotation([*scale(sine, axis), (0.5 * angle).cos()])


def turned(vector: Sequence[Expr]) -> Matrix:
    """Rotation of a rotation vector, smooth at zero."""
    square = dot(vector, vector)
    near = square < SMALL
    angle = near.select(1.0, square).sqrt()
    share = near.select(
        0.5 - square * (1.0 / 48.0 - square * (1.0 / 3840.0)), (0.5 * angle).sin() / angle
    )
    cosine = near.select(1.0 - square * (0.125 - square * (1.0 / 384.0)), (0.5 * angle).cos())
    return rotation([*scale(share, vector), cosine])


@dataclass(frozen=True, eq=False)
class SliceRows:
    """The rows of a chart as functions of the coordinates that vary, the others held."""

    chart: Chart

    @cached_property
    def code(self) -> ChartRows:
        """Rows in all coordinates."""
        return rows_of(self.chart)

    @cached_property
    def _varying(self) -> list[int]:
        return [self.code.names.index(name) for name in self.chart.names]

    @cached_property
    def _held(self) -> np.ndarray:
        home = dict(zip("xyz", self.chart.home_pose.translation.tolist(), strict=True))
        given = home | dict(self.chart.held)
        return np.array([given.get(name, 0.0) for name in self.code.names])

    def at(self, q: np.ndarray, c: np.ndarray) -> Rows:
        """Values (rows,), derivatives by q (rows, nv) and by c (rows, k), dimensionless.

        Parameters
        ----------
        q, c : (nq,) and (k,) arrays, or (n, nq) and (n, k)
        """
        coordinates = np.empty((*c.shape[:-1], len(self._held)))
        coordinates[:] = self._held
        coordinates[..., self._varying] = c
        values, by_q, by_c = self.code.run(q, coordinates)
        return values, by_q, by_c[..., self._varying]


_ROWS: WeakKeyDictionary[Mechanism, dict[object, ChartRows]] = WeakKeyDictionary()


def rows_of(chart: Chart) -> ChartRows:
    """Rows for the joints and outputs that a chart prescribes, made once."""
    known = _ROWS.setdefault(chart.mechanism, {})
    return known.setdefault((chart.joints, chart.outputs, chart.tilting), ChartRows(chart))
