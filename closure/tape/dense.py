"""Small dense linear algebra on a tape: unrolled, stable without a choice of pivots by samples.

Matrices are lists of rows of expressions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from closedchain.closure.tape.expression import Expr, Graph, total

Columns = list[list[Expr]]


def inner(g: Graph, a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    """Return a . b."""
    return g.lift(total(x * y for x, y in zip(a, b, strict=True)))


def triangle(g: Graph, columns: Sequence[Sequence[Expr]]) -> Columns:
    """Upper triangular R, as rows, of A = Q R for the columns of A (modified Gram-Schmidt).

    R is as good as that of Householder's method [Bjorck 1967]; Q is not formed.
    """
    left = [list(column) for column in columns]
    n = len(left)
    zero = g.constant(0.0)
    r = [[zero] * n for _ in range(n)]
    for i in range(n):
        square = inner(g, left[i], left[i])
        inverse = square.recip()
        size = square.sqrt()
        r[i][i] = size
        for j in range(i + 1, n):
            share = inner(g, left[i], left[j]) * inverse
            r[i][j] = share * size
            left[j] = [b - share * a for a, b in zip(left[i], left[j], strict=True)]
    return r


def over_triangle(g: Graph, rows: Sequence[Sequence[Expr]], upper: Columns) -> Columns:
    """X R^-1 for the rows of X and an upper triangular R."""
    n = len(upper)
    inverses = [upper[i][i].recip() for i in range(n)]
    found = []
    for row in rows:
        x: list[Expr] = []
        for j in range(n):
            x.append((row[j] - inner(g, x, [upper[i][j] for i in range(j)])) * inverses[j])
        found.append(x)
    return found


def determinant(g: Graph, matrix: Sequence[Sequence[Expr]]) -> Expr:
    """Determinant of a square matrix, by elimination with the largest pivot of each column."""
    a = [list(row) for row in matrix]
    n = len(a)
    product = g.constant(1.0)
    numbers = [[x.value for x in row] for row in a]
    if n and not any(x is None for row in numbers for x in row):
        return g.constant(float(np.linalg.det(np.array(numbers, dtype=float))))
    for k in range(n):
        for i in range(k + 1, n):
            larger = abs(a[k][k]) < abs(a[i][k])
            first, second = a[k], a[i]
            # the rows change places and one its sign: the determinant stays
            a[k] = first[:k] + [larger.select(y, x) for x, y in zip(first[k:], second[k:])]
            a[i] = second[:k] + [larger.select(-x, y) for x, y in zip(first[k:], second[k:])]
        pivot = a[k][k]
        product = product * pivot
        inverse = (abs(pivot) > 0.0).select(pivot, 1.0).recip()
        for i in range(k + 1, n):
            factor = a[i][k] * inverse
            a[i] = a[i][: k + 1] + [
                y - factor * x for x, y in zip(a[k][k + 1 :], a[i][k + 1 :], strict=True)
            ]
    return product


def gram_root(g: Graph, rows: Sequence[dict[int, Expr]]) -> Expr:
    """Square root of det (1 + X X^T) for sparse rows X: Cholesky's method."""
    n = len(rows)
    one = g.constant(1.0)
    a = [
        [
            g.lift(total(rows[i][c] * rows[j][c] for c in rows[i] if c in rows[j]))
            + (one if i == j else 0.0)
            for j in range(i + 1)
        ]
        for i in range(n)
    ]
    product = one
    for k in range(n):
        product = product * a[k][k]
        inverse = a[k][k].recip()
        for i in range(k + 1, n):
            factor = a[i][k] * inverse
            for j in range(k + 1, i + 1):
                a[i][j] = a[i][j] - factor * a[j][k]
    return product.sqrt()
