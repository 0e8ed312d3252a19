"""Numerical rank with the evidence for it: the two singular values around the cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RANK_TOLERANCE = 1e-9
"""Singular values below this share of the largest count as zero. Matrices are scaled first."""

NOISE = 1e-14
"""Singular values below it are rounding in any matrix that is scaled, however small it is."""

DOUBT = 1e-5
"""Share of the largest singular value below which one that counts may be zero at the closed posture
that is meant: where closures hold to the second order, no row shows a posture's error before."""


@dataclass(frozen=True)
class Rank:
    """A rank decision.

    Attributes
    ----------
    value : int
    above, below : float
        Smallest singular value that counts and largest that does not (0 where there is none).

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> rank = cc.mobility(m).rank
    >>> rank.value, rank.above > 1e3 * rank.below
    (13, True)
    """

    value: int
    above: float
    below: float

    @property
    def gap(self) -> float:
        """Ratio ``above / below``; infinite for an exact zero or full rank."""
        return self.above / self.below if self.below > 0.0 else float("inf")

    def __str__(self) -> str:
        """Rank and the two singular values around the cut."""
        return f"rank {self.value} (singular values {self.above:.3g} | {self.below:.3g})"


def rank_of_singular_values(s: np.ndarray, tolerance: float = RANK_TOLERANCE) -> Rank:
    """Rank decision from singular values ``s`` in falling order, relative to the largest."""
    if s.size == 0:
        return Rank(0, 0.0, 0.0)
    return rank_above(s, max(tolerance * float(s[0]), NOISE))


def rank_above(s: np.ndarray, floor: float) -> Rank:
    """Rank decision from singular values ``s`` in falling order: those above ``floor`` count."""
    value = int(np.count_nonzero(s > floor))
    above = float(s[value - 1]) if value else 0.0
    return Rank(value, above, float(s[value]) if value < s.size else 0.0)


def numerical_rank(matrix: np.ndarray, tolerance: float = RANK_TOLERANCE) -> Rank:
    """Rank of a dimensionless matrix (rows, columns), relative to its largest singular value."""
    if 0 in matrix.shape:
        return Rank(0, 0.0, 0.0)
    return rank_of_singular_values(np.linalg.svd(matrix, compute_uv=False), tolerance)


def doubtful(matrix: np.ndarray, zero: float = RANK_TOLERANCE, counts: float = DOUBT) -> bool:
    """Whether a singular value of a dimensionless matrix may stem from the posture's error.

    It lies between what is ``zero`` and what ``counts``, as shares of the largest.
    """
    if 0 in matrix.shape:
        return False
    s = np.linalg.svd(matrix, compute_uv=False)
    return bool(((s > zero * s[0]) & (s < counts * s[0])).any())


def null_space(matrix: np.ndarray, tolerance: float = RANK_TOLERANCE) -> tuple[np.ndarray, Rank]:
    """Orthonormal null space (columns, k) of a dimensionless matrix, and the rank decision."""
    columns = matrix.shape[1]
    if matrix.shape[0] == 0:
        return np.eye(columns), Rank(0, 0.0, 0.0)
    _, s, vt = np.linalg.svd(matrix, full_matrices=True)
    rank = rank_of_singular_values(s, tolerance)
    return np.ascontiguousarray(vt[rank.value :].T), rank


def independent_rows(matrices: np.ndarray, rank: int) -> tuple[int, ...]:
    """Rows, ``rank`` of them, that are independent in every one of (n, rows, columns) matrices.

    One after the other, that which stands out most of the span of those before, where it stands
    out least among the matrices.
    """
    left = matrices.copy()
    chosen: list[int] = []
    for _ in range(rank):
        heights = np.linalg.norm(left, axis=2).min(axis=0)
        heights[chosen] = -1.0
        best = int(np.argmax(heights))
        chosen.append(best)
        unit = left[:, best] / np.maximum(np.linalg.norm(left[:, best], axis=1), 1e-300)[:, None]
        left = left - np.einsum("nrc,nc->nr", left, unit)[:, :, None] * unit[:, None, :]
    return tuple(sorted(chosen))


@dataclass(frozen=True, eq=False)
class Factors:
    """Singular value decomposition of a matrix (rows, columns) whose rank is decided elsewhere.

    Attributes
    ----------
    u : (rows, rows) array
    s : (min(rows, columns),) array
        Falling.
    vt : (columns, columns) array
    """

    u: np.ndarray
    s: np.ndarray
    vt: np.ndarray

    def kernel(self, dimension: int) -> np.ndarray:
        """Orthonormal null space (columns, dimension)."""
        return np.ascontiguousarray(self.vt[len(self.vt) - dimension :].T)

    def left_kernel(self, dimension: int) -> np.ndarray:
        """Orthonormal null space (rows, dimension) of the transpose."""
        return np.ascontiguousarray(self.u[:, len(self.u) - dimension :])

    def solve(self, wanted: np.ndarray, rank: int) -> np.ndarray:
        """Least-squares solution of least norm for ``wanted`` (rows,) or (rows, k)."""
        target = self.u[:, :rank].T @ wanted
        return np.asarray(self.vt[:rank].T @ (target.T / self.s[:rank]).T)


def decomposed(matrix: np.ndarray) -> Factors:
    """Singular value decomposition of a matrix, empty ones included."""
    if 0 in matrix.shape:
        rows, columns = matrix.shape
        return Factors(np.eye(rows), np.zeros(0), np.eye(columns))
    return Factors(*np.linalg.svd(matrix))


def kernel(matrix: np.ndarray, dimension: int) -> np.ndarray:
    """Orthonormal null space (columns, dimension) of a matrix whose rank is decided elsewhere."""
    return decomposed(matrix).kernel(dimension)


def least_solution(
    matrix: np.ndarray, wanted: np.ndarray, rank: int
) -> tuple[np.ndarray, np.ndarray]:
    """``Factors.solve`` for a matrix, and its null space (columns, columns - rank)."""
    factors = decomposed(matrix)
    return factors.solve(wanted, rank), factors.kernel(matrix.shape[1] - rank)
