"""The singular values that are watched: from squares, from factors, or by rotations.

Each way is taken only where it keeps the digits: an error of 1e-12 of the largest value at most.
"""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.algebra import mend, orthogonalise, singular_values
from closedchain.closure.batch.compiled import entry, kernel
from closedchain.closure.batch.lanczos import smallest
from closedchain.closure.batch.tridiagonal import smallest_eigenvalue

_EXACT = 1e-14  # error allowed of a singular value, against the Frobenius norm
_SMALL = 5e-3  # share of the Frobenius norm below which squares lose too many digits


@entry
def smallest_value(
    matrix: np.ndarray,
    rows: int,
    cols: int,
    product: np.ndarray,
    lu: np.ndarray,
    factored: bool,
    doubtful: bool,
    norm: float,
    vectors: np.ndarray,
    basis: np.ndarray,
    shares: np.ndarray,
    alpha: np.ndarray,
    beta: np.ndarray,
    small: np.ndarray,
) -> float:
    """Smallest of the min(rows, cols) singular values of a leading block.

    ``product`` holds A A^T; ``lu`` the factors of A where ``factored``; ``doubtful`` asks them
    first whether the value is small.
    """
    if rows == 0 or cols == 0:
        return 1.0
    sigma, good, doubtful = 0.0, False, doubtful and factored
    if factored:
        mend(lu, 1e-17 * norm)
        if doubtful:
            sigma, good = smallest(lu, _EXACT * norm, 2.0 * _SMALL * norm, basis, alpha, beta)
            doubtful = not good and sigma <= _SMALL * norm
    if not good and not doubtful and rows <= cols:
        value = smallest_eigenvalue(product, rows, vectors, basis[0], basis[1], small, basis[2])
        sigma = math.sqrt(max(value, 0.0))
        good = sigma > _SMALL * norm
        if factored and not good:
            sigma, good = smallest(lu, _EXACT * norm, math.inf, basis, alpha, beta)
    if not good:
        sigma = _orthogonal(matrix, rows, cols, norm, vectors, basis, shares, alpha, beta, small)
    return sigma


@entry
def _orthogonal(
    matrix: np.ndarray,
    rows: int,
    cols: int,
    norm: float,
    vectors: np.ndarray,
    basis: np.ndarray,
    shares: np.ndarray,
    alpha: np.ndarray,
    beta: np.ndarray,
    small: np.ndarray,
) -> float:
    """Smallest of the min(rows, cols) singular values of a leading block, by its triangular factor.

    Where Lanczos on that is not certified, by rotating the rows until they are orthogonal.
    """
    if rows == 0 or cols == 0:
        return 1.0
    count, length = min(rows, cols), max(rows, cols)
    _lay_flat(matrix, rows, cols, vectors)
    orthogonalise(vectors, count, length, count, basis, shares, 0.0, False)
    triangle = np.zeros((count, count))
    for a in range(count):
        for b in range(a, count):
            triangle[a, b] = shares[a, b]
    mend(triangle, 1e-17 * norm)
    sigma, good = smallest(triangle, _EXACT * norm, math.inf, basis, alpha, beta)
    if not good:
        _lay_flat(matrix, rows, cols, vectors)
        singular_values(vectors, count, length, small)
        sigma = small[count - 1]
    return sigma


@kernel
def _lay_flat(matrix: np.ndarray, rows: int, cols: int, vectors: np.ndarray) -> None:
    """Copy of a leading block with no more rows than columns: transposed where it has more."""
    for a in range(rows):
        for b in range(cols):
            if rows <= cols:
                vectors[a, b] = matrix[a, b]
            else:
                vectors[b, a] = matrix[a, b]


@kernel
def exact_values(
    raw: np.ndarray,
    rows: int,
    d: int,
    nv: int,
    n: int,
    r: int,
    vectors: np.ndarray,
    small: np.ndarray,
    out: np.ndarray,
    i: int,
    first: int,
) -> None:
    """All three values where K has a larger rank than r: the numbers asked for, of K as it is."""
    for kind in range(3):
        height = rows + d if kind == 1 else rows
        width = n if kind == 0 else nv
        number = min(r, n) if kind == 0 else (r + d if kind == 1 else r)
        if kind == 1 and d == 0:
            continue
        _lay_flat(raw, height, width, vectors)
        singular_values(vectors, min(height, width), max(height, width), small)
        value = 1.0 if number == 0 else 0.0
        if 0 < number <= min(height, width):
            value = small[number - 1]
        out[i, first + kind] = value
