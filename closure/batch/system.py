"""Order of elimination of a system of rows, from its structural zeros.

Which rows a step of Gaussian elimination touches follows from which joints each closure's loop
holds; partial pivoting chooses among those rows, so the lists hold for every posture.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from closedchain.closure.batch.tables import integers


class System(NamedTuple):
    """Columns and elimination of a matrix.

    Attributes
    ----------
    column : (nv,): column of each unknown, -1 where it has none
    unknown : (columns,): unknown of each column
    row_sign : parity of the rows in the order of their first slots, +1 or -1
    steps : (pivots, 4): begin, middle, end in ``slots``, column; see ``algebra.eliminate``
    slots : rows that may pivot, then rows that are only cleared, step by step
    """

    column: np.ndarray
    unknown: np.ndarray
    row_sign: float
    steps: np.ndarray
    slots: np.ndarray


def eliminated(
    pattern: np.ndarray, unknowns: Sequence[int], rest: Sequence[int] = (), cleared: int = 0
) -> System:
    """System with pivots in the columns of ``unknowns``, those of ``rest`` to their right.

    Parameters
    ----------
    pattern : (rows, nv) array of bool
        Entries that can differ from zero.
    unknowns : as many as rows that pivot
        Their columns are ordered so that little fills in [Markowitz 1957].
    cleared : int
        Rows at the end that never pivot.
    """
    rows, nv = pattern.shape
    pivoting = rows - cleared
    live = pattern.copy()
    free, left = list(range(pivoting)), list(unknowns)
    order: list[int] = []
    steps: list[tuple[int, int, int]] = []
    slots: list[int] = []
    firsts: list[int] = []
    while left:
        best: tuple[tuple[int, bool, int], int, list[int]] | None = None
        for v in left:
            touched = [r for r in free if live[r, v]]
            union = int(np.any(live[np.ix_(touched, left)], axis=0).sum())
            cost = (max(len(touched) - 1, 0) * max(union - 1, 0), not touched, v)
            if best is None or cost < best[0]:
                best = (cost, v, touched)
        assert best is not None
        _, v, touched = best
        pivots = touched or free[:1]
        extra = [r for r in range(pivoting, rows) if live[r, v]]
        steps.append((len(slots), len(slots) + len(pivots), len(slots) + len(pivots) + len(extra)))
        slots += [*pivots, *extra]
        live[pivots] = live[pivots].any(axis=0)
        live[extra] |= live[pivots[0]]
        firsts.append(pivots[0])
        free.remove(pivots[0])
        left.remove(v)
        order.append(v)
    unknown = [*order, *rest]
    column = np.full(nv, -1, dtype=np.int64)
    column[unknown] = np.arange(len(unknown))
    columns = [(*step, k) for k, step in enumerate(steps)]
    return System(
        column=column,
        unknown=np.array(unknown, dtype=np.int64),
        row_sign=float(parity(firsts)),
        steps=integers(columns, 4),
        slots=np.array(slots, dtype=np.int64),
    )


def dense(rows: int, first_row: int = 0, first_column: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Steps and slots of the elimination of a full square block."""
    steps: list[tuple[int, int, int, int]] = []
    slots: list[int] = []
    for k in range(rows):
        steps.append((len(slots), len(slots) + rows - k, len(slots) + rows - k, first_column + k))
        slots += list(range(first_row + k, first_row + rows))
    return integers(steps, 4), np.array(slots, dtype=np.int64)


def plain(unknowns: Sequence[int], nv: int) -> System:
    """System without elimination: unknowns in their order."""
    column = np.full(nv, -1, dtype=np.int64)
    column[list(unknowns)] = np.arange(len(unknowns))
    steps, slots = integers([], 4), np.zeros(0, dtype=np.int64)
    return System(column, np.array(unknowns, dtype=np.int64), 1.0, steps, slots)


def parity(order: Sequence[int] | np.ndarray) -> int:
    """Sign of a permutation."""
    left, sign = list(order), 1
    for i in range(len(left)):
        while left[i] != i:
            j = left[i]
            left[i], left[j] = left[j], left[i]
            sign = -sign
    return sign
