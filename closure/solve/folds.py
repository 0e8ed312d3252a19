"""Folds on a way: where two postures of the same targets meet, located to rounding.

A branch that is followed up to a fold ends short of it. The fold itself is found by Newton's method
in the posture and the share of the way together: the rows, and the least singular value of their
Jacobian, its singular vectors held for a step. Near it the way is a parabola in the vector that
vanishes, one posture on either side: that tells where the other one is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.solve.alone import Between

STEP = 1e-5  # dimensionless, or a share of the way: how far away slopes are taken
ITERATIONS = 30
LONGEST = 0.2  # of a step of Newton's method
CLOSED = 1e-12  # dimensionless rows
VANISHED = 1e-10  # share of the largest singular value
CROSSING = 1e-7  # least slope of rows along the way, and least curvature, that make a fold


@dataclass(frozen=True, eq=False)
class Fold:
    """A singular posture on a way, and the parabola around it.

    Attributes
    ----------
    q : (nq,) array
    share : float
        Of the way.
    along : (free,) array
        Unit vector that the Jacobian takes to zero, dimensionless.
    bend : float
        Postures beside it at ``x`` along that vector have the share ``share + bend x^2``; 0 where
        the branch does not fold, but goes on or meets others.
    """

    q: np.ndarray
    share: float
    along: np.ndarray
    bend: float

    def aside(self, share: float) -> float | None:
        """How far along the vector the two postures of another share are; None on the far side."""
        square = (share - self.share) / self.bend if self.bend else -1.0
        return float(np.sqrt(square)) if square > 0.0 else None


@dataclass(frozen=True, eq=False)
class _Local:
    """Rows (m,), their Jacobian (m, n), its least singular triple; slopes by differences."""

    values: np.ndarray
    jacobian: np.ndarray
    left: np.ndarray
    least: float
    right: np.ndarray
    scale: float
    by_share: np.ndarray
    least_by_share: float
    least_by_q: np.ndarray

    @property
    def bend(self) -> float:
        """Of the parabola, where rows and slopes are those of a fold."""
        slope = float(self.left @ self.by_share)
        curvature = float(self.least_by_q @ self.right)
        if min(abs(slope), abs(curvature)) < CROSSING * self.scale:
            return 0.0
        return -0.5 * curvature / slope


def fold_near(way: Between, q: np.ndarray, share: float) -> Fold | None:
    """The singular posture beside one (nq,) that is nearly closed at a share of a way, or None."""
    for _ in range(ITERATIONS):
        here = _local(way, q, share)
        if here is None:
            return None
        open_ = float(np.abs(here.values).max(initial=0.0))
        if open_ < CLOSED and here.least < VANISHED * here.scale:
            return Fold(way(q, share)[1], share, here.right, here.bend)
        matrix = np.block(
            [
                [here.jacobian, here.by_share[:, None]],
                [here.least_by_q[None], np.array([[here.least_by_share]])],
            ]
        )
        step = -np.linalg.lstsq(matrix, np.append(here.values, here.least), rcond=1e-12)[0]
        size = float(np.linalg.norm(step))
        if not np.isfinite(size):
            return None
        step *= min(1.0, LONGEST / max(size, LONGEST))
        system, q = way(q, share)
        q, share = system.move(q, step[:-1]), share + float(step[-1])
    return None


def _local(way: Between, q: np.ndarray, share: float) -> _Local | None:
    system, q = way(q, share)
    values, jacobian = _rows(way, q, share)
    if not np.isfinite(jacobian).all() or 0 in jacobian.shape:
        return None
    u, s, vt = np.linalg.svd(jacobian, full_matrices=False)
    if len(s) < jacobian.shape[1]:
        return None
    left, right = u[:, -1], vt[-1]
    (_, ahead), (_, behind) = (
        _rows(way, system.move(q, side * STEP * right), share) for side in (1.0, -1.0)
    )
    (after, later), (before, earlier) = (_rows(way, q, share + side * STEP) for side in (1.0, -1.0))
    return _Local(
        values=values,
        jacobian=jacobian,
        left=left,
        least=float(s[-1]),
        right=right,
        scale=float(s[0]),
        by_share=(after - before) / (2.0 * STEP),
        least_by_share=float(left @ (later - earlier) @ right) / (2.0 * STEP),
        # at a fold, slopes of u.J v by q are those of u.J along v: rows' second derivatives
        least_by_q=left @ (ahead - behind) / (2.0 * STEP),
    )


def _rows(way: Between, q: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    system, q = way(q, share)
    values, jacobian = system.evaluate(q)
    return values / system.row_scale, jacobian
