"""What the decomposition of a mechanism into single open chains gives: see ``structure``.

The theory is that of single open chains (SOC) and POC sets: T. Yang, A. Liu, H. Shen, L. Hang,
Q. Luo, Topology Design of Robot Mechanisms, Springer 2018; as used by H. Shen, C. Wu, D. Chablat,
G. Wu, T. Yang, DETC2018-85709, 2018 (eqs. (3)-(5)).
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

from closedchain.analysis.screws.twists import symbol
from closedchain.closure.ranks import Rank


@dataclass(frozen=True)
class Composite:
    """A parallelogram that stands for one pair.

    Attributes
    ----------
    name : str
    bodies : (str, str)
    chains : tuple of tuple of str
        Pairs of each of its sides, from the first body to the second.
    freedoms : int
        What its loops leave of the freedoms of its pairs, idle spins included.
    ranks : tuple of int
        Independent displacement equations of each of its loops.
    motion : (int, int)
        Independent translations and rotations of the second body against the first.

    Examples
    --------
    >>> s = cc.structure(cc.load("linear_delta"))
    >>> s.composites[0].motion  # a parallelogram: one translation, no rotation
    (1, 0)
    """

    name: str
    bodies: tuple[str, str]
    chains: tuple[tuple[str, ...], ...]
    freedoms: int
    ranks: tuple[int, ...]
    motion: tuple[int, int]


@dataclass(frozen=True)
class OpenChain:
    """A single open chain: what is added to close the next loop.

    Attributes
    ----------
    elements : tuple of str
        Its pairs and composites.
    freedoms : int
        Sum of their freedoms f_i.
    inputs : tuple of str
        Inputs among them.
    rank : int
        xi_L = dim(M_pa + M_b), the independent displacement equations of the loop [Shen et al.
        2018, eq. (3b)]. The union of the two sets of motions is the sum of the spaces of twists.
    rank_decision : Rank
        Its gap: of the posture where it was smallest.
    before, chain, union : (int, int)
        Translations and rotations of M_pa, what the sub-mechanism closed so far lets the two ends
        of the chain do against each other; of M_b, what the chain lets them do; of both together.
    constraint_degree : int
        Delta = sum f_i - inputs - xi.
    mobility : int
        Freedoms of the sub-mechanism after it.

    Examples
    --------
    >>> s = cc.structure(cc.load("rpa3t"))
    >>> [(chain.rank, chain.constraint_degree) for chain in s.open_chains]
    [(6, 0), (5, 0)]
    """

    elements: tuple[str, ...]
    freedoms: int
    inputs: tuple[str, ...]
    rank: int
    rank_decision: Rank
    before: tuple[int, int]
    chain: tuple[int, int]
    union: tuple[int, int]
    constraint_degree: int
    mobility: int


@dataclass(frozen=True)
class AssurChain:
    """Loops, by their place among the open chains, that have to be solved together.

    ``coupling_degree`` is kappa = 1/2 sum |Delta_j| over them: how many unknowns must be assumed
    before each of their loops can be solved on its own. At 0 every loop is solved by itself.

    Examples
    --------
    >>> chain = cc.structure(cc.load("rpa3t")).assur_chains[0]
    >>> chain.coupling_degree
    0
    """

    loops: tuple[int, ...]
    coupling_degree: int


@dataclass(frozen=True)
class Structure:
    """Topological structure of a mechanism.

    Attributes
    ----------
    composites : tuple of Composite
    open_chains : tuple of OpenChain
        In the order of least coupling that was found.
    ranks : tuple of int
        xi_Lj of the open chains.
    freedoms : int
        Sum of f_i over the open chains, and over pairs in no loop.
    mobility : int
        F = sum f_i - sum xi_Lj [Shen et al. 2018, eq. (3a)].
    assur_chains : tuple of AssurChain
        Empty where the sum of Delta_j is not zero.
    coupling_degree : int or None
        Largest kappa of the Assur chains. None where the mobility is not the number of inputs: the
        definition is for zero freedoms with the inputs locked.
    exhaustive : bool
        Whether all orders and choices of open chains were searched; else the coupling degree is an
        upper bound.

    Examples
    --------
    >>> s = cc.structure(cc.load("rpa3t"))
    >>> s.ranks, s.mobility, s.coupling_degree
    ((6, 5), 3, 0)
    """

    name: str
    composites: tuple[Composite, ...]
    open_chains: tuple[OpenChain, ...]
    freedoms: int
    mobility: int
    assur_chains: tuple[AssurChain, ...]
    coupling_degree: int | None
    exhaustive: bool
    text: str

    @property
    def ranks(self) -> tuple[int, ...]:
        """Ranks xi_Lj of the loops, in order."""
        return tuple(chain.rank for chain in self.open_chains)


def structure_text(s: Structure) -> str:
    """Composites, loops and their ranks, count, coupling degree, in sentences."""
    lines = []
    for pa in s.composites:
        lines.append(
            f"{pa.name} between {pa.bodies[0]} and {pa.bodies[1]} counts as one pair with "
            f"{pa.freedoms} freedoms, {symbol(pa.motion)}; rank of its loops "
            f"{', '.join(map(str, pa.ranks))}."
        )
    for number, c in enumerate(s.open_chains, 1):
        joined = f"{symbol(c.before)} + {symbol(c.chain)} = " if sum(c.before) else ""
        driven = f"driven by {' '.join(c.inputs)}" if c.inputs else "not driven"
        lines.append(
            f"Loop {number}: {' '.join(c.elements)}; f = {c.freedoms}, {driven}, "
            f"xi = {c.rank} ({joined}{symbol(c.union)}; {c.rank_decision}), "
            f"Delta = {c.freedoms} - {len(c.inputs)} - {c.rank} = {c.constraint_degree:+d}, "
            f"F = {c.mobility}."
        )
    lines.append(
        f"F = sum f - sum xi = {s.freedoms} - {sum(s.ranks)} = {s.freedoms - sum(s.ranks)}."
    )
    if s.mobility != s.freedoms - sum(s.ranks):
        lines.append(f"With parts that no pair connects: {s.mobility}.")
    if s.coupling_degree is None:
        total = sum(c.constraint_degree for c in s.open_chains)
        lines.append(
            f"Coupling degree: not defined, for the constraint degrees add up to {total:+d}: the "
            "freedoms are not as many as the inputs."
        )
    else:
        parts = "; ".join(
            f"loop {' '.join(str(j + 1) for j in a.loops)}: {a.coupling_degree}"
            for a in s.assur_chains
        )
        searched = (
            "least over all orders of loops"
            if s.exhaustive
            else "an upper bound, by a greedy search: too many branches to try all orders"
        )
        lines.append(
            f"Coupling degree {s.coupling_degree} ({searched}). Assur chains: {parts or 'none'}."
        )
    head = f"{s.name}: loop ranks {', '.join(map(str, s.ranks)) or 'none'}."
    return "\n".join(textwrap.fill(line, 80, subsequent_indent="  ") for line in (head, *lines))
