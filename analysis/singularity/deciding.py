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
from closedchain.closure.nearness import FARTHEST, MOST, NEAR, ROUNDING, SAME, UNFOUND
from closedchain.closure.ranks import Factors, Rank, decomposed, rank_of_singular_values


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
class Spectrum:
    """The first ``count`` singular values, falling, 0 where they are missing, and their scale."""

    values: np.ndarray
    scale: float
    count: int

    def below(self, share: float) -> int:
        """How many are below a share of the scale."""
        there = self.values[: self.count]
        return self.count - int((there > share * self.scale).sum())


@dataclass(frozen=True, eq=False)
class Deciding:
    """Decisions at a closed posture, each made when it is first asked for."""

    at: FirstOrder

    @cached_property
    def generic(self) -> GenericRanks:
        """Ranks at generic postures."""
        return generic_ranks(self.at.mechanism, self.at.outputs)

    @cached_property
    def factors(self) -> Factors:
        """Singular value decomposition of K."""
        return decomposed(self.at.K)

    @cached_property
    def passive_factors(self) -> Factors:
        """Singular value decomposition of K_p."""
        return decomposed(self.at.K_passive)

    @cached_property
    def stacked_factors(self) -> Factors:
        """Singular value decomposition of [K; J]."""
        return decomposed(self.at.stacked)

    @cached_property
    def closures(self) -> Decision:
        """Rank of K."""
        s, r = self.factors.s, generic_rank(self.at.mechanism)
        rank, nearest = self._kept("constraint", Spectrum(s, max(1.0, s.max(initial=0.0)), r), r)
        return Decision(_cut(s, rank), nearest)

    @cached_property
    def lost(self) -> int:
        """Ranks that K lacks here."""
        return generic_rank(self.at.mechanism) - self.closures.rank.value

    @cached_property
    def inputs(self) -> Decision:
        """Rank of A."""
        v, g = self.motions, self.generic
        idle = g.motions - g.inputs.value
        generic = self.at.mechanism.passive_v.size - idle
        rank, nearest = self._kept("direct", Spectrum(self._inputs.s, 1.0, v.size - idle), generic)
        return Decision(_cut(self._inputs.s, rank), nearest)

    @cached_property
    def outputs(self) -> Decision:
        """Rank of T."""
        s, d = self._outputs.s, self.generic.outputs.value
        scale = max(self.generic.output_scale, s.max(initial=0.0))
        # motions that only a constraint singularity has may produce outputs beyond the generic ones
        more = int((s[d:] > NEAR * scale).sum()) if self.lost else 0
        generic = generic_rank(self.at.mechanism) + d
        rank, nearest = self._kept("inverse", Spectrum(s, scale, d), generic)
        return Decision(_cut(s, rank + more), nearest)

    @cached_property
    def locked(self) -> Decision:
        """Rank of K_p: its kernel are the motions with all inputs locked."""
        free = self.motions.size - self.inputs.rank.value
        s, columns = self.passive_factors.s, self.at.mechanism.passive_v.size
        return Decision(_cut(s, columns - free), self.inputs.nearest)

    @cached_property
    def held(self) -> Decision:
        """Rank of [K; J]: its kernel are the motions with all outputs at rest."""
        rank = self.closures.rank.value + self.outputs.rank.value
        return Decision(_cut(self.stacked_factors.s, rank), self.outputs.nearest)

    @cached_property
    def unseen(self) -> int:
        """Dimension of the motions with all inputs and all outputs at rest."""
        free = self.motions.size - self.inputs.rank.value
        if not free:
            return 0
        still = self.motions.size - self.outputs.rank.value
        return _common(self._inputs.kernel(free), self._outputs.kernel(still))

    @cached_property
    def _inputs(self) -> Factors:
        return decomposed(self.motions.inputs)

    @cached_property
    def _outputs(self) -> Factors:
        return decomposed(self.motions.outputs)

    @cached_property
    def motions(self) -> ClosedMotions:
        """The closed motions, as many as the rank of K leaves."""
        return self.motions_for(self.closures.rank.value)

    def motions_for(self, rank: int) -> ClosedMotions:
        """The closed motions, as many as a rank of K leaves."""
        at, basis = self.at, self.factors.kernel(self.at.mechanism.model.nv - rank)
        return closed_motions(at.mechanism, basis, physical_rates(at.mechanism, at.q), at.J)

    @cached_property
    def nearest(self) -> Mapping[str, Nearest]:
        """The nearest singular posture of each kind; all are direct where inputs are missing."""
        everywhere = Nearest(0.0, self.place(self.lost).accuracy)
        return {
            "direct": everywhere if self.generic.undriven else self.inputs.nearest,
            "inverse": self.outputs.nearest,
            "constraint": self.closures.nearest,
        }

    @cached_property
    def ranks(self) -> Ranks:
        """Ranks of K, A, T and [A; T]."""
        size = self.motions.size
        return Ranks(
            self.closures.rank, self.inputs.rank, self.outputs.rank, size - self.unseen, size
        )

    def place(self, lost: int | None = None) -> Place:
        """The posture, where K lacks ``lost`` ranks; None while that is not decided."""
        at, s, r = self.at, self.factors.s, generic_rank(self.at.mechanism)
        residual = float(np.abs(at.values / at.row_unit).max(initial=0.0))
        counted = int((s[:r] > NEAR * s[:1]).sum()) if lost is None else r - lost
        least = float(s[counted - 1]) if counted else 1.0
        return Place(at.mechanism, at.q, residual, least, lost or 0)

    def _kept(self, kind: str, spectrum: Spectrum, generic: int) -> tuple[int, Nearest]:
        """How many singular values are not zero, and the nearest singular posture.

        ``generic`` is the rank of the kind's matrix at a generic posture.
        """
        place, count = self.place(None if kind == "constraint" else self.lost), spectrum.count
        before = place.lost if kind == "inverse" else 0  # by K, with [K; J]
        rounding = ROUNDING * max(1.0, self.at.K.shape[1] / 10.0) / min(max(place.least, 0.1), 1.0)
        small = spectrum.below(max(NEAR, min(place.accuracy, FARTHEST)))
        unfound, zero = spectrum.below(UNFOUND), spectrum.below(rounding / min(spectrum.scale, 1.0))
        nearest = Nearest(0.0 if zero else np.inf, place.accuracy)
        measure = Measure(self.at.mechanism, kind, self.at.outputs)
        short = min(measure.shape) - generic
        # where K nearly loses a rank, its null space turns within the accuracy of the posture
        blurred = kind != "constraint" and place.least < NEAR
        for lost in range(small, zero, -1):
            if blurred or measure.losing(short + before + lost).codimension > MOST:
                found = Nearest(np.inf, place.accuracy)
            else:
                found = nearest_singular(place, measure, generic, before + lost)
            if lost <= unfound and not np.isfinite(found.distance):
                found = Nearest(0.0, place.accuracy)
            if found.here:
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
    def factors(self) -> Factors:
        """Singular value decomposition of K."""
        return self._decided.factors

    @cached_property
    def closures(self) -> Rank:
        """Rank of K."""
        return rank_of_singular_values(self.factors.s, self.tolerance)

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
        s, scale = self.factors.s, output_scale(self.motions, generic)
        shares = {
            "direct": float(sigma_direct(v, generic)),
            "inverse": float(sigma_inverse(v, generic)) / scale,
            "constraint": float(
                entry(s, generic_rank(self.at.mechanism)) / max(s[:1], default=1.0)
            ),
        }
        return {kind: Nearest(share, self.tolerance) for kind, share in shares.items()}


def _cut(s: np.ndarray, rank: int) -> Rank:
    """Rank with the singular values (falling) on both sides of it."""
    above = float(s[rank - 1]) if 0 < rank <= s.size else 0.0
    return Rank(rank, above, float(s[rank]) if rank < s.size else 0.0)


def _common(one: np.ndarray, two: np.ndarray) -> int:
    """Dimension of what two spaces of motions, orthonormal columns (m, k), have in common."""
    if not one.shape[1] or not two.shape[1]:
        return 0
    cosines = np.linalg.svd(one.T @ two, compute_uv=False)
    return int((cosines**2 > 1.0 - SAME).sum())
