"""What parts of a mechanism, as sets of pairs, can do at postures of the whole."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache

import numpy as np

from closedchain.analysis.screws.twists import TwistSpace, twist_space
from closedchain.analysis.structure.composites import Element
from closedchain.analysis.structure.loops import LoopGraph
from closedchain.analysis.structure.pair_screws import PairScrews


class SubMechanisms:
    """Freedoms and relative motions of sets of pairs, the largest over a few postures.

    Ranks of screws can drop at special postures and not rise, so the largest is the generic one.
    """

    def __init__(self, graph: LoopGraph, postures: Sequence[PairScrews]) -> None:
        """Keep the screws; ranks are found when asked for, once for every set."""
        self.graph = graph
        self.postures = tuple(postures)
        self._rank: Callable[[frozenset[int]], int] = lru_cache(maxsize=None)(self._find_rank)

    def _find_rank(self, pairs: frozenset[int]) -> int:
        return max(at.rank(sorted(pairs)).value for at in self.postures)

    def pair_freedoms(self, pairs: Iterable[int]) -> int:
        """Sum of the freedoms of pairs."""
        return sum(self.graph.pairs[p].freedoms for p in pairs)

    def mobility(self, pairs: Iterable[int]) -> int:
        """Freedoms of the sub-mechanism made of ``pairs``, its loops and couplings closed.

        Parts that do not hang together move on their own, each against itself.
        """
        chosen = frozenset(pairs)
        return self.pair_freedoms(chosen) - self._rank(chosen)

    def freedoms(self, element: Element) -> int:
        """Freedoms of a pair or a parallelogram."""
        return self.mobility(element.pairs)

    def motion(self, element: Element) -> TwistSpace:
        """Relative motion across an element."""
        return self._largest(lambda at: self._across(at, element))

    def spaces(
        self, elements: Sequence[Element], done: Sequence[int], gaps: Sequence[tuple[int, int]]
    ) -> tuple[TwistSpace, TwistSpace, TwistSpace]:
        """Twists of M_pa across ``gaps`` in the sub-mechanism ``done``, of M_b, and of both.

        The union's rank decision is the one with the smallest gap among the postures of the
        largest dimension.
        """
        found = []
        for at in self.postures:
            before = [at.relative_motion(done, a, b).basis for a, b in gaps]
            chain = [self._across(at, element).basis for element in elements]
            found.append(
                tuple(
                    twist_space(np.hstack([np.zeros((6, 0)), *parts]))
                    for parts in (before, chain, before + chain)
                )
            )
        best = max(union.dimension for _, _, union in found)
        narrow = min(
            (spaces for spaces in found if spaces[2].dimension == best),
            key=lambda spaces: spaces[2].rank.gap,
        )
        return narrow[0], narrow[1], narrow[2]

    def _across(self, at: PairScrews, element: Element) -> TwistSpace:
        if element.composite:
            return at.relative_motion(element.pairs, element.start, element.end)
        return twist_space(at.screws[element.pairs[0]])

    def _largest(self, find: Callable[[PairScrews], TwistSpace]) -> TwistSpace:
        return max((find(at) for at in self.postures), key=lambda space: space.dimension)
