"""Ranges that nobody gave: wide enough for what the modes reach, and no wider."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from closedchain.closure.chart import Chart
from closedchain.closure.modes.connections.covering import Branches, Covering, covering_of
from closedchain.closure.modes.connections.window import SPAN, Wanted, around, window_of
from closedchain.closure.progress import Count

COARSE = {1: 60, 2: 20, 3: 8}
"""Cells along an axis of the grid that ranges are fitted on, by the number of coordinates."""

GROWTHS = 3  # times that a range is doubled where the modes reach its end

Range = tuple[float, float]


def fitted(
    chart: Chart, wanted: Wanted, q: np.ndarray, branches: Branches, report: Count | None = None
) -> Wanted:
    """The same with all ranges given: on a coarse grid modes (n, nq) do not reach beyond them.

    A range is doubled, on the side where they do, at most ``GROWTHS`` times.
    """
    k = len(chart.names)
    given = {name: x for name, x in wanted.ranges.items() if x is not None}
    ranges = {name: given.get(name) or around(chart, name, wanted) for name in chart.names}
    free = [name for name in chart.names if name not in given and not _whole(ranges[name])]
    spans = {name: [SPAN, SPAN] for name in free}
    for _ in range(GROWTHS + 1):
        if not free:
            break
        window = window_of(chart, replace(wanted, ranges=ranges, resolution=COARSE[k]))
        covering = covering_of(window, q, branches, report)
        grown = dict(ranges)
        for name in free:
            for side, reached in enumerate(_reached(covering, name)):
                spans[name][side] *= 2.0 if reached else 1.0
            low, high = (around(chart, name, wanted, span)[i] for i, span in enumerate(spans[name]))
            grown[name] = low, high
        if grown == ranges:
            break
        ranges = grown
    for name in free:
        ranges[name] = _around_all(covering, name)
    return replace(wanted, ranges=ranges)


def _whole(given: Range) -> bool:
    return abs(given[1] - given[0] - 2.0 * np.pi) < 1e-9


def _reached(covering: Covering, name: str) -> tuple[bool, bool]:
    """Whether modes reach the lower and the upper end of a range."""
    axis = covering.window.names.index(name)
    index = np.unravel_index(covering.point, covering.window.shape)[axis]
    return bool((index == 0).any()), bool((index == covering.window.shape[axis] - 1).any())


def _around_all(covering: Covering, name: str) -> Range:
    """What the modes reach of a range, and a cell beyond."""
    axis = covering.window.names.index(name)
    line = covering.window.axes[axis]
    index = np.unravel_index(covering.point, covering.window.shape)[axis]
    low, high = max(int(index.min()) - 1, 0), min(int(index.max()) + 1, len(line) - 1)
    return float(line[low]), float(line[high])
