"""The loop graph of a mechanism: rigid bodies, kinematic pairs, independent loops with signs."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile

from closedchain.analysis.structure.graph import (
    Edge,
    Walk,
    bridges,
    components,
    nodes_of,
    short_cycles,
)
from closedchain.analysis.structure.hinges import pairs_of_tree, symbol_of
from closedchain.closure.joint_kinds import JOINT_KINDS
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import Description, Joint


@dataclass(frozen=True)
class Body:
    """Links without motion against each other; named after the one that is drawn in most detail.

    Examples
    --------
    >>> graph = cc.loops(cc.load("rpa3t"))
    >>> graph.bodies[0].name, "platform" in [body.name for body in graph.bodies]
    ('base', True)
    """

    name: str
    links: tuple[str, ...]


@dataclass(frozen=True)
class Pair:
    """A kinematic pair between two bodies.

    Attributes
    ----------
    name : str
        Of the joint or of the closure; for a universal joint or ball of the tree what the names
        of its joints have in common.
    symbol : str
        R, P, U, S, C or E; PS, PPS and SS for a ball on a line, a ball on a plane, and a rod.
    parent, child : int
        Bodies. Screws are motions of the child against the parent.
    joints : tuple of str
        Joints of the spanning tree; empty for a cut pair.
    closure : str or None
        Name of the closure of a cut pair.
    freedoms : int
    inputs : tuple of str
        Inputs that drive it.

    Examples
    --------
    >>> pair = cc.loops(cc.load("linear_delta")).pairs[0]
    >>> pair.name, pair.symbol, pair.freedoms, pair.inputs
    ('leg1_P', 'P', 1, ('q1',))
    """

    name: str
    symbol: str
    parent: int
    child: int
    joints: tuple[str, ...]
    closure: str | None
    freedoms: int
    inputs: tuple[str, ...]


@dataclass(frozen=True)
class Loop:
    """A closed walk over pairs: sign +1 where a pair is passed from its parent to its child.

    ``bodies`` are those that the walk sets out from, one for each pair.

    Examples
    --------
    >>> graph = cc.loops(cc.load("rpa3t"))
    >>> loop = graph.loops[0]
    >>> len(loop.pairs) == len(loop.signs) == len(loop.bodies)
    True
    """

    pairs: tuple[int, ...]
    signs: tuple[int, ...]
    bodies: tuple[int, ...]


@dataclass(frozen=True)
class LoopGraph:
    """Bodies and pairs of a mechanism, and a basis of its loops.

    Attributes
    ----------
    bodies : tuple of Body
        The first is the base.
    pairs : tuple of Pair
        Joints of the tree, then cut joints. Floating joints are virtual chains and no pairs;
        fixed joints and fixed closures make one body of two links.
    loops : tuple of Loop
        Independent, pairs - bodies + components of them, short ones preferred.
    bridges : tuple of int
        Pairs that are in no loop.
    components : int
        Parts of the mechanism that no pair connects; 1 as a rule.

    Examples
    --------
    >>> graph = cc.loops(cc.load("rpa3t"))
    >>> len(graph.bodies), len(graph.pairs), len(graph.loops)
    (14, 17, 4)
    """

    name: str
    bodies: tuple[Body, ...]
    pairs: tuple[Pair, ...]
    loops: tuple[Loop, ...]
    bridges: tuple[int, ...]
    components: int

    @property
    def edges(self) -> tuple[Edge, ...]:
        """Bodies that each pair joins, (parent, child)."""
        return tuple((pair.parent, pair.child) for pair in self.pairs)

    @property
    def freedoms(self) -> int:
        """Sum of the freedoms of the pairs."""
        return sum(pair.freedoms for pair in self.pairs)

    @property
    def text(self) -> str:
        """Counts, and each loop as a walk over signed pairs."""
        return _text(self)


def loops(mechanism: Mechanism) -> LoopGraph:
    """Find the bodies, the kinematic pairs and independent loops of a mechanism.

    There are v = m - n + 1 independent loops for m pairs and n bodies in one piece [Shen et al.
    2018, below eq. (3)]; which ones is a choice, and short ones are preferred. A universal joint
    written as two revolutes about a cross link is one pair, as in ``mobility``.

    Examples
    --------
    >>> print(cc.loops(cc.load("linear_delta")).text.splitlines()[0])
    linear_delta: 17 bodies, 21 pairs with 21 freedoms, 5 independent loops.
    """
    description = mechanism.description
    bodies = _bodies(description)
    of_link = {link: i for i, body in enumerate(bodies) for link in body.links}
    pairs = _pairs(description, of_link)
    edges = [(pair.parent, pair.child) for pair in pairs]
    found = tuple(as_loop(edges, walk) for walk in short_cycles(len(bodies), edges))
    return LoopGraph(
        name=mechanism.name,
        bodies=bodies,
        pairs=pairs,
        loops=found,
        bridges=tuple(sorted(bridges(len(bodies), edges))),
        components=len(set(components(len(bodies), edges))),
    )


def as_loop(edges: list[Edge] | tuple[Edge, ...], walk: Walk) -> Loop:
    """Loop of a closed walk."""
    return Loop(
        pairs=tuple(e for e, _ in walk),
        signs=tuple(sign for _, sign in walk),
        bodies=nodes_of(edges, walk),
    )


def _bodies(description: Description) -> tuple[Body, ...]:
    """Group links that nothing moves against each other; cross links are left out."""
    crosses = {j.child for row in pairs_of_tree(description) for j in row[:-1]}
    points = {j.child for j in description.joints if j.type == "fixed"}
    names = [link.name for link in description.links if link.name not in crosses]
    names.sort(key=lambda name: name != description.root)
    index = {name: i for i, name in enumerate(names)}
    welds = [(j.parent, j.child) for j in description.joints if j.type == "fixed"]
    welds += [(c.parent, c.child) for c in description.closures if c.type == "fixed"]
    labels = components(len(names), [(index[a], index[b]) for a, b in welds])
    groups: dict[int, list[str]] = {}
    for name, label in zip(names, labels, strict=True):
        groups.setdefault(label, []).append(name)
    visuals = {link.name: link.visuals for link in description.links}

    def speaking(link: str) -> tuple[bool, int, bool]:
        return link == description.root, visuals[link], link not in points

    return tuple(Body(max(links, key=speaking), tuple(links)) for links in groups.values())


def _pairs(description: Description, of_link: dict[str, int]) -> tuple[Pair, ...]:
    driven: dict[str, list[str]] = {}
    for spec in description.inputs:
        driven.setdefault(spec.joint, []).append(spec.name)
    rows = pairs_of_tree(description)
    taken = {j.name for j in description.joints} | {c.name for c in description.closures}
    found = []
    for joints in rows:
        found.append(_tree_pair(joints, of_link, driven, taken))
    for closure in description.closures:
        if closure.type != "fixed":
            found.append(
                Pair(
                    name=closure.name,
                    symbol=JOINT_KINDS[closure.type].symbol,
                    parent=of_link[closure.parent],
                    child=of_link[closure.child],
                    joints=(),
                    closure=closure.name,
                    freedoms=JOINT_KINDS[closure.type].freedoms,
                    inputs=(),
                )
            )
    return tuple(found)


def _tree_pair(
    joints: tuple[Joint, ...],
    of_link: dict[str, int],
    driven: dict[str, list[str]],
    taken: set[str],
) -> Pair:
    free = (word for word in _common([j.name for j in joints]) if word not in taken)
    name = next(free, joints[0].name)
    taken.add(name)
    return Pair(
        name=name,
        symbol=symbol_of(joints),
        parent=of_link[joints[0].parent],
        child=of_link[joints[-1].child],
        joints=tuple(j.name for j in joints),
        closure=None,
        freedoms=len(joints),
        inputs=tuple(name for j in joints for name in driven.get(j.name, ())),
    )


def _common(names: list[str]) -> Iterator[str]:
    """What the names of joints that are one pair have in common: at the front, or at both ends."""
    first, last = names[0], names[-1]
    if first != last:
        front = _shared(first, last)
        yield from filter(None, (front.rstrip("_"), front + _shared(first[::-1], last[::-1])[::-1]))


def _shared(one: str, two: str) -> str:
    return "".join(a for a, _ in takewhile(lambda ab: ab[0] == ab[1], zip(one, two, strict=False)))


def _text(graph: LoopGraph) -> str:
    lines = [
        f"{graph.name}: {len(graph.bodies)} bodies, {len(graph.pairs)} pairs with "
        f"{graph.freedoms} freedoms, {len(graph.loops)} independent "
        f"loop{'s' * (len(graph.loops) != 1)}."
    ]
    for number, loop in enumerate(graph.loops, 1):
        walk = " ".join(
            f"{'+' if sign > 0 else '-'}{graph.pairs[p].name}({graph.pairs[p].symbol})"
            for p, sign in zip(loop.pairs, loop.signs, strict=True)
        )
        freedoms = sum(graph.pairs[p].freedoms for p in loop.pairs)
        lines.append(f"  loop {number}, {freedoms} freedoms: {walk}")
    if graph.bridges:
        names = " ".join(graph.pairs[p].name for p in graph.bridges)
        lines.append(f"  in no loop: {names}")
    if graph.components > 1:
        lines.append(f"  {graph.components} parts that no pair connects")
    return "\n".join(textwrap.fill(line, 80, subsequent_indent="    ") for line in lines)
