"""A posture of a task: its null motion, its distances from singularities and their slopes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.motion.follow.measures import Sigmas, measured, null_motions
from closedchain.analysis.motion.follow.measures import slopes as slopes_of
from closedchain.analysis.motion.follow.problem import Problem
from closedchain.analysis.structure.mobility import generic_rank


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
        The smallest singular values of A, and of T with the locked inputs at rest, in this order.
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
    m, k = problem.mechanism, problem.freedoms
    here = measured(problem, q)
    basis = null_motions(problem, here)
    if before is not None and k:
        u, _, vt = np.linalg.svd(basis.T @ before)  # the nearest basis of the same space
        basis = basis @ (u @ vt)
    return Posture(
        q=q,
        residual=residual,
        basis=basis,
        sigmas=here.sigmas,
        values=here.values,
        slopes=slopes_of(problem, here, basis) if slopes else np.zeros((here.values.size, k)),
        passive=here.at.K_passive,
        left=_left(here.at.K_passive, generic_rank(m)),
    )


def _left(passive: np.ndarray, rank: int) -> np.ndarray:
    """Basis of the columns of K_p where K_p is square but for redundant rows, else no column."""
    rows, columns = passive.shape
    if columns != rank:
        return np.zeros((rows, 0))
    return np.eye(rows) if rows == rank else np.linalg.svd(passive)[0][:, :rank]
