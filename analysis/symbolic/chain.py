"""The legs of a mechanism as walks: bodies, joints and cut joints turned into steps."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from closedchain.analysis.screws.network import column_names
from closedchain.analysis.structure.loops import LoopGraph, Pair
from closedchain.analysis.symbolic.exact import exact_or_rounded
from closedchain.analysis.symbolic.parameters import Affine, Sizes, law_angle
from closedchain.analysis.symbolic.ring import Angle
from closedchain.analysis.symbolic.walk import Fixed, Laws, Slide, Step, Turn
from closedchain.closure.tree import z_onto
from closedchain.urdf.description import Description

_ZERO = Affine({}, {})
_ONE = Affine({(): Fraction(1)}, {})
_NO = (_ZERO, _ZERO, _ZERO)
AXES: tuple[Laws, ...] = ((_ONE, _ZERO, _ZERO), (_ZERO, _ONE, _ZERO), (_ZERO, _ZERO, _ONE))
_STILL = (Angle(), Angle(), Angle())
_QUARTER = Fixed(_NO, (Angle({"pi": Fraction(1, 2)}), Angle(), Angle()))


class Chains:
    """Turns runs of pairs into steps.

    Parameters
    ----------
    ties : mapping
        Angles that follow from others on closed postures, by coordinate name.
    """

    def __init__(
        self, description: Description, graph: LoopGraph, found: Sizes, ties: Mapping[str, Angle]
    ) -> None:
        self.description, self.graph, self.sizes, self.ties = description, graph, found, ties
        self.names = column_names(graph)
        self.joints = {j.name: j for j in description.joints}
        self.cuts = {c.name: c for c in description.closures}
        self.rigid: dict[str, list[tuple[str, list[Step]]]] = {}
        for joint in description.joints:
            if joint.type == "fixed":
                there = [self._origin(f"joint {joint.name}", "")]
                self._join(joint.parent, joint.child, there)
        for closure in description.closures:
            if closure.type == "fixed":
                element = f"closure {closure.name}"
                there = [
                    self._cut_frame(element, "parent_", closure.parent_axis),
                    _inverse(self._cut_frame(element, "child_", closure.child_axis)),
                ]
                self._join(closure.parent, closure.child, there)

    def steps(
        self, walk: Sequence[tuple[int, int]], link: str | None = None, end: str | None = None
    ) -> list[Step]:
        """Steps along signed pairs, from ``link`` (that of the first joint by default)."""
        out: list[Step] = []
        here = link
        for p, sign in walk:
            pair = self.graph.pairs[p]
            first, last = self._ends(pair, sign)
            if here is not None:
                out += self.within(here, first)
            out += self._pair(p, pair, sign)
            here = last
        if end is not None and here is not None:
            out += self.within(here, end)
        return out

    def ends(self, walk: Sequence[tuple[int, int]]) -> tuple[str, str]:
        """Links where a run of signed pairs begins and ends."""
        (first, one), (last, two) = walk[0], walk[-1]
        pairs = self.graph.pairs
        return self._ends(pairs[first], one)[0], self._ends(pairs[last], two)[1]

    def _join(self, one: str, two: str, there: Sequence[Step]) -> None:
        back: list[Step] = [_inverse(s) for s in reversed(there) if isinstance(s, Fixed)]
        self.rigid.setdefault(one, []).append((two, list(there)))
        self.rigid.setdefault(two, []).append((one, back))

    def within(self, start: str, end: str) -> list[Step]:
        """From link to link of one body."""
        seen: dict[str, list[Step]] = {start: []}
        queue = deque([start])
        while queue:
            link = queue.popleft()
            if link == end:
                return seen[link]
            for other, there in self.rigid.get(link, ()):
                if other not in seen:
                    seen[other] = seen[link] + there
                    queue.append(other)
        raise AssertionError((start, end))

    def _ends(self, pair: Pair, sign: int) -> tuple[str, str]:
        if pair.closure is not None:
            closure = self.cuts[pair.closure]
            ends = closure.parent, closure.child
        else:
            ends = self.joints[pair.joints[0]].parent, self.joints[pair.joints[-1]].child
        return ends if sign > 0 else (ends[1], ends[0])

    def _pair(self, p: int, pair: Pair, sign: int) -> list[Step]:
        if pair.closure is not None:
            return self._cut(p, pair, sign)
        out: list[Step] = []
        for name in pair.joints if sign > 0 else reversed(pair.joints):
            joint = self.joints[name]
            element = f"joint {name}"
            axis = self._laws(element, "axis")
            moving = self._move(name, axis, joint.type == "prismatic", sign)
            origin = self._origin(element, "")
            out += [origin, moving] if sign > 0 else [moving, _inverse(origin)]
        return out

    def _cut(self, p: int, pair: Pair, sign: int) -> list[Step]:
        closure = self.cuts[pair.name]
        element = f"closure {closure.name}"
        one = self._cut_frame(element, "parent_", closure.parent_axis)
        two = self._cut_frame(element, "child_", closure.child_axis)
        names = self.names[p]
        z = AXES[2]
        moves: list[Step]
        if closure.type == "spherical":
            # hinges x y z from the side that the walk comes from, whichever that is
            moves = [self._move(n, axis, False, 1) for n, axis in zip(names, AXES, strict=True)]
            first, last = (one, two) if sign > 0 else (two, one)
            return [first, *moves, _inverse(last)]
        if closure.type == "planar":
            moves = [
                self._move(names[0], AXES[0], True, sign),
                self._move(names[1], AXES[1], True, sign),
                self._move(names[2], z, False, sign),
            ]
        elif closure.type == "cylindrical":
            moves = [self._move(names[0], z, False, sign), self._move(names[1], z, True, sign)]
        elif closure.type == "universal":
            moves = [
                self._move(names[0], z, False, sign),
                _QUARTER,
                self._move(names[1], z, False, sign),
            ]
        else:
            moves = [self._move(names[0], z, closure.type == "prismatic", sign)]
        if sign > 0:
            return [one, *moves, _inverse(two)]
        moves = [_inverse(m) if isinstance(m, Fixed) else m for m in reversed(moves)]
        return [two, *moves, _inverse(one)]

    def _move(self, name: str, axis: Laws, slide: bool, sign: int) -> Step:
        if slide:
            return Slide(name, axis, sign)
        angle = self.ties.get(name, Angle({name: Fraction(1)}))
        return Turn(name, axis, angle * sign, sign)

    def _origin(self, element: str, prefix: str) -> Fixed:
        roll, pitch, yaw = (Angle(law_angle(x)) for x in self._laws(element, f"{prefix}rpy"))
        return Fixed(self._laws(element, f"{prefix}xyz"), (roll, pitch, yaw))

    def _laws(self, element: str, what: str) -> Laws:
        laws = self.sizes.laws
        return laws[element, what, 0], laws[element, what, 1], laws[element, what, 2]

    def _cut_frame(self, element: str, prefix: str, axis: tuple[float, float, float]) -> Fixed:
        """Frame of a cut joint, z along its axis."""
        origin = self._origin(element, f"{prefix}origin_")
        turned = z_onto(axis).rotation
        if np.array_equal(turned, np.eye(3)):
            return origin
        matrix = tuple(tuple(exact_or_rounded(float(x))[0] for x in row) for row in turned)
        return Fixed(origin.translation, origin.rpy, matrix)


def _inverse(step: Fixed) -> Fixed:
    return Fixed(step.translation, step.rpy, step.matrix, not step.inverse)
