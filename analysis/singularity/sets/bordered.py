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

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from closedchain.analysis.singularity.sets.postures_at import Kinematics, kinematics, moved, skew
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import OUTPUTS

DIFFERENCE = 1e-5  # dimensionless step of the one central difference in a gradient

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

    @property
    def needs_tip(self) -> bool:
        """Whether the task's rows belong to the matrix."""
        return self.kind == "inverse"

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the matrix."""
        r, nv = generic_rank(self.mechanism), self.mechanism.model.nv
        if self.kind == "direct":
            return r, self.mechanism.passive_v.size
        return (r + len(self.outputs), nv) if self.kind == "inverse" else (r, nv)

    @property
    def codimension(self) -> int:
        """Number of equations that the loss is: (|rows - columns| + corank) corank."""
        rows, columns = self.shape
        return (abs(rows - columns) + self.corank) * self.corank

    def losing(self, corank: int) -> Measure:
        """The measure of a loss of so many ranks."""
        return replace(self, corank=corank)

    def values(self, at: Kinematics, combine: np.ndarray) -> np.ndarray:
        """Singular values of the matrix at a posture, falling."""
        return np.asarray(np.linalg.svd(self.matrix(at, combine), compute_uv=False))

    def matrix(self, at: Kinematics, combine: np.ndarray) -> np.ndarray:
        """Matrix (rows, columns) at a posture."""
        closures = combine @ at.closures
        if self.kind == "direct":
            return closures[..., self.mechanism.passive_v]
        if self.kind == "constraint":
            return closures
        return np.concatenate([closures, self.task_rows(at)], axis=-2)

    @property
    def _units(self) -> np.ndarray:
        return np.array([self.mechanism.length if n in "xyz" else 1.0 for n in self.outputs])

    @property
    def _angular(self) -> list[int]:
        return [OUTPUTS.index(n) - 3 for n in self.outputs if n in OUTPUTS[3:]]

    def task_rows(self, at: Kinematics) -> np.ndarray:
        """J, dimensionless: one or two rotations are components along the tip's own axes."""
        linear = [OUTPUTS.index(n) for n in self.outputs if n in "xyz"]
        angular = at.tip[..., 3:, :]
        if len(self._angular) != 3:
            angular = at.attitude.swapaxes(-1, -2) @ angular
        rows = np.concatenate([at.tip[..., linear, :], angular[..., self._angular, :]], axis=-2)
        return np.asarray(rows * self.mechanism.column_scale / self._units[:, None])

    def borders(self, at: Kinematics, combine: np.ndarray) -> Borders:
        """Singular vectors of the matrix at a posture: the borders that are best nearby."""
        matrix = self.matrix(at, combine)
        if matrix.shape[-2] > matrix.shape[-1]:
            matrix = matrix.swapaxes(-1, -2)
        u, _, vt = np.linalg.svd(matrix)
        first = matrix.shape[-2] - self.corank
        return u[..., first:], vt[..., first:, :].swapaxes(-1, -2)

    def evaluate(
        self, q: np.ndarray, at: Kinematics, combine: np.ndarray, borders: Borders
    ) -> tuple[np.ndarray, np.ndarray]:
        """Corner g (codimension,) and its derivative (codimension, nv), dimensionless.

        Raises ``numpy.linalg.LinAlgError`` where the bordered matrix of a posture is singular; of
        many postures, those have a g of NaN.
        """
        matrix = self.matrix(at, combine)
        transposed = matrix.shape[-2] > matrix.shape[-1]
        g, w, v = corner(matrix.swapaxes(-1, -2) if transposed else matrix, borders)
        gradient = []
        for a in range(w.shape[-1]):
            for i in range(v.shape[-1]):
                both = (v[..., i], w[..., a]) if transposed else (w[..., a], v[..., i])
                gradient.append(-self._derivative(q, at, combine, *both))
        return g.reshape(*g.shape[:-2], -1), np.stack(gradient, axis=-2)

    def _derivative(
        self,
        q: np.ndarray,
        at: Kinematics,
        combine: np.ndarray,
        left: np.ndarray,
        right: np.ndarray,
    ) -> np.ndarray:
        """Derivative (nv,) of left^T A right, left and right held.

        Rows of K are derivatives of the residual, so that of left^T K right along x is that of
        left^T K x along right, but for the bracket of the two fields of motion: one central
        difference along ``right`` does for all x. Angular velocity is no derivative; its structure
        equation d omega = +-omega x omega (world, tip axes) adds a term.
        """
        mechanism = self.mechanism
        r, columns = combine.shape[-2], mechanism.column_scale
        along = np.zeros((*q.shape[:-1], mechanism.model.nv))
        along[..., mechanism.passive_v if self.kind == "direct" else slice(None)] = right
        size = np.linalg.norm(along, axis=-1, keepdims=True)
        size = np.where(size > 0.0, size, 1.0)
        step = DIFFERENCE / size * along * columns
        ahead, behind = (
            kinematics(mechanism, moved(mechanism, q, s * step), tip=self.needs_tip)
            for s in (1.0, -1.0)
        )
        rate = size / (2.0 * DIFFERENCE)
        bracket = _bracket(mechanism, along * columns)
        rows = _times(left[..., :r], combine)
        found = rate * _times(rows, ahead.closures - behind.closures)
        if bracket is not None:
            found += _times(_times(rows, at.closures) / columns, bracket)
        if not self.needs_tip:
            return np.asarray(found)
        change = rate[..., None] * (self.task_rows(ahead) - self.task_rows(behind))
        if bracket is not None:
            change += (self.task_rows(at) / columns) @ bracket
        angular, sign = at.tip[..., 3:, :] * columns, -1.0
        if len(self._angular) != 3:
            angular, sign = at.attitude.swapaxes(-1, -2) @ angular, 1.0
        turn = (angular @ along[..., None])[..., 0]
        turning = sign * skew(turn) @ angular
        first = len(self.outputs) - len(self._angular)
        change[..., first:, :] += turning[..., self._angular, :]
        return np.asarray(found + _times(left[..., r:], change))


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
    right = _solved(bordered, unit[:, m:])
    left = _solved(bordered.swapaxes(-1, -2), unit[:, n:])
    return right[..., n:, :], left[..., :m, :], right[..., :n, :]


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions (..., n, j) of one or many systems; NaN for singular ones among many."""
    try:
        return np.asarray(
            np.linalg.solve(matrix, np.broadcast_to(right, (*matrix.shape[:-1], right.shape[-1])))
        )
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            raise
        found = np.full((*matrix.shape[:-1], right.shape[-1]), np.nan)
        for i in np.ndindex(matrix.shape[:-2]):
            with suppress(np.linalg.LinAlgError):
                found[i] = np.linalg.solve(matrix[i], right)
        return found


def _times(row: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Product (n,) of a row (m,) and a matrix (m, n)."""
    return np.asarray((row[..., None, :] @ matrix)[..., 0, :])


def _bracket(mechanism: Mechanism, v: np.ndarray) -> np.ndarray | None:
    """Matrix (nv, nv) of x -> [x, v] in the tangent space: None where no body floats."""
    floating = [joint.idx_v for joint in list(mechanism.model.joints)[1:] if joint.nv == 6]
    if not floating:
        return None
    out = np.zeros((*v.shape[:-1], v.shape[-1], v.shape[-1]))
    for first in floating:
        linear, angular = skew(v[..., first : first + 3]), skew(v[..., first + 3 : first + 6])
        out[..., first : first + 3, first : first + 3] = -angular
        out[..., first : first + 3, first + 3 : first + 6] = -linear
        out[..., first + 3 : first + 6, first + 3 : first + 6] = -angular
    return np.asarray(out * mechanism.column_scale)
