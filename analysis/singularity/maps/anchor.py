"""The cell from which a branch is followed: the nearest to the start that can be reached."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from closedchain.analysis.singularity.maps.grid import Grid
from closedchain.closure.chart import Chart
from closedchain.closure.nearest import LIMIT_TOLERANCE
from closedchain.closure.solve.flood import ARRIVED, CLOSED
from closedchain.closure.solve.hops import SMALLEST_STEP
from closedchain.closure.solve.path import Way, follower_of
from closedchain.closure.solve.ways import follow
from closedchain.urdf.errors import ClosureError

TRIED = 9
"""Cells that are tried, nearest first."""
_AROUND = 4  # positions along each axis among which the nearest cells are looked for


@dataclass(frozen=True, eq=False)
class Anchor:
    """A cell with its posture (nq,)."""

    cell: tuple[int, ...]
    q: np.ndarray


def anchor_of(grid: Grid) -> Anchor:
    """Reach a cell from the start along a straight line of the grid's coordinates.

    Raises
    ------
    ClosureError
        None of the cells nearest to the start can be reached.
    """
    chart = grid.chart
    begin = chart.values(grid.start)
    why = ""
    for cell in _nearest(grid, begin):
        target = grid.coordinates(np.array([cell]))[0]
        way = _way(chart, grid.start, begin, target)
        if not way.started.all():
            raise ClosureError(
                "the start of the map is singular for its coordinates: no branch can be followed "
                "from it; give a posture elsewhere (at=) or other coordinates"
            )
        if way.codes[0] == ARRIVED and _proper(chart, way.q, target):
            return Anchor(cell, way.q[0])
        why = why or _why(grid, begin, target, way)
    raise ClosureError(
        f"the map's first cell cannot be reached, nor can the next ones: {why}. Choose values "
        "nearer to the start, other held values (at=) or another posture (at=, mode=)"
    )


def _way(chart: Chart, q: np.ndarray, begin: np.ndarray, end: np.ndarray) -> Way:
    """Way of the branch of a posture (nq,) between coordinates (k,)."""
    one, two = (chart.targets(values) for values in (begin, end))
    return follow(chart.problem, q[None], one, two, SMALLEST_STEP)


def _proper(chart: Chart, q: np.ndarray, values: np.ndarray) -> bool:
    """Whether a posture (1, nq) is closed and within limits, no joint mirrored, no tip reversed."""
    columns = np.hstack([q, chart.targets(values)]).T
    largest, sense, facing, within = follower_of(chart.problem).check.run(columns)[:, 0]
    return bool(largest < CLOSED and sense >= 0.0 and facing >= 0.0 and within >= -LIMIT_TOLERANCE)


def _nearest(grid: Grid, begin: np.ndarray) -> Iterator[tuple[int, ...]]:
    """Cells by their distance from coordinates (k,), in cells."""
    choices = [
        np.sort(np.argsort(np.abs(axis - b), kind="stable")[:_AROUND])
        for axis, b in zip(grid.values, begin, strict=True)
    ]
    spans = [float(np.diff(axis).mean()) for axis in grid.values]
    cells = list(product(*(tuple(int(i) for i in c) for c in choices)))
    places = grid.coordinates(np.array(cells))
    far = np.linalg.norm((places - begin) / spans, axis=1)
    return (cells[i] for i in np.argsort(far, kind="stable")[:TRIED])


def _why(grid: Grid, begin: np.ndarray, target: np.ndarray, way: Way) -> str:
    reached = float(way.reached[0])
    if way.codes[0] == ARRIVED:
        return f"at {_place(grid, target)} a joint is beyond its limits or mirrored"
    end = begin + reached * (target - begin)
    folds = grid.chart.folds
    kind = "a singularity of these coordinates" if folds is None else f"a singularity ({folds})"
    return (
        f"the straight way to {_place(grid, target)} ends after {reached:.1%}, at "
        f"{_place(grid, end)}, at {kind}"
    )


def _place(grid: Grid, values: np.ndarray) -> str:
    return ", ".join(f"{n}={v:.6g}" for n, v in zip(grid.names, values, strict=True))
