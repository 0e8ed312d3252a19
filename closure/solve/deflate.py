"""Postures where closures hold to the second order, found to rounding.

Where rows hold to the second order they say of a posture that is off by e only e squared, and what
counts as closed may be off by its root. The loss of rank is of the first order in e. So it is asked
for as well, which is called deflation: N^T f = 0 together with N^T K V = 0, with N and V the left
and right null spaces of K that the posture is to have, is regular where f = 0 alone is not. Along
motions that are none of this kind both hold, and nothing is changed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.solve.newton import Rows

STEPS = 30
_SLOPE = 1e-5  # dimensionless step of a difference
_SETTLED, _ROUNDING = 1e-14, 1e-10  # steps that are none, and that may be no better than rounding
_FARTHEST = 1.0  # dimensionless
_SURE, _STARTS = 1e-2, 24  # share of a form's size that is not nothing, and starts to its least


@dataclass(frozen=True, eq=False)
class Deflated:
    """A posture with the strongest directions closed, and the others as the second order lets them.

    Attributes
    ----------
    q : (nq,) array
    rank : int
    rows : (rows,) array
        Dimensionless rows there.
    jacobian : (rows, free) array
    u, values, vt : arrays
        Its singular value decomposition; what is beyond the rank spans N and V.
    bends : (k, rows, free) array
        Derivative of the Jacobian along each of V.
    floor : float
        Curvature of closures, dimensionless, below which they are taken to hold along a motion.
    """

    q: np.ndarray
    rank: int
    rows: np.ndarray
    jacobian: np.ndarray
    u: np.ndarray
    values: np.ndarray
    vt: np.ndarray
    bends: np.ndarray
    floor: float

    @property
    def spare(self) -> np.ndarray:
        """N (rows, rows - rank), directions of the rows that are left open."""
        return self.u[:, self.rank :]

    @property
    def motions(self) -> np.ndarray:
        """V (free, k), which keeps the strongest directions closed."""
        return np.asarray(self.vt[self.rank :].T)

    @property
    def loss(self) -> np.ndarray:
        """N^T K V (rows - rank, k), 0 where the rank is no higher."""
        return np.asarray(self.spare.T @ self.jacobian @ self.motions)

    @property
    def left(self) -> np.ndarray:
        """What is open: N^T f, then the loss, column by column."""
        return np.concatenate([self.spare.T @ self.rows, self.loss.T.ravel()])

    @property
    def open(self) -> float:
        """Largest row, of the loss too."""
        rows = float(np.abs(self.rows).max(initial=0.0))
        return max(rows, float(np.abs(self.loss).max(initial=0.0)))

    @property
    def slopes(self) -> np.ndarray:
        """Derivative of ``left`` along V."""
        bent = np.einsum("rm,lrf,fk->kml", self.spare, self.bends, self.motions)
        return np.vstack([self.loss, bent.reshape(-1, self.motions.shape[1])])

    def bent(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Singular value decomposition of ``slopes``, those too small to count left out."""
        u, s, vt = np.linalg.svd(self.slopes, full_matrices=False)
        count = int((s > self.floor).sum())
        return u[:, :count], s[:count], vt[:count]

    def straight(self) -> np.ndarray:
        """Orthonormal directions (k, m) among V along which closures are not bent."""
        vt = np.linalg.svd(self.slopes)[2]
        return np.asarray(vt[self.bent()[1].size :].T)

    def alone(self) -> bool:
        """Whether closures hold in no direction but the straight ones, to the second order.

        Then all closed postures beside this one are of its rank; else other branches may part here.
        """
        basis = self.bent()[2]
        if not len(basis):
            return True
        form = np.einsum("rm,krf,fl->mkl", self.spare, self.bends, self.motions)
        form = np.einsum("mkl,ak,bl->mab", form, basis, basis)
        form = 0.5 * (form + form.transpose(0, 2, 1))
        return _least_on_sphere(form) > _SURE * float(np.abs(form).max())

    def sideways(self) -> np.ndarray:
        """Least change (k,) along V that takes ``left`` away, as far as it can, negative."""
        u, s, vt = self.bent()
        return np.asarray(vt.T @ ((u.T @ self.left) / s))


def deflated(equations: Rows, q: np.ndarray, rank: int, floor: float) -> Deflated | None:
    """Newton's steps from ``q`` (nq,) to a posture of such a rank; None where they fly off.

    Where there is none they end at the nearest to one, along V. ``floor`` is a curvature that
    counts as none: more than the posture is off, and less than that of what is bent.
    """
    last, gone = np.inf, 0.0
    for _ in range(STEPS):
        here = _at(equations, q, rank, floor)
        u, vt = here.u[:, :rank], here.vt[:rank]
        strong = -vt.T @ ((u.T @ here.rows) / here.values[:rank])
        step = strong - here.motions @ here.sideways()
        size = float(np.linalg.norm(step))
        gone += size
        if not gone < _FARTHEST or (size > 2.0 * last and size > _ROUNDING):
            return None
        if size < _SETTLED or (size < _ROUNDING and size > 0.3 * last):
            return here
        last = max(size, 1e-13)
        q = equations.move(q, step)
    return None


def _at(equations: Rows, q: np.ndarray, rank: int, floor: float) -> Deflated:
    values, jacobian = equations.evaluate(q)
    rows = values / equations.row_scale
    u, s, vt = np.linalg.svd(jacobian, full_matrices=True)
    bends = np.zeros((vt.shape[0] - rank, *jacobian.shape))
    for k, motion in enumerate(vt[rank:]):
        ahead = equations.evaluate(equations.move(q, _SLOPE * motion))[1]
        back = equations.evaluate(equations.move(q, -_SLOPE * motion))[1]
        bends[k] = (np.array(ahead) - back) / (2.0 * _SLOPE)
    return Deflated(q, rank, rows, jacobian, u, s, vt, bends, floor)


def _least_on_sphere(form: np.ndarray) -> float:
    """Least size of quadratic forms (m, c, c) of unit vectors (c,), by Gauss and Newton's steps."""
    w = np.random.default_rng(0).standard_normal((_STARTS, form.shape[1]))
    for _ in range(STEPS):
        w /= np.linalg.norm(w, axis=1, keepdims=True)
        values = np.einsum("mab,na,nb->nm", form, w, w)
        slopes = 2.0 * np.einsum("mab,nb->nma", form, w)
        slopes -= np.einsum("nma,na->nm", slopes, w)[:, :, None] * w[:, None, :]
        steps = np.einsum("nam,nm->na", np.linalg.pinv(slopes, rcond=_SURE), values)
        w -= steps / np.maximum(1.0, np.linalg.norm(steps, axis=1, keepdims=True))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    return float(np.linalg.norm(np.einsum("mab,na,nb->nm", form, w, w), axis=1).min())
