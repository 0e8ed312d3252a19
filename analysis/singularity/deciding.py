"""The one place where ranks at a posture are decided: ``classify``, maps, sets and rates ask here.

K, A and T tell all of them (letters as in ``rank_loss``). Singular values above ``NEAR`` of their
scale count, those below ``ROUNDING`` do not. Where one lies between, the distance to the nearest
posture decides at which K, or its columns K_p that are no inputs, or [K; J] lacks a rank more, see
``distance``: the ranks of K_p and [K; J] are those of K, A and T.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.analysis.first_order import FirstOrder
from closedchain.analysis.singularity.distance import Nearest, Place, nearest_singular
from closedchain.analysis.singularity.rank_loss import (
    ROUNDING,
    ClosedMotions,
    Ranks,
    closed_motions,
    entry,
    output_scale,
    ranks_of,
    sigma_direct,
    sigma_inverse,
)
from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.generic import GenericRanks, generic_ranks
from closedchain.closure.joint_rates import physical_rates
from closedchain.closure.ranks import Rank, rank_of_singular_values

NEAR = 1e-5
"""Share of its scale above which a singular value counts without a distance."""

UNFOUND = 1e-8
"""Share below which one is zero where Newton's method finds no singular posture to measure to."""

SAME = 1e-9  # of one: squared cosine of motions that are one


@dataclass(frozen=True)
class Decision:
    """Rank of a matrix at a posture, with its gap.

    Attributes
    ----------
    nearest : Nearest
        The singular posture beside: at distance 0 where singular values are zero to rounding,
        infinitely far where none is small.
    """

    rank: Rank
    nearest: Nearest


@dataclass(frozen=True, eq=False)
class Deciding:
    """Decisions at a closed posture, each made when it is first asked for."""

    at: FirstOrder

    @cached_property
    def generic(self) -> GenericRanks:
        """Ranks at generic postures."""
        return generic_ranks(self.at.mechanism, self.at.outputs)

    @cached_property
    def values(self) -> Mapping[str, np.ndarray]:
        """Singular values, falling, of the matrix of each kind; K's come with ``basis``."""
        return {
            "direct": _values(self.at.K_passive),
            "inverse": _values(self.at.stacked),
            "constraint": self._closures[0],
        }

    @cached_property
    def _closures(self) -> tuple[np.ndarray, np.ndarray]:
        nv = self.at.mechanism.model.nv
        if not self.at.K.shape[0]:
            return np.zeros(0), np.eye(nv)
        _, s, vt = np.linalg.svd(self.at.K)
        return s, vt

    @cached_property
    def closures(self) -> Decision:
        """Rank of K."""
        s, r = self.values["constraint"], generic_rank(self.at.mechanism)
        rank, nearest = self._kept("constraint", s / max(1.0, s.max(initial=0.0)), r, r)
        return Decision(_cut(s, rank), nearest)

    @property
    def lost(self) -> int:
        """Ranks that K lacks here."""
        return generic_rank(self.at.mechanism) - self.closures.rank.value

    @cached_property
    def locked(self) -> Decision:
        """Rank of K_p: its kernel are the motions with all inputs locked."""
        v, g, columns = self.motions, self.generic, self.at.mechanism.passive_v.size
        generic = columns - g.motions + g.inputs.value
        driven = v.size - g.motions + g.inputs.value
        rank, nearest = self._kept("direct", _values(v.inputs), driven, generic)
        return Decision(_cut(self.values["direct"], columns - v.size + rank), nearest)

    @cached_property
    def held(self) -> Decision:
        """Rank of [K; J]: its kernel are the motions with all outputs at rest."""
        v, d = self.motions, self.generic.outputs.value
        values = _values(v.outputs) / output_scale(v, self.generic)
        # motions that only a constraint singularity has may produce outputs beyond the generic ones
        more = int((values[d:] > NEAR).sum()) if self.lost else 0
        generic = generic_rank(self.at.mechanism) + d
        rank, nearest = self._kept("inverse", values, d, generic)
        return Decision(
            _cut(self.values["inverse"], self.closures.rank.value + rank + more), nearest
        )

    @cached_property
    def motions(self) -> ClosedMotions:
        """The closed motions, as many as the rank of K leaves."""
        return self.motions_for(self.closures.rank.value)

    def motions_for(self, rank: int) -> ClosedMotions:
        """The closed motions, as many as a rank of K leaves."""
        at, basis = self.at, np.ascontiguousarray(self._closures[1][rank:].T)
        return closed_motions(at.mechanism, basis, physical_rates(at.mechanism, at.q), at.J)

    @cached_property
    def nearest(self) -> Mapping[str, Nearest]:
        """The nearest singular posture of each kind; all are direct where inputs are missing."""
        everywhere = Nearest(0.0, self.place(self.lost).accuracy)
        return {
            "direct": everywhere if self.generic.undriven else self.locked.nearest,
            "inverse": self.held.nearest,
            "constraint": self.closures.nearest,
        }

    @cached_property
    def ranks(self) -> Ranks:
        """Ranks of K, A, T and [A; T]."""
        v, nv = self.motions, self.at.mechanism.model.nv
        free = self.at.mechanism.passive_v.size - self.locked.rank.value
        still = nv - self.held.rank.value
        return Ranks(
            self.closures.rank,
            _cut(_values(v.inputs), v.size - free),
            _cut(_values(v.outputs), v.size - still),
            v.size - _common(v.inputs, free, v.outputs, still),
            v.size,
        )

    def place(self, lost: int | None = None) -> Place:
        """The posture, where K lacks ``lost`` ranks; None while that is not decided."""
        at, s, r = self.at, self._closures[0], generic_rank(self.at.mechanism)
        residual = float(np.abs(at.values / at.row_unit).max(initial=0.0))
        counted = int((s[:r] > NEAR * s[:1]).sum()) if lost is None else r - lost
        least = float(s[counted - 1]) if counted else 1.0
        return Place(at.mechanism, at.q, residual, least, lost or 0)

    def _kept(self, kind: str, values: np.ndarray, count: int, generic: int) -> tuple[int, Nearest]:
        """How many of ``count`` singular values are not zero, and the nearest singular posture.

        Values fall, are shares of their scale, and are zero where they are missing. ``generic`` is
        the rank of the kind's matrix at a generic posture.
        """
        place = self.place(None if kind == "constraint" else self.lost)
        before = place.lost if kind == "inverse" else 0  # by K, with [K; J]
        there = np.zeros(count)
        there[: values.size] = values[:count]
        small, unfound, zero = (
            int((there <= share).sum()) for share in (max(NEAR, place.accuracy), UNFOUND, ROUNDING)
        )
        nearest = Nearest(0.0 if zero else np.inf, place.accuracy)
        measure = Measure(self.at.mechanism, kind, self.at.outputs if kind == "inverse" else ())
        for lost in range(small, zero, -1):
            found = nearest_singular(place, measure, generic, before + lost)
            if found.here or (lost <= unfound and not np.isfinite(found.distance)):
                return count - lost, found
            nearest = nearest if zero else found
        return count - zero, nearest


@dataclass(frozen=True, eq=False)
class ByShare:
    """The same with singular values below a share of their scale for zeros, as ``rank_loss`` says.

    In the place of the distance stands the share, in that of the accuracy the tolerance.
    """

    at: FirstOrder
    tolerance: float

    @cached_property
    def _decided(self) -> Deciding:
        return Deciding(self.at)

    @property
    def values(self) -> Mapping[str, np.ndarray]:
        """As ``Deciding`` has them."""
        return self._decided.values

    @cached_property
    def closures(self) -> Rank:
        """Rank of K."""
        return rank_of_singular_values(self.values["constraint"], self.tolerance)

    @cached_property
    def motions(self) -> ClosedMotions:
        """The closed motions, as many as the rank of K leaves, at least the generic number."""
        return self._decided.motions_for(min(self.closures.value, generic_rank(self.at.mechanism)))

    @cached_property
    def ranks(self) -> Ranks:
        """Ranks of K, A, T and [A; T]."""
        return ranks_of(self.motions, self.closures, self._decided.generic, self.tolerance)

    @cached_property
    def nearest(self) -> Mapping[str, Nearest]:
        """Shares and the tolerance."""
        v, generic = self.motions, self._decided.generic
        s, scale = self.values["constraint"], output_scale(self.motions, generic)
        shares = {
            "direct": float(sigma_direct(v, generic)),
            "inverse": float(sigma_inverse(v, generic)) / scale,
            "constraint": float(
                entry(s, generic_rank(self.at.mechanism)) / max(s[:1], default=1.0)
            ),
        }
        return {kind: Nearest(share, self.tolerance) for kind, share in shares.items()}


def _values(matrix: np.ndarray) -> np.ndarray:
    if 0 in matrix.shape:
        return np.zeros(0)
    return np.asarray(np.linalg.svd(matrix, compute_uv=False))


def _cut(s: np.ndarray, rank: int) -> Rank:
    """Rank with the singular values (falling) on both sides of it."""
    above = float(s[rank - 1]) if 0 < rank <= s.size else 0.0
    return Rank(rank, above, float(s[rank]) if rank < s.size else 0.0)


def _common(one: np.ndarray, in_one: int, two: np.ndarray, in_two: int) -> int:
    """Dimension of what the kernels of two matrices, of given dimensions, have in common."""
    if not in_one or not in_two:
        return 0
    first, second = _kernel(one, in_one), _kernel(two, in_two)
    cosines = np.linalg.svd(first @ second.T, compute_uv=False)
    return int((cosines**2 > 1.0 - SAME).sum())


def _kernel(matrix: np.ndarray, dimension: int) -> np.ndarray:
    """Orthonormal motions (dimension, m) that a matrix takes to zero, or most nearly so."""
    m = matrix.shape[1]
    if not matrix.shape[0]:
        return np.eye(m)[:dimension]
    return np.asarray(np.linalg.svd(matrix)[2][m - dimension :])
