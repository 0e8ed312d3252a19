"""Legs and platforms of a mechanism, found from its loop graph.

Platforms are the bodies with more than two pairs, the base and the tip; a leg is a chain of pairs
between two of them. Chains without inputs side by side, such as the two bars of a parallelogram,
act as one joint where they make an end body into a link of a chain.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from closedchain.analysis.structure.composites import Element
from closedchain.analysis.structure.graph import Chain, chains, components, incidence, reverse
from closedchain.analysis.structure.loops import LoopGraph
from closedchain.urdf.errors import ClosureError


@dataclass(frozen=True)
class LegChain:
    """A leg: elements in a row from platform ``start``, the one nearer to the base, to ``end``."""

    start: int
    end: int
    elements: tuple[Element, ...]
    signs: tuple[int, ...]


@dataclass(frozen=True)
class LegGraph:
    """Legs, and the platforms that they hold: the tip first, then those to be eliminated."""

    legs: tuple[LegChain, ...]
    platforms: tuple[int, ...]


def leg_graph(graph: LoopGraph, tip: int, driven: Collection[int]) -> LegGraph:
    """Legs between platforms; ``driven`` are the pairs that do not move on their own.

    Raises
    ------
    ClosureError
        A body that is no platform and in no leg: it hangs on a single pair, on the base's or
        another platform's own loop, or on nothing.
    """
    count = len(graph.bodies)

    def refuse(body: int, why: str) -> ClosureError:
        name = graph.bodies[body].name
        return ClosureError(f"{graph.name} is not made of legs: body {name!r} {why}")

    if tip == 0:
        raise refuse(tip, "is the base and the task's tip at once")
    at = incidence(count, graph.edges, range(len(graph.edges)))
    labels = components(count, graph.edges)
    for body in range(count):
        if labels[body] != labels[0]:
            raise refuse(body, "is connected to the base by no pair")
        if len(at[body]) == 1 and body not in (0, tip):
            raise refuse(body, "hangs on a single pair and ends in no platform")
    elements = [Element(*edge, ((p,),)) for p, edge in enumerate(graph.edges)]
    while True:
        found = _chains(count, elements, tip)
        merged = _side_by_side(elements, found, tip, driven)
        if merged is None:
            break
        composite, used = merged
        elements = [e for i, e in enumerate(elements) if i not in used] + [composite]
    for chain in found:
        if chain.start == chain.end:
            first, sign = chain.walk[0]
            lone = elements[first].end if sign > 0 else elements[first].start
            raise refuse(lone, "is in a loop that begins and ends on one body")
    ends = sorted({node for chain in found for node in (chain.start, chain.end)} - {0, tip})
    distance = _distances(count, found)
    distance[tip] = count
    legs = tuple(_upright(elements, chain, distance) for chain in found)
    return LegGraph(legs, (tip, *ends))


def _chains(count: int, elements: list[Element], tip: int) -> tuple[Chain, ...]:
    """Chains between platforms. Two edges from base to tip make both of them branch."""
    ends = [(element.start, element.end) for element in elements]
    extra = {len(ends), len(ends) + 1}
    edges = [*ends, (0, tip), (0, tip)]
    found = chains(count, edges, range(len(edges)))
    return tuple(c for c in found if extra.isdisjoint(e for e, _ in c.walk))


def _side_by_side(
    elements: list[Element], found: tuple[Chain, ...], tip: int, driven: Collection[int]
) -> tuple[Element, set[int]] | None:
    """Element for passive chains side by side that leave an end body with two pairs at most."""
    groups: dict[tuple[int, int], list[Chain]] = {}
    degree: dict[int, int] = {}
    for chain in found:
        for node in (chain.start, chain.end):
            degree[node] = degree.get(node, 0) + 1
        inside = {p for e, _ in chain.walk for p in elements[e].pairs}
        if inside.isdisjoint(driven) and chain.start != chain.end:
            a, b = sorted((chain.start, chain.end))
            groups.setdefault((a, b), []).append(chain)
    for (a, b), group in groups.items():
        spare = len(group) - 1
        if spare and any(n not in (0, tip) and degree[n] - spare <= 2 for n in (a, b)):
            members = []
            for chain in group:
                walk = chain.walk if chain.start == a else reverse(chain.walk)
                members.append(tuple(p for e, _ in walk for p in elements[e].pairs))
            return Element(a, b, tuple(members)), {e for c in group for e, _ in c.walk}
    return None


def _distances(count: int, found: tuple[Chain, ...]) -> list[int]:
    """Legs from the base to each platform."""
    distance = [count] * count
    distance[0] = 0
    for _ in found:
        for c in found:
            for one, two in ((c.start, c.end), (c.end, c.start)):
                distance[two] = min(distance[two], distance[one] + 1)
    return distance


def _upright(elements: list[Element], chain: Chain, distance: list[int]) -> LegChain:
    """The chain from its end nearer to the base."""
    start, end, walk = chain.start, chain.end, chain.walk
    if distance[start] > distance[end]:
        start, end, walk = end, start, reverse(walk)
    return LegChain(
        start, end, tuple(elements[e] for e, _ in walk), tuple(sign for _, sign in walk)
    )
