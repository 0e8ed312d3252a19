"""Which kinds of singularity a posture shows, and of which types, with the evidence.

Kinds and types are tables in ``kinds``, the measures are defined in ``rank_loss``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import FirstOrder, first_order, moving_joints, tip_twists
from closedchain.analysis.singularity.deciding import ByShare, Deciding
from closedchain.analysis.singularity.distance import Nearest
from closedchain.analysis.singularity.kinds import TYPES, kinds_of, title, types_of
from closedchain.analysis.singularity.rank_loss import (
    ClosedMotions,
    Ranks,
    entry,
    sigma_direct,
    sigma_inverse,
)
from closedchain.analysis.structure.driving import driving
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.generic import generic_ranks
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.choosing import mode_posture
from closedchain.closure.ranks import Rank
from closedchain.urdf.description import OUTPUTS

SINGULAR = 1e-8
"""Share of its scale below which a singular value counts as zero where no distance is sought."""


@dataclass(frozen=True, eq=False)
class Classification:
    """Kinds of singularity of a posture, with the evidence.

    Attributes
    ----------
    kinds : frozenset of str
        Some of "direct", "inverse", "constraint"; the first two together are combined.
    types : frozenset of str
        Zlatanov's types, some of "RI", "RO", "II", "IO", "IIM", "RPM".
    sigma_direct, sigma_inverse : float
        Dimensionless singular values of the input and output rates of unit closed motions, 0 at
        direct and inverse singularities: how much the inputs must move, and the outputs can, when
        the joints move at a rate of 1. They do not depend on which joints were cut.
    sigma_constraint : float
        Singular value r of the dimensionless K, 0 at constraint singularities. It detects, and is
        no distance: its size depends on what was cut.
    det_direct, det_inverse : float or None
        Signed determinants of the dimensionless K_p and [K; J]; None where they are not square.
        With redundant closure rows det_direct has no sign, see ``determinants``. Only signs and
        zeros mean something.
    free_twists : (6, k) array
        Tip twists (linear, angular) [m/s, rad/s], world-aligned at the tip, of the motions that
        remain with all inputs locked, at a joint rate of 1, the largest first; a zero column moves
        legs only. None unless the posture is direct.
    lost_twists : (d, k) array
        Combinations of outputs that cannot be produced: orthonormal in dimensionless outputs. None
        unless the posture is inverse.
    ranks : mapping of kind to Rank
        The decision for each kind with its gap: of A, T and K, see ``rank_loss``. ``gap`` is the
        ratio of the smallest singular value that counts to the largest that does not.
    nearest : mapping of kind to Nearest
        ``distance`` to the nearest posture that is singular in this way, in the norm of physical
        joint rates, and the ``accuracy`` to which the posture is known: what lies within it counts.
        At an infinite distance where no singular value is small, so that none was sought.
    outputs : tuple of str
    text : str

    Examples
    --------
    >>> m = cc.load("d1")
    >>> found = cc.classify(m, m.home)
    >>> sorted(found.types)
    ['IO', 'RI']
    >>> found.lost_twists.shape  # one combination of the six outputs cannot be produced
    (6, 1)
    >>> bool(found.distance <= found.accuracy)
    True
    """

    kinds: frozenset[str]
    types: frozenset[str]
    sigma_direct: float
    sigma_inverse: float
    sigma_constraint: float
    det_direct: float | None
    det_inverse: float | None
    free_twists: np.ndarray
    lost_twists: np.ndarray
    ranks: Mapping[str, Rank]
    nearest: Mapping[str, Nearest]
    outputs: tuple[str, ...]
    text: str

    @property
    def distance(self) -> float:
        """To the nearest singular posture, of whatever kind, see ``nearest``."""
        return min(found.distance for found in self.nearest.values())

    @property
    def accuracy(self) -> float:
        """To which the posture is known in that respect."""
        return min(self.nearest.values(), key=lambda found: found.distance).accuracy

    @property
    def combined(self) -> bool:
        """Whether the posture is a direct and an inverse singularity at once (type 3)."""
        return {"direct", "inverse"} <= self.kinds


def classify(
    mechanism: Mechanism,
    q: ArrayLike | str | int,
    outputs: str | tuple[str, ...] | list[str] | None = None,
    *,
    tolerance: float | None = None,
) -> Classification:
    """Classify a closed posture.

    A posture is singular where a singular one lies within the accuracy to which it is known. Where
    a singular value is small, Newton's method seeks it.

    Parameters
    ----------
    q : (nq,) array, or str or int
        A posture, or a mode by name or number, as ``cc.direct`` takes it.
    outputs : str, optional
        Such as "x y z rx rz"; those of the task by default.
    tolerance : float, optional
        Singular values below this share of their scale count as zero instead, and no distance is
        sought. A posture known to n digits shows values of the order 10**-n on a singular set.

    Raises
    ------
    ClosureError
        Malformed or open posture, unknown outputs, no task.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> sorted(cc.classify(m, m.home).kinds)
    ['inverse']
    >>> sorted(cc.classify(m, m.home, "x y z rx rz").kinds)  # a task without rotation about y
    []
    """
    if isinstance(q, str | int):
        q = mode_posture(mechanism, q)
    at = first_order(mechanism, q, outputs)
    generic = generic_ranks(mechanism, at.outputs)
    decided = Deciding(at) if tolerance is None else ByShare(at, tolerance)
    v, ranks = decided.motions, decided.ranks
    kinds, types = kinds_of(ranks, generic), types_of(ranks, generic)
    free, lost = _free(at, v, ranks, kinds), _lost(v, ranks, kinds)
    sigma = {
        "direct": float(sigma_direct(v, generic)),
        "inverse": float(sigma_inverse(v, generic)),
        "constraint": float(entry(decided.factors.s, generic_rank(mechanism))),
    }
    found = determinants(mechanism, at.K[None], at.J[None])
    dets = {kind: None if value is None else float(value[0]) for kind, value in found.items()}
    return Classification(
        kinds=kinds,
        types=types,
        sigma_direct=sigma["direct"],
        sigma_inverse=sigma["inverse"],
        sigma_constraint=sigma["constraint"],
        det_direct=dets["direct"],
        det_inverse=dets["inverse"],
        free_twists=tip_twists(mechanism, at.q, free),
        lost_twists=lost,
        ranks=MappingProxyType(
            {"direct": ranks.inputs, "inverse": ranks.outputs, "constraint": ranks.closures}
        ),
        nearest=MappingProxyType(decided.nearest),
        outputs=at.outputs,
        text=_text(at, decided, sigma, free, lost),
    )


def _free(at: FirstOrder, v: ClosedMotions, ranks: Ranks, kinds: frozenset[str]) -> np.ndarray:
    """Motions (nv, k) [m/s, rad/s] with all inputs locked, those that move the tip most first."""
    if "direct" not in kinds:
        return np.zeros((v.motions.shape[0], 0))
    free = v.motions
    if v.inputs.shape[0]:
        _, _, wt = np.linalg.svd(v.inputs)
        free = v.motions @ wt[ranks.inputs.value :].T
    free = free * at.column_unit[:, None]
    units = np.array([at.mechanism.length if name in "xyz" else 1.0 for name in OUTPUTS])
    _, _, turn = np.linalg.svd(tip_twists(at.mechanism, at.q, free) / units[:, None])
    return np.asarray(free @ turn.T)


def _lost(v: ClosedMotions, ranks: Ranks, kinds: frozenset[str]) -> np.ndarray:
    """Combinations of outputs (d, k) that no closed motion produces, largest entries positive."""
    if "inverse" not in kinds:
        return np.zeros((v.outputs.shape[0], 0))
    u, _, _ = np.linalg.svd(v.outputs)
    lost = u[:, ranks.outputs.value :]
    lost = lost * np.sign(lost[np.abs(lost).argmax(axis=0), range(lost.shape[1])])
    return np.ascontiguousarray(lost)


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
    at: FirstOrder,
    decided: Deciding | ByShare,
    sigma: dict[str, float],
    free: np.ndarray,
    lost: np.ndarray,
) -> str:
    mechanism, ranks = at.mechanism, decided.ranks
    generic = generic_ranks(mechanism, at.outputs)
    kinds, types = kinds_of(ranks, generic), types_of(ranks, generic)
    listed = ", ".join(
        f"{kind} {value:.3g}" + " (vanishes)" * (kind in kinds) for kind, value in sigma.items()
    )
    lines = [
        f"{mechanism.name}: {title(kinds)}, outputs {' '.join(at.outputs)}.",
        f"  singular values: {listed}",
    ]
    ranked = {"direct": ranks.inputs, "inverse": ranks.outputs, "constraint": ranks.closures}
    lines.extend(
        f"  {kind}: {ranked[kind]}, singular at a distance of {near.distance:.3g}, where the "
        f"posture is known to {near.accuracy:.3g}"
        for kind, near in decided.nearest.items()
        if np.isfinite(near.distance) and isinstance(decided, Deciding)
    )
    if types:
        named = ", ".join(f"{name} {TYPES[name].title}" for name in TYPES if name in types)
        lines.append(f"  types: {named}")
    twists = tip_twists(mechanism, at.q, free)
    for motion, twist in zip(free.T, twists.T, strict=True):
        moves = ", ".join(moving_joints(mechanism, motion))
        still = np.linalg.norm(twist) < 1e-9 * np.linalg.norm(motion)
        what = "the tip stays at rest" if still else f"the tip moves with {_numbers(twist)}"
        lines.append(f"  inputs locked, {what}; moving: {moves}")
    lines.extend(f"  lost output combination {_numbers(twist)}" for twist in lost.T)
    lines.extend(f"  {sentence}" for sentence in driving(mechanism, at.outputs))
    return "\n".join(lines)


def _numbers(vector: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in np.where(np.abs(vector) < 1e-12, 0.0, vector)) + ")"
