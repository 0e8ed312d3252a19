"""Small dense linear algebra on a tape: unrolled, stable without a choice of pivots by samples.

Matrices are lists of rows of expressions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from closedchain.closure.tape.expression import Expr, Graph, total

Columns = list[list[Expr]]

TINY = 1e-290


def inner(g: Graph, a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
    """Return a . b, of long vectors in several sums side by side."""
    terms = [x * y for x, y in zip(a, b, strict=True)]
    if len(terms) < 9:
        return g.lift(total(terms))
    one, two, three, four = (total(terms[k::4]) for k in range(4))
    return g.lift((one + two) + (three + four))


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
            for c in range(k, n):
                x, y = first[c], second[c]
                first[c], second[c] = larger.select(y, x), larger.select(-x, y)
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


def bidiagonal(g: Graph, matrix: Sequence[Sequence[Expr]]) -> tuple[list[Expr], list[Expr]]:
    """Squares of a bidiagonal matrix with the same singular values: diagonal, then beside it.

    By Householder's reflections from both sides, of a matrix (p, q); min(p, q) on the diagonal.
    """
    a = [list(row) for row in matrix]
    if a and len(a) > len(a[0]):
        a = [list(column) for column in zip(*a, strict=True)]
    p = len(a)
    diagonal, beside = [], []
    for k in range(p):
        along, rest = a[k][k:], [row[k:] for row in a[k + 1 :]]
        square, rest = reflected(g, along, rest)
        diagonal.append(square)
        for i, row in enumerate(rest):
            a[k + 1 + i][k:] = row
        if k + 1 == p:
            continue
        down = [row[k] for row in a[k + 1 :]]
        others = [[row[c] for row in a[k + 1 :]] for c in range(k + 1, len(a[k]))]
        square, others = reflected(g, down, others)
        beside.append(square)
        for c, column in enumerate(others):
            for i, value in enumerate(column):
                a[k + 1 + i][k + 1 + c] = value
    return diagonal, beside


def reflected(
    g: Graph, vector: Sequence[Expr], others: Sequence[Sequence[Expr]]
) -> tuple[Expr, list[list[Expr]]]:
    """Turn a vector onto the first axis by a reflection, and others along.

    Returns the square of its length, and the other vectors.
    """
    square = inner(g, vector, vector)
    if len(vector) == 1:
        return square, [list(other) for other in others]
    size = square.sqrt()
    first = vector[0] + (vector[0] < 0.0).select(-size, size)
    normal = [first, *vector[1:]]
    half = square + abs(vector[0]) * size
    share = (half > TINY).select(half, 1.0).recip()
    found = []
    for other in others:
        amount = inner(g, normal, other) * share
        found.append([x - amount * n for x, n in zip(other, normal, strict=True)])
    return square, found
