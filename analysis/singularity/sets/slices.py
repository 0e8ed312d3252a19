"""Equations of a slice: closures, coordinates of a chart, measures; unknowns are (q, c).

With the varying coordinates c among the unknowns, nothing special happens where the chart itself
fails: at a fold of the chart the solution turns round in c and goes on in q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.analysis.singularity.sets.bordered import Borders, Combine, Measure
from closedchain.analysis.singularity.sets.chart_rows import SliceRows
from closedchain.analysis.singularity.sets.postures_at import (
    FirstOrderCode,
    Postures,
    apart,
    first_order_code,
    moved,
)
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.chart import Chart
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.turns import turning, without_turns


@dataclass(frozen=True, eq=False)
class Frame:
    """What is held fixed while Newton's method runs: combined closure rows, borders.

    The equations are smooth with it held, and their signs can be compared. Of many points, each
    has its own.
    """

    combine: Combine
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
    def _turning(self) -> np.ndarray:
        return turning(self.mechanism)

    @cached_property
    def _code(self) -> FirstOrderCode:
        if self.measures:
            return self.measures[0].code
        return first_order_code(self.mechanism, ())

    @cached_property
    def _rows(self) -> SliceRows:
        return SliceRows(self.chart)

    # -- points: one (nq + k,) or many (n, nq + k) ------------------------------------------------

    def point(self, q: np.ndarray, values: np.ndarray | None = None) -> np.ndarray:
        """Points z of postures and coordinates (k,), by default their own."""
        values = self.chart.values(q) if values is None else values
        return np.concatenate([q, values], axis=-1)

    def posture(self, z: np.ndarray) -> np.ndarray:
        """Posture (nq,), or postures (n, nq)."""
        return z[..., : self.mechanism.model.nq]

    def coordinates(self, z: np.ndarray) -> np.ndarray:
        """Coordinates (k,), or (n, k)."""
        return z[..., self.mechanism.model.nq :]

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Points after dimensionless steps (nv + k,)."""
        nv, by = self.mechanism.model.nv, step * self.unit
        q = moved(self.mechanism, self.posture(z), by[..., :nv])
        return np.concatenate([q, self.coordinates(z) + by[..., nv:]], axis=-1)

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        """Dimensionless steps from ``one`` to ``two``, whole turns of joints left out."""
        change = apart(self.mechanism, self.posture(one), self.posture(two))
        change = without_turns(change, self._turning)
        shift = self.coordinates(two) - self.coordinates(one)
        return np.asarray(np.concatenate([change, shift], axis=-1) / self.unit)

    # -- equations: of one point or of many ------------------------------------------------------

    def at(self, z: np.ndarray) -> Postures:
        """Closures and task at points."""
        return self._code.at(self.posture(z))

    def frame(self, z: np.ndarray) -> Frame:
        """Combined rows and borders that suit points and their neighbourhood."""
        return self._frame(self.at(z))

    def _frame(self, at: Postures) -> Frame:
        r = generic_rank(self.mechanism)
        combine = None
        if r < self.mechanism.rows or self.unfold:
            combine = np.linalg.svd(at.closures)[0][..., :r].swapaxes(-1, -2)
        return Frame(combine, tuple(m.borders(at, combine) for m in self.measures))

    @cached_property
    def unfold(self) -> bool:
        """Whether the closures themselves lose rows on the set: at constraint singularities.

        These rows are left out, since two or more branches of closed postures meet there.
        """
        return self._unfolded > 0

    @cached_property
    def _unfolded(self) -> int:
        return sum(m.corank for m in self.measures if m.kind == "constraint")

    @cached_property
    def coranks(self) -> tuple[int, ...]:
        """Ranks that each measure's matrix loses on the set."""
        return tuple(m.corank for m in self.measures)

    def losing(self, coranks: Sequence[int]) -> Slice:
        """The same slice for losses of so many ranks."""
        both = zip(self.measures, coranks, strict=True)
        return Slice(self.chart, tuple(m.losing(k) for m, k in both))

    def values(self, z: np.ndarray) -> list[np.ndarray]:
        """Singular values of each measure's matrix at a point, falling."""
        at = self.at(z)
        combine = self._frame(at).combine
        return [m.values(at, combine) for m in self.measures]

    def lost(self, z: np.ndarray, share: float) -> tuple[int, ...]:
        """Number of singular values below a share of the largest one, for each measure."""
        return tuple(int((s <= share * s[0]).sum()) for s in self.values(z))

    def evaluate(self, z: np.ndarray, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) and Jacobian (rows, nv + k), dimensionless."""
        q, nv, at = self.posture(z), self.mechanism.model.nv, self.at(z)
        if frame.combine is None:
            values, rows = [at.residual], [at.closures]
        else:
            closures = frame.combine[..., : frame.combine.shape[-2] - self._unfolded, :]
            values = [(closures @ at.residual[..., None])[..., 0]]
            rows = [closures @ at.closures]
        coordinates, by_q, by_c = self._rows.at(q, self.coordinates(z))
        for measure, borders in zip(self.measures, frame.borders, strict=True):
            g, gradient = measure.evaluate(q, at, frame.combine, borders)
            values.append(g)
            rows.append(gradient)
        first, count = sum(part.shape[-2] for part in rows), coordinates.shape[-1]
        jacobian = np.zeros((*z.shape[:-1], first + count, self.size))
        begin = 0
        for part in rows:
            end = begin + part.shape[-2]
            jacobian[..., begin:end, :nv] = part
            begin = end
        jacobian[..., first:, :nv], jacobian[..., first:, nv:] = by_q, by_c
        return np.concatenate([*values, coordinates], axis=-1), jacobian

    def residual(self, z: np.ndarray) -> np.ndarray:
        """Largest closure [m, rad], over all rows, and coordinate row (...); no measure."""
        at = self.at(z)
        coordinates = self.apart_from(self.posture(z), self.coordinates(z))
        closed = np.abs(at.residual * self.mechanism.row_scale).max(axis=-1, initial=0.0)
        return np.maximum(closed, np.abs(coordinates).max(axis=-1, initial=0.0))

    def apart_from(self, q: np.ndarray, c: np.ndarray) -> np.ndarray:
        """Rows (..., p) of the chart that are zero where postures have the coordinates ``c``."""
        return self._rows.at(q, c)[0]
