"""Sparse Gaussian elimination of a matrix of expressions, unrolled in a fixed order of pivots.

The order comes from sample postures: among entries that are not small against their row in any of
them, the one that fills in least [Markowitz 1957]. A posture unlike the samples may meet a small
pivot all the same: ``least`` tells, so that whoever runs the tape can guard against it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.closure.tape.expression import Expr, Graph, Number, total
from closedchain.closure.tape.numbers import evaluate

THRESHOLD = 0.05  # share of the largest entry of its row that a pivot has in every sample

Sparse = dict[int, Expr]


@dataclass(frozen=True, eq=False)
class Elimination:
    """Factors L U = P A Q, entries as expressions.

    Attributes
    ----------
    pivots : tuple of (row, column, pivot)
        In the order of elimination.
    lower : tuple of dict
        For each step the multipliers of the rows below, by row.
    upper : tuple of dict
        For each step the rest of the pivot row, by column: later pivots' and free columns.
    free : tuple of int
        Columns without a pivot, where there are more columns than rows.
    """

    graph: Graph
    pivots: tuple[tuple[int, int, Expr], ...]
    lower: tuple[Sparse, ...]
    upper: tuple[Sparse, ...]
    free: tuple[int, ...]

    @property
    def least(self) -> Expr:
        """Smallest pivot in size."""
        found: Expr | None = None
        for _, _, pivot in self.pivots:
            found = abs(pivot) if found is None else found.min(abs(pivot))
        return self.graph.constant(1.0) if found is None else found

    def determinant(self, columns: Sequence[int]) -> Expr:
        """Determinant of the square matrix with its columns in the order given.

        Where there are free columns, that of the matrix with unit rows for them put below.
        """
        place = {c: i for i, c in enumerate(columns)}
        order = [c for _, c, _ in self.pivots] + list(self.free)
        sign = parity([r for r, _, _ in self.pivots]) * parity([place[c] for c in order])
        product = self.graph.constant(1.0)
        for _, _, pivot in self.pivots:
            product = product * pivot
        return product if sign > 0 else -product

    def numbers(self) -> list[Expr]:
        """All numbers of the factors, one after the other."""
        found = [pivot for _, _, pivot in self.pivots]
        return found + [x for part in (*self.lower, *self.upper) for x in part.values()]

    def renewed(self, graph: Graph, numbers: Sequence[Expr]) -> Elimination:
        """Return the same factors with their numbers from elsewhere, as ``numbers`` orders them."""
        rest = iter(numbers)
        pivots = tuple((row, column, next(rest)) for row, column, _ in self.pivots)
        lower, upper = (
            tuple({key: next(rest) for key in part} for part in side)
            for side in (self.lower, self.upper)
        )
        return Elimination(graph, pivots, lower, upper, self.free)

    def solve(self, right: Sequence[Expr], free: Sparse | None = None) -> Sparse:
        """x with A x = right (by row), with given values of the free columns (0 by default)."""
        known = dict(free or {})
        b = dict(enumerate(right))
        for (row, _, _), multipliers in zip(self.pivots, self.lower, strict=True):
            for below, factor in multipliers.items():
                b[below] = b[below] - factor * b[row]
        for (row, column, pivot), rest in zip(
            reversed(self.pivots), reversed(self.upper), strict=True
        ):
            value = b[row]
            for other, entry in rest.items():
                if other in known:
                    value = value - entry * known[other]
            known[column] = value * pivot.recip()
        return known

    def solve_transposed(self, right: Sparse) -> list[Expr]:
        """y (by row) with A^T y = right (by column) in the columns that have pivots."""
        zero = self.graph.constant(0.0)
        c = {column: right.get(column, zero) for _, column, _ in self.pivots}
        y: Sparse = {}
        for (row, column, pivot), rest in zip(self.pivots, self.upper, strict=True):
            y[row] = c[column] * pivot.recip()
            for other, entry in rest.items():
                if other in c:
                    c[other] = c[other] - entry * y[row]
        for (row, _, _), multipliers in zip(
            reversed(self.pivots), reversed(self.lower), strict=True
        ):
            for below, factor in multipliers.items():
                y[row] = y[row] - factor * y[below]
        return [y[row] for row in range(len(self.pivots))]

    def shortest(self, right: Sequence[Expr]) -> Sparse:
        """Shortest x with A x = right: with free columns, least in the Euclidean norm."""
        start = self.solve(right)
        if not self.free:
            return start
        directions = self.kernel()
        k = len(directions)
        gram = {
            a: {b: self.graph.lift(along(directions[a], directions[b])) for b in range(k)}
            for a in range(k)
        }
        slope = [self.graph.lift(along(directions[a], start)) for a in range(k)]
        shares = positive_solve(self.graph, gram, [-s for s in slope])
        found = {}
        columns = [c for _, c, _ in self.pivots] + list(self.free)
        zero = self.graph.constant(0.0)
        for c in columns:
            value = start.get(c, zero)
            for share, direction in zip(shares, directions, strict=True):
                if c in direction:
                    value = value + share * direction[c]
            found[c] = value
        return found

    def kernel(self) -> list[Sparse]:
        """Basis of the null space, one vector for each free column."""
        zero, one = self.graph.constant(0.0), self.graph.constant(1.0)
        nothing = [zero] * len(self.pivots)
        found = []
        for column in self.free:
            vector = self.solve(nothing, {column: one})
            found.append({c: e for c, e in vector.items() if e.value != 0.0})
        return found


def along(row: Sparse, motion: Sparse) -> Number:
    """A row times a column, both sparse; the number 0 where they have no entry in common."""
    return total(entry * motion[c] for c, entry in row.items() if c in motion)


def eliminate(
    graph: Graph,
    rows: Sequence[Sparse],
    columns: Sequence[int],
    samples: np.ndarray,
    carried: Sequence[int] = (),
) -> Elimination:
    """Factorise rows over ``columns`` (others are not looked at); at least as many as rows.

    ``samples`` (inputs, n) are values of the graph's inputs, real or complex, at which pivots must
    not be small.
    ``carried`` are further columns that are eliminated along and never have a pivot.

    Raises
    ------
    ArithmeticError
        No pivot is left: the rows are dependent at the samples.
    """
    open_ = set(columns)
    known = open_ | set(carried)
    live = {r: {c: e for c, e in row.items() if c in known} for r, row in enumerate(rows)}
    numbers = _numbers(graph, live, samples)
    pivots, lower, upper = [], [], []
    while live:
        row, column = _pivot(live, numbers, open_)
        rest = live.pop(row)
        pivot, size = rest.pop(column), numbers.pop(row)
        inverse = pivot.recip()
        multipliers = {}
        for below, entries in live.items():
            if column not in entries:
                continue
            factor = entries.pop(column) * inverse
            share = numbers[below].pop(column) / size[column]
            multipliers[below] = factor
            for c, e in rest.items():
                entries[c] = entries[c] - factor * e if c in entries else -(factor * e)
                numbers[below][c] = numbers[below].get(c, 0.0) - share * size[c]
        pivots.append((row, column, pivot))
        lower.append(multipliers)
        upper.append(rest)
    used = {c for _, c, _ in pivots}
    free = tuple(c for c in (*columns, *carried) if c not in used)
    return Elimination(graph, tuple(pivots), tuple(lower), tuple(upper), free)


def relative_change(lu: Elimination, before: Sequence[Sparse], now: Sequence[Sparse]) -> Expr:
    """Bound of ||(A - A') R|| for rows A before and A' now (that of ``lu``), where A' R = 1.

    Below 1 it shows that every matrix on the straight line between the two has full row rank:
    A' + s (A - A') times R is 1 + s (A - A') R. The bound of the norm is the smaller of Frobenius'
    and the geometric mean of the largest sums of rows and columns.
    """
    g = lu.graph
    zero, one = g.constant(0.0), g.constant(1.0)
    size = len(before)
    sums_of_rows, squares, largest_column = [zero] * size, zero, zero
    for k in range(size):
        unit = [one if r == k else zero for r in range(size)]
        inverse = lu.shortest(unit)
        column_sum = zero
        for r in range(size):
            entry = zero
            for c, value in inverse.items():
                change = before[r].get(c, zero) - now[r].get(c, zero)
                entry = entry + change * value
            column_sum = column_sum + abs(entry)
            sums_of_rows[r] = sums_of_rows[r] + abs(entry)
            squares = squares + entry * entry
        largest_column = largest_column.max(column_sum)
    largest_row = zero
    for row_sum in sums_of_rows:
        largest_row = largest_row.max(row_sum)
    return squares.min(largest_row * largest_column).sqrt()


def positive_solve(graph: Graph, matrix: dict[int, Sparse], right: Sequence[Expr]) -> list[Expr]:
    """Solve a small symmetric positive definite system, unrolled, in its own order."""
    n = len(right)
    a = {i: dict(matrix[i]) for i in range(n)}
    b = list(right)
    for k in range(n):
        inverse = a[k][k].recip()
        for i in range(k + 1, n):
            factor = a[i][k] * inverse
            for j in range(k + 1, n):
                a[i][j] = a[i][j] - factor * a[k][j]
            b[i] = b[i] - factor * b[k]
    x: list[Expr] = [graph.constant(0.0)] * n
    for k in reversed(range(n)):
        value = b[k]
        for j in range(k + 1, n):
            value = value - a[k][j] * x[j]
        x[k] = value * a[k][k].recip()
    return x


def small_determinant(graph: Graph, matrix: dict[int, Sparse]) -> Expr:
    """Determinant of a small matrix near a positive definite one, unrolled, in its own order."""
    n = len(matrix)
    a = {i: dict(matrix[i]) for i in range(n)}
    product = graph.constant(1.0)
    for k in range(n):
        product = product * a[k][k]
        inverse = a[k][k].recip()
        for i in range(k + 1, n):
            factor = a[i][k] * inverse
            for j in range(k + 1, n):
                a[i][j] = a[i][j] - factor * a[k][j]
    return product


def parity(order: Sequence[int]) -> int:
    """Sign of a permutation."""
    left, sign = list(order), 1
    for i in range(len(left)):
        while left[i] != i:
            j = left[i]
            left[i], left[j] = left[j], left[i]
            sign = -sign
    return sign


def _numbers(
    graph: Graph, live: dict[int, Sparse], samples: np.ndarray
) -> dict[int, dict[int, np.ndarray]]:
    """Values (n,) of every entry at the samples."""
    places = [(r, c) for r, row in live.items() for c in row]
    tape = graph.tape([live[r][c] for r, c in places], samples.shape[0])
    values = evaluate(tape, list(samples))
    found: dict[int, dict[int, np.ndarray]] = {r: {} for r in live}
    for (r, c), value in zip(places, values, strict=True):
        found[r][c] = np.broadcast_to(np.asarray(value, dtype=samples.dtype), samples.shape[1])
    return found


def _pivot(
    live: dict[int, Sparse], numbers: dict[int, dict[int, np.ndarray]], columns: set[int]
) -> tuple[int, int]:
    """Entry that fills in least, among those of ``columns`` never small against their row."""
    counts: dict[int, int] = {}
    for row in live.values():
        for c in row:
            counts[c] = counts.get(c, 0) + 1
    best: tuple[tuple[int, float], int, int] | None = None
    for r, row in live.items():
        here = [c for c in row if c in columns]
        if not here:
            raise ArithmeticError(f"row {r} depends on the others: no pivot is left")
        least_fill = min((len(row) - 1) * (counts[c] - 1) for c in here)
        if best is not None and least_fill > best[0][0]:
            continue
        sizes = {c: np.abs(numbers[r][c]) for c in row if c in columns}
        largest = np.maximum.reduce(list(sizes.values()))
        for c, size in sizes.items():
            share = float(np.min(size / np.maximum(largest, 1e-300)))
            if share < THRESHOLD:
                continue
            key = ((len(row) - 1) * (counts[c] - 1), -share)
            if best is None or key < best[0]:
                best = (key, r, c)
    if best is not None:
        return best[1], best[2]
    # no entry is large everywhere: the one whose worst share is largest
    worst = (-1.0, -1, -1)
    for r, row in live.items():
        sizes = {c: np.abs(numbers[r][c]) for c in row if c in columns}
        largest = np.maximum.reduce(list(sizes.values()))
        for c, size in sizes.items():
            share = float(np.min(size / np.maximum(largest, 1e-300)))
            worst = max(worst, (share, r, c))
    if worst[0] <= 1e-9:
        raise ArithmeticError(f"rows {sorted(live)} depend on the others: no pivot is left")
    return worst[1], worst[2]
