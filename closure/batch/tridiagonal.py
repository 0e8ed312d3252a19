"""The smallest eigenvalue of a small symmetric matrix, by Householder's tridiagonal form.

Backward stable whatever the spectrum: the error is a few roundings of the largest eigenvalue
[Golub, Van Loan, Matrix Computations, 8.3]. Of A A^T it gives the smallest singular value of A,
with digits to spare as long as that is not small.
"""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.compiled import kernel


@kernel
def gram(
    matrix: np.ndarray,
    across: np.ndarray,
    rows: int,
    end_row: int,
    begin: int,
    end: int,
    out: np.ndarray,
    fresh: bool,
) -> None:
    """Add products of rows over columns begin to end to rows up to end_row of out, lower half.

    ``across`` is the transposed matrix; zeros, of which there are many, are skipped.
    """
    for i in range(rows, end_row):
        if fresh:
            for j in range(i + 1):
                out[i, j] = 0.0
        for x in range(begin, end):
            factor = matrix[i, x]
            if factor != 0.0:
                for j in range(i + 1):
                    out[i, j] += factor * across[x, j]


@kernel
def smallest_eigenvalue(
    source: np.ndarray,
    n: int,
    a: np.ndarray,
    v: np.ndarray,
    w: np.ndarray,
    diagonal: np.ndarray,
    off: np.ndarray,
) -> float:
    """Smallest eigenvalue of the positive matrix whose lower half is in source (n, n).

    ``a`` (n, n), ``v``, ``w``, ``diagonal``, ``off`` (n,) are scratch.
    """
    for i in range(n):
        for j in range(i + 1):
            a[i, j] = source[i, j]
    # from the last row up: what is left is the leading block, whose rows begin at 0
    for k in range(n - 1, 0, -1):
        size = 0.0
        for j in range(k - 1):
            size += a[k, j] * a[k, j]
        last = a[k, k - 1]
        diagonal[k] = a[k, k]
        if size == 0.0:
            off[k] = last
            continue
        length = math.sqrt(size + last * last)
        if last > 0.0:
            length = -length
        off[k] = length
        for j in range(k):
            v[j] = a[k, j]
        v[k - 1] = last - length
        beta = 2.0 / (size + v[k - 1] * v[k - 1])
        # w = A v from the lower half: each row serves as a column too
        along = 0.0
        for i in range(k):
            x = v[i]
            total = a[i, i] * x
            for j in range(i):
                total += a[i, j] * v[j]
                w[j] += x * a[i, j]
            w[i] = total
        for i in range(k):
            w[i] *= beta
            along += w[i] * v[i]
        along *= 0.5 * beta
        for i in range(k):
            w[i] -= along * v[i]
        for i in range(k):
            x, y = v[i], w[i]
            for j in range(i + 1):
                a[i, j] -= x * w[j] + y * v[j]
    diagonal[0] = a[0, 0]
    return _least_root(diagonal, off, n)


@kernel
def _least_root(diagonal: np.ndarray, off: np.ndarray, n: int) -> float:
    """Laguerre's method from 0: it rises to the least eigenvalue, with third order at the end."""
    x = 0.0
    for _ in range(40):
        # pivots d of T - x and their derivatives: sums of 1/(lambda - x) and its square
        d, first, second = diagonal[0] - x, -1.0, 0.0
        if not d > 0.0:
            return x
        s1 = 1.0 / d
        s2 = s1 * s1
        for i in range(1, n):
            inverse = 1.0 / d
            b = off[i] * off[i] * inverse
            slope = first * inverse
            second = b * (second * inverse - 2.0 * slope * slope)
            first = -1.0 + b * slope
            d = diagonal[i] - x - b
            if not d > 0.0:
                return x
            inverse = 1.0 / d
            slope = first * inverse
            s1 -= slope
            s2 += slope * slope - second * inverse
        root = (n - 1) * (n * s2 - s1 * s1)
        step = n / (s1 + (math.sqrt(root) if root > 0.0 else 0.0))
        x += step
        if step <= 1e-16 * x:
            break
    return x
