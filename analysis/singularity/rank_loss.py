"""How far a posture is from losing a rank: the definitions that everything else follows.

At a closed posture q, all lengths divided by ``mechanism.length``:

* K (rows, nv) is the constraint Jacobian, r its generic rank, and V = ker K the closed motions, of
  dimension m here and n = nv - r at a generic posture. m >= n.
* P (k, nv) maps a motion to the rates of all physical joints, cut ones included
  (``closure.joint_rates``). |P v| is the norm of a motion v in V, whatever was cut.
* N (nv, m) is a basis of V that is orthonormal in that norm: N^T P^T P N = 1.
* A = N[inputs] (n_inputs, m) are the input rates of its motions, T = J N (d_o, m) the output rates,
  lengths among them divided by ``mechanism.length``.
* a, d, b are the generic ranks of A, T and [A; T]. n - b freedoms are idle: they move neither
  inputs nor outputs in any posture. b - a freedoms move outputs with all inputs locked in every
  posture: 0 for a mechanism that its inputs drive, where b = a.

The measures, with sv_i(M) the i-th largest singular value, 0 where M is too small to have it, and 1
for i = 0, where there is nothing to lose:

* sigma_constraint = sv_r(K), as K is scaled. It detects, and is no distance: its size depends on
  what was cut.
* sigma_direct = sv_(b + m - n)(A): sv_a(A) at a posture without a constraint singularity. It is the
  least input motion that a unit motion needs, idle freedoms apart. At most 1.
* sigma_inverse = sv_d(T): the least output motion that a unit motion can be for, in the direction
  that is hardest to produce.
* condition = sv_1(S) / sv_d(S), with S = T A^+ the twist map on what the inputs can do: for the
  singular value decomposition A = U s W^T, S = T W_c / s_c with the first c = b + m - n columns.
  Infinite where sigma_direct or sv_d(S) is zero to rounding.

The kinds, with the rank of a matrix here counted against what is generic:

* constraint: m > n;
* direct: dim ker A > n - b, which is sigma_direct = 0;
* inverse: rank T < d, which is sigma_inverse = 0.

Singular values of A are compared with 1, since input rates are among the physical ones; those of T
with its largest one at generic postures; those of K with the largest of K itself.

None of this but sigma_constraint depends on which joints were cut, on redundant closure rows, on
names or on any order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.generic import GenericRanks
from closedchain.closure.joint_rates import orthonormal_motions, physical_rates
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearness import ROUNDING
from closedchain.closure.ranks import Rank, rank_above

__all__ = [
    "ClosedMotions", "Ranks", "closed_motions", "condition", "entry", "output_scale",
    "physical_rates", "ranks_of",
    "sigma_direct", "sigma_inverse",
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class ClosedMotions:
    """The closed motions of one posture or of many that have equally many: leading axes are free.

    Attributes
    ----------
    motions : (..., nv, m) array
        N, dimensionless, orthonormal in the norm of the physical joint rates.
    inputs : (..., n_inputs, m) array
        A.
    outputs : (..., d_o, m) array
        T.
    """

    motions: np.ndarray
    inputs: np.ndarray
    outputs: np.ndarray

    @property
    def size(self) -> int:
        """Dimension m of the closed motions."""
        return int(self.motions.shape[-1])


@dataclass(frozen=True)
class Ranks:
    """Ranks at a posture: of K, and of A, T and [A; T] on its closed motions.

    Attributes
    ----------
    closures, inputs, outputs : Rank
    together : int
        That of [A; T], between what ``inputs`` and ``outputs`` allow.
    motions : int
        m, the dimension of ker K.
    """

    closures: Rank
    inputs: Rank
    outputs: Rank
    together: int
    motions: int


def closed_motions(
    mechanism: Mechanism, basis: np.ndarray, rates: np.ndarray, task: np.ndarray
) -> ClosedMotions:
    """Measure closed motions by physical joint rates.

    Parameters
    ----------
    basis : (..., nv, m) array
        Any basis of ker K.
    rates : (..., k, nv) array
        P.
    task : (..., d_o, nv) array
        J.
    """
    motions = orthonormal_motions(basis, rates)
    return ClosedMotions(motions, motions[..., mechanism.input_v, :], task @ motions)


def sigma_direct(v: ClosedMotions, generic: GenericRanks) -> np.ndarray:
    """sv_(b + m - n)(A), (...)."""
    return entry(_values(v.inputs), _driven(v, generic))


def sigma_inverse(v: ClosedMotions, generic: GenericRanks) -> np.ndarray:
    """sv_d(T), (...)."""
    return entry(_values(v.outputs), generic.outputs.value)


def condition(v: ClosedMotions, generic: GenericRanks) -> np.ndarray:
    """Ratio of the largest to the d-th singular value of the twist map, (...)."""
    c, d = _driven(v, generic), generic.outputs.value
    infinite = np.full(v.inputs.shape[:-2], np.inf)
    if generic.undriven or not 0 < c <= min(v.inputs.shape[-2:]) or not 0 < d <= c:
        return infinite
    _, s, wt = np.linalg.svd(v.inputs, full_matrices=False)
    regular = s[..., c - 1] > ROUNDING
    scale = np.where(regular[..., None], s[..., :c], 1.0)
    values = _values(v.outputs @ wt[..., :c, :].swapaxes(-1, -2) / scale[..., None, :])
    regular &= values[..., d - 1] > ROUNDING * values[..., 0]
    least = np.where(regular, values[..., d - 1], 1.0)
    return np.where(regular, values[..., 0] / least, infinite)


def ranks_of(v: ClosedMotions, closures: Rank, generic: GenericRanks, tolerance: float) -> Ranks:
    """Decide the ranks at one posture; ``tolerance`` is relative, see the module."""
    scale = output_scale(v, generic)
    inputs = rank_above(_values(v.inputs), tolerance)
    outputs = rank_above(_values(v.outputs), tolerance * scale)
    both = _values(np.vstack([v.inputs, v.outputs / scale]))
    counted = int(np.count_nonzero(both > tolerance))
    least = max(inputs.value, outputs.value)
    most = min(v.size, inputs.value + outputs.value)
    return Ranks(closures, inputs, outputs, min(max(counted, least), most), v.size)


def output_scale(v: ClosedMotions, generic: GenericRanks) -> float:
    """What singular values of T at one posture are compared with."""
    return max(generic.output_scale, float(_values(v.outputs).max(initial=0.0)))


def entry(values: np.ndarray, number: int) -> np.ndarray:
    """Singular value number ``number`` of (..., s) in falling order, as the module says."""
    if number == 0:
        return np.ones(values.shape[:-1])
    if number > values.shape[-1]:
        return np.zeros(values.shape[:-1])
    return np.asarray(values[..., number - 1])


def _driven(v: ClosedMotions, generic: GenericRanks) -> int:
    """Number of freedoms here that are not idle, b + m - n: as many as inputs must move."""
    return generic.together.value + v.size - generic.motions


def _values(matrix: np.ndarray) -> np.ndarray:
    """Singular values (..., s), falling; none where the matrix is empty."""
    if 0 in matrix.shape[-2:]:
        return np.zeros((*matrix.shape[:-2], 0))
    return np.asarray(np.linalg.svd(matrix, compute_uv=False))
