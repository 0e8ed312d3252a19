"""Equations of a slice: closures, coordinates of a chart, measures; unknowns are (q, c).

With the varying coordinates c among the unknowns, nothing special happens where the chart itself
fails: at a fold of the chart the solution turns round in c and goes on in q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.analysis.bordered import Borders, Kinematics, Measure, kinematics
from closedchain.analysis.mobility import generic_rank
from closedchain.closure.chart import Chart
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import OUTPUTS

TURN = 1e-6  # rad or m/length: central difference of the target pose along a coordinate


@dataclass(frozen=True, eq=False)
class Frame:
    """What is held fixed while Newton's method runs: combined closure rows, borders.

    The equations are smooth with it held, and their signs can be compared.
    """

    combine: np.ndarray
    borders: tuple[Borders, ...]


@dataclass(frozen=True, eq=False)
class Slice:
    """Closed postures on a chart, with coordinates, on which some measures vanish.

    A point z is (q, c): a posture (nq,) and the chart's varying coordinates (k,) [m or rad]. A
    step is (nv + k,), dimensionless.

    Attributes
    ----------
    chart : Chart
        Coordinates that vary, and those that are held.
    measures : tuple of Measure
        None for the closed postures themselves.
    """

    chart: Chart
    measures: tuple[Measure, ...] = ()

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism of the chart."""
        return self.chart.mechanism

    @cached_property
    def size(self) -> int:
        """Number of unknowns nv + k."""
        return int(self.mechanism.model.nv) + len(self.chart.names)

    @cached_property
    def unit(self) -> np.ndarray:
        """Unit of each unknown, (nv + k,)."""
        return np.concatenate([self.mechanism.column_scale, self.chart.scale])

    @cached_property
    def codimension(self) -> int:
        """Number of equations that the measures are."""
        return sum(m.codimension for m in self.measures)

    @cached_property
    def _tip(self) -> bool:
        return bool(self.chart.outputs) or any(m.needs_tip for m in self.measures)

    # -- points ----------------------------------------------------------------------------------

    def point(self, q: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Point z of a posture (nq,) and coordinates (k,), by default its own."""
        return np.concatenate([q, self.chart.values(q) if values is None else values])

    def posture(self, z: np.ndarray) -> np.ndarray:
        """Posture (nq,), or postures (n, nq)."""
        return z[..., : self.mechanism.model.nq]

    def coordinates(self, z: np.ndarray) -> np.ndarray:
        """Coordinates (k,), or (n, k)."""
        return z[..., self.mechanism.model.nq :]

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Point after a dimensionless step."""
        model, by = self.mechanism.model, step * self.unit
        q = pin.integrate(model, self.posture(z), by[: model.nv])
        return np.concatenate([q, self.coordinates(z) + by[model.nv :]])

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Dimensionless step from ``one`` to ``two``."""
        change = pin.difference(self.mechanism.model, self.posture(one), self.posture(two))
        return np.concatenate([change, self.coordinates(two) - self.coordinates(one)]) / self.unit

    # -- equations -------------------------------------------------------------------------------

    def frame(self, z: np.ndarray) -> Frame:
        """Combined rows and borders that suit a point and its neighbourhood."""
        at = kinematics(self.mechanism, self.posture(z), tip=self._tip)
        r = generic_rank(self.mechanism)
        if r == self.mechanism.rows and not self.unfold:
            combine = np.eye(r)
        else:
            combine = np.linalg.svd(at.closures)[0][:, :r].T
        return Frame(combine, tuple(m.borders(at, combine) for m in self.measures))

    @cached_property
    def unfold(self) -> bool:
        """Whether the closures themselves lose a row on the set: at constraint singularities.

        That row is left out, since two or more branches of closed postures meet there.
        """
        return any(m.kind == "constraint" for m in self.measures)

    def evaluate(self, z: np.ndarray, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) and Jacobian (rows, nv + k), dimensionless."""
        q, nv = self.posture(z), self.mechanism.model.nv
        at = kinematics(self.mechanism, q, tip=self._tip)
        closures = frame.combine[:-1] if self.unfold else frame.combine
        values, rows = [closures @ at.residual], [closures @ at.closures]
        coordinates, by_q, by_c = self._chart_rows(q, self.coordinates(z), at)
        for measure, borders in zip(self.measures, frame.borders, strict=True):
            g, gradient = measure.evaluate(q, at, frame.combine, borders)
            values.append(g)
            rows.append(gradient)
        jacobian = np.zeros((sum(v.size for v in values) + coordinates.size, self.size))
        first = jacobian.shape[0] - coordinates.size
        jacobian[:first, :nv] = np.vstack(rows)
        jacobian[first:, :nv], jacobian[first:, nv:] = by_q, by_c
        return np.concatenate([*values, coordinates]), jacobian

    def residual(self, z: np.ndarray) -> float:
        """Largest closure [m, rad], over all rows, and coordinate row; no measure."""
        q = self.posture(z)
        at = kinematics(self.mechanism, q, tip=self._tip)
        coordinates = self._chart_rows(q, self.coordinates(z), at)[0]
        closed = np.abs(at.residual * self.mechanism.row_scale).max(initial=0.0)
        return float(max(closed, np.abs(coordinates).max(initial=0.0)))

    def _chart_rows(
        self, q: np.ndarray, c: np.ndarray, at: Kinematics
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values (rows,) of the chart's rows, their derivatives by q (rows, nv), c (rows, k)."""
        chart, k = self.chart, c.size
        offsets = TURN * np.diag(chart.scale)
        pins, turns, places = chart.prescribed(np.vstack([c, c + offsets, c - offsets]))
        ahead, behind = slice(1, 1 + k), slice(1 + k, None)
        unit = self.mechanism.column_scale[chart.pinned_v]
        values = (q[chart.pinned_q] - pins[0]) / unit
        by_q = np.eye(self.mechanism.model.nv)[chart.pinned_v]
        by_c = (pins[behind] - pins[ahead]).T / unit[:, None] / (2.0 * TURN)
        if not chart.outputs:
            return values, by_q, by_c
        goal, by_twist = _goal_rows(at, turns[0], places[0], chart.outputs)
        # a twist of the target is the opposite twist of the tip
        target = np.zeros((6, k))
        target[:3] = (places[ahead] - places[behind]).T
        for i in range(k):
            target[3:, i] = pin.log3(turns[1 + i] @ turns[1 + k + i].T)
        goal_unit = np.array([self.mechanism.length if n in "xyz" else 1.0 for n in chart.outputs])
        by_twist = by_twist / goal_unit[:, None]
        return (
            np.concatenate([values, goal / goal_unit]),
            np.vstack([by_q, by_twist @ (at.tip * self.mechanism.column_scale)]),
            np.vstack([by_c, by_twist @ target / (-2.0 * TURN)]),
        )


def _goal_rows(
    at: Kinematics, turn: np.ndarray, place: np.ndarray, outputs: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a tip goal as ``closure.task`` has them, and their derivative by the tip's twist."""
    linear = [OUTPUTS.index(n) for n in outputs if n in "xyz"]
    angular = [OUTPUTS.index(n) - 3 for n in outputs if n in OUTPUTS[3:]]
    by_twist = np.zeros((len(outputs), 6))
    by_twist[range(len(linear)), linear] = 1.0
    values = [(at.place - place)[linear]]
    if len(angular) in (1, 3):
        relative = turn.T @ at.attitude
        values.append(pin.log3(relative)[angular])
        by_twist[len(linear) :, 3:] = (pin.Jlog3(relative) @ at.attitude.T)[angular]
    elif len(angular) == 2:
        (third,) = {0, 1, 2} - set(angular)
        axis = at.attitude[:, third]
        values.append(turn[:, angular].T @ axis)
        by_twist[len(linear) :, 3:] = np.cross(axis, turn[:, angular].T)
    return np.concatenate(values), by_twist
