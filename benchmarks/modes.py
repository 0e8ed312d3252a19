"""All postures: searched, counted for the first time and with what is kept on disk, and proved.

Beside the counts of platforms stands msolve, which finds all of their real postures, too.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator

import closedchain as cc
from benchmarks.msolve_peer import solve_with_msolve
from benchmarks.timing import OURS, Row
from closedchain.closure.modes.certificates import certified
from closedchain.closure.modes.result import Postures
from closedchain.closure.position import driven

SEARCHED, FIRST, KEPT, PROVED = (
    "all assembly modes, searched",
    "the same, counted for the first time on a machine",
    "the same, counted with generic solutions on disk",
    "a posture proved to be alone",
)


ROBOTS = ("three_rps", "gough_stewart dietmaier", "eclipse", "linear_delta", "rus6", "d1")
PLATFORMS = ("three_rps", "gough_stewart dietmaier")


def rows(robots: Iterable[str] = ROBOTS, *, first: bool = True) -> Iterator[Row]:
    """Rows for assembly modes at home's inputs; ``first`` without anything on disk, too.

    A robot is a name of the catalogue, with a variant behind it or not.
    """
    for name in robots:

        def load(name: str = name) -> cc.Mechanism:
            robot, _, variant = name.partition(" ")
            return cc.load(robot, variant=variant or None)

        m = load()
        inputs = m.input_values(m.home)
        cc.postures(m, inputs=inputs, count=False)  # to warm up
        took, found = timed(lambda m=m, u=inputs: cc.postures(m, inputs=u, count=False))  # type: ignore[misc]
        yield row(name, SEARCHED, took, found)
        if first:
            with tempfile.TemporaryDirectory() as folder:
                before = os.environ.get("CLOSEDCHAIN_CACHE")
                os.environ["CLOSEDCHAIN_CACHE"] = folder
                try:
                    fresh = load()
                    took, found = timed(lambda m=fresh, u=inputs: cc.postures(m, inputs=u))  # type: ignore[misc]
                finally:
                    if before is None:
                        del os.environ["CLOSEDCHAIN_CACHE"]
                    else:
                        os.environ["CLOSEDCHAIN_CACHE"] = before
            yield row(name, FIRST, took, found)
            if name in PLATFORMS:
                yield solve_with_msolve(name, FIRST, m)
        cc.postures(m, inputs=inputs)
        took, found = timed(lambda m=m, u=inputs: cc.postures(m, inputs=u))  # type: ignore[misc]
        yield row(name, KEPT, took, found)
        if name in PLATFORMS:
            yield solve_with_msolve(name, KEPT, m)
        problem = driven(m)
        certified(problem, found.q, inputs)
        begin = time.process_time()
        certified(problem, found.q, inputs)
        each = (time.process_time() - begin) / len(found)
        yield Row(name, PROVED, OURS, each, None, None, f"{found.certified.sum()} of {len(found)}")


def timed(ask: Callable[[], Postures]) -> tuple[float, Postures]:
    """Processor time [s] of a question, and its answer."""
    begin = time.process_time()
    found = ask()
    return time.process_time() - begin, found


def row(name: str, work: str, took: float, found: Postures) -> Row:
    """Row with what was found as a note."""
    said = f"{len(found)} real"
    if found.complex_count is not None:
        said += f" of {found.complex_count}"
    return Row(name, work, OURS, took, float(found.residual.max()), None, said)
