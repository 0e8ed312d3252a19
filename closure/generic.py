"""Generic ranks: what closures, inputs and outputs are worth at a posture without special features.

Ranks are largest on almost all closed postures and drop on special ones, so each is the largest
over some closed postures around home. Home itself may be special.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from closedchain.closure.joint_rates import orthonormal_motions, physical_rates
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import (
    RANK_TOLERANCE,
    Rank,
    doubtful,
    null_space,
    numerical_rank,
    rank_above,
)
from closedchain.closure.solve.samples import closed_samples
from closedchain.closure.task import task_jacobian


@dataclass(frozen=True)
class GenericRank:
    """Rank of the dimensionless constraint Jacobian on closed postures.

    Attributes
    ----------
    rank : Rank
        The largest, at the posture where its gap was smallest. Home counts unless one of its
        singular values may be its own error.
    at_home : int
    samples : int
        Postures looked at, home included.
    """

    rank: Rank
    at_home: int
    samples: int


@dataclass(frozen=True)
class GenericRanks:
    """Ranks on the closed motions V = ker K at a generic posture, for a choice of outputs.

    Attributes
    ----------
    motions : int
        n, the dimension of V: the mobility.
    inputs : Rank
        a, of A: V -> input rates.
    outputs : Rank
        d, of T: V -> output rates.
    together : Rank
        b, of [A; T].
    drives : int
        Number of inputs.
    output_scale : float
        Largest singular value of T over the postures looked at; 1 where no output ever moves.
    samples : int
    """

    motions: int
    inputs: Rank
    outputs: Rank
    together: Rank
    drives: int
    output_scale: float
    samples: int

    @property
    def idle(self) -> int:
        """Freedoms that move neither inputs nor outputs, n - b."""
        return self.motions - self.together.value

    @property
    def undriven(self) -> int:
        """Freedoms that move outputs with all inputs locked, b - a; none where well driven."""
        return self.together.value - self.inputs.value

    @property
    def spare(self) -> int:
        """Inputs beyond those that can be moved independently."""
        return self.drives - self.inputs.value

    @property
    def architecturally_singular(self) -> bool:
        """Whether there are inputs enough to drive what moves, and yet they do not."""
        return self.undriven > 0 and self.drives >= self.together.value


_FOUND: WeakKeyDictionary[Mechanism, GenericRank] = WeakKeyDictionary()
_RANKS: WeakKeyDictionary[Mechanism, dict[tuple[str, ...], GenericRanks]] = WeakKeyDictionary()


def sampled_rank(mechanism: Mechanism) -> GenericRank:
    """Generic rank of a mechanism's closures, found once."""
    if mechanism not in _FOUND:
        jacobians = [dimensionless_jacobian(mechanism, q) for q in closed_samples(mechanism)]
        ranks = [numerical_rank(jacobian) for jacobian in jacobians]
        unclear = [doubtful(jacobian) for jacobian in jacobians]
        rank = _largest(ranks[1:] if unclear[0] and not all(unclear) else ranks)
        _FOUND[mechanism] = GenericRank(rank, min(ranks[0].value, rank.value), len(ranks))
    return _FOUND[mechanism]


def generic_ranks(mechanism: Mechanism, outputs: tuple[str, ...]) -> GenericRanks:
    """Generic ranks of inputs and outputs on the closed motions, found once.

    Parameters
    ----------
    outputs : tuple of str
        Some of x y z rx ry rz, in this order; none where nothing is asked of the tip.
    """
    found = _RANKS.setdefault(mechanism, {})
    if outputs not in found:
        found[outputs] = _ranks(mechanism, outputs)
    return found[outputs]


def still_joints(mechanism: Mechanism) -> tuple[str, ...]:
    """Joints of the tree that no closed motion moves, at home and at postures around it."""
    moving = np.zeros(mechanism.model.nv)
    for q in closed_samples(mechanism):
        basis, _ = null_space(dimensionless_jacobian(mechanism, q))
        moving = np.maximum(moving, np.abs(basis).max(axis=1, initial=0.0))
    joints = list(zip(mechanism.model.names, mechanism.model.joints, strict=True))[1:]
    return tuple(
        name for name, j in joints if moving[j.idx_v : j.idx_v + j.nv].max() < RANK_TOLERANCE
    )


def dimensionless_jacobian(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """K (rows, nv) with lengths divided by the characteristic length, at ``q`` (nq,), unchecked."""
    jacobian = np.array(mechanism.workspace.evaluate(q)[1])
    return jacobian * mechanism.column_scale / mechanism.row_scale[:, None]


def dimensionless_task(mechanism: Mechanism, q: np.ndarray, outputs: tuple[str, ...]) -> np.ndarray:
    """J (d, nv) with lengths divided by the characteristic length, at ``q`` (nq,)."""
    if not outputs:
        return np.zeros((0, mechanism.model.nv))
    units = np.array([mechanism.length if name in "xyz" else 1.0 for name in outputs])
    return task_jacobian(mechanism, q, outputs) * mechanism.column_scale / units[:, None]


def _ranks(mechanism: Mechanism, outputs: tuple[str, ...]) -> GenericRanks:
    r = sampled_rank(mechanism).rank.value
    inputs, tips = [], []
    for q in closed_samples(mechanism):
        basis, rank = null_space(dimensionless_jacobian(mechanism, q))
        if rank.value != r:
            continue  # a constraint singularity, with motions that others do not have
        motions = orthonormal_motions(basis, physical_rates(mechanism, q))
        inputs.append(motions[mechanism.input_v])
        tips.append(dimensionless_task(mechanism, q, outputs) @ motions)
    scale = max((np.linalg.norm(t, 2) for t in tips if t.size), default=0.0)
    scale = float(scale) if scale > RANK_TOLERANCE else 1.0  # below it is rounding
    both = [np.vstack([a, t / scale]) for a, t in zip(inputs, tips, strict=True)]
    return GenericRanks(
        motions=mechanism.model.nv - r,
        inputs=_largest([_rank(a) for a in inputs]),
        outputs=_largest([_rank(t / scale) for t in tips]),
        together=_largest([_rank(m) for m in both]),
        drives=len(mechanism.inputs),
        output_scale=scale,
        samples=len(inputs),
    )


def _rank(matrix: np.ndarray) -> Rank:
    """Rank of a matrix of rates for unit motions, whose natural size is 1."""
    values = np.linalg.svd(matrix, compute_uv=False) if matrix.size else np.zeros(0)
    return rank_above(values, RANK_TOLERANCE)


def _largest(ranks: list[Rank]) -> Rank:
    """The largest rank, where its gap is smallest: ranks can only drop elsewhere."""
    best = max(rank.value for rank in ranks)
    return min((rank for rank in ranks if rank.value == best), key=lambda rank: rank.gap)
