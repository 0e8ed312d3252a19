"""Timing, and the rows that a run reports."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One measurement: median ``seconds`` that ``tool`` takes for ``work`` on ``robot``.

    ``residual`` is the largest closure row [m, rad] over all timed postures, by the tool's own
    account; ``tip_error`` [m] how far its tip ends from the one of this package. None where a tool
    was not run or has nothing of the kind; ``note`` says why.
    """

    robot: str
    work: str
    tool: str
    seconds: float | None = None
    residual: float | None = None
    tip_error: float | None = None
    note: str = ""


def median_seconds(work: Callable[[int], object], repeats: int) -> float:
    """Median time of ``work(i)`` over ``repeats`` calls, after a tenth as many to warm up."""
    for i in range(max(1, repeats // 10)):
        work(i)
    times = []
    for i in range(repeats):
        begin = time.perf_counter()
        work(i)
        times.append(time.perf_counter() - begin)
    return statistics.median(times)
