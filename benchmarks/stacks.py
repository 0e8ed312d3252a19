"""Gough-Stewart platforms on top of each other: how times grow with their number.

Machine code is made anew for each, in a cache folder of its own.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Sequence

import numpy as np

import closedchain as cc
from benchmarks.robots import stacked
from benchmarks.timing import OURS, Row, a_call, least

WORKS = ("load", "direct", "classify", "map cell", "first direct", "first map")


def rows(counts: Sequence[int], cells: int, repeats: int = 200) -> Iterator[Row]:
    """Rows of each stack, then the exponents of growth between the two largest."""
    found: dict[int, dict[str, Row]] = {}
    before = os.environ.get("CLOSEDCHAIN_CACHE")
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            os.environ["CLOSEDCHAIN_CACHE"] = folder
            try:
                found[count] = {row.work: row for row in stack(count, cells, repeats)}
            finally:
                os.environ.pop("CLOSEDCHAIN_CACHE")
                if before is not None:
                    os.environ["CLOSEDCHAIN_CACHE"] = before
        yield from found[count].values()
    for few, many in zip(counts[-2:-1], counts[-1:], strict=True):
        for work in WORKS:
            one, two = (found[n][work].seconds for n in (few, many))
            assert one is not None
            assert two is not None
            power = np.log(two / one) / np.log(many / few)
            yield Row("stacked", f"{work}: growth", note=f"N^{power:.2f} from {few} to {many}")


def stack(count: int, cells: int, repeats: int) -> Iterator[Row]:
    """Rows of a stack. The first calls make its machine code."""
    name = f"stacked, N = {count}"
    begin = time.process_time()
    m = stacked(count)
    yield Row(name, "load", OURS, time.process_time() - begin)
    inputs = m.input_values(m.home)
    begin = time.process_time()
    first = cc.direct(m, inputs + 1e-3).raise_if_failed()
    yield Row(name, "first direct", OURS, time.process_time() - begin, note="machine code made")
    target = inputs + 3e-3
    residual = cc.direct(m, target, first.q).raise_if_failed().residual
    seconds = a_call(lambda: cc.direct(m, target, first.q), repeats)
    yield Row(name, "direct", OURS, seconds, residual)
    seconds = a_call(lambda: cc.classify(m, first.q), max(3, repeats // 20), block=1)
    yield Row(name, "classify", OURS, seconds)
    axes = {
        n: np.linspace(x - 0.02, x + 0.02, cells)
        for n, x in zip(m.inputs[:2], inputs[:2], strict=True)
    }

    def whole() -> int:
        found = cc.singularity_map(m, axes, progress=False, workers=1)
        return int((found["status"] == 0).sum())

    begin = time.process_time()
    count = whole()
    yield Row(name, "first map", OURS, time.process_time() - begin, note="machine code made")
    seconds = least(whole, 2) / count
    yield Row(name, "map cell", OURS, seconds, note=f"{count} of {cells} x {cells} cells")
