"""Which kinds of singularity a posture shows, by the ranks of K and J.

K is the constraint Jacobian with generic rank r, p its columns that are no inputs, J the task
Jacobian with d rows:

* constraint: rank K < r. The mechanism itself gains mobility, or branches.
* direct (type 2): rank K_p < min(r, n_p). Something moves with all inputs locked.
* inverse (type 1): rank [K; J] < r + d. Some output cannot be produced.
* direct and inverse together: combined (type 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import FirstOrder, first_order, moving_joints, tip_twists
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import null_space

SINGULAR = 1e-8
"""Share of the largest singular value below which one counts as zero."""


@dataclass(frozen=True, eq=False)
class Classification:
    """Kinds of singularity of a posture, with the evidence.

    Attributes
    ----------
    kinds : frozenset of str
        Some of "direct", "inverse", "constraint"; the first two together are combined.
    sigma_direct, sigma_inverse, sigma_constraint : float
        The dimensionless singular value that vanishes there: number min(r, n_p) of K_p, r + d of
        [K; J], r of K. 0 where the matrix is too small to have it.
    det_direct, det_inverse : float or None
        Signed determinants of the dimensionless K_p and [K; J]; None where they are not square.
        With redundant closure rows det_direct has no sign, see ``determinants``.
    free_twists : (6, k) array
        Tip twists (linear, angular) [m/s, rad/s], world-aligned at the tip, of the motions that
        remain with all inputs locked; a zero column moves legs only.
    lost_twists : (d, k) array
        Combinations of outputs that cannot be produced: orthonormal in dimensionless outputs.
    outputs : tuple of str
    text : str
    """

    kinds: frozenset[str]
    sigma_direct: float
    sigma_inverse: float
    sigma_constraint: float
    det_direct: float | None
    det_inverse: float | None
    free_twists: np.ndarray
    lost_twists: np.ndarray
    outputs: tuple[str, ...]
    text: str

    @property
    def combined(self) -> bool:
        """Whether the posture is a direct and an inverse singularity at once (type 3)."""
        return {"direct", "inverse"} <= self.kinds


def classify(
    mechanism: Mechanism,
    q: ArrayLike,
    outputs: str | tuple[str, ...] | list[str] | None = None,
    *,
    tolerance: float = SINGULAR,
) -> Classification:
    """Classify a closed posture.

    Parameters
    ----------
    q : (nq,) array
    outputs : str, optional
        Such as "x y z rx rz"; those of the task by default.
    tolerance : float
        Singular values below this share of the largest count as zero. A posture known to n digits
        shows values of the order 10**-n on a singular set.

    Raises
    ------
    ClosureError
        Malformed or open posture, unknown outputs, no task.
    """
    at = first_order(mechanism, q, outputs)
    r, p = generic_rank(mechanism), mechanism.passive_v
    sigma, largest = measures(at, r)
    kinds = frozenset(kind for kind in sigma if sigma[kind] <= tolerance * largest[kind])
    found = determinants(mechanism, at.K[None], at.J[None])
    dets = {kind: None if value is None else float(value[0]) for kind, value in found.items()}
    free = np.zeros((mechanism.model.nv, 0))
    if "direct" in kinds:
        motions, _ = null_space(at.K_passive, tolerance)
        free = np.zeros((mechanism.model.nv, motions.shape[1]))
        free[p] = motions * at.column_unit[p, None]
    lost = np.zeros((len(at.outputs), 0))
    if "inverse" in kinds:
        least = 0 if "constraint" in kinds else 1
        lost = _lost(at, tolerance, tolerance * largest["inverse"], least)
        lost *= np.sign(lost[np.abs(lost).argmax(axis=0), range(lost.shape[1])])
    return Classification(
        kinds=kinds,
        sigma_direct=sigma["direct"],
        sigma_inverse=sigma["inverse"],
        sigma_constraint=sigma["constraint"],
        det_direct=dets["direct"],
        det_inverse=dets["inverse"],
        free_twists=tip_twists(mechanism, at.q, free),
        lost_twists=lost,
        outputs=at.outputs,
        text=_text(mechanism, at, kinds, sigma, free, lost),
    )


def _lost(at: FirstOrder, tolerance: float, floor: float, least: int) -> np.ndarray:
    """Combinations of outputs (d, k) that no closed motion produces, ``least`` of them or more.

    The singular value of [K; J] decides whether there is one; here the matrix is another, and near
    the tolerance a decision of its own could contradict it.
    """
    possible, _ = null_space(at.K, tolerance)
    u, s, _ = np.linalg.svd(at.J @ possible)
    produced = min(int(np.count_nonzero(s > floor)), max(s.size - least, 0))
    return np.ascontiguousarray(u[:, produced:])


def measures(at: FirstOrder, r: int) -> tuple[dict[str, float], dict[str, float]]:
    """The singular value that each kind watches, and the largest of the same matrix."""
    rank_direct = min(r, at.mechanism.passive_v.size)
    watched = {
        "direct": (at.K_passive, rank_direct),
        "inverse": (at.stacked, r + len(at.outputs)),
        "constraint": (at.K, r),
    }
    sigma, largest = {}, {}
    for kind, (matrix, number) in watched.items():
        values = np.linalg.svd(matrix, compute_uv=False) if matrix.size else np.zeros(0)
        none = 1.0 if number == 0 else 0.0  # nothing that could lose rank, or too few of them
        sigma[kind] = float(values[number - 1]) if 0 < number <= values.size else none
        largest[kind] = float(values[0]) if values.size else 1.0
    return sigma, largest


def determinants(
    mechanism: Mechanism, closures: np.ndarray, task: np.ndarray
) -> dict[str, np.ndarray | None]:
    """Determinants of K_p and [K; J] of dimensionless matrices; None where not square.

    Redundant closure rows are combined into r independent ones first. Bases of the row space have
    no common orientation over all postures, so then only what does not depend on it has a sign:
    the ratio of the two determinants. The one of K_p is given without sign, which loses nothing
    on a branch (it keeps its sign there), and the one of [K; J] with the sign of the ratio. Without
    a determinant of K_p, bases are oriented as at home, as far as that can be told.

    Parameters
    ----------
    closures : (n, rows, nv) array
        K at n postures.
    task : (n, d, nv) array
        J there.

    Returns
    -------
    dict
        "direct" and "inverse": (n,) array or None.
    """
    combine = row_combination(mechanism, closures)
    reduced = combine @ closures
    square = {
        "direct": reduced[:, :, mechanism.passive_v],
        "inverse": np.concatenate([reduced, task], axis=1),
    }
    found = {k: np.linalg.det(m) if m.shape[1] == m.shape[2] else None for k, m in square.items()}
    if reduced.shape[1] == mechanism.rows:
        return found
    direct, inverse = found["direct"], found["inverse"]
    if direct is None:
        k = first_order(mechanism, mechanism.home, task=False).K[None]
        orientation = np.linalg.det(row_combination(mechanism, k) @ combine.swapaxes(1, 2))
    else:
        orientation = direct
        found["direct"] = np.abs(direct)
    if inverse is not None:
        found["inverse"] = np.where(orientation < 0.0, -inverse, inverse)
    return found


def row_combination(mechanism: Mechanism, closures: np.ndarray) -> np.ndarray:
    """Matrices (..., r, rows) that combine redundant closure rows into r independent ones.

    The identity where no row is redundant; else the left singular vectors of K (..., rows, nv):
    the combined rows lose rank where K does, and nowhere else.
    """
    r = generic_rank(mechanism)
    if r == mechanism.rows:
        return np.broadcast_to(np.eye(r), (*closures.shape[:-2], r, r))
    u, _, _ = np.linalg.svd(closures)
    return np.ascontiguousarray(u[..., :r].swapaxes(-1, -2))


def _text(
    mechanism: Mechanism,
    at: FirstOrder,
    kinds: frozenset[str],
    sigma: dict[str, float],
    free: np.ndarray,
    lost: np.ndarray,
) -> str:
    name = "regular"
    if {"direct", "inverse"} <= kinds:
        name = "combined singularity (direct and inverse, type 3)"
    elif "direct" in kinds:
        name = "direct singularity (type 2)"
    elif "inverse" in kinds:
        name = "inverse singularity (type 1)"
    if "constraint" in kinds:
        name = "constraint singularity" if kinds == {"constraint"} else f"{name}, and constraint"
    listed = ", ".join(f"{kind} {value:.3g}" for kind, value in sigma.items())
    lines = [
        f"{mechanism.name}: {name}, outputs {' '.join(at.outputs)}.",
        f"  vanishing singular values: {listed}",
    ]
    twists = tip_twists(mechanism, at.q, free)
    for motion, twist in zip(free.T, twists.T, strict=True):
        moves = ", ".join(moving_joints(mechanism, motion))
        still = np.linalg.norm(twist) < 1e-9 * np.linalg.norm(motion)
        what = "the tip stays at rest" if still else f"the tip moves with {_numbers(twist)}"
        lines.append(f"  inputs locked, {what}; moving: {moves}")
    lines.extend(f"  lost output combination {_numbers(twist)}" for twist in lost.T)
    return "\n".join(lines)


def _numbers(vector: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in np.where(np.abs(vector) < 1e-12, 0.0, vector)) + ")"
