"""The tape of following complex paths: one step of Newton's method, and what becomes of it.

A path is at a share of its way, with the slope there and what was known a step before. From these
a cubic leads ahead, and Newton's method corrects what it gives: quickly, or the step is refused and
made shorter. The slope is Newton's step from a little further on the way. The same tape serves
starts from afar, which stay at a place and take bounded steps until they are closed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from closedchain.closure.modes.complex_tape import (
    Parts,
    complex_inputs,
    on_complex,
    product,
    root,
    squared,
)
from closedchain.closure.modes.path_control import (
    BOUND,
    FAR,
    HIGH,
    HUGE,
    LEAST,
    REST,
    SCALARS,
    SHIFT,
    choice,
    scalars_after,
)
from closedchain.closure.modes.systems import System
from closedchain.closure.tape.expression import Expr, Graph, Tape

LEFT = 1e-4
"""Share of the rows that a step may leave of the linear equations."""

ROUNDING = 1e-11
"""Dimensionless: what rounding leaves of them."""

VECTORS = ("here", "trial", "slope", "before", "slope_before")


@dataclass(frozen=True, eq=False)
class Seen:
    """What Newton's method says at a posture: the unknown numbers there, and after its step.

    ``size`` is the step's, relative; without a value where there is none.
    """

    at: list[Parts]
    after: list[Parts]
    size: Expr


@dataclass(frozen=True, eq=False)
class Lane:
    """Numbers of one path as expressions of a tape: its state, and the parameters behind."""

    graph: Graph
    vectors: dict[str, list[Parts]]
    scalars: dict[str, Expr]

    @cached_property
    def tried(self) -> Expr:
        """Share of the way at which Newton's method looks."""
        s = self.scalars
        ahead = s["share"] + s["step"]
        whole = ~(ahead < 1.0 - 1e-14)
        return (s["phase"] < 0.5).select(s["share"] + self.ahead, whole.select(1.0, ahead))

    @cached_property
    def ahead(self) -> Expr:
        """How far ahead the slope is seen."""
        s = self.scalars
        return (SHIFT * s["step"]).max((REST * (1.0 - s["share"])).min(LEAST))

    @cached_property
    def posture(self) -> list[Parts]:
        """Unknown numbers where Newton's method looks."""
        slope, v = self.scalars["phase"] < 0.5, self.vectors
        return [_select(slope, x, y) for x, y in zip(v["here"], v["trial"], strict=True)]


@dataclass(frozen=True, eq=False)
class PathTapes:
    """Tapes of a system's paths."""

    system: System

    @property
    def states(self) -> int:
        """Numbers of the state: parts of ``VECTORS``, then ``SCALARS``."""
        return 2 * len(VECTORS) * len(self.system.numbers.own) + len(SCALARS)

    @cached_property
    def step_tape(self) -> Tape:
        """A step of Newton's method and what becomes of it: the new state, and whether to go on.

        Parameters: parts of the targets and of the postures at both places.
        """
        system, numbers = self.system, self.system.numbers
        lane = self._lane()
        g = lane.graph
        count, first = system.prescribed, self.states
        ends = [complex_inputs(g, first + 2 * count * k, count) for k in (0, 1)]
        first += 4 * count
        given = [complex_inputs(g, first + 2 * numbers.count * k, numbers.count) for k in (0, 1)]
        targets, posture = (
            [_mixed(lane.tried, a, b) for a, b in zip(*both, strict=True)] for both in (ends, given)
        )
        for i in numbers.poses:
            targets[i : i + 4] = _normalised(targets[i : i + 4])
        for number, value in zip(numbers.own.tolist(), lane.posture, strict=True):
            posture[number] = value
        for number, value in zip(numbers.pinned, targets, strict=False):
            posture[number] = value
        for i in numbers.turns:
            posture[i : i + 4] = _normalised(posture[i : i + 4])
        found = on_complex(g, system.tape, posture + targets)
        m, k = len(numbers.own), system.size
        moved, step, (before, after) = found[:m], found[m : m + k], found[m + k :]
        share = LEFT * LEFT * squared(before) * ROUNDING**-2.0 + 1.0
        at = [posture[i] for i in numbers.own.tolist()]
        size = self._size(g, posture, step)
        fine = (squared(after) * ROUNDING**-2.0 < share) & (size < HUGE)
        if system.slow is None:  # such a step is refused
            size, fine = fine.select(size, HUGE), size > -1.0
        return self._decided(lane, Seen(at, moved, size), fine, first + 4 * numbers.count)

    @cached_property
    def judge_tape(self) -> Tape:
        """What becomes of a path that asks, by Newton's step from elsewhere.

        Parameters: parts of the unknown numbers where it looked and after the step, its size.
        """
        lane, m = self._lane(), len(self.system.numbers.own)
        g, first = lane.graph, self.states
        at, after = (complex_inputs(g, first + 2 * m * k, m) for k in (0, 1))
        size = g.input(first + 4 * m)
        return self._decided(lane, Seen(at, after, size), None, first + 4 * m + 1)

    def _lane(self) -> Lane:
        g, m = Graph(), len(self.system.numbers.own)
        vectors = {name: complex_inputs(g, 2 * m * k, m) for k, name in enumerate(VECTORS)}
        scalars = g.inputs(2 * m * len(VECTORS), len(SCALARS))
        return Lane(g, vectors, dict(zip(SCALARS, scalars, strict=True)))

    def _size(self, g: Graph, posture: list[Parts], step: list[Parts]) -> Expr:
        """Largest component of a step; as ``System.relative`` says."""
        largest, total = g.constant(0.0), g.constant(0.0)
        for component, parts in enumerate(step):
            one = squared(parts)
            if component in self.system.relative:
                number, unit = self.system.relative[component]
                one = one * (1.0 + squared(posture[number]) * (1.0 / unit**2)).recip()
            largest, total = largest.max(one), total + one
        return (total < HUGE).select(largest.sqrt(), HUGE)  # a number that is none is not largest

    def _far(self, own: list[Parts]) -> Expr:
        """Whether unknown numbers are beyond all bounds, or none."""
        numbers = self.system.numbers
        place = {number: i for i, number in enumerate(numbers.own.tolist())}
        near = own[0][0] * 0.0 < 1.0
        for i in (*numbers.lengths, *numbers.others):
            bound = FAR * (numbers.unit if i in numbers.lengths else 1.0)
            near = near & (squared(own[place[i]]) < bound**2)
        for i in numbers.angles:
            near = near & (abs(own[place[i]][1]) < HIGH)
        return ~near

    def _decided(self, lane: Lane, seen: Seen, fine: Expr | None, inputs: int) -> Tape:
        """The tape of what becomes of a path; where it is not fine, it asks."""
        s, v, size = lane.scalars, lane.vectors, seen.size
        c = choice(s, lane.tried, size, fine)
        inverse, bound = lane.ahead.recip(), BOUND * size.max(BOUND).recip()
        given, predicting = c.sloping & (size < HUGE), c.sloping | c.refuse
        cubic = _Cubic.of(s["length"], c.ahead.min(1.0 - c.share))
        state: dict[str, list[Parts]] = {name: [] for name in VECTORS}
        for k, (at, after) in enumerate(zip(seen.at, seen.after, strict=True)):
            x, y, slope, old, slope_old = (v[name][k] for name in VECTORS)
            change = _less(after, at)
            steep = _select(given, _scaled(change, inverse), slope)
            tried = _select(c.afar, _plus(at, _scaled(change, bound)), _select(c.keeps, after, y))
            state["here"].append(_select(c.accept | c.afar, tried, x))
            state["trial"].append(_select(predicting, cubic.at(x, steep, old, slope_old), tried))
            state["slope"].append(steep)
            state["before"].append(_select(c.accept, x, old))
            state["slope_before"].append(_select(c.accept, slope, slope_old))
        far = self._far(state["here"])
        now = scalars_after(s, c, size, far, asking=fine is not None)
        out = [x for name in VECTORS for parts in state[name] for x in parts]
        out += [now[name] for name in SCALARS]
        return lane.graph.tape([*out, c.now & (now["status"] < 0.0)], inputs)


@dataclass(frozen=True, eq=False)
class _Cubic:
    """The cubic through a point and the one before; along the slope where there is none before."""

    known: Expr
    inverse: Expr
    h: Expr

    @classmethod
    def of(cls, length: Expr, h: Expr) -> _Cubic:
        """For the step before, 0 where there was none, and the one ahead."""
        known = length > 0.0
        return cls(known, known.select(length, 1.0).recip(), h)

    def at(self, x: Parts, slope: Parts, before: Parts, slope_before: Parts) -> Parts:
        """Number a step ahead."""
        h, inverse = self.h, self.inverse
        found = []
        for a, s, b, t in zip(x, slope, before, slope_before, strict=True):
            mean = (a - b) * inverse
            third = (t + s - 2.0 * mean) * inverse
            bend = ((s - mean) * inverse + third + third * (h * inverse)) * (h * h)
            found.append(a + h * s + self.known.select(bend, 0.0))
        return found[0], found[1]


def _select(where: Expr, then: Parts, otherwise: Parts) -> Parts:
    return where.select(then[0], otherwise[0]), where.select(then[1], otherwise[1])


def _plus(a: Parts, b: Parts) -> Parts:
    return a[0] + b[0], a[1] + b[1]


def _less(a: Parts, b: Parts) -> Parts:
    return a[0] - b[0], a[1] - b[1]


def _scaled(a: Parts, by: Expr) -> Parts:
    return a[0] * by, a[1] * by


def _mixed(share: Expr, a: Parts, b: Parts) -> Parts:
    """The number at a share of the way from one to another."""
    rest = 1.0 - share
    return rest * a[0] + share * b[0], rest * a[1] + share * b[1]


def _normalised(quaternion: list[Parts]) -> list[Parts]:
    """Divided by the root of the sum of squares, without conjugates."""
    g = quaternion[0][0].graph
    total: Parts = (g.constant(0.0), g.constant(0.0))
    for one in quaternion:
        total = _plus(total, product(one, one))
    size = root(total)
    inverse = squared(size).recip()
    by = size[0] * inverse, -(size[1] * inverse)
    return [product(one, by) for one in quaternion]
