"""Parallelograms as composite pairs, and the chains that remain between branching bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.structure.graph import Chain, chains, reverse
from closedchain.analysis.structure.loops import LoopGraph
from closedchain.analysis.structure.pair_screws import PairScrews

CONGRUENT = 1e-7  # dimensionless misfit of two screws that counts as none


@dataclass(frozen=True)
class Element:
    """A pair, or a parallelogram that stands for one: bodies, pairs inside.

    ``members`` are the chains of a parallelogram as runs of pairs; one run of one pair otherwise.
    """

    start: int
    end: int
    members: tuple[tuple[int, ...], ...]

    @property
    def pairs(self) -> tuple[int, ...]:
        """All pairs inside."""
        return tuple(p for run in self.members for p in run)

    @property
    def composite(self) -> bool:
        """Whether it is a parallelogram."""
        return len(self.members) > 1


@dataclass(frozen=True)
class Branch:
    """Elements in a row between two bodies where the mechanism branches."""

    start: int
    end: int
    elements: tuple[Element, ...]
    signs: tuple[int, ...]

    @property
    def pairs(self) -> tuple[int, ...]:
        """All pairs inside, those of parallelograms included."""
        return tuple(p for element in self.elements for p in element.pairs)


def branches(
    graph: LoopGraph, postures: Sequence[PairScrews], *, parallelograms: bool
) -> tuple[Branch, ...]:
    """Chains between branching bodies, parallelograms merged to single elements.

    A parallelogram is a set of chains between the same two bodies without inputs, each of which is
    a translated copy of the others at every posture. The theory of single open chains puts an
    equivalent serial chain in its place [Yang, Liu, Shen et al. 2018; RPa of Shen et al. 2018].
    """
    edges = graph.edges
    count = len(graph.bodies)
    elements = [Element(*edges[p], ((p,),)) for p in range(len(edges)) if p not in graph.bridges]
    while True:
        ends = [(element.start, element.end) for element in elements]
        found = chains(count, ends, range(len(ends)))
        merged = _first_parallelogram(graph, postures, elements, found) if parallelograms else None
        if merged is None:
            break
        composite, used = merged
        elements = [e for i, e in enumerate(elements) if i not in used] + [composite]
    return tuple(
        Branch(
            c.start,
            c.end,
            tuple(elements[e] for e, _ in c.walk),
            tuple(sign for _, sign in c.walk),
        )
        for c in found
    )


def _first_parallelogram(
    graph: LoopGraph,
    postures: Sequence[PairScrews],
    elements: list[Element],
    found: Sequence[Chain],
) -> tuple[Element, set[int]] | None:
    """Parallelogram element among parallel chains, and the elements that it takes in."""
    passive: dict[tuple[int, int], list[tuple[tuple[int, int], ...]]] = {}
    for chain in found:
        inside = [elements[e] for e, _ in chain.walk]
        driven = any(graph.pairs[p].inputs for element in inside for p in element.pairs)
        if driven or any(element.composite for element in inside) or chain.start == chain.end:
            continue
        forward = chain.start < chain.end
        ends = (chain.start, chain.end) if forward else (chain.end, chain.start)
        walk = chain.walk if forward else reverse(chain.walk)
        passive.setdefault(ends, []).append(walk)
    for (start, end), walks in passive.items():
        for first in walks:
            runs = [[elements[e].pairs[0] for e, _ in walk] for walk in walks]
            mine = [elements[e].pairs[0] for e, _ in first]
            same = [
                i for i, run in enumerate(runs) if all(_copies(at, mine, run) for at in postures)
            ]
            if len(same) > 1:
                members = tuple(tuple(runs[i]) for i in same)
                return Element(start, end, members), {e for i in same for e, _ in walks[i]}
    return None


def _copies(at: PairScrews, one: list[int], two: list[int]) -> bool:
    """Whether a run of pairs is a translated copy of another at a posture.

    Axes are parallel pair by pair, and one displacement d takes the moments m of the first to
    those of the second: m2 = m1 + d x axis.
    """
    kinds = [[at.graph.pairs[p].symbol for p in run] for run in (one, two)]
    if kinds[0] != kinds[1]:
        return False
    first = np.hstack([at.screws[p] for p in one])
    second = np.hstack([at.screws[p] for p in two])
    turning = np.any(first[3:], axis=0)
    axes = np.where(turning, first[3:], first[:3])
    others = np.where(turning, second[3:], second[:3])
    sense = np.sign(np.sum(axes * others, axis=0))
    if np.abs(axes - sense * others).max() > CONGRUENT:
        return False
    moments = (sense * second - first)[:3, turning]
    if not moments.size:
        return True
    # d x w = -[w]x d, stacked over all turning axes
    system = np.vstack([-_cross_matrix(w) for w in first[3:, turning].T])
    wanted = moments.T.ravel()
    d = np.linalg.lstsq(system, wanted, rcond=None)[0]
    return bool(np.abs(system @ d - wanted).max() < CONGRUENT)


def _cross_matrix(w: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
