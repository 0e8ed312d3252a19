"""The kernels that ``Batch`` calls: what has to be compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from closedchain.closure.batch.evaluate import evaluate
from closedchain.closure.batch.measures import measure
from closedchain.closure.batch.search import search
from closedchain.closure.batch.spread import solve, spread

ENTRIES = (evaluate, measure, solve, spread, search)


def warm(tables: Any, tip: Any, problem: Any, equations: Any) -> None:
    """Call every kernel on no posture, which loads or compiles it."""
    numbers, many = np.zeros((0, 0)), np.zeros((0, 0, 0))
    integers, codes = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int8)
    postures = np.zeros((0, tables.limits.shape[1]))
    evaluate(tables, integers, postures, True, numbers, many)
    measure(tables, tip, problem, postures, True, numbers)
    solve(tables, tip, equations, postures, numbers, codes)
    search(tables, tip, equations, postures, True, numbers, postures, codes)
    one = np.ones(1, dtype=np.int64)
    spread(
        tables, tip, equations, one, numbers, codes, postures, integers, 0, codes.copy(), one.copy()
    )
