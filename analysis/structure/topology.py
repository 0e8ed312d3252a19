"""Topological structure: single open chains in order, loop ranks, Assur chains, coupling degree.

The theory is cited in ``open_chains``. Here the dimensions of its sets of motions are ranks of
screws at closed postures; nothing is read from symbols.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache

from numpy.typing import ArrayLike

from closedchain.analysis.structure.composites import Branch, Element, branches
from closedchain.analysis.structure.graph import Walk
from closedchain.analysis.structure.loops import LoopGraph, loops
from closedchain.analysis.structure.open_chains import (
    AssurChain,
    Composite,
    OpenChain,
    Structure,
    structure_text,
)
from closedchain.analysis.structure.ordering import best_order
from closedchain.analysis.structure.pair_screws import PairScrews, pair_screws
from closedchain.analysis.structure.postures import tangent, wander
from closedchain.analysis.structure.submechanisms import SubMechanisms
from closedchain.closure.mechanism import Mechanism

POSTURES = 3


def structure(
    mechanism: Mechanism, q: ArrayLike | None = None, *, parallelograms: bool = True
) -> Structure:
    """Decompose a mechanism into single open chains, with loop ranks and coupling degree.

    The chains are those whose constraint degrees Delta_j have the least sum of sizes, over all
    orders and choices for up to ten branches between branching bodies, by a greedy search beyond.
    Ranks are of screws at a few closed postures of one motion, so a sub-mechanism is asked in
    postures that the whole mechanism can take.

    Parameters
    ----------
    q : (nq,) array, optional
        Closed posture whose motion component is asked; home by default.
    parallelograms : bool
        Take chains without inputs that are translated copies of each other as one composite pair,
        as the theory does. False counts every loop.

    Raises
    ------
    ClosureError
        Malformed or open posture, or one that no motion leads away from.

    Examples
    --------
    >>> s = cc.structure(cc.load("rpa3t"))
    >>> s.coupling_degree  # its loops can be solved one after the other
    0
    """
    graph = loops(mechanism)
    postures = _generic_screws(mechanism, graph, q)
    sub = SubMechanisms(graph, postures)
    found = branches(graph, postures, parallelograms=parallelograms)
    names = {e: _name(graph, e) for branch in found for e in branch.elements}
    ends = [(branch.start, branch.end) for branch in found]

    def pairs_of(chosen: Iterable[int]) -> list[int]:
        return [*graph.bridges, *(p for b in chosen for p in found[b].pairs)]

    def degree(chosen: frozenset[int]) -> int:
        return sub.mobility(pairs_of(chosen)) - sum(len(_inputs(graph, found[b])) for b in chosen)

    weight = [sum(sub.freedoms(e) for e in branch.elements) for branch in found]
    order, exhaustive = best_order(len(graph.bodies), ends, lru_cache(maxsize=None)(degree), weight)
    chains: list[OpenChain] = []
    done: list[int] = []
    for walk in order:
        chain = _open_chain(graph, sub, found, names, pairs_of(done), walk)
        inputs = tuple(name for name in mechanism.inputs if name in chain.inputs)
        chains.append(replace(chain, inputs=inputs))
        done += [b for b, _ in walk]
    assur = _assur_chains([c.constraint_degree for c in chains])
    result = Structure(
        name=mechanism.name,
        composites=tuple(_composite(graph, sub, e, n) for e, n in names.items() if e.composite),
        open_chains=tuple(chains),
        freedoms=sub.pair_freedoms(graph.bridges) + sum(c.freedoms for c in chains),
        mobility=sub.mobility(pairs_of(range(len(found)))) + 6 * (graph.components - 1),
        assur_chains=assur,
        coupling_degree=_coupling_degree(chains, assur),
        exhaustive=exhaustive,
        text="",
    )
    return replace(result, text=structure_text(result))


def _generic_screws(
    mechanism: Mechanism, graph: LoopGraph, start: ArrayLike | None
) -> list[PairScrews]:
    """Screws at postures of greatest rank K, of one motion."""
    found = wander(mechanism, POSTURES, start)
    ranks = [tangent(mechanism, q)[1].value for q in found]
    return [
        pair_screws(mechanism, graph, q)
        for q, rank in zip(found, ranks, strict=True)
        if rank == max(ranks)
    ]


def _inputs(graph: LoopGraph, branch: Branch) -> tuple[str, ...]:
    return tuple(name for p in branch.pairs for name in graph.pairs[p].inputs)


def _name(graph: LoopGraph, element: Element) -> str:
    runs = [" ".join(graph.pairs[p].name for p in run) for run in element.members]
    return f"Pa({' | '.join(runs)})" if element.composite else runs[0]


def _open_chain(
    graph: LoopGraph,
    sub: SubMechanisms,
    found: Sequence[Branch],
    names: dict[Element, str],
    done: list[int],
    walk: Walk,
) -> OpenChain:
    """Chain that closes the next loop of a sub-mechanism made of the pairs ``done``."""
    passed = [found[b] if sign > 0 else _reversed(found[b]) for b, sign in walk]
    elements = [element for branch in passed for element in branch.elements]
    # where a branch ends and where the next one sets out, the sub-mechanism lies between
    following = [*passed[1:], passed[0]]
    gaps = [(b.end, n.start) for b, n in zip(passed, following, strict=True) if b.end != n.start]
    before, chain, union = sub.spaces(elements, done, gaps)
    freedoms = sum(sub.freedoms(element) for element in elements)
    inputs = tuple(name for branch in passed for name in _inputs(graph, branch))
    after = sub.mobility([*done, *(p for element in elements for p in element.pairs)])
    rank = freedoms + sub.mobility(done) - after
    return OpenChain(
        elements=tuple(names[element] for element in elements),
        freedoms=freedoms,
        inputs=inputs,
        rank=rank,
        rank_decision=union.rank,
        before=before.dimensions,
        chain=chain.dimensions,
        union=union.dimensions,
        constraint_degree=freedoms - len(inputs) - rank,
        mobility=after,
    )


def _reversed(branch: Branch) -> Branch:
    return Branch(branch.end, branch.start, branch.elements[::-1], branch.signs[::-1])


def _composite(graph: LoopGraph, sub: SubMechanisms, element: Element, name: str) -> Composite:
    freedoms = [
        sub.mobility(p for run in element.members[: k + 1] for p in run)
        for k in range(len(element.members))
    ]
    added = [sub.pair_freedoms(run) for run in element.members]
    return Composite(
        name=name,
        bodies=(graph.bodies[element.start].name, graph.bodies[element.end].name),
        chains=tuple(tuple(graph.pairs[p].name for p in run) for run in element.members),
        freedoms=freedoms[-1],
        ranks=tuple(
            added[k] + freedoms[k - 1] - freedoms[k] for k in range(1, len(element.members))
        ),
        motion=sub.motion(element).dimensions,
    )


def _assur_chains(degrees: Sequence[int]) -> tuple[AssurChain, ...]:
    """Split the loops where the sum of constraint degrees comes back to zero."""
    if sum(degrees):
        return ()
    found, members, away = [], [], 0
    for j, degree in enumerate(degrees):
        members.append(j)
        away += degree
        if away == 0:
            kappa = sum(abs(degrees[k]) for k in members) // 2
            found.append(AssurChain(tuple(members), kappa))
            members = []
    return tuple(found)


def _coupling_degree(chains: Sequence[OpenChain], assur: Sequence[AssurChain]) -> int | None:
    if sum(c.constraint_degree for c in chains):
        return None
    return max((a.coupling_degree for a in assur), default=0)
