"""Mobility: the Gruebler count beside the rank of the loops, which is what decides."""

from __future__ import annotations

import textwrap
from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.structure.driving import driving
from closedchain.analysis.structure.hinges import pairs_of_tree, symbol_of
from closedchain.closure.closures import Coupling
from closedchain.closure.generic import (
    GenericRank,
    dimensionless_jacobian,
    generic_ranks,
    sampled_rank,
    still_joints,
)
from closedchain.closure.joint_kinds import BY_SYMBOL, JOINT_KINDS
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.dimension import finite_dimensions
from closedchain.closure.ranks import Rank, numerical_rank
from closedchain.urdf.description import Description
from closedchain.urdf.errors import ClosureError

OPEN = 1e-9


@dataclass(frozen=True)
class Mobility:
    """Mobility of a mechanism.

    Attributes
    ----------
    links : int
        Bodies, the base included; the cross links of universal joints and balls are no bodies, nor
        are the rods of distance closures.
    pairs : int
        Kinematic pairs, cut joints included; a universal or spherical joint is one pair.
    freedoms : int
        Sum of the freedoms of the pairs.
    gruebler : int
        6 (links - pairs - 1) + freedoms, less one for every coupling.
    generic_rank : int
        Rank r of the constraint Jacobian on random closed postures.
    mobility : int
        nv - r: what the mechanism can really do at a generic posture.
    redundant_rows : int
        Closure rows beyond the rank; consistent, since the postures close.
    rank : Rank
        The decision with its gap, at the posture where the gap was smallest.
    pair_counts : mapping of symbol to count
    undriven, idle : int or None
        Freedoms that move the outputs of the task with all inputs locked, in every posture, and
        freedoms that move neither inputs nor outputs; None without a task.

    Examples
    --------
    >>> found = cc.mobility(cc.load("linear_delta"))
    >>> found.gruebler, found.mobility, found.redundant_rows
    (-9, 3, 12)
    """

    links: int
    pairs: int
    freedoms: int
    gruebler: int
    generic_rank: int
    mobility: int
    redundant_rows: int
    rank: Rank
    pair_counts: dict[str, int]
    undriven: int | None
    idle: int | None
    text: str
    mechanism: Mechanism = field(repr=False, compare=False)

    @cached_property
    def finite(self) -> int:
        """Dimension of the set of postures around home, the largest of its branches.

        Idle freedoms count. It differs from ``mobility`` where closures hold to the first order in
        directions in which nothing moves. Measured when it is first asked for, which takes a
        moment.
        """
        return self.finite_at(self.mechanism.home)[0]

    def finite_at(self, q: ArrayLike) -> tuple[int, ...]:
        """Dimensions that branches of postures around a closed one (nq,) have, the largest first.

        Where all closure rows are independent, or nothing moves to the first order, the rank alone
        tells; elsewhere the set is measured. Raises ``ClosureError`` where the loops are open.
        """
        q = self.mechanism.configuration(q)
        gap = float(np.abs(self.mechanism.workspace.residual(q)).max(initial=0.0))
        if gap > OPEN:
            raise ClosureError(
                f"the loops are open there by {gap:.3g}; close them first (cc.close)"
            )
        jacobian = dimensionless_jacobian(self.mechanism, q)
        if (rank := numerical_rank(jacobian).value) in jacobian.shape:
            return (self.mechanism.model.nv - rank,)
        return finite_dimensions(self.mechanism, q)


def mobility(mechanism: Mechanism) -> Mobility:
    """Count links and pairs, find the generic rank, and say what they mean.

    Gruebler's (Kutzbach's) count F = 6 (n - j - 1) + sum f_i [Gallardo-Alvarado 2010, eq. (1)]
    knows only numbers; the mobility is nv - rank K on the set of closed postures. Virtual
    chains (floating joints) have six freedoms and add nothing to either.

    Examples
    --------
    >>> found = cc.mobility(cc.load("linear_delta"))
    >>> found.mobility, found.gruebler  # parallelograms fool the count
    (3, -9)
    """
    counts, cross_links = _pairs(mechanism.description)
    bodies = _bodies(mechanism.description) - cross_links
    pairs = sum(counts.values())
    freedoms = sum(_freedoms(symbol) * n for symbol, n in counts.items())
    gruebler = 6 * (bodies - pairs - 1) + freedoms - _couplings(mechanism)
    generic = sampled_rank(mechanism)
    rank = generic.rank
    degrees = mechanism.model.nv - rank.value
    redundant = mechanism.rows - rank.value
    driven = None
    if mechanism.task is not None:
        driven = generic_ranks(mechanism, mechanism.outputs())
    return Mobility(
        links=bodies,
        pairs=pairs,
        freedoms=freedoms,
        gruebler=gruebler,
        generic_rank=rank.value,
        mobility=degrees,
        redundant_rows=redundant,
        rank=rank,
        pair_counts=dict(counts),
        undriven=None if driven is None else driven.undriven,
        idle=None if driven is None else driven.idle,
        text=_text(mechanism, counts, bodies, freedoms, gruebler, generic),
        mechanism=mechanism,
    )


def generic_rank(mechanism: Mechanism) -> int:
    """Rank r of the constraint Jacobian at a generic closed posture."""
    return sampled_rank(mechanism).rank.value


def _bodies(description: Description) -> int:
    """Number of rigid bodies: links, less those that hang on a fixed joint."""
    return len(description.links) - sum(j.type == "fixed" for j in description.joints)


def _pairs(description: Description) -> tuple[Counter[str], int]:
    """Pairs by symbol, and the number of links swallowed by pairs that are several joints."""
    rows = pairs_of_tree(description)
    counts: Counter[str] = Counter(map(symbol_of, rows))
    for closure in description.closures:
        counts[JOINT_KINDS[closure.type].symbol] += 1
    return counts, sum(len(row) - 1 for row in rows)


def _freedoms(symbol: str) -> int:
    return BY_SYMBOL[symbol].freedoms


def _couplings(mechanism: Mechanism) -> int:
    return sum(isinstance(closure, Coupling) for closure in mechanism.closures)


def _text(
    mechanism: Mechanism,
    counts: Counter[str],
    bodies: int,
    freedoms: int,
    gruebler: int,
    generic: GenericRank,
) -> str:
    rank = generic.rank
    degrees = mechanism.model.nv - rank.value
    pairs = sum(counts.values())
    listed = " + ".join(f"{n}{symbol}" for symbol, n in sorted(counts.items()))
    couplings = _couplings(mechanism)
    tied = f" - {couplings} coupling{'s' * (couplings > 1)}" if couplings else ""
    lines = [
        f"{mechanism.name}: mobility {degrees}.",
        f"Count: n = {bodies} links, j = {listed} = {pairs} pairs, sum f = {freedoms}; "
        f"F = 6 (n - j - 1) + sum f{tied} = {gruebler}.",
        f"Rank: the {mechanism.rows} closure rows have generic {rank} over {generic.samples} "
        f"closed postures; nv - r = {mechanism.model.nv} - {rank.value} = {degrees}.",
    ]
    if any(BY_SYMBOL[symbol].is_rod for symbol in counts):
        lines.append("SS is a rod between two balls that has no spin of its own and is no link.")
    redundant = mechanism.rows - rank.value
    if redundant:
        rows = "1 closure row is" if redundant == 1 else f"{redundant} closure rows are"
        lines.append(f"{rows} redundant and consistent (overconstrained).")
    if gruebler != degrees:
        lines.append("The count differs from the mobility: it knows no special geometry.")
    if generic.at_home < rank.value:
        lines.append(f"At home the rank drops to {generic.at_home}: a constraint singularity.")
    still = still_joints(mechanism) if degrees else ()
    if still:
        listed = ", ".join(still[:6]) + (f" and {len(still) - 6} more" if len(still) > 6 else "")
        lines.append(f"The loops hold still, in every posture looked at: {listed}.")
    lines.extend(driving(mechanism))
    for remark in mechanism.description.remarks:
        if remark.about == "mobility":
            source = f" [{remark.source}]" if remark.source else ""
            lines.append(f"{remark.text}{source}")
    return "\n".join(textwrap.fill(line, 80) for line in lines)
