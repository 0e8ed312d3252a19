"""All legs together: driving and constraint wrenches on what can move, in the base's axes.

Unknown are the twist of one platform and the rates of passive joints that lead on from it to other
platforms; platforms held together by more than one leg do not decouple and are refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.screws.leg_graph import LegChain, LegGraph
from closedchain.analysis.structure.loops import LoopGraph
from closedchain.analysis.symbolic.chain import Chains
from closedchain.analysis.symbolic.legforms import LegForms, signed
from closedchain.analysis.symbolic.ring import (
    Angle,
    Element,
    Matrix,
    Ring,
    Vector,
    convert,
    evaluate,
)
from closedchain.analysis.symbolic.spaces import Point, pairing, swapped
from closedchain.analysis.symbolic.walk import Slide, Step, Walked, angles_of, walk
from closedchain.closure.ranks import numerical_rank
from closedchain.closure.task_frame import TaskFrame
from closedchain.urdf.errors import ClosureError

Walk = list[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class PlatformForms:
    """Rows over the unknowns, in one ring.

    Attributes
    ----------
    wrenches : list of (6,) vectors
        Driving wrenches at the world's origin, (force; moment).
    driving, constraints, outputs : lists of rows over the unknowns
    owners : tuple of tuple of str
        Inputs of each driving row.
    levers : list of mappings
        Levers of each driving row, in this ring.
    relations : list of elements
        Zero on closed postures, of two terms each.
    """

    ring: Ring
    wrenches: list[Vector]
    driving: list[Vector]
    constraints: list[Vector]
    outputs: list[Vector]
    owners: tuple[tuple[str, ...], ...]
    levers: list[dict[str, Element]]
    relations: list[Element]


def check_decoupled(pairs: LoopGraph, graph: LegGraph) -> None:
    """Refuse legs that share a platform other than the tip in a loop.

    Raises
    ------
    ClosureError
        Naming the platform and the legs.
    """
    bodies = pairs.bodies
    between: dict[tuple[int, int], list[LegChain]] = {}
    for leg in graph.legs:
        if leg.start and leg.end:
            between.setdefault((min(leg.start, leg.end), max(leg.start, leg.end)), []).append(leg)
    for (a, b), legs in between.items():
        named = ", ".join(pairs.pairs[leg.elements[0].pairs[0]].name for leg in legs)
        platforms = f"{bodies[a].name!r} and {bodies[b].name!r}"
        if len(legs) > 1:
            raise ClosureError(
                f"the legs of {pairs.name} do not decouple: the {len(legs)} legs that "
                f"begin with {named} join the platforms {platforms}, which other legs hold too, so "
                "that no determinant splits into factors of single legs; ask cc.classify or "
                "cc.singularity_set for numbers"
            )
        if any(e.composite for e in legs[0].elements):
            raise ClosureError(
                f"the legs of {pairs.name} do not decouple: a parallelogram joins "
                f"the platforms {platforms}"
            )


def platform_forms(
    chains: Chains,
    graph: LegGraph,
    forms: Sequence[LegForms],
    task: TaskFrame,
    outputs: Sequence[str],
) -> PlatformForms:
    """Rows of all legs over the unknowns."""
    values = chains.sizes.values
    root_link = chains.description.root
    paths = _paths(chains, graph)
    before: list[list[Step]] = []
    for form in forms:
        there = paths[form.chain.start]
        first = chains.ends(_walk(chains, form.chain))[0]
        steps = chains.steps(there, link=root_link)
        link = chains.ends(there)[1] if there else root_link
        before.append([*steps, *chains.within(link, first), *form.before])
    tip_body = graph.platforms[0]
    to_tip = chains.steps(paths[tip_body], link=root_link, end=task.tip)
    closed = _closing_walks(chains, graph, paths)
    walks = [*before, to_tip, *[s for pair in closed for s in pair]]
    links = {i: _full(chains, paths, f.chain, root_link) for i, f in enumerate(forms) if _links(f)}
    walks += list(links.values())
    angles: dict[Angle, None] = {}
    slides: dict[str, None] = {}
    for steps in walks:
        angles |= dict.fromkeys(angles_of(steps, values))
        slides |= dict.fromkeys(s.column for s in steps if isinstance(s, Slide))
    for form in forms:
        angles |= dict.fromkeys(form.ring.angles)
        slides |= dict.fromkeys(v for v in form.ring.variables if v not in values)
    ring = Ring([*values, *slides], list(angles))
    unknowns = _Unknowns(chains, graph, ring, {
        i: walk(steps, ring, values).screws for i, steps in links.items()
    }, forms)  # fmt: skip
    wrenches, driving, constraints, owners, levers = [], [], [], [], []
    for form, steps in zip(forms, before, strict=True):
        at = walk(steps, ring, values)

        def moved(w: Vector, at: Walked = at, form: LegForms = form) -> Vector:
            inside = [convert(x, form.ring, ring) for x in w]
            force = ring.apply(at.rotation, inside[:3])
            moment = ring.apply(at.rotation, inside[3:])
            arm = ring.cross(at.position, force)
            return [*force, *[a + b for a, b in zip(moment, arm, strict=True)]]

        for drive in form.driving:
            wrench = moved(drive.wrench)
            wrenches.append(wrench)
            driving.append(unknowns.row(wrench, form.chain))
            owners.append(tuple(drive.levers))
            levers.append({n: convert(x, form.ring, ring) for n, x in drive.levers.items()})
        if not _links(form):
            constraints += [unknowns.row(moved(w), form.chain) for w in form.constraints]
    at_tip = walk(to_tip, ring, values)
    out_rows = _outputs(ring, unknowns, tip_body, at_tip.rotation, at_tip.position, outputs)
    relations = []
    for one, two in closed:
        a, b = walk(one, ring, values).position, walk(two, ring, values).position
        relations += [d for x, y in zip(a, b, strict=True) if len(d := x - y) == 2]
    return PlatformForms(
        ring, wrenches, driving, constraints, out_rows, tuple(owners), levers, relations
    )


def determinant(forms: PlatformForms, rows: list[Vector], at: Point) -> tuple[Element | None, str]:
    """Determinant of ``rows`` below as many constraints as are independent; None, and why."""
    chosen = _independent(forms.ring, forms.constraints, at)
    matrix = [*chosen, *rows]
    if not matrix or len(matrix) != len(matrix[0]):
        have = len(matrix[0]) if matrix else 0
        return None, (
            f"not square: {len(rows)} rows and {len(chosen)} constraints on {have} unknowns"
        )
    factor, rest = _eliminate(forms.ring, matrix)
    return forms.ring.mul(factor, forms.ring.det(rest)), ""


def rows_rank(forms: PlatformForms, rows: list[Vector], at: Point) -> int:
    """Rank of rows at a posture."""
    return numerical_rank(_numbers(forms.ring, rows, at), 1e-7).value if rows else 0


class _Unknowns:
    """Twist of the root platform, then the rates of joints that lead from it to the others."""

    def __init__(
        self,
        chains: Chains,
        graph: LegGraph,
        ring: Ring,
        screws: Mapping[int, Mapping[str, Vector]],
        forms: Sequence[LegForms],
    ) -> None:
        self.ring = ring
        count = {p: sum(p in (f.chain.start, f.chain.end) for f in forms) for p in graph.platforms}
        self.root = max(graph.platforms, key=lambda p: count[p])
        self.names: list[str] = []
        self.moves: dict[int, dict[str, Vector]] = {self.root: {}}
        links = [(i, f) for i, f in enumerate(forms) if _links(f)]
        for _ in links:
            for i, form in links:
                for one, two, sign in (
                    (form.chain.start, form.chain.end, 1),
                    (form.chain.end, form.chain.start, -1),
                ):
                    if one in self.moves and two not in self.moves:
                        own = {c: [x * sign for x in screws[i][c]] for c in form.columns}
                        self.moves[two] = {**self.moves[one], **own}
                        self.names += list(own)
        lost = [chains.graph.bodies[p].name for p in graph.platforms if p not in self.moves]
        if lost:
            raise ClosureError(
                f"the legs of {chains.description.name} do not decouple: platform {lost[0]!r} and "
                "the tip are joined by way of the base only"
            )

    def row(self, wrench: Vector, chain: LegChain) -> Vector:
        """Work of a leg's wrench, on its end against its start."""
        end, start = self._row(wrench, chain.end), self._row(wrench, chain.start)
        return [a - b for a, b in zip(end, start, strict=True)]

    def _row(self, wrench: Vector, body: int) -> Vector:
        ring = self.ring
        if body == 0:
            return [ring.zero] * (6 + len(self.names))
        moves = self.moves[body]
        rates = [pairing(ring, wrench, moves[n]) if n in moves else ring.zero for n in self.names]
        return [*swapped(wrench), *rates]

    def twist(self, body: int) -> list[Vector]:
        """Rows (6) of a platform's twist over the unknowns."""
        ring = self.ring
        unit = [[ring.one if i == j else ring.zero for j in range(6)] for i in range(6)]
        columns = [*unit, *[self.moves[body].get(n, [ring.zero] * 6) for n in self.names]]
        return [list(row) for row in zip(*columns, strict=True)]


def _outputs(
    ring: Ring,
    unknowns: _Unknowns,
    body: int,
    rotation: Matrix,
    position: Vector,
    outputs: Sequence[str],
) -> list[Vector]:
    """Rows of the outputs: velocity of the tip along the base's axes, rotations as in a task."""
    twist = unknowns.twist(body)
    turning = [n for n in outputs if n.startswith("r")]
    own = 0 < len(turning) < 3
    rows = []
    for name in outputs:
        k = "xyz".index(name[-1])
        if name in "xyz":
            # v_P = v_O + omega x p
            i, j = (k + 1) % 3, (k + 2) % 3
            rows.append([
                v + ring.mul(wi, position[j]) - ring.mul(wj, position[i])
                for v, wi, wj in zip(twist[3 + k], twist[i], twist[j], strict=True)
            ])  # fmt: skip
        elif own:
            axis = [rotation[i][k] for i in range(3)]
            rows.append([ring.dot(axis, list(c)) for c in zip(*twist[:3], strict=True)])
        else:
            rows.append(twist[k])
    return rows


def _paths(chains: Chains, graph: LegGraph) -> dict[int, Walk]:
    """Signed pairs from the base to each platform, by legs without spherical joints if possible."""

    def cost(leg: LegChain) -> tuple[bool, bool, int]:
        symbols = [chains.graph.pairs[p].symbol for e in leg.elements for p in e.pairs]
        return "S" in symbols, any(e.composite for e in leg.elements), len(symbols)

    paths: dict[int, Walk] = {0: []}
    for _ in graph.platforms:
        for leg in sorted(graph.legs, key=cost):
            if leg.start in paths and leg.end not in paths:
                paths[leg.end] = paths[leg.start] + _walk(chains, leg)
            elif leg.end in paths and leg.start not in paths:
                back = [(p, -s) for p, s in reversed(_walk(chains, leg))]
                paths[leg.start] = paths[leg.end] + back
    return paths


def _walk(chains: Chains, leg: LegChain) -> Walk:
    out: Walk = []
    for element, sign in zip(leg.elements, leg.signs, strict=True):
        if element.composite:
            out += signed(chains, element, sign, 0)
        else:
            out.append((element.pairs[0], sign))
    return out


def _full(chains: Chains, paths: dict[int, Walk], leg: LegChain, root: str) -> list[Step]:
    return chains.steps([*paths[leg.start], *_walk(chains, leg)], link=root)


def _closing_walks(
    chains: Chains, graph: LegGraph, paths: dict[int, Walk]
) -> list[tuple[list[Step], list[Step]]]:
    """Two walks from the base to one link, around loops without spherical joints."""
    root = chains.description.root
    out = []
    for leg in graph.legs:
        there = [*paths[leg.start], *_walk(chains, leg)]
        path = paths[leg.end]
        spherical = any(chains.graph.pairs[p].symbol == "S" for p, _ in [*there, *path])
        if spherical or there == path or not path:
            continue
        link = chains.ends(path)[1]
        out.append((chains.steps(path, link=root), chains.steps(there, link=root, end=link)))
    return out


def _links(form: LegForms) -> bool:
    """Whether a leg joins two platforms that both move."""
    return bool(form.chain.start and form.chain.end)


def _numbers(ring: Ring, rows: list[Vector], at: Point) -> np.ndarray:
    return np.array([[evaluate(ring, x, at) for x in row] for row in rows])


def _independent(ring: Ring, rows: list[Vector], at: Point) -> list[Vector]:
    """Independent rows, the simplest first."""
    order = sorted(range(len(rows)), key=lambda i: (sum(_work(x) for x in rows[i]), i))
    value = _numbers(ring, rows, at) if rows else np.zeros((0, 0))
    chosen: list[int] = []
    for i in order:
        if numerical_rank(value[[*chosen, i]]).value == len(chosen) + 1:
            chosen.append(i)
    return [rows[i] for i in sorted(chosen)]


def _work(x: Element) -> int:
    return len(x) + sum(sum(m) for m in x)


def _eliminate(ring: Ring, matrix: list[Vector]) -> tuple[Element, list[Vector]]:
    """Take out rows and columns by pivots that are numbers: factor and rest of the determinant."""
    rows = [list(row) for row in matrix]
    factor = ring.one
    while True:
        pivots = [
            (sum(bool(x) for x in row), i, j)
            for i, row in enumerate(rows)
            for j, x in enumerate(row)
            if len(x) == 1 and not any(next(iter(x)))
        ]
        if not pivots:
            return factor, rows
        _, i, j = min(pivots)
        pivot = rows[i][j]
        for k, row in enumerate(rows):
            if k != i and row[j]:
                by = ring.mul(row[j], ring.R(1 / pivot.LC))
                rows[k] = [x - ring.mul(by, y) for x, y in zip(row, rows[i], strict=True)]
        factor = factor * pivot * (-1) ** (i + j)
        rows = [row[:j] + row[j + 1 :] for k, row in enumerate(rows) if k != i]
