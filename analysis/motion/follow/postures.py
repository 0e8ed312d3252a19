"""A posture of a task: its null motion, the singular values that matter and their slopes.

Singular values sigma = u^T A v change along a motion by u^T dA v, the derivative of the matrix by
itself taken with central differences of the exact Jacobians. Several of the smallest ones
are kept, so that two of them may cross.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.first_order import first_order
from closedchain.analysis.motion.follow.problem import Problem
from closedchain.analysis.structure.mobility import generic_rank

KEPT = 3
_STEP = 1e-5  # dimensionless way of the central differences


@dataclass(frozen=True, eq=False)
class Sigmas:
    """Singular values of a posture that vanish at singularities.

    Attributes
    ----------
    direct, inverse, constraint : float
        As ``cc.classify`` gives them.
    driven : float
        The one of [K; J] without the columns of locked inputs; ``inverse`` where none is.
    """

    direct: float
    inverse: float
    constraint: float
    driven: float

    @property
    def smallest(self) -> float:
        """Distance to the nearest singularity of the mechanism as it is driven."""
        return min(self.direct, self.driven)


@dataclass(frozen=True, eq=False)
class Posture:
    """A posture that holds its sample of the task.

    Attributes
    ----------
    q : (nq,) array
    residual : float
        Largest row of closures and task [m or rad].
    basis : (free, k) array
        Orthonormal dimensionless null motions of closures and task.
    sigmas : Sigmas
    values : (w,) array
        The smallest singular values of K_p and of the driven [K; J], in this order.
    slopes : (w, k) array
        Their derivatives along the basis.
    passive, left : (rows, n_p) and (rows, r) arrays
        Dimensionless K_p and a basis of its columns; no columns where K_p, less its redundant
        rows, is not square: then a path does not cross from one sheet to another.
    """

    q: np.ndarray
    residual: float
    basis: np.ndarray
    sigmas: Sigmas
    values: np.ndarray
    slopes: np.ndarray
    passive: np.ndarray
    left: np.ndarray

    def crossed_from(self, before: Posture) -> bool:
        """Whether a direct singularity lies between a posture nearby and this one.

        det(U^T K_p), with U from before, does not vanish in between while the columns' space turns
        little; it is the determinant of K_p itself where no row is redundant.
        """
        u = before.left
        if not u.shape[1]:
            return False
        signs = [np.linalg.slogdet(u.T @ p.passive)[0] for p in (before, self)]
        return bool(signs[0] * signs[1] < 0.0)


def posture(
    problem: Problem,
    q: np.ndarray,
    residual: float,
    before: np.ndarray | None = None,
    *,
    slopes: bool = True,
) -> Posture:
    """Look at a closed posture; ``before`` (free, k) is a basis nearby that is to be continued."""
    at = first_order(problem.mechanism, q, problem.outputs)
    m, k = problem.mechanism, problem.freedoms
    rank_direct = min(generic_rank(m), m.passive_v.size)
    stacked = at.stacked
    passive = np.linalg.svd(at.K_passive, full_matrices=False)
    driven = np.linalg.svd(stacked[:, problem.free], full_matrices=True)
    closures = np.linalg.svd(at.K, compute_uv=False)
    of_driven = _entry(driven[1], problem.rank)
    inverse = of_driven
    if problem.locked:
        inverse = _entry(np.linalg.svd(stacked, compute_uv=False), problem.rank)
    sigmas = Sigmas(
        direct=_entry(passive[1], rank_direct),
        inverse=inverse,
        constraint=_entry(closures, generic_rank(m)),
        driven=of_driven,
    )
    basis = driven[2][problem.free.size - k :].T
    if before is not None and k:
        u, _, vt = np.linalg.svd(basis.T @ before)  # the nearest basis of the same space
        basis = basis @ (u @ vt)
    passive_kept = _kept(rank_direct, passive[1])
    driven_kept = _kept(problem.rank, driven[1])
    values = np.concatenate([passive[1][passive_kept], driven[1][driven_kept]])
    rates = np.zeros((values.size, k))
    if slopes:
        for column in range(k):
            dk, dj = _derivatives(problem, q, basis[:, column])
            ends = (passive[0][:, passive_kept], passive[2][passive_kept])
            there = _forms(ends[0], dk[:, m.passive_v], ends[1])
            ends = (driven[0][:, driven_kept], driven[2][driven_kept])
            rates[:, column] = np.concatenate(
                [there, _forms(ends[0], np.vstack([dk, dj])[:, problem.free], ends[1])]
            )
    return Posture(
        q=q,
        residual=residual,
        basis=basis,
        sigmas=sigmas,
        values=values,
        slopes=rates,
        passive=at.K_passive,
        left=_left(passive[0], rank_direct, generic_rank(m), m.passive_v.size),
    )


def _left(u: np.ndarray, rank_direct: int, rank: int, passive: int) -> np.ndarray:
    """Basis of the columns of K_p where K_p is square but for redundant rows, else no column."""
    if not rank_direct == rank == passive:
        return np.zeros((len(u), 0))
    return np.eye(len(u)) if len(u) == rank else u[:, :rank]


def _entry(values: np.ndarray, number: int) -> float:
    """Singular value number ``number``; 1 where none is asked for, 0 where there are too few."""
    if number == 0:
        return 1.0
    return float(values[number - 1]) if number <= values.size else 0.0


def _kept(number: int, values: np.ndarray) -> slice:
    """The last singular values up to number ``number``."""
    last = min(number, values.size)
    return slice(max(last - KEPT, 0), last)


def _forms(left: np.ndarray, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """u_j^T A v_j for the columns u_j of ``left`` and the rows v_j of ``right``."""
    return np.asarray(((left.T @ matrix) * right).sum(axis=1))


def _derivatives(
    problem: Problem, q: np.ndarray, motion: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of dimensionless K and J along a dimensionless motion (free,)."""
    m = problem.mechanism
    ends = []
    for h in (_STEP, -_STEP):
        at = first_order(m, problem.moved(q, h * motion), problem.outputs)
        ends.append((at.K, at.J))
    (k_ahead, j_ahead), (k_behind, j_behind) = ends
    return (k_ahead - k_behind) / (2.0 * _STEP), (j_ahead - j_behind) / (2.0 * _STEP)
