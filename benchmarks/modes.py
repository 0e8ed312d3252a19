"""All postures: searched, counted for the first time and with what is kept on disk, and proved."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator

import closedchain as cc
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


def rows(robots: Iterable[str], *, first: bool = True) -> Iterator[Row]:
    """Rows for assembly modes at home's inputs; ``first`` without anything on disk, too."""
    for name in robots:
        m = cc.load(name)
        inputs = m.input_values(m.home)
        cc.postures(m, inputs=inputs, count=False)  # to warm up
        took, found = timed(lambda m=m, u=inputs: cc.postures(m, inputs=u, count=False))  # type: ignore[misc]
        yield row(name, SEARCHED, took, found)
        if first:
            with tempfile.TemporaryDirectory() as folder:
                before = os.environ.get("CLOSEDCHAIN_CACHE")
                os.environ["CLOSEDCHAIN_CACHE"] = folder
                try:
                    fresh = cc.load(name)
                    took, found = timed(lambda m=fresh, u=inputs: cc.postures(m, inputs=u))  # type: ignore[misc]
                finally:
                    if before is None:
                        del os.environ["CLOSEDCHAIN_CACHE"]
                    else:
                        os.environ["CLOSEDCHAIN_CACHE"] = before
            yield row(name, FIRST, took, found)
        cc.postures(m, inputs=inputs)
        took, found = timed(lambda m=m, u=inputs: cc.postures(m, inputs=u))  # type: ignore[misc]
        yield row(name, KEPT, took, found)
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
