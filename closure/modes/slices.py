"""Slices of the curve of solutions over a line of what is prescribed, for the trace test.

What is prescribed moves on a line, by a parameter z, and y is a weighted sum of numbers that tell
where the bodies are. The solutions for all z are a curve, and surfaces (z - z0) (y - c) = s meet it
in as many points for each s. At s = 0 those with z = z0 are the solutions at one place.

Where angles are prescribed, the tangents of half of them move on the line, so that all is
algebraic.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from closedchain.closure.closures import Closure
from closedchain.closure.modes.blocks import Block
from closedchain.closure.modes.paths import Followed
from closedchain.closure.modes.places import Place
from closedchain.closure.modes.shapes import numbers_of_shapes
from closedchain.closure.modes.systems import Linear, System, solved
from closedchain.closure.solve.problem import POSE
from closedchain.closure.tape.derivative import forward
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.numbers import evaluate
from closedchain.closure.tape.rows import Kinematics
from closedchain.closure.tape.vectors import turned_quaternion

Z = -1
"""Stands for z among tangent coordinates."""

APART = 1e-6
"""Relative: values of y that differ by less are one."""

SAMPLES = 8
"""Points of the curve at which the order of elimination is chosen."""


@dataclass(frozen=True, eq=False)
class Slices(Followed):
    """The equations of a block with z beside its unknowns, and one more: (z - z0) (y - c) = s.

    A posture is that of the mechanism with z behind. What is prescribed (``targets`` of a place):
    a and b of each line a + b z (dimensionless positions and quaternions of goals, then lengths of
    joints or tangents of half their angles), then z0, c, s, and the weights of y.

    Attributes
    ----------
    block : Block
    place : Place
    known : (n, nq) complex array
        Solutions there, at least one.
    """

    block: Block
    place: Place
    known: np.ndarray

    # -- what moves ----------------------------------------------------------------------------

    @cached_property
    def _graph(self) -> tuple[Graph, Kinematics]:
        m = self.block.equations.problem.mechanism
        g = Graph()
        return g, Kinematics(m, g, g.inputs(0, m.model.nq), upright=False)

    @cached_property
    def _number(self) -> dict[int, int]:
        """The number of q that each tangent coordinate of a joint with one freedom is of."""
        model = self.block.equations.problem.mechanism.model
        return {
            model.idx_vs[j]: int(model.idx_qs[j])
            for j in range(1, model.njoints)
            if model.nvs[j] == 1
        }

    @cached_property
    def _moving(self) -> list[int]:
        """Tangent coordinates of joints that are not the block's own and that its rows know."""
        problem = self.block.equations.problem
        g, k = self._graph
        rows = problem.rows(k, g.inputs(problem.mechanism.model.nq, problem.prescribed))
        known = {v for r in self.block.rows for v in rows.entries[problem.kept[r]]}
        own = {problem.free[c] for c in self.block.columns}
        return [v for v in sorted(known - own) if v in self._number]

    @cached_property
    def _moving_q(self) -> np.ndarray:
        return np.array([self._number[v] for v in self._moving], dtype=int)

    @cached_property
    def _goals(self) -> int:
        """Numbers of target poses."""
        return POSE * len(self.block.equations.problem.goals)

    @cached_property
    def _lines(self) -> int:
        return self._goals + len(self._moving)

    @cached_property
    def own(self) -> np.ndarray:
        """Numbers of a posture that are unknown."""
        last = self.block.equations.problem.mechanism.model.nq
        return np.sort(np.concatenate([self.block.own, self._moving_q, [last]])).astype(int)

    @cached_property
    def _unknown(self) -> list[int]:
        problem = self.block.equations.problem
        return [*(problem.free[c] for c in self.block.columns), *self._moving, Z]

    # -- equations -----------------------------------------------------------------------------

    @cached_property
    def _numbers(self) -> list[Expr]:
        """Numbers that y is the sum of.

        Coordinates of points, where they tell the known solutions apart; else all of shapes.
        """
        _, k = self._graph
        m = self.block.equations.problem.mechanism
        points = [x for i in range(1, m.model.njoints) for x in k.poses[i][1]]
        for closure in m.closures:
            if isinstance(closure, Closure):
                points += k.frame(closure.joint1, closure.placement1)[1]
        found = self._moved_alone(points)
        if found:
            values = np.array(self._values(found))
            y = np.random.default_rng(1).standard_normal(len(found)) @ values
            gap = np.abs(y[:, None] - y[None])
            np.fill_diagonal(gap, np.inf)
            if (gap > APART * (1.0 + np.abs(y))).all():
                return found
        return self._moved_alone(numbers_of_shapes(k))

    def _values(self, numbers: list[Expr]) -> list[np.ndarray]:
        g, _ = self._graph
        tape = g.tape(numbers, self.known.shape[1])
        n = len(self.known)
        return [np.broadcast_to(x, (n,)) for x in evaluate(tape, list(self.known.T))]

    def _moved_alone(self, numbers: list[Expr]) -> list[Expr]:
        """Those that the block's unknowns change, and that nothing changes that stands still."""
        g, _ = self._graph
        used: list[frozenset[int]] = []
        for node in g.nodes:
            if node[0] == "const":
                used.append(frozenset())
            elif node[0] == "input":
                used.append(frozenset(node[1:]))
            else:
                used.append(frozenset().union(*(used[i] for i in node[1:])))
        own, allowed = set(self.block.own.tolist()), set(self.own.tolist())
        return [
            x for x in dict.fromkeys(numbers) if used[x.index] <= allowed and used[x.index] & own
        ]

    @cached_property
    def system(self) -> System:
        """The equations for paths."""
        g, k = self._graph
        nq, lines = self.block.equations.problem.mechanism.model.nq, self._lines
        z = g.input(nq)
        a, b = (g.inputs(nq + 1 + i * lines, lines) for i in (0, 1))
        line = [one + two * z for one, two in zip(a, b, strict=True)]
        first = nq + 1 + 2 * lines
        z0, c, s = g.inputs(first, 3)
        weights = g.inputs(first + 3, len(self._numbers))
        values, entries = self._rows(line)
        for value, row in zip(values, entries, strict=True):
            row[Z] = forward(g, [value], {nq: 1.0})[0]
        y = g.constant(0.0)
        for weight, number in zip(weights, self._numbers, strict=True):
            y = y + weight * number
        values.append((z - z0) * (y - c) - s)
        slopes = {v: (z - z0) * self._slope(y, v) for v in self._unknown if v != Z}
        entries.append({**slopes, Z: y - c})
        entries = [{v: e for v, e in row.items() if e.value != 0.0} for row in entries]
        step, guard = solved(g, Linear(values, entries, self._unknown), self._samples())
        moved = [*k.moved(k.q, {v: e for v, e in step.items() if v != Z}), z + step[Z]]
        out = [*(moved[i] for i in self.own), *(step[v] for v in self._unknown), *guard]
        tape = g.tape(out, first + 3 + len(weights))
        k_block, free = len(self.block.columns), [*self._moving_q.tolist(), nq]
        relative = {**self.block.relative, **{k_block + i: (x, 1.0) for i, x in enumerate(free)}}
        block = self.block.numbers
        numbers = replace(
            block,
            count=nq + 1,
            own=self.own,
            others=(*block.others, nq),
            pinned=(),
            poses=(),
        )
        return System(numbers, first + 3 + len(weights) - (nq + 1), tape, relative)

    def _rows(self, line: list[Expr]) -> tuple[list[Expr], list[dict[int, Expr]]]:
        """The block's rows, and what ties its moving joints to their lines."""
        problem = self.block.equations.problem
        m = problem.mechanism
        g, k = self._graph
        target = [k.q[i] for i in problem.pinned_q]
        for i in range(0, self._goals, POSE):
            turn = line[i + 3 : i + 7]
            size = (turn[0] * turn[0] + turn[1] * turn[1]) + (turn[2] * turn[2] + turn[3] * turn[3])
            inverse = size.sqrt().recip()
            target += [m.length * x for x in line[i : i + 3]] + [inverse * x for x in turn]
        every = problem.rows(k, target)
        chosen = [problem.kept[r] for r in self.block.rows]
        values = [every.values[r] for r in chosen]
        entries = [
            {v: e for v, e in every.entries[r].items() if v in self._unknown} for r in chosen
        ]
        for v, number, t in zip(self._moving, self._moving_q, line[self._goals :], strict=True):
            q = k.q[number]
            if m.translational[v]:
                values.append((1.0 / m.length) * q - t)
                entries.append({v: g.constant(1.0)})
            else:
                values.append(q.sin() - t * (1.0 + q.cos()))
                entries.append({v: q.cos() + t * q.sin()})
        return values, entries

    def _slope(self, y: Expr, v: int) -> Expr:
        """Derivative of y by a tangent coordinate."""
        g, k = self._graph
        m = self.block.equations.problem.mechanism
        if v in self._number:
            return forward(g, [y], {self._number[v]: float(m.column_scale[v])})[0]
        model = m.model
        j = next(j for j in range(1, model.njoints) if 0 <= v - model.idx_vs[j] < model.nvs[j])
        first, axis = int(model.idx_qs[j]), v - int(model.idx_vs[j])
        if axis < 3:
            return forward(g, [y], {first + axis: float(m.length)})[0]
        q = k.q[first + 3 : first + 7]
        turned = turned_quaternion(q, [g.constant(float(i == axis - 3)) for i in range(3)])
        seeds = {first + 3 + i: turned[i] - q[i] for i in range(4)}
        return forward(g, [y], seeds)[0]

    def _samples(self) -> np.ndarray:
        """Points of curves through known solutions and what they meet (inputs, n)."""
        rng, found = np.random.default_rng(5), []
        for q in np.resize(self.known, (SAMPLES, self.known.shape[1])):
            place = self.through(q, rng)
            found.append(np.concatenate([q, place.given[-1:], place.targets]))
        return np.array(found).T

    # -- places --------------------------------------------------------------------------------

    def random(self, rng: np.random.Generator, wide: float = 1.0) -> Place:
        """A random line, slice and y; what moves is ``wide`` in size."""
        n = 2 * self._lines + 3 + len(self._numbers)
        targets = rng.standard_normal(n) + 1j * rng.standard_normal(n)
        targets[: 2 * self._lines] *= wide
        return Place(targets, np.append(self.known[0], 0.0))

    def through(self, q: np.ndarray, rng: np.random.Generator) -> Place:
        """A random line through the place of a solution (nq,), with s = 0 and that place at z0."""
        m = self.block.equations.problem.mechanism
        place = self.random(rng)
        pins = len(self.block.equations.problem.pinned)
        at = self.place.targets[pins:].copy()
        for i in range(0, self._goals, POSE):
            at[i : i + 3] /= m.length
        x = q[self._moving_q]
        slides = m.translational[self._moving]
        at = np.concatenate([at, np.where(slides, x / m.length, np.tan(0.5 * x))])
        lines = self._lines
        z0 = place.targets[2 * lines]
        place.targets[:lines] = at - place.targets[lines : 2 * lines] * z0
        place.targets[2 * lines + 2] = 0.0
        place.given[-1] = z0
        return place

    def at(self, place: Place, s: complex) -> Place:
        """The same place with another s."""
        targets = place.targets.copy()
        targets[2 * self._lines + 2] = s
        return Place(targets, place.given)

    def y(self, place: Place, q: np.ndarray) -> np.ndarray:
        """y - c (n,) of points (n, nq + 1) with s not nothing."""
        z0, _, s = place.targets[2 * self._lines : 2 * self._lines + 3]
        return np.asarray(s / (q[:, -1] - z0))
