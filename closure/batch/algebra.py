"""Dense algebra on small matrices: LU that skips zeros, orthogonal bases, singular values."""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.compiled import kernel


@kernel
def eliminate(
    matrix: np.ndarray, order: np.ndarray, steps: np.ndarray, slots: np.ndarray
) -> tuple[float, float, float]:
    """Gaussian elimination with partial pivoting, in place; multipliers stay below the pivots.

    Step k takes a pivot in column steps[k, 3] among the rows of slots[steps[k, 0]:steps[k, 1]] and
    clears the column in those up to slots[steps[k, 2]]: no other row can have an entry there.
    ``order`` holds the row of each slot; pivots are swapped into the first slot of their step.

    Returns the product of the pivots with the sign of the swaps, the least and the largest pivot.
    """
    width = matrix.shape[1]
    product, least, most = 1.0, math.inf, 0.0
    for k in range(steps.shape[0]):
        begin, middle, end, col = steps[k, 0], steps[k, 1], steps[k, 2], steps[k, 3]
        size, at = -1.0, begin
        for c in range(begin, middle):
            here = abs(matrix[order[slots[c]], col])
            if here > size:
                size, at = here, c
        row = order[slots[at]]
        if at != begin:
            order[slots[at]] = order[slots[begin]]
            order[slots[begin]] = row
            product = -product
        pivot = matrix[row, col]
        product *= pivot
        size = abs(pivot)
        least, most = min(least, size), max(most, size)
        if size == 0.0:
            continue
        inverse = 1.0 / pivot
        for c in range(begin + 1, end):
            i = order[slots[c]]
            factor = matrix[i, col]
            if factor != 0.0:
                factor *= inverse
                matrix[i, col] = factor
                for j in range(col + 1, width):
                    matrix[i, j] -= factor * matrix[row, j]
    return product, least, most


@kernel
def gather(
    matrix: np.ndarray, order: np.ndarray, steps: np.ndarray, slots: np.ndarray, factors: np.ndarray
) -> None:
    """Copy the rows of the pivots, in their order, to factors (n, n): L below, U on and above."""
    n = factors.shape[0]
    for k in range(n):
        row = order[slots[steps[k, 0]]]
        for j in range(n):
            factors[k, j] = matrix[row, j]


@kernel
def mend(factors: np.ndarray, floor: float) -> None:
    """Replace pivots below ``floor`` by it: solves then stay finite and show the null space."""
    for k in range(factors.shape[0]):
        if not abs(factors[k, k]) > floor:
            factors[k, k] = floor


@kernel
def dot(a: np.ndarray, b: np.ndarray, n: int) -> float:
    """Sum of the first n products."""
    total = 0.0
    for i in range(n):
        total += a[i] * b[i]
    return total


@kernel
def solve(factors: np.ndarray, x: np.ndarray) -> None:
    """x <- (L U)^-1 x."""
    n = factors.shape[0]
    for k in range(1, n):
        total = 0.0
        for j in range(k):
            total += factors[k, j] * x[j]
        x[k] -= total
    for k in range(n - 1, -1, -1):
        total = 0.0
        for j in range(k + 1, n):
            total += factors[k, j] * x[j]
        x[k] = (x[k] - total) / factors[k, k]


@kernel
def solve_transposed(factors: np.ndarray, x: np.ndarray) -> None:
    """x <- (L U)^-T x."""
    n = factors.shape[0]
    for k in range(n):
        z = x[k] / factors[k, k]
        x[k] = z
        for j in range(k + 1, n):
            x[j] -= z * factors[k, j]
    for k in range(n - 1, 0, -1):
        z = x[k]
        for j in range(k):
            x[j] -= z * factors[k, j]


@kernel
def orthogonalise(
    vectors: np.ndarray,
    n: int,
    length: int,
    limit: int,
    basis: np.ndarray,
    shares: np.ndarray,
    tolerance: float,
    pivoting: bool,
) -> tuple[int, float, float, float]:
    """Modified Gram-Schmidt, each vector twice, on the rows of vectors (n, length), in place.

    vectors[j] = sum_i shares[i, j] basis[i], basis orthonormal (r, length). With ``pivoting`` the
    longest rest comes next, and the basis ends below the share ``tolerance`` of the first one, or
    at ``limit`` vectors. Without, a vector that depends on those before it gets a basis vector 0.

    Returns r, the length of the longest rest that was left out, and the first and last length.
    """
    rank, first, last, rest = 0, 0.0, 0.0, 0.0
    most = min(n, limit)
    for i in range(most):
        for j in range(n):
            shares[i, j] = 0.0
    while True:
        at, size = -1, -1.0
        if pivoting:
            for j in range(n):
                here = dot(vectors[j], vectors[j], length)
                if here > size:
                    at, size = j, here
        elif rank < n:
            at = rank
            size = dot(vectors[at], vectors[at], length)
        size = math.sqrt(max(size, 0.0))
        if rank == 0:
            first = size
        if pivoting and (rank >= most or not size > tolerance * first):
            rest = size
            break
        if rank >= most:
            break
        row = basis[rank]
        factor = 1.0 / size if size > 0.0 else 0.0
        for x in range(length):
            row[x] = vectors[at, x] * factor
        # once more against the basis: the first pass leaves rounding errors of short rests
        for i in range(rank):
            share = dot(basis[i], row, length)
            shares[i, at] += size * share
            for x in range(length):
                row[x] -= share * basis[i, x]
        long = math.sqrt(dot(row, row, length))
        factor = 1.0 / long if long > 1e-8 else 0.0
        for x in range(length):
            row[x] *= factor
        shares[rank, at] = size * long
        last = size * long
        for x in range(length):
            vectors[at, x] = 0.0
        for j in range(n):
            if (not pivoting and j > rank) or (pivoting and j != at):
                share = dot(row, vectors[j], length)
                if share != 0.0:
                    shares[rank, j] += share
                    for x in range(length):
                        vectors[j, x] -= share * row[x]
        rank += 1
    return rank, rest, first, last


@kernel
def singular_values(rows: np.ndarray, n: int, length: int, values: np.ndarray) -> None:
    """Singular values (n,), falling, of rows (n, length), n <= length, by one-sided Jacobi.

    The rows are rotated until they are orthogonal and sorted by length, in place. Each value has
    an error of rounding level against the largest.
    """
    for _ in range(60):
        largest = 0.0
        for i in range(n):
            values[i] = dot(rows[i], rows[i], length)
            largest = max(largest, values[i])
        floor = 1e-40 * largest
        turned = False
        for i in range(n - 1):
            for j in range(i + 1, n):
                a, b = dot(rows[i], rows[i], length), dot(rows[j], rows[j], length)
                g = dot(rows[i], rows[j], length)
                if a < floor or b < floor or abs(g) <= 1e-15 * math.sqrt(a * b):
                    continue
                turned = True
                zeta = (b - a) / (2.0 * g)
                tangent = 1.0 / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                if zeta < 0.0:
                    tangent = -tangent
                c = 1.0 / math.sqrt(1.0 + tangent * tangent)
                s = c * tangent
                for x in range(length):
                    u, v = rows[i, x], rows[j, x]
                    rows[i, x] = c * u - s * v
                    rows[j, x] = s * u + c * v
        if not turned:
            break
    for i in range(n):
        values[i] = math.sqrt(dot(rows[i], rows[i], length))
    for i in range(1, n):  # by insertion: few, and nearly sorted
        j = i
        while j > 0 and values[j] > values[j - 1]:
            values[j], values[j - 1] = values[j - 1], values[j]
            for x in range(length):
                rows[j, x], rows[j - 1, x] = rows[j - 1, x], rows[j, x]
            j -= 1


@kernel
def cholesky(matrix: np.ndarray, n: int) -> bool:
    """Lower factor of a positive definite matrix (n, n), in place; False where it is not."""
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                matrix[i, i] = math.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    return True


@kernel
def cholesky_solve(matrix: np.ndarray, n: int, x: np.ndarray) -> None:
    """x <- (L L^T)^-1 x."""
    for i in range(n):
        total = x[i]
        for k in range(i):
            total -= matrix[i, k] * x[k]
        x[i] = total / matrix[i, i]
    for i in range(n - 1, -1, -1):
        x[i] /= matrix[i, i]
        for k in range(i):
            x[k] -= matrix[i, k] * x[i]
