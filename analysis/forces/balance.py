"""Efforts of the inputs and multipliers of the closures that balance what the tree needs.

With g the efforts (nv,) that a load, at rest or moving, needs at the joints of the tree, S the rows
of the inputs and K the constraint Jacobian, S^T tau + K^T lambda = g. Where no input acts, K_p^T
lambda = g_p, and then tau = g_a - K_a^T lambda. The kernel of K_p^T are the internal forces: what
inputs and closures do against each other without a load. The kernel of K_p are the free motions,
those with all inputs locked: a load that does work on one of them cannot be carried.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.first_order import FirstOrder
from closedchain.closure.ranks import RANK_TOLERANCE, Rank, kernel, least_solution, rank_above


@dataclass(frozen=True, eq=False)
class Balance:
    """A solution, and what may be added to it.

    All is dimensionless but for a common factor: forces are multiplied by the characteristic
    length, so that everything is a moment [N m].

    Attributes
    ----------
    efforts : (n_inputs,) array
    multipliers : (rows,) array
    internal_efforts, internal_multipliers : (n_inputs, k), (rows, k) arrays
        Basis of the internal forces.
    free : (nv, f) array
        Basis of the free motions, orthonormal.
    missing : (f,) array
        Work of what is not balanced, on the free motions.
    rank : Rank
        Of K_p.
    """

    at: FirstOrder
    efforts: np.ndarray
    multipliers: np.ndarray
    internal_efforts: np.ndarray
    internal_multipliers: np.ndarray
    free: np.ndarray
    missing: np.ndarray
    rank: Rank

    def plus(self, coefficients: np.ndarray) -> Balance:
        """The same with internal forces added, coefficients (k,)."""
        return self._with(coefficients, self.internal_efforts, self.internal_multipliers)

    def _with(self, c: np.ndarray, efforts: np.ndarray, multipliers: np.ndarray) -> Balance:
        return Balance(
            at=self.at,
            efforts=self.efforts + self.internal_efforts @ c,
            multipliers=self.multipliers + self.internal_multipliers @ c,
            internal_efforts=efforts,
            internal_multipliers=multipliers,
            free=self.free,
            missing=self.missing,
            rank=self.rank,
        )

    @property
    def input_efforts(self) -> np.ndarray:
        """Efforts (n_inputs,) [N, N m]."""
        return self.efforts / self._input_unit

    @property
    def row_multipliers(self) -> np.ndarray:
        """Multipliers (rows,) of the closure rows [N for lengths, N m for angles]."""
        return self.multipliers / self.at.row_unit

    @property
    def internal(self) -> np.ndarray:
        """Internal forces (n_inputs + rows, k): efforts, then multipliers [N, N m]."""
        return np.vstack(
            [
                self.internal_efforts / self._input_unit[:, None],
                self.internal_multipliers / self.at.row_unit[:, None],
            ]
        )

    @property
    def free_motions(self) -> np.ndarray:
        """Free motions (nv, f) in SI units."""
        return self.free * self.at.column_unit[:, None]

    @property
    def _input_unit(self) -> np.ndarray:
        return self.at.column_unit[self.at.mechanism.input_v]


def balance(at: FirstOrder, needed: np.ndarray, rank: Rank) -> Balance:
    """Balance efforts (nv,) [N, N m] that the tree needs.

    The input efforts are the least ones (forces multiplied by the length), the multipliers any
    that go with them; what is on the free motions stays unbalanced and is told.

    Parameters
    ----------
    rank : Rank
        Of the dimensionless K_p, decided elsewhere.
    """
    m = at.mechanism
    a, p = m.input_v, m.passive_v
    wanted = needed * at.column_unit
    passive = at.K[:, p]
    multipliers, basis = least_solution(passive.T, wanted[p], rank.value)
    free = np.zeros((m.model.nv, p.size - rank.value))
    free[p] = kernel(passive, p.size - rank.value)
    whole = Balance(
        at=at,
        efforts=wanted[a] - at.K[:, a].T @ multipliers,
        multipliers=multipliers,
        internal_efforts=-at.K[:, a].T @ basis,
        internal_multipliers=basis,
        free=free,
        missing=free.T @ wanted,
        rank=rank,
    )
    return whole.plus(least_added(whole.efforts, whole.internal_efforts)[0])


def least_added(first: np.ndarray, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (k,) with which |first + basis c| is least, and those (k, j) that change none.

    Parameters
    ----------
    first : (n,) array
    basis : (n, k) array
        Of natural size 1: what is at rounding level counts as zero.
    """
    if 0 in basis.shape:
        return np.zeros(basis.shape[1]), np.eye(basis.shape[1])
    if basis.shape[0] > basis.shape[1]:
        turn, basis = np.linalg.qr(basis)
        first = turn.T @ first
    s = np.linalg.svd(basis, compute_uv=False)
    return least_solution(basis, -first, rank_above(s, RANK_TOLERANCE).value)


def settled(whole: Balance, strain: np.ndarray, strains: np.ndarray) -> Balance:
    """The balance whose strain is least, among those with the same input efforts.

    Parameters
    ----------
    strain : (n,) array
        What the balance does to the joints, in any measure.
    strains : (n, k) array
        What its internal forces do.
    """
    _, silent = least_added(np.zeros(whole.efforts.size), whole.internal_efforts)
    c, _ = least_added(strain, strains @ silent)
    return whole.plus(silent @ c)
