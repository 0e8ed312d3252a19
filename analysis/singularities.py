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
from closedchain.analysis.mobility import generic_rank
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
        Signed determinants of the dimensionless K_p and [K; J]; None where they are not square
        (redundant closure rows are first combined, see ``row_combination``).
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
    determinants = signed_determinants(at)
    free = np.zeros((mechanism.model.nv, 0))
    if "direct" in kinds:
        motions, _ = null_space(at.K_passive, tolerance)
        free = np.zeros((mechanism.model.nv, motions.shape[1]))
        free[p] = motions * at.column_unit[p, None]
    lost = np.zeros((len(at.outputs), 0))
    if "inverse" in kinds:
        possible, _ = null_space(at.K, tolerance)
        lost, _ = null_space((at.J @ possible).T, tolerance)
        lost *= np.sign(lost[np.abs(lost).argmax(axis=0), range(lost.shape[1])])
    return Classification(
        kinds=kinds,
        sigma_direct=sigma["direct"],
        sigma_inverse=sigma["inverse"],
        sigma_constraint=sigma["constraint"],
        det_direct=determinants["direct"],
        det_inverse=determinants["inverse"],
        free_twists=tip_twists(mechanism, at.q, free),
        lost_twists=lost,
        outputs=at.outputs,
        text=_text(mechanism, at, kinds, sigma, free, lost),
    )


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


def signed_determinants(at: FirstOrder) -> dict[str, float | None]:
    """Signed determinants of the dimensionless K_p and [K; J]; None where not square."""
    combine = row_combination(at.mechanism)
    reduced = combine @ at.K
    matrices = {
        "direct": reduced[:, at.mechanism.passive_v],
        "inverse": np.vstack([reduced, at.J]),
    }
    return {
        kind: float(np.linalg.det(m)) if m.shape[0] == m.shape[1] else None
        for kind, m in matrices.items()
    }


def row_combination(mechanism: Mechanism) -> np.ndarray:
    """Constant matrix (r, rows) that combines redundant closure rows into r independent ones.

    The identity where no row is redundant; else the left singular vectors of K at home. Away from
    home the combination can lose rank on its own, so a vanishing determinant is a candidate that
    the singular values must confirm.
    """
    r = generic_rank(mechanism)
    if r == mechanism.rows:
        return np.eye(r)
    at_home = first_order(mechanism, mechanism.home, task=False)
    u, _, _ = np.linalg.svd(at_home.K)
    return np.ascontiguousarray(u[:, :r].T)


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
