"""Timing by processor time, and the rows that a run reports.

Processor time of the process does not grow where other programs share the machine's cores, though
they still take room in its caches: the least of several repeats is the least disturbed.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

OURS = "closedchain"


@dataclass(frozen=True)
class Row:
    """One measurement: processor ``seconds`` that ``tool`` takes for one ``work`` on ``robot``.

    ``residual`` is the largest closure row [m, rad] over all timed postures, by the tool's own
    account; ``tip_error`` [m] how far its tip ends from the one of this package. None where a tool
    was not run or has nothing of the kind; ``note`` says why, or what the time is for.
    """

    robot: str
    work: str
    tool: str = OURS
    seconds: float | None = None
    residual: float | None = None
    tip_error: float | None = None
    note: str = ""


def least(work: Callable[[], object], repeats: int) -> float:
    """Least processor time of ``work()`` over ``repeats`` calls."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def a_call(work: Callable[[], object], repeats: int, block: int = 20) -> float:
    """Processor time of a call that takes microseconds: the least mean over blocks of calls."""

    def several() -> None:
        for _ in range(block):
            work()

    several()
    return least(several, max(1, repeats // block)) / block


def of_process(
    command: Sequence[str], environment: Mapping[str, str] | None = None, repeats: int = 1
) -> float:
    """Median processor time of a process and its children, user and system.

    Raises
    ------
    CalledProcessError
        It fails.
    """
    times = []
    for _ in range(repeats):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            command,
            env={**os.environ, **(environment or {})},
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=600.0,
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    return statistics.median(times)
