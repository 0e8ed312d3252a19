"""Factors of a dimensionless Jacobian: Newton's step, and whether a singular one may lie between.

A square one is factorised by LU, which gives the sign of its determinant; one that is not square is
decomposed into singular vectors and cut at its rank.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from closedchain.closure.ranks import rank_of_singular_values

PIVOT_LIMIT = 1e-14  # of the largest pivot: below it a square system is singular to rounding
NEAR = 0.9  # relative change of a Jacobian that is surely not singular anywhere in between: below 1


@cache
def _lapack() -> Any:
    """SciPy's LAPACK, imported at the first solve: it takes half the time of ``import``."""
    from scipy.linalg import lapack

    return lapack


@dataclass(frozen=True, eq=False)
class Factors:
    """LU factors of a square dimensionless Jacobian; ``sign`` is that of its determinant.

    Sign 0 marks a singular matrix, which cannot be solved with.
    """

    matrix: np.ndarray
    lu: np.ndarray
    pivots: np.ndarray
    sign: int

    @classmethod
    def of(cls, matrix: np.ndarray) -> Factors:
        """Factorise (n, n)."""
        lu, pivots, info = _lapack().dgetrf(matrix)
        diagonal = lu.diagonal()
        size = np.abs(diagonal)
        least = size[size.argmin()]
        # not a number at all: neither smaller nor larger
        if info != 0 or not least >= PIVOT_LIMIT * size[size.argmax()]:
            return cls(matrix, lu, pivots, 0)
        swaps = np.count_nonzero(pivots != np.arange(pivots.size))
        negative = np.count_nonzero(np.signbit(diagonal))
        return cls(matrix, lu, pivots, -1 if (swaps + negative) % 2 else 1)

    def step(self, values: np.ndarray) -> np.ndarray:
        """Newton step (n,) for residual ``values`` (n,)."""
        return -_lapack().dgetrs(self.lu, self.pivots, values)[0]

    def solve(self, right: np.ndarray, *, transposed: bool = False) -> np.ndarray:
        """Solution of A x = right, or A^T x = right; (n,) or (n, k)."""
        return np.asarray(_lapack().dgetrs(self.lu, self.pivots, right, trans=int(transposed))[0])

    def left_by(self, other: Factors) -> bool:
        """Whether a singular matrix may lie on the straight line from here to ``other``."""
        relative = self.solve(other.matrix - self.matrix)
        return bool(np.linalg.norm(relative) >= NEAR and np.linalg.norm(relative, 2) >= NEAR)


@dataclass(frozen=True, eq=False)
class Range:
    """Singular bases of a dimensionless Jacobian that is not square, cut at its rank.

    It has no determinant; in its place, ``left_by`` tells whether another Jacobian is too far away
    for this one to rule out a singular one in between.
    """

    u: np.ndarray
    s: np.ndarray
    v: np.ndarray
    sign: None = None

    @classmethod
    def of(cls, matrix: np.ndarray) -> Range:
        """Decompose (rows, columns)."""
        u, s, vt = np.linalg.svd(matrix, full_matrices=False)
        rank = rank_of_singular_values(s).value
        return cls(u[:, :rank], s[:rank], vt[:rank].T)

    def step(self, values: np.ndarray) -> np.ndarray:
        """Shortest least-squares step (columns,) for residual ``values`` (rows,)."""
        return -self.v @ ((self.u.T @ values) / self.s)

    def left_by(self, other: Range) -> bool:
        """Whether the rank changed, or may have dropped between here and ``other``.

        Where S^-1 U^T A V differs from 1 by less than 1, so does every Jacobian on the straight
        line from this one to A: all of them keep the rank.
        """
        if self.s.size != other.s.size:
            return True
        here = (self.u.T @ other.u) * other.s @ (other.v.T @ self.v)
        return bool(np.linalg.norm(here / self.s[:, None] - np.eye(self.s.size), 2) >= NEAR)


def largest(values: np.ndarray) -> float:
    """Largest absolute entry; 0 for none."""
    return float(max(values.max(), -values.min())) if values.size else 0.0


def factorise(matrix: np.ndarray) -> Factors | Range:
    """LU factors of a square matrix, singular bases of another."""
    square = matrix.shape[0] == matrix.shape[1] and matrix.size
    return Factors.of(matrix) if square else Range.of(matrix)
