"""A mechanism's equations, written once: closure rows, goals of the tip, and their Jacobians.

Rows are expressions as ``bodies`` has them. Those that hold a point (three slides) are written
along the world's axes, so that most entries of the Jacobian vanish.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from closedchain.closure.closures import Closure, Coupling
from closedchain.closure.joint_kinds import JOINT_KINDS
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.tape.bodies import Bodies, Entries
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.vectors import (
    Pose,
    column,
    cross,
    dot,
    matmul,
    matvec,
    sub,
    transposed,
)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of equations: values, entries of the Jacobian, and units [m] or [rad] of the values."""

    values: list[Expr]
    entries: list[Entries]
    units: list[float]

    def __add__(self, other: Rows) -> Rows:
        """Rows of both."""
        return Rows(
            self.values + other.values, self.entries + other.entries, self.units + other.units
        )

    def largest(self, graph: Graph, which: Sequence[int] | None = None) -> Expr:
        """Size of the largest row, or of the largest of some [m or rad]; 0 for none."""
        found = graph.constant(0.0)
        for r in range(len(self.values)) if which is None else which:
            found = found.max(self.units[r] * abs(self.values[r]))
        return found


@dataclass(frozen=True, eq=False)
class Kinematics(Bodies):
    """The bodies of a mechanism, and the rows of its equations.

    Attributes
    ----------
    upright : bool or set of str
        Whether rows that hold a point are along the world's axes, or the closures whose rows are;
        else they are along those of frame 1, as the public residual has them.
    """

    upright: bool | frozenset[str] = True

    @cached_property
    def closures(self) -> Rows:
        """Rows of all closures, in the order of the mechanism's."""
        rows = Rows([], [], [])
        for closure in self.mechanism.closures:
            if isinstance(closure, Coupling):
                rows = rows + self._coupling(closure)
            else:
                rows = rows + self._closure(closure)
        return rows

    @cached_property
    def least_sense(self) -> Expr:
        """Least cosine of axes that a closed joint has parallel: negative where it is mirrored."""
        found = self.graph.constant(1.0)
        for cosine in self.senses:
            found = found.min(cosine)
        return found

    @cached_property
    def senses(self) -> list[Expr]:
        """Cosines between axes that closed joints have parallel: -1 where one is mirrored."""
        found = []
        for closure in self.mechanism.closures:
            if isinstance(closure, Closure):
                a = self.frame(closure.joint1, closure.placement1)[0]
                b = self.frame(closure.joint2, closure.placement2)[0]
                for k in closure.joint_kind.senses:
                    found.append(self.graph.lift(dot(column(a, k), column(b, k))))
        return found

    def _closure(self, closure: Closure) -> Rows:
        length = self.mechanism.length
        kind = closure.joint_kind
        a, pa = self.frame(closure.joint1, closure.placement1)
        b, pb = self.frame(closure.joint2, closure.placement2)
        gap = sub(pb, pa)
        p, r = matvec(transposed(a), gap), matmul(transposed(a), b)
        sizes = {name: size / length for name, size in closure.sizes.items()}
        values, wrenches = kind.values(p, r, sizes), kind.wrenches(p, r, sizes)
        world = [(matvec(a, f), matvec(a, m)) for f, m in wrenches]
        upright = (
            closure.name in self.upright if isinstance(self.upright, frozenset) else self.upright
        )
        if upright and kind.holds_point:
            # a held point: its three rows turned into the world's axes
            one, zero = self.graph.constant(1.0), self.graph.constant(0.0)
            axes = [[one if r == c else zero for c in range(3)] for r in range(3)]
            values = [*gap, *values[3:]]
            world = [*((axis, [zero] * 3) for axis in axes), *world[3:]]
        moved = self.relative(closure.joint1, closure.joint2, pb)
        entries = [self.row(f, m, moved) for f, m in world]
        units = [length if slides else 1.0 for slides in kind.translational]
        return Rows([self.graph.lift(x) for x in values], entries, units)

    def _coupling(self, tie: Coupling) -> Rows:
        unit = self.mechanism.length if tie.length_row else 1.0
        entries: Entries = {}
        for v, slope in tie.gradient(self.q):
            entry = self.graph.lift(slope) * (self.mechanism.column_scale[v] / unit)
            entry = entries[v] + entry if v in entries else entry
            if entry.value != 0.0:
                entries[v] = entry
        value = self.graph.lift(tie.value(self.q)) * (1.0 / unit)
        return Rows([value], [entries], [unit])

    def goal(self, frame: str, outputs: Sequence[int], target: Pose) -> Rows:
        """Rows that hold components ``outputs`` (0 to 5 for x y z rx ry rz) of a frame's pose.

        ``target`` in the world, its origin in lengths. Components as ``closure.task`` says.
        """
        (own, place), joint = self.named(frame)
        wanted, to = target
        moved = self.relative(0, joint, place)
        g, length = self.graph, self.mechanism.length
        zero = [g.constant(0.0)] * 3
        axes = [[g.constant(float(r == c)) for c in range(3)] for r in range(3)]
        gap = sub(place, to)
        linear = [k for k in outputs if k < 3]
        angular = [k - 3 for k in outputs if k >= 3]
        found = [(gap[k], axes[k], zero) for k in linear]
        relative = matmul(transposed(wanted), own)
        if len(angular) in (1, 3):
            kind = JOINT_KINDS["fixed"]
            values, wrenches = kind.values(zero, relative, {}), kind.wrenches(zero, relative, {})
            found += [(values[3 + k], zero, matvec(wanted, wrenches[3 + k][1])) for k in angular]
        elif len(angular) == 2:
            (third,) = {0, 1, 2} - set(angular)
            axis = column(own, third)
            found += [(relative[k][third], zero, cross(axis, column(wanted, k))) for k in angular]
        return Rows(
            [g.lift(value) for value, _, _ in found],
            [self.row(f, m, moved) for _, f, m in found],
            [length] * len(linear) + [1.0] * len(angular),
        )

    def faces(self, frame: str, outputs: Sequence[int], target: Pose) -> Expr:
        """Cosine that is negative where a goal of two rotations is met the other way round."""
        angular = {k - 3 for k in outputs if k >= 3}
        if len(angular) != 2:
            return self.graph.constant(1.0)
        (third,) = {0, 1, 2} - angular
        (own, _), _ = self.named(frame)
        return self.graph.lift(dot(column(own, third), column(target[0], third)))

    def task(self, frame: str, outputs: Sequence[int]) -> list[Entries]:
        """Task Jacobian: rates of the outputs, dimensionless, as ``closure.task`` says."""
        (own, place), joint = self.named(frame)
        g = self.graph
        zero = [g.constant(0.0)] * 3
        axes = [[g.constant(float(r == c)) for c in range(3)] for r in range(3)]
        moved = self.relative(0, joint, place)
        world = sum(k >= 3 for k in outputs) == 3
        found = []
        for k in outputs:
            axis = axes[k % 3] if k < 3 or world else column(own, k - 3)
            found.append(self.row(axis, zero, moved) if k < 3 else self.row(zero, axis, moved))
        return found


def kinematics(
    mechanism: Mechanism, graph: Graph | None = None, first: int = 0, *, upright: bool = True
) -> Kinematics:
    """Expressions of a mechanism; its q are the inputs ``first`` and on of the graph."""
    g = graph or Graph()
    return Kinematics(mechanism, g, g.inputs(first, mechanism.model.nq), upright)
