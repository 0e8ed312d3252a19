"""Measures of singularity that are smooth and signed: corners of bordered matrices.

The smallest singular value has a kink where it vanishes, and the determinant spans many decades.
For a matrix A (m, n), m <= n, bordered by b (m, k) and c (n, e + k) with e = n - m, the solution of

    [A   b] [V]   [0]
    [c^T 0] [g] = [1]

has a corner g (k, e + k) that is smooth in A, and zero exactly where A loses k ranks, as long as
the bordered matrix is regular [Griewank1984]_, [Govaerts2000]_. Borders are singular vectors of A
at a posture nearby. A loss of k ranks, the corank, is thus k (e + k) equations, and where they are
independent it has that codimension; a mechanism whose ranks vanish together, all of them with one
factor, makes them dependent. With the last rows (W^T, h) of the inverse, dg = -W^T dA V. A matrix
with more rows than columns is transposed.

All functions take one posture (nq,) or many (n, nq); a leading n then stands before every shape.

[Griewank1984]_ A. Griewank and G. W. Reddien, Characterization and computation of generalized
turning points, SIAM J. Numer. Anal. 21, 1984.
[Govaerts2000]_ W. Govaerts, Numerical methods for bifurcations of dynamical equilibria, SIAM, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from closedchain.analysis.singularity.sets.postures_at import (
    FirstOrderCode,
    Postures,
    first_order_code,
)
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.factors import Factors
from closedchain.closure.solve.square_systems import solutions

Combine = np.ndarray | None
"""Combinations (r, rows) of closure rows; None where all rows count as they are."""

Borders = tuple[np.ndarray, np.ndarray]
"""b (short side, corank) and c (long side, e + corank)."""


@dataclass(frozen=True, eq=False)
class Measure:
    """The matrix whose rank loss is one kind of singularity.

    K_p for "direct", [K; J] for "inverse", K for "constraint", all dimensionless, closure rows
    combined by ``combine`` (r, rows) into as many as the generic rank. ``corank`` is the number of
    ranks that are lost at once.
    """

    mechanism: Mechanism
    kind: str
    outputs: tuple[str, ...] = ()
    corank: int = 1

    @cached_property
    def code(self) -> FirstOrderCode:
        """K and J of its mechanism and outputs, and their slopes."""
        return first_order_code(self.mechanism, self.outputs)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the matrix."""
        r, nv = generic_rank(self.mechanism), self.mechanism.model.nv
        if self.kind == "direct":
            return r, self.mechanism.passive_v.size
        return (r + len(self.outputs), nv) if self.kind == "inverse" else (r, nv)

    @property
    def empty(self) -> bool:
        """Whether the matrix has no column: every joint is an input, none can move by itself."""
        return self.shape[1] == 0

    @property
    def codimension(self) -> int:
        """Number of equations that the loss is: (|rows - columns| + corank) corank."""
        rows, columns = self.shape
        return (abs(rows - columns) + self.corank) * self.corank

    def losing(self, corank: int) -> Measure:
        """The measure of a loss of so many ranks."""
        return replace(self, corank=corank)

    def values(self, at: Postures, combine: Combine) -> np.ndarray:
        """Singular values of the matrix at a posture, falling."""
        return np.asarray(np.linalg.svd(self.matrix(at, combine), compute_uv=False))

    def matrix(self, at: Postures, combine: Combine) -> np.ndarray:
        """Matrix (rows, columns) at a posture."""
        closures = at.closures if combine is None else combine @ at.closures
        if self.kind == "direct":
            return np.asarray(closures[..., self.mechanism.passive_v])
        if self.kind == "constraint":
            return np.asarray(closures)
        return np.concatenate([closures, at.task], axis=-2)

    def borders(self, at: Postures, combine: Combine) -> Borders:
        """Singular vectors of the matrix at a posture: the borders that are best nearby."""
        matrix = self.matrix(at, combine)
        if matrix.shape[-2] > matrix.shape[-1]:
            matrix = matrix.swapaxes(-1, -2)
        u, _, vt = np.linalg.svd(matrix)
        first = matrix.shape[-2] - self.corank
        return u[..., first:], vt[..., first:, :].swapaxes(-1, -2)

    def evaluate(
        self, q: np.ndarray, at: Postures, combine: Combine, borders: Borders
    ) -> tuple[np.ndarray, np.ndarray]:
        """Corner g (codimension,) and its derivative (codimension, nv), dimensionless.

        Raises ``numpy.linalg.LinAlgError`` where the bordered matrix of a posture is singular; of
        many postures, those have a g of NaN.
        """
        matrix = self.matrix(at, combine)
        transposed = matrix.shape[-2] > matrix.shape[-1]
        g, w, v = corner(matrix.swapaxes(-1, -2) if transposed else matrix, borders)
        if q.ndim == 1 and g.size == 1:
            left, right = (v[:, 0], w[:, 0]) if transposed else (w[:, 0], v[:, 0])
            return g[0], -self._slopes(q, combine, left, right)[None]
        # one combination of rows with one of columns for each entry of g, that of w first
        pairs = [(a, i) for a in range(w.shape[-1]) for i in range(v.shape[-1])]
        rows = np.stack([w[..., a] for a, _ in pairs], axis=-2)
        columns = np.stack([v[..., i] for _, i in pairs], axis=-2)
        left, right = (columns, rows) if transposed else (rows, columns)
        some = (*rows.shape[:-1], q.shape[-1])
        many = np.broadcast_to(q[..., None, :], some).reshape(-1, q.shape[-1])
        if combine is not None and combine.ndim == 3:
            combine = np.repeat(combine, len(pairs), axis=0)
        flat = (part.reshape(len(many), -1) for part in (left, right))
        slopes = self._slopes(many, combine, *flat).reshape(*some[:-1], -1)
        return g.reshape(*g.shape[:-2], -1), -slopes

    def _slopes(
        self, q: np.ndarray, combine: Combine, left: np.ndarray, right: np.ndarray
    ) -> np.ndarray:
        """Derivative (nv,) of left^T A right, both held; of many postures, each with its own."""
        r, closures = generic_rank(self.mechanism), self.mechanism.rows
        full = np.zeros((*q.shape[:-1], closures + len(self.outputs)))
        if combine is None:
            full[..., :closures] = left[..., :r]
        else:
            full[..., :closures] = (left[..., None, :r] @ combine)[..., 0, :]
        if self.kind == "inverse":
            full[..., closures:] = left[..., r:]
        along = right
        if self.kind == "direct":
            along = np.zeros((*q.shape[:-1], self.mechanism.model.nv))
            along[..., self.mechanism.passive_v] = right
        return self.code.slopes(q, full, along)


def corner(matrix: np.ndarray, borders: Borders) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corner g (k, e + k) of a bordered matrix (m, n), m <= n, with W (m, k) and V (n, e + k).

    Raises ``numpy.linalg.LinAlgError`` where the bordered matrix is singular; NaN for such ones
    among many.
    """
    b, c = borders
    m, n = matrix.shape[-2:]
    size = n + b.shape[-1]
    bordered = np.zeros((*matrix.shape[:-2], size, size))
    bordered[..., :m, :n] = matrix
    bordered[..., :m, n:] = b
    bordered[..., m:, :n] = c.swapaxes(-1, -2)
    unit = np.eye(size)
    if matrix.ndim == 2:
        factors = Factors.of(bordered)
        if factors.sign == 0:
            raise np.linalg.LinAlgError("the bordered matrix is singular")
        right = factors.solve(unit[:, m:])
        left = factors.solve(unit[:, n:], transposed=True)
    else:
        right = solutions(bordered, unit[:, m:])
        left = solutions(bordered.swapaxes(-1, -2), unit[:, n:])
    return right[..., n:, :], left[..., :m, :], right[..., :n, :]
