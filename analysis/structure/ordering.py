"""In which order the loops of a mechanism are closed: the search behind the coupling degree."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from itertools import count

from closedchain.analysis.structure.graph import Edge, Walk, components, short_cycles, simple_cycles

MOST_BRANCHES = 10
"""With more branches the orders are not all searched: 2^n sets of them are too many."""

Degree = Callable[[frozenset[int]], int]
"""Freedoms less inputs of the sub-mechanism made of a set of branches."""


def next_loops(
    nodes: int, edges: Sequence[Edge], done: frozenset[int], *, every: bool
) -> list[Walk]:
    """Loops that can be closed next, as walks over branches that are not done yet.

    What is done counts as one body a piece, so that each walk is a cycle: a branch between two
    bodies of it, branches in a row, or a cycle elsewhere. With ``every`` all of them, else a basis.
    """
    labels = components(nodes, edges, done)
    ends = [(labels[a], labels[b]) for a, b in edges]
    left = [e for e in range(len(edges)) if e not in done]
    if every:
        return simple_cycles(nodes, ends, left)
    basis = short_cycles(nodes, [ends[e] for e in left])
    return [tuple((left[e], sign) for e, sign in walk) for walk in basis]


def best_order(
    nodes: int, edges: Sequence[Edge], degree: Degree, weight: Sequence[int]
) -> tuple[list[Walk], bool]:
    """Order of loops with the least sum of |constraint degrees|, and whether all were tried.

    The constraint degree of a loop is the change of ``degree`` (freedoms less inputs) that closing
    it makes, so it depends on the sets of branches before and after alone, and the best order is a
    shortest path over such sets. Ties go to orders that keep the sub-mechanisms near ``degree``
    zero, which splits them into as many Assur chains as can be, then to short loops first
    (``weight`` is the number of freedoms of each branch).
    """
    if len(edges) > MOST_BRANCHES:
        return _greedy(nodes, edges, degree, weight), False
    full = frozenset(range(len(edges)))
    start: frozenset[int] = frozenset()
    ticket = count()
    queue: list[tuple[tuple[int, int, int], int, frozenset[int], tuple[Walk, ...]]]
    queue = [((0, 0, 0), next(ticket), start, ())]
    settled: set[frozenset[int]] = set()
    while queue:
        (total, away, size), _, done, walks = heapq.heappop(queue)
        if done == full:
            return list(walks), True
        if done in settled:
            continue
        settled.add(done)
        for walk in next_loops(nodes, edges, done, every=True):
            after = done | {e for e, _ in walk}
            if after in settled:
                continue
            cost = (
                total + abs(degree(after) - degree(done)),
                away + abs(degree(after) - degree(start)),
                size + (len(edges) - len(done)) * sum(weight[e] for e, _ in walk),
            )
            heapq.heappush(queue, (cost, next(ticket), after, (*walks, walk)))
    raise AssertionError("branches without bridges are always covered by loops")


def _greedy(nodes: int, edges: Sequence[Edge], degree: Degree, weight: Sequence[int]) -> list[Walk]:
    """Close next the loop of the least |constraint degree|, the shortest of them."""
    done: frozenset[int] = frozenset()
    walks: list[Walk] = []
    while len(done) < len(edges):

        def cost(walk: Walk, done: frozenset[int] = done) -> tuple[int, int]:
            members = {e for e, _ in walk}
            change = abs(degree(done | members) - degree(done))
            return change, sum(weight[e] for e in members)

        walk = min(next_loops(nodes, edges, done, every=False), key=cost)
        walks.append(walk)
        done = done | {e for e, _ in walk}
    return walks
