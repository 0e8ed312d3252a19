"""The smallest singular value of a factored matrix, by Lanczos on its inverse, with a certificate.

The largest eigenvalue of B = (A^T A)^-1 is 1 / sigma^2. With full reorthogonalisation the Ritz
value theta and the residual r of its vector bound the error: |theta - lambda| <= r for some
eigenvalue lambda [Parlett, The Symmetric Eigenvalue Problem, 4.5]. The bound r^2 / gap would need
fewer steps, but no gap is known: of a close pair of eigenvalues few steps show one.
"""

from __future__ import annotations

import math

import numpy as np

from closedchain.closure.batch.algebra import dot, solve, solve_transposed
from closedchain.closure.batch.compiled import kernel


@kernel
def smallest(
    factors: np.ndarray,
    tolerance: float,
    limit: float,
    basis: np.ndarray,
    alpha: np.ndarray,
    beta: np.ndarray,
) -> tuple[float, bool]:
    """Smallest singular value of A = L U.

    Parameters
    ----------
    factors : (n, n) LU factors, pivots not zero
    tolerance : absolute error that is allowed
    limit : value from which it is not sought: two steps tell
    basis, alpha, beta : scratch (> steps, n), (steps,), (steps,)

    Returns
    -------
    The value, and whether its error is certified to be below the tolerance.
    """
    n = factors.shape[0]
    most = min(n, alpha.shape[0])
    norm = 0.0
    for i in range(n):
        # numbers without a pattern that a mechanism could share
        x = 0.6180339887498949 * (i + 1.0)
        x += 0.5 - math.floor(x)
        basis[0, i] = x if (i * 7) % 3 != 1 else -x
        norm += x * x
    norm = 1.0 / math.sqrt(norm)
    for i in range(n):
        basis[0, i] *= norm
    theta = 0.0
    for k in range(most):
        new = basis[k + 1]
        for i in range(n):
            new[i] = basis[k, i]
        solve_transposed(factors, new)
        solve(factors, new)
        before = dot(new, new, n)
        alpha[k] = dot(basis[k], new, n)
        for _ in range(2):
            for i in range(k + 1):
                share = dot(basis[i], new, n)
                for x in range(n):
                    new[x] -= share * basis[i, x]
        size = math.sqrt(dot(new, new, n))
        beta[k] = size
        if not before < math.inf:
            return 0.0, False
        theta, residual = _ritz(alpha, beta, k + 1, theta)
        sigma = 1.0 / math.sqrt(theta)
        # at rounding level of B the Krylov space holds all that the start does
        exhausted = size <= 1e-15 * math.sqrt(before)
        if exhausted or 0.5 * sigma * residual < tolerance * theta:
            return sigma, True
        if k == 1 and sigma > limit:
            return sigma, False
        inverse = 1.0 / size
        for i in range(n):
            new[i] *= inverse
    return 1.0 / math.sqrt(theta), most == n


@kernel
def _ritz(alpha: np.ndarray, beta: np.ndarray, k: int, theta: float) -> tuple[float, float]:
    """Largest eigenvalue of the tridiagonal (k, k), and the residual of its Ritz vector."""
    if k == 1:
        return alpha[0], beta[0]
    # above all eigenvalues Newton's method on the last pivot falls monotonically
    x = 0.0
    for i in range(k):
        reach = alpha[i] + (beta[i - 1] if i > 0 else 0.0) + (beta[i] if i < k - 1 else 0.0)
        x = max(x, reach)
    x = min(x, max(theta, alpha[k - 1]) + beta[k - 2])
    for _ in range(60):
        # pivots d of x - T, their derivatives, and the sum of logarithmic derivatives
        d, slope, total = x - alpha[0], 1.0, 0.0
        good = d > 0.0
        for i in range(1, k):
            if not good:
                break
            total += slope / d
            ratio = beta[i - 1] / d
            slope = 1.0 + ratio * ratio * slope
            d = x - alpha[i] - beta[i - 1] * ratio
            good = d > 0.0
        if not good:
            break  # at the eigenvalue, to rounding
        step = 1.0 / (total + slope / d)
        x -= step
        if step < 1e-16 * x:
            break
    # eigenvector from its end; the pivots before the last are positive there
    size, d = 0.0, x - alpha[0]
    for i in range(k - 1):
        # product of beta / d from i to the end, summed by Horner from the front
        ratio = beta[i] / d if d > 0.0 else math.inf
        size = (size + 1.0) * ratio * ratio
        d = x - alpha[i + 1] - beta[i] * ratio
    return x, beta[k - 1] / math.sqrt(1.0 + size)
