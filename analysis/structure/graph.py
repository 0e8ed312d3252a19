"""Multigraphs as lists of edges: cycles, bridges and chains. No mechanism enters here.

An edge is a pair of node numbers; its number is its place in the list. A walk is a tuple of
(edge, sign), the sign +1 where the edge is passed from its first node to its second.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

Edge = tuple[int, int]
Walk = tuple[tuple[int, int], ...]


def incidence(nodes: int, edges: Sequence[Edge], used: Iterable[int]) -> list[list[int]]:
    """Edges of ``used`` at every node; a self-loop is listed once."""
    at: list[list[int]] = [[] for _ in range(nodes)]
    for e in used:
        for node in set(edges[e]):
            at[node].append(e)
    return at


def other_end(edge: Edge, node: int) -> tuple[int, int]:
    """Node at the far end of an edge, and the sign of passing it that way."""
    return (edge[1], 1) if edge[0] == node else (edge[0], -1)


def components(nodes: int, edges: Sequence[Edge], used: Iterable[int] | None = None) -> list[int]:
    """Lowest node of each node's component, (nodes,)."""
    parent = list(range(nodes))

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    for e in range(len(edges)) if used is None else used:
        a, b = sorted((root(edges[e][0]), root(edges[e][1])))
        parent[b] = a
    return [root(node) for node in range(nodes)]


def shortest_walks(
    nodes: int, edges: Sequence[Edge], used: Iterable[int], start: int
) -> dict[int, Walk]:
    """A shortest walk from ``start`` to every node that it reaches, breadth first."""
    at = incidence(nodes, edges, used)
    walks: dict[int, Walk] = {start: ()}
    queue = deque([start])
    while queue:
        node = queue.popleft()
        for e in at[node]:
            far, sign = other_end(edges[e], node)
            if far not in walks:
                walks[far] = (*walks[node], (e, sign))
                queue.append(far)
    return walks


def bridges(nodes: int, edges: Sequence[Edge]) -> frozenset[int]:
    """Edges that are in no cycle."""
    found = set()
    for e, (a, b) in enumerate(edges):
        labels = components(nodes, edges, (k for k in range(len(edges)) if k != e))
        if labels[a] != labels[b]:
            found.add(e)
    return frozenset(found)


def reverse(walk: Walk) -> Walk:
    """The same walk backwards."""
    return tuple((e, -sign) for e, sign in reversed(walk))


def _upright(walk: Walk) -> Walk:
    """The closed walk begun at its lowest edge, which is passed forwards."""
    first = min(range(len(walk)), key=lambda i: walk[i][0])
    (edge, sign), *others = walk[first:] + walk[:first]
    return ((edge, 1), *(others if sign > 0 else reverse(tuple(others))))


def short_cycles(nodes: int, edges: Sequence[Edge]) -> tuple[Walk, ...]:
    """Independent cycles, as many as there are, short ones preferred.

    Candidates are those of Horton (A polynomial-time algorithm to find the shortest cycle basis of
    a graph, SIAM J. Comput. 16, 1987): a shortest walk to one end of an edge, the edge, and a
    shortest walk back; the shortest are taken that are independent over GF(2).
    """
    everything = range(len(edges))
    candidates: dict[frozenset[int], Walk] = {}
    for start in range(nodes):
        walks = shortest_walks(nodes, edges, everything, start)
        for e, (a, b) in enumerate(edges):
            if a not in walks:
                continue
            walk = (*walks[a], (e, 1), *reverse(walks[b]))
            members = frozenset(k for k, _ in walk)
            if len(members) == len(walk) and _is_simple(edges, walk, start):
                candidates.setdefault(members, walk)
    count = len(edges) - nodes + len(set(components(nodes, edges)))
    chosen: list[Walk] = []
    pivots: dict[int, int] = {}
    for members in sorted(candidates, key=lambda s: (len(s), sorted(s))):
        if len(chosen) == count:
            break
        bits = sum(1 << e for e in members)
        while bits and bits.bit_length() in pivots:
            bits ^= pivots[bits.bit_length()]
        if bits:
            pivots[bits.bit_length()] = bits
            chosen.append(_upright(candidates[members]))
    return tuple(chosen)


def _is_simple(edges: Sequence[Edge], walk: Walk, start: int) -> bool:
    """Whether a closed walk from ``start`` passes no node twice."""
    seen, node = set(), start
    for e, sign in walk:
        node = edges[e][1] if sign > 0 else edges[e][0]
        if node in seen:
            return False
        seen.add(node)
    return node == start


def nodes_of(edges: Sequence[Edge], walk: Walk) -> tuple[int, ...]:
    """Nodes that a walk sets out from, one for each edge."""
    return tuple(edges[e][0 if sign > 0 else 1] for e, sign in walk)


def simple_cycles(nodes: int, edges: Sequence[Edge], used: Iterable[int]) -> list[Walk]:
    """Every cycle through edges of ``used`` that passes no node twice, each once."""
    at = incidence(nodes, edges, used)
    found: dict[frozenset[int], Walk] = {}

    def extend(start: int, node: int, walk: Walk, seen: frozenset[int]) -> None:
        for e in at[node]:
            far, sign = other_end(edges[e], node)
            if any(e == k for k, _ in walk):
                continue
            longer = (*walk, (e, sign))
            if far == start:
                found.setdefault(frozenset(k for k, _ in longer), longer)
            elif far > start and far not in seen:
                extend(start, far, longer, seen | {far})

    for start in range(nodes):
        extend(start, start, (), frozenset())
    return [_upright(found[key]) for key in sorted(found, key=sorted)]


@dataclass(frozen=True)
class Chain:
    """Edges in a row, from node ``start`` to node ``end``; nothing branches off in between."""

    start: int
    end: int
    walk: Walk


def chains(nodes: int, edges: Sequence[Edge], used: Sequence[int]) -> tuple[Chain, ...]:
    """Maximal chains of a graph without bridges, between the nodes where it branches.

    A cycle that branches nowhere is one chain from its lowest node to itself.
    """
    at = incidence(nodes, edges, used)
    degree = [sum(2 if edges[e][0] == edges[e][1] else 1 for e in es) for es in at]
    ends = {node for node in range(nodes) if degree[node] > 2}
    labels = components(nodes, edges, used)
    for node in range(nodes):
        if degree[node] and not any(labels[k] == labels[node] for k in ends):
            ends.add(node)
    found: dict[frozenset[int], Chain] = {}
    for start in sorted(ends):
        for first in at[start]:
            node, sign = other_end(edges[first], start)
            walk: Walk = ((first, sign),)
            while node not in ends:
                (e,) = (k for k in at[node] if k != walk[-1][0])
                node, sign = other_end(edges[e], node)
                walk = (*walk, (e, sign))
            members = frozenset(e for e, _ in walk)
            if members not in found:
                found[members] = Chain(start, node, walk)
    return tuple(found[key] for key in sorted(found, key=min))
