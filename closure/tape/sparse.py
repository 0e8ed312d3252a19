"""Sparse normal equations as expressions, eliminated in an order that fills in little."""

from __future__ import annotations

from collections.abc import Sequence

from closedchain.closure.tape.expression import Expr, Graph

Sparse = dict[int, Expr]
Symmetric = dict[int, Sparse]
"""Entries of a symmetric matrix by row, both halves."""


def normal_equations(
    graph: Graph, rows: Sequence[Sparse], values: Sequence[Expr], columns: Sequence[int]
) -> tuple[Symmetric, Sparse]:
    """A^T A and A^T values over ``columns`` of rows; every column has its diagonal entry."""
    zero, wanted = graph.constant(0.0), set(columns)
    matrix: Symmetric = {c: {c: zero} for c in columns}
    slope: Sparse = dict.fromkeys(columns, zero)
    for row, value in zip(rows, values, strict=True):
        entries = [(c, e) for c, e in sorted(row.items()) if c in wanted]
        for i, (a, x) in enumerate(entries):
            slope[a] = slope[a] + x * value
            for b, y in entries[i:]:
                entry = matrix[a].get(b, zero) + x * y
                matrix[a][b] = matrix[b][a] = entry
    return matrix, slope


def positive_solve(matrix: Symmetric, right: Sparse) -> Sparse:
    """x with A x = right for a positive definite matrix, by rows, in order of least degree."""
    a = {r: dict(row) for r, row in matrix.items()}
    b = dict(right)
    done: list[tuple[int, Expr, Sparse]] = []
    while a:
        pivot = min(a, key=lambda r: (len(a[r]), r))
        row = a.pop(pivot)
        inverse = row.pop(pivot).recip()
        for i in row:
            del a[i][pivot]
        others = sorted(row)
        for k, i in enumerate(others):
            factor = row[i] * inverse
            for j in others[k:]:
                old = a[i].get(j)
                change = factor * row[j]
                a[i][j] = a[j][i] = -change if old is None else old - change
            b[i] = b[i] - factor * b[pivot]
        done.append((pivot, inverse, row))
    x: Sparse = {}
    for pivot, inverse, row in reversed(done):
        value = b[pivot]
        for j, entry in row.items():
            value = value - entry * x[j]
        x[pivot] = value * inverse
    return x
