"""Redundant closure rows combined into independent ones, and the twist map by least squares."""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.algebra import dot, orthogonalise
from closedchain.closure.batch.compiled import entry, kernel

_RANK = 1e-9  # as closure.ranks.RANK_TOLERANCE
_IDLE = 1e-9  # as analysis.velocity: a tip or loop at rest


@kernel
def combine(
    home: np.ndarray,
    r: int,
    raw: np.ndarray,
    rows: int,
    vectors: np.ndarray,
    basis: np.ndarray,
    shares: np.ndarray,
    matrix: np.ndarray,
) -> tuple[bool, float]:
    """K' = Q K into matrix[:r]; whether K has more than rank r, and the sense of Q against home."""
    nv = raw.shape[1]
    for a in range(rows):
        for b in range(nv):
            vectors[b, a] = raw[a, b]
    rank, rest, first, _ = orthogonalise(vectors, nv, rows, r, basis, shares, 0.0, True)
    for a in range(r):
        for b in range(nv):
            matrix[a, b] = shares[a, b] if a < rank else 0.0
    sense = 1.0
    if home.shape[0] > 0:
        for a in range(r):
            for b in range(r):
                vectors[a, b] = dot(home[a], basis[b], rows) if b < rank else 0.0
        sense = _determinant(vectors, r)
    return rest > _RANK * first, -1.0 if sense < 0.0 else 1.0


@kernel
def _determinant(matrix: np.ndarray, n: int) -> float:
    """Determinant of the leading block (n, n), which is destroyed."""
    product = 1.0
    for k in range(n):
        at = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[at, k]):
                at = i
        if matrix[at, k] == 0.0:
            return 0.0
        if at != k:
            product = -product
            for j in range(k, n):
                matrix[at, j], matrix[k, j] = matrix[k, j], matrix[at, j]
        product *= matrix[k, k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, n):
                matrix[i, j] -= factor * matrix[k, j]
    return product


@kernel
def frobenius(matrix: np.ndarray, rows: int, columns: int) -> float:
    """Frobenius norm of a leading block."""
    total = 0.0
    for a in range(rows):
        for b in range(columns):
            total += matrix[a, b] * matrix[a, b]
    return math.sqrt(total)


@entry
def least_twist(
    raw: np.ndarray,
    rows: int,
    d: int,
    n: int,
    nv: int,
    vectors: np.ndarray,
    basis: np.ndarray,
    shares: np.ndarray,
    small: np.ndarray,
    twist: np.ndarray,
) -> bool:
    """Twist map J_a - J_p K_p^+ K_a, or False where the inputs do not determine the tip's motion.

    As ``analysis.velocity``: motions with all inputs locked must leave the tip at rest, and the
    loops must follow every input.
    """
    for a in range(rows):
        for b in range(n):
            vectors[b, a] = raw[a, b]
    rank, _, _, _ = orthogonalise(vectors, n, rows, min(n, rows), basis, shares, _RANK, True)
    # K_p = Q^T C; rows of C again: C = T Z with Z orthonormal
    z = np.empty((rank, n))
    low = np.empty((rank, rank))
    c = np.empty((rank, n))
    for a in range(rank):
        for b in range(n):
            c[a, b] = shares[a, b]
    upper = np.empty((rank, rank))
    orthogonalise(c, rank, n, rank, z, upper, 0.0, False)
    for a in range(rank):
        for b in range(rank):
            low[a, b] = upper[b, a]
    free = rank < n
    moved, missed = 0.0, 0.0
    if free:
        for a in range(d):
            for b in range(n):
                small[b] = raw[rows + a, b]
            for k in range(rank):
                share = dot(z[k], raw[rows + a], n)
                for b in range(n):
                    small[b] -= share * z[k, b]
            for b in range(n):
                moved = max(moved, abs(small[b]))
    rate = np.empty(n)
    for j in range(nv - n):
        for a in range(rank):
            small[a] = 0.0
            for x in range(rows):
                small[a] += basis[a, x] * raw[x, n + j]
        for a in range(rank):
            for k in range(a):
                small[a] -= low[a, k] * small[k]
            small[a] /= low[a, a]
        for b in range(n):
            rate[b] = 0.0
            for k in range(rank):
                rate[b] -= z[k, b] * small[k]
        for x in range(rows):
            missed = max(missed, abs(raw[x, n + j] + dot(raw[x], rate, n)))
        for a in range(d):
            value = raw[rows + a, n + j] + dot(raw[rows + a], rate, n)
            if d <= nv - n:
                twist[a, j] = value
            else:
                twist[j, a] = value
    return not free or (moved < _IDLE and missed < _IDLE)
