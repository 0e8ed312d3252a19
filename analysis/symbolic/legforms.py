"""One leg in closed form: its determinant, the wrenches that drive it, its constraints.

All is seen from a frame inside the leg, where expressions are short: before a spherical joint or a
parallelogram, or else where the leg begins. Determinants and pairings do not depend on the frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import isqrt

from closedchain.analysis.screws.drives import Drive
from closedchain.analysis.screws.leg_graph import LegChain
from closedchain.analysis.structure.composites import Element as PairElement
from closedchain.analysis.symbolic.chain import Chains
from closedchain.analysis.symbolic.factors import primitive
from closedchain.analysis.symbolic.ring import Angle, Element, Ring, Vector
from closedchain.analysis.symbolic.spaces import independent, pairing, reciprocal
from closedchain.analysis.symbolic.walk import (
    Fixed,
    Slide,
    Step,
    Walked,
    angles_of,
    backwards,
    walk,
)


@dataclass(frozen=True, eq=False)
class Driving:
    """A wrench that does no work on the leg's passive joints, and its pairings with the inputs."""

    wrench: Vector
    levers: Mapping[str, Element]


@dataclass(frozen=True, eq=False)
class LegForms:
    """A leg in the ring of its own angles.

    Attributes
    ----------
    columns : tuple of str
        Freedoms from start to end; a parallelogram's under its bracketed name.
    screws : mapping
        By column. Hinges that stand for a spherical joint are its three ``hinges``.
    matrix : list of lists or None
        Square matrix of the screws (rows: angular, linear; without those that are zero for a leg
        of fewer than six freedoms); None where there is none.
    physical : list of lists or None
        The same with the unit axes of the frame in place of the hinges of a spherical joint.
    before : tuple of Step
        Walk from the world to the frame.
    """

    chain: LegChain
    ring: Ring
    columns: tuple[str, ...]
    inputs: tuple[str, ...]
    hinges: tuple[str, ...]
    screws: Mapping[str, Vector]
    points: Mapping[str, Vector]
    matrix: list[list[Element]] | None
    physical: list[list[Element]] | None
    driving: tuple[Driving, ...]
    constraints: tuple[Vector, ...]
    passive: tuple[Vector, ...]
    before: tuple[Step, ...]


def leg_forms(
    chains: Chains,
    chain: LegChain,
    drives: Mapping[str, Drive],
    point: Mapping[str, float],
    scale: float,
) -> LegForms:
    """Leg forms; ``point`` holds generic values of joints and parameters, ``scale`` a length."""
    values = chains.sizes.values
    steps, cut = _steps(chains, chain)
    branches = _members(chains, chain, cut)
    there = [backwards(steps[:cut]), list(steps[cut:]), *[m for group in branches for m in group]]
    angles: dict[Angle, None] = {}
    for part in there:
        angles |= dict.fromkeys(angles_of(part, values))
    slides = [s.column for part in there for s in part if isinstance(s, Slide)]
    ring = Ring(list(dict.fromkeys([*values, *slides])), list(angles))
    back, forth = walk(there[0], ring, values), walk(there[1], ring, values)
    screws = {**back.screws, **forth.screws}
    points = {**back.points, **forth.points}
    columns: list[str] = []
    passive: list[Vector] = []
    driven: dict[str, Vector] = {}
    hinges: list[str] = []
    physical: dict[str, Vector] = {}
    groups = iter(branches)
    for element, sign in zip(chain.elements, chain.signs, strict=True):
        if element.composite:
            found = _composite(ring, next(groups), values, point, scale)
            name = _bracket(chains, element)
            names = [name] if len(found) == 1 else [f"{name}.{i + 1}" for i in range(len(found))]
            for n, screw in zip(names, found, strict=True):
                screws[n] = [x * sign for x in screw]
                physical[n] = screws[n]
                columns.append(n)
                passive.append(screws[n])
            continue
        (p,) = element.pairs
        pair = chains.graph.pairs[p]
        own = chains.names[p] if sign > 0 or pair.symbol == "S" else chains.names[p][::-1]
        for k, name in enumerate(own):
            columns.append(name)
            physical[name] = screws[name]
            if pair.symbol == "S":
                axis = [ring.one if i == k else ring.zero for i in range(3)]
                physical[name] = [*axis, *ring.cross(points[name], axis)]
                hinges.append(name)
            if name in drives:
                driven[name] = screws[name]
            else:
                passive.append(physical[name])
    constraints = reciprocal(ring, [*passive, *driven.values()], point, scale)
    driving = _apart(ring, _driving(ring, passive, driven, point, scale), driven, constraints)
    return LegForms(
        chain=chain,
        ring=ring,
        columns=tuple(columns),
        inputs=tuple(driven),
        hinges=tuple(hinges),
        screws=screws,
        points=points,
        matrix=_square([screws[c] for c in columns]),
        physical=_square([physical[c] for c in columns]),
        driving=driving,
        constraints=tuple(constraints),
        passive=tuple(passive),
        before=tuple(steps[:cut]),
    )


def _steps(chains: Chains, chain: LegChain) -> tuple[list[Step], int]:
    """Steps of a leg, parallelograms by their first member, and where the frame is put."""
    steps: list[Step] = []
    cut: int | None = None
    spherical: int | None = None
    link: str | None = None
    for element, sign in zip(chain.elements, chain.signs, strict=True):
        run = [(p, 1) for p in element.pairs] if not element.composite else None
        if run is not None:
            ((p, _),) = run
            part_walk = [(p, sign)]
        else:
            part_walk = signed(chains, element, sign, 0)
        first, last = chains.ends(part_walk)
        if link is not None:
            steps += chains.within(link, first)
        if element.composite and cut is None:
            cut = len(steps)
        if not element.composite and chains.graph.pairs[part_walk[0][0]].symbol == "S":
            # the frame of the joint itself, on the side that the leg comes from
            spherical = len(steps) + 1 if spherical is None else spherical
        steps += chains.steps(part_walk)
        link = last
    if cut is None:
        cut = spherical
    if cut is None:
        cut = next(i for i, s in enumerate(steps) if not isinstance(s, Fixed))
    return steps, cut


def signed(chains: Chains, element: PairElement, sign: int, member: int) -> list[tuple[int, int]]:
    """Pairs of one member of a composite with signs, from where the leg enters it."""
    here = element.start
    out: list[tuple[int, int]] = []
    for p in element.members[member]:
        parent, child = chains.graph.edges[p]
        way = 1 if parent == here else -1
        here = child if way > 0 else parent
        out.append((p, way))
    return out if sign > 0 else [(p, -way) for p, way in reversed(out)]


def _members(chains: Chains, chain: LegChain, cut: int) -> list[list[list[Step]]]:
    """Walks from the frame through each member of each composite."""
    out: list[list[list[Step]]] = []
    done: list[tuple[int, int]] = []
    for element, sign in zip(chain.elements, chain.signs, strict=True):
        if not element.composite:
            done.append((element.pairs[0], sign))
            continue
        group = []
        before = chains.steps(done) if done else []
        skip = min(cut, len(before))
        link = chains.ends(done)[1] if done else None
        for member in range(len(element.members)):
            run = signed(chains, element, sign, member)
            first, _ = chains.ends(run)
            joined: list[Step] = []
            anchor = chains.ends(signed(chains, element, sign, 0))[0]
            if not done or cut > len(before):
                # the frame is that of the first member's first link
                joined = chains.within(anchor, first)
            else:
                joined = before[skip:] + chains.within(link or anchor, first)
            group.append([*joined, *chains.steps(run)])
        out.append(group)
        done += signed(chains, element, sign, 0)
    return out


def _composite(
    ring: Ring,
    members: list[list[Step]],
    values: Mapping[str, float],
    point: Mapping[str, float],
    scale: float,
) -> list[Vector]:
    """Twists that all members permit: reciprocal to the wrenches that any of them bears."""
    wrenches: list[Vector] = []
    for steps in members:
        walked = walk(steps, ring, values)
        wrenches += reciprocal(ring, _unit_hinges(ring, walked), point, scale)
    return reciprocal(ring, independent(ring, wrenches, point, scale), point, scale)


def _unit_hinges(ring: Ring, walked: Walked) -> list[Vector]:
    """Screws of a walk, with unit axes for the three hinges of a spherical joint."""
    out: list[Vector] = []
    for name, screw in walked.screws.items():
        stem, _, axis = name.rpartition(".")
        spherical = stem and all(f"{stem}.{a}" in walked.screws for a in "xyz")
        if spherical and axis in "xyz":
            unit = [ring.one if i == "xyz".index(axis) else ring.zero for i in range(3)]
            out.append([*unit, *ring.cross(walked.points[name], unit)])
        else:
            out.append(screw)
    return out


def _driving(
    ring: Ring,
    passive: list[Vector],
    driven: Mapping[str, Vector],
    point: Mapping[str, float],
    scale: float,
) -> tuple[Driving, ...]:
    """One wrench for each driven joint; one for all that no wrench tells apart."""
    found: list[Driving] = []
    for name, screw in driven.items():
        others = [s for n, s in driven.items() if n != name]
        basis = reciprocal(ring, [*passive, *others], point, scale)
        able = [(w, x) for w in basis if (x := pairing(ring, w, screw))]
        if able:
            wrench = _sharpest(ring, able)
            found.append(Driving(wrench, {name: pairing(ring, wrench, screw)}))
    if not found and driven:
        basis = reciprocal(ring, passive, point, scale)
        for wrench in (unit(ring, w) for w in basis):
            levers = {n: pairing(ring, wrench, s) for n, s in driven.items()}
            if any(levers.values()):
                found.append(Driving(wrench, {n: x for n, x in levers.items() if x}))
    return tuple(found)


def _sharpest(ring: Ring, able: list[tuple[Vector, Element]]) -> Vector:
    """Combination of wrenches whose lever vanishes only where all levers do.

    Wrenches that differ by the leg's constraints have different levers; a single one may vanish
    where the wrench itself turns into a constraint, which means nothing.
    """
    _, shares = primitive(ring, [lever for _, lever in able])
    plain = [w for (w, _), x in zip(able, shares, strict=True) if not any(map(any, x))]
    if plain:
        return unit(ring, min(plain, key=lambda w: sum(len(x) for x in w)))
    mixed = [
        sum((ring.mul(x, w[i]) for (w, _), x in zip(able, shares, strict=True)), ring.zero)
        for i in range(6)
    ]
    return unit(ring, primitive(ring, mixed)[1])


def _apart(
    ring: Ring,
    driving: tuple[Driving, ...],
    driven: Mapping[str, Vector],
    constraints: list[Vector],
) -> tuple[Driving, ...]:
    """The same wrenches, never turning into one of the leg's constraints.

    A wrench is as good with any multiple of a constraint added, which does no work on any joint.
    With the right multiple all its entries may have a factor in common, where it was nothing but
    a constraint; without that factor the lever does not vanish there, as nothing does.
    """
    found = []
    for one in driving:
        best = one.wrench
        for constraint in constraints:
            for i in (i for i in range(6) if constraint[i]):
                mixed = [
                    ring.mul(constraint[i], a) - ring.mul(best[i], b)
                    for a, b in zip(best, constraint, strict=True)
                ]
                if not any(mixed):
                    continue
                trial = unit(ring, primitive(ring, mixed)[1])
                if _degree(ring, trial, one, driven) < _degree(ring, best, one, driven):
                    best = trial
        levers = {name: pairing(ring, best, driven[name]) for name in one.levers}
        found.append(Driving(best, levers))
    return tuple(found)


def _degree(
    ring: Ring, wrench: Vector, one: Driving, driven: Mapping[str, Vector]
) -> tuple[int, int]:
    """Degree and terms of a wrench's levers."""
    levers = [pairing(ring, wrench, driven[name]) for name in one.levers]
    return max(sum(mono) for x in levers for mono in x), sum(map(len, levers))


def unit(ring: Ring, wrench: Vector) -> Vector:
    """Wrench of unit force, or unit couple, where its size is a rational number."""
    part = wrench[:3] if any(wrench[:3]) else wrench[3:]
    square = ring.dot(part, part)
    if len(square) != 1 or any(next(iter(square))):
        return wrench
    value = Fraction(str(square.LC))
    root = Fraction(isqrt(value.numerator), isqrt(value.denominator))
    return [x * ring.number(1 / root) for x in wrench] if root * root == value else wrench


def _square(columns: list[Vector]) -> list[list[Element]] | None:
    """Matrix of the columns without zero rows, if it is square then."""
    rows = [list(row) for row in zip(*columns, strict=True) if any(row)]
    return rows if len(rows) == len(columns) else None


def _bracket(chains: Chains, element: PairElement) -> str:
    runs = (" ".join(chains.graph.pairs[p].name for p in run) for run in element.members)
    return f"[{' | '.join(runs)}]"
