"""Measures of singularity that are smooth and signed: corners of bordered matrices.

The smallest singular value has a kink where it vanishes, and the determinant spans many decades.
For a matrix A (m, n), m <= n, bordered by b (m, 1) and c (n, e + 1) with e = n - m, the solution of

    [A   b] [V]   [0]
    [c^T 0] [g] = [1]

has a corner g (e + 1,) that is smooth in A, and zero exactly where A loses rank, as long as the
bordered matrix is regular [Griewank1984]_, [Govaerts2000]_. Borders are singular vectors of A at a
posture nearby. A rank loss is thus e + 1 equations: it has codimension e + 1. With the last row
(w^T, h) of the inverse, dg = -w^T dA V. A matrix with more rows than columns is transposed.

[Griewank1984]_ A. Griewank and G. W. Reddien, Characterization and computation of generalized
turning points, SIAM J. Numer. Anal. 21, 1984.
[Govaerts2000]_ W. Govaerts, Numerical methods for bifurcations of dynamical equilibria, SIAM, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.mobility import generic_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import OUTPUTS

DIFFERENCE = 1e-5  # dimensionless step of the one central difference in a gradient

Borders = tuple[np.ndarray, np.ndarray]
"""b (short side, 1) and c (long side, e + 1)."""


@dataclass(frozen=True, eq=False)
class Kinematics:
    """What a measure needs at a posture: the closures' and the tip's Jacobians there.

    Attributes
    ----------
    residual : (rows,) array
        Closures, dimensionless.
    closures : (rows, nv) array
        K, dimensionless.
    tip : (6, nv) array
        Jacobian of the tip (linear, angular), world axes [m/s, rad/s]; empty without a task.
    place : (3,) array
        Origin of the tip in the world [m].
    attitude : (3, 3) array
        Rotation of the tip in the world.
    """

    residual: np.ndarray
    closures: np.ndarray
    tip: np.ndarray
    place: np.ndarray
    attitude: np.ndarray


def kinematics(mechanism: Mechanism, q: np.ndarray, *, tip: bool) -> Kinematics:
    """Evaluate closures and, where asked for, the tip at ``q`` (nq,), unchecked."""
    values, jacobian = mechanism.workspace.evaluate(q)
    unit = mechanism.row_scale
    scaled = jacobian * mechanism.column_scale / unit[:, None]
    if not tip:
        return Kinematics(values / unit, scaled, np.zeros((6, 0)), np.zeros(3), np.eye(3))
    model, data = mechanism.model, mechanism.workspace.data
    frame = model.frames[mechanism.frame_id(mechanism.required_task().tip)]
    if frame.parentJoint == 0:
        moves = np.zeros((6, model.nv))
    else:
        moves = np.array(
            pin.getFrameJacobian(
                model, data, frame.parentJoint, frame.placement, pin.LOCAL_WORLD_ALIGNED
            )
        )
    pose = data.oMi[frame.parentJoint] * frame.placement
    return Kinematics(values / unit, scaled, moves, pose.translation.copy(), pose.rotation.copy())


@dataclass(frozen=True, eq=False)
class Measure:
    """The matrix whose rank loss is one kind of singularity.

    K_p for "direct", [K; J] for "inverse", K for "constraint", all dimensionless, closure rows
    combined by ``combine`` (r, rows) into as many as the generic rank.
    """

    mechanism: Mechanism
    kind: str
    outputs: tuple[str, ...] = ()

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
        """Number of equations that a rank loss is: |rows - columns| + 1."""
        rows, columns = self.shape
        return abs(rows - columns) + 1

    def matrix(self, at: Kinematics, combine: np.ndarray) -> np.ndarray:
        """Matrix (rows, columns) at a posture."""
        closures = combine @ at.closures
        if self.kind == "direct":
            return closures[:, self.mechanism.passive_v]
        if self.kind == "constraint":
            return closures
        return np.vstack([closures, self.task_rows(at)])

    @property
    def _units(self) -> np.ndarray:
        return np.array([self.mechanism.length if n in "xyz" else 1.0 for n in self.outputs])

    @property
    def _angular(self) -> list[int]:
        return [OUTPUTS.index(n) - 3 for n in self.outputs if n in OUTPUTS[3:]]

    def task_rows(self, at: Kinematics) -> np.ndarray:
        """J, dimensionless: one or two rotations are components along the tip's own axes."""
        linear = [OUTPUTS.index(n) for n in self.outputs if n in "xyz"]
        angular = at.tip[3:]
        if len(self._angular) != 3:
            angular = at.attitude.T @ angular
        rows = np.vstack([at.tip[linear], angular[self._angular]])
        return rows * self.mechanism.column_scale / self._units[:, None]

    def borders(self, at: Kinematics, combine: np.ndarray) -> Borders:
        """Singular vectors of the matrix at a posture: the borders that are best nearby."""
        matrix = self.matrix(at, combine)
        if matrix.shape[0] > matrix.shape[1]:
            matrix = matrix.T
        u, _, vt = np.linalg.svd(matrix)
        return u[:, -1:], vt[matrix.shape[0] - 1 :].T

    def evaluate(
        self, q: np.ndarray, at: Kinematics, combine: np.ndarray, borders: Borders
    ) -> tuple[np.ndarray, np.ndarray]:
        """Corner g (codimension,) and its derivative (codimension, nv), dimensionless."""
        matrix = self.matrix(at, combine)
        transposed = matrix.shape[0] > matrix.shape[1]
        g, w, v = corner(matrix.T if transposed else matrix, borders)
        if transposed:
            gradient = [-self._derivative(q, at, combine, left, w) for left in v.T]
        else:
            gradient = [-self._derivative(q, at, combine, w, right) for right in v.T]
        return g, np.array(gradient)

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
        r = combine.shape[0]
        along = np.zeros(mechanism.model.nv)
        along[mechanism.passive_v if self.kind == "direct" else slice(None)] = right
        size = float(np.linalg.norm(along)) or 1.0
        step = DIFFERENCE / size * along * mechanism.column_scale
        sides = [
            kinematics(mechanism, pin.integrate(mechanism.model, q, s * step), tip=self.needs_tip)
            for s in (1.0, -1.0)
        ]
        rate = size / (2.0 * DIFFERENCE)
        bracket = _bracket(mechanism, along * mechanism.column_scale)
        rows = combine.T @ left[:r]
        found = rate * (rows @ (sides[0].closures - sides[1].closures))
        found += (rows @ at.closures / mechanism.column_scale) @ bracket
        if not self.needs_tip:
            return np.asarray(found)
        change = rate * (self.task_rows(sides[0]) - self.task_rows(sides[1]))
        change += (self.task_rows(at) / mechanism.column_scale) @ bracket
        angular, sign = at.tip[3:] * mechanism.column_scale, -1.0
        if len(self._angular) != 3:
            angular, sign = at.attitude.T @ angular, 1.0
        turning = sign * pin.skew(angular @ along) @ angular
        first = len(self.outputs) - len(self._angular)
        change[first:] += turning[self._angular]
        return np.asarray(found + left[r:] @ change)


def corner(matrix: np.ndarray, borders: Borders) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corner g (e + 1,) of a bordered matrix (m, n), m <= n, with w (m,) and V (n, e + 1)."""
    b, c = borders
    m, n = matrix.shape
    bordered = np.zeros((n + 1, n + 1))
    bordered[:m, :n] = matrix
    bordered[:m, n:] = b
    bordered[m:, :n] = c.T
    unit = np.eye(n + 1)
    right = np.linalg.solve(bordered, unit[:, m:])
    left = np.linalg.solve(bordered.T, unit[n])
    return right[n], left[:m], right[:n]


def _bracket(mechanism: Mechanism, v: np.ndarray) -> np.ndarray:
    """Matrix (nv, nv) of x -> [x, v] in the tangent space: not zero for floating bodies only."""
    out = np.zeros((v.size, v.size))
    for joint in list(mechanism.model.joints)[1:]:
        if joint.nv == 6:
            block = slice(joint.idx_v, joint.idx_v + 6)
            out[block, block] = -pin.Motion(v[block]).action
    return out * mechanism.column_scale
