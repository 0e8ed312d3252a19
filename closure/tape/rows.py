"""A mechanism's equations, written once: poses, closure rows, their Jacobian, points, the tip.

Everything is an expression in the numbers of q, in dimensionless lengths (divided by
``mechanism.length``). Motions are coordinates of the tangent: rates of hinges [rad] and slides
[lengths], and for a floating joint the velocity of its origin and its angular velocity, both along
the axes of the frame that it floats in. Pinocchio's v has the body's own axes there: ``own`` turns
a row of a Jacobian into those. That changes no determinant and no singular value, and most entries
of the Jacobian vanish with it.

Rows that hold a point (three slides) are written along the world's axes, for the same reasons.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure, Coupling
from closedchain.closure.joint_kinds import JOINT_KINDS
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.tape.expression import ZERO, Expr, Graph, Number
from closedchain.closure.tape.vectors import (
    Pose,
    Vector,
    add,
    column,
    compose,
    cross,
    dot,
    matmul,
    matvec,
    neg,
    rotation,
    scale,
    sub,
    transposed,
    turned_quaternion,
)

Entries = dict[int, Expr]
"""One row of a Jacobian: entry of each tangent coordinate that is not zero."""


@dataclass(frozen=True, eq=False)
class Screw:
    """Unit motion of a tangent coordinate: a turn about ``axis`` through ``point``, or a slide."""

    axis: list[Expr]
    point: list[Expr] | None

    def at(self, place: Vector) -> list[Expr]:
        """Velocity of a point that moves along."""
        return self.axis if self.point is None else cross(self.axis, sub(place, self.point))

    def turns(self) -> list[Expr] | None:
        """Angular velocity; None for a slide."""
        return None if self.point is None else self.axis


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


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Expressions of a mechanism in the numbers ``q`` of a graph.

    Attributes
    ----------
    graph : Graph
    q : list of nq expressions
        Lengths in m, angles in rad, quaternions x y z w.
    upright : bool or set of str
        Whether rows that hold a point are along the world's axes, or the closures whose rows are;
        else they are along those of frame 1, as the public residual has them.
    """

    mechanism: Mechanism
    graph: Graph
    q: list[Expr]
    upright: bool | frozenset[str] = True
    _screws: dict[int, Screw] = field(init=False, default_factory=dict, repr=False)

    @cached_property
    def poses(self) -> list[Pose]:
        """Pose of every joint's frame in the world, the base first; z is its axis."""
        g, model = self.graph, self.mechanism.model
        one, zero = g.constant(1.0), g.constant(0.0)
        base = [[one if r == c else zero for c in range(3)] for r in range(3)]
        found: list[Pose] = [(base, [zero] * 3)]
        for i in range(1, model.njoints):
            found.append(self._placed(i, found[model.parents[i]]))
        return found

    def _placed(self, i: int, parent: Pose) -> Pose:
        model, inverse = self.mechanism.model, 1.0 / self.mechanism.length
        joint = model.joints[i]
        turn = self._turns[i]
        own = pin.SE3(turn, np.zeros(3))
        r, p = compose(
            parent, self._constant(self._on(model.parents[i], model.jointPlacements[i]) * own)
        )
        if joint.nq == 7:
            orientation = rotation(self.q[joint.idx_q + 3 : joint.idx_q + 7])
            place = [inverse * x for x in self.q[joint.idx_q : joint.idx_q + 3]]
            return matmul(r, orientation), add(p, matvec(r, place))
        value = self.q[joint.idx_q]
        if self.mechanism.translational[joint.idx_v]:
            return r, add(p, scale(inverse * value, column(r, 2)))
        c, s = value.cos(), value.sin()
        return [[c * x + s * y, c * y - s * x, z] for x, y, z in r], p

    @cached_property
    def _turns(self) -> list[np.ndarray]:
        """For each joint the rotation that takes z onto its axis: every hinge turns about z."""
        axes = {j.name: j.axis for j in self.mechanism.description.joints if j.type != "floating"}
        names = list(self.mechanism.model.names)[1:]
        return [np.eye(3), *(_from_z(axes.get(name, (0.0, 0.0, 1.0))) for name in names)]

    def _on(self, joint: int, placement: pin.SE3) -> pin.SE3:
        """Placement on Pinocchio's joint frame as one on ours."""
        turn = self._turns[joint].T
        return pin.SE3(turn @ placement.rotation, turn @ placement.translation)

    def _constant(self, placement: pin.SE3) -> Pose:
        g, length = self.graph, self.mechanism.length
        turned = [[g.constant(x) for x in row] for row in placement.rotation]
        return turned, [g.constant(x / length) for x in placement.translation]

    def frame(self, joint: int, placement: pin.SE3) -> Pose:
        """Pose of a frame that sits at ``placement`` on Pinocchio's joint."""
        return compose(self.poses[joint], self._constant(self._on(joint, placement)))

    def named(self, frame: str) -> tuple[Pose, int]:
        """Pose of a named link or point, and the joint that carries it."""
        f = self.mechanism.model.frames[self.mechanism.frame_id(frame)]
        return self.frame(f.parentJoint, f.placement), int(f.parentJoint)

    # -- motions -----------------------------------------------------------------------------------

    def screw(self, v: int) -> Screw:
        """Unit motion of tangent coordinate ``v``."""
        if v not in self._screws:
            self._screws[v] = self._screw(v)
        return self._screws[v]

    def _screw(self, v: int) -> Screw:
        model = self.mechanism.model
        i = self._joint_of[v]
        joint = model.joints[i]
        own, place = self.poses[i]
        if joint.nv == 1:
            slides = self.mechanism.translational[v]
            return Screw(column(own, 2), None if slides else list(place))
        k = v - joint.idx_v
        parent = self.poses[model.parents[i]][0]
        still = self._constant(self._on(model.parents[i], model.jointPlacements[i]))[0]
        axis = column(matmul(parent, still), k % 3)
        return Screw(axis, None if k < 3 else list(place))

    @cached_property
    def _joint_of(self) -> list[int]:
        model = self.mechanism.model
        return [i for i in range(1, model.njoints) for _ in range(model.nvs[i])]

    def tangent(self, joint: int) -> list[int]:
        """Tangent coordinates of a joint."""
        first = self.mechanism.model.idx_vs[joint]
        return list(range(first, first + self.mechanism.model.nvs[joint]))

    def path(self, first: int, second: int) -> list[tuple[int, int]]:
        """Joints between two: +1 for those that move the second, -1 for the first."""
        one, two = self._above(first), self._above(second)
        signs = [(j, -1) for j in one if j not in two] + [(j, 1) for j in two if j not in one]
        return sorted(signs)

    def _above(self, joint: int) -> set[int]:
        found = set()
        while joint > 0:
            found.add(joint)
            joint = self.mechanism.model.parents[joint]
        return found

    def relative(self, first: int, second: int, place: Vector) -> dict[int, tuple[Vector, Vector]]:
        """Velocity at ``place`` and angular velocity of body 2 against body 1, for each motion."""
        zero = [self.graph.constant(0.0)] * 3
        found: dict[int, tuple[Vector, Vector]] = {}
        for joint, sign in self.path(first, second):
            for v in self.tangent(joint):
                screw = self.screw(v)
                linear, angular = screw.at(place), screw.turns() or zero
                found[v] = (linear, angular) if sign > 0 else (neg(linear), neg(angular))
        return found

    # -- rows --------------------------------------------------------------------------------------

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
        entries = [self._row(f, m, moved) for f, m in world]
        units = [length if slides else 1.0 for slides in kind.translational]
        return Rows([self.graph.lift(x) for x in values], entries, units)

    def _row(
        self,
        force: Sequence[Number],
        moment: Sequence[Number],
        moved: dict[int, tuple[Vector, Vector]],
    ) -> Entries:
        g = self.graph
        f, m = [g.lift(x) for x in force], [g.lift(x) for x in moment]
        entries = {}
        for v, (linear, angular) in moved.items():
            entry = dot(f, linear) + dot(m, angular)
            if entry.value != 0.0:
                entries[v] = entry
        return entries

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
            [self._row(f, m, moved) for _, f, m in found],
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
            found.append(self._row(axis, zero, moved) if k < 3 else self._row(zero, axis, moved))
        return found

    # -- moving ------------------------------------------------------------------------------------

    def moved(self, q: Sequence[Expr], step: dict[int, Expr]) -> list[Expr]:
        """q after a dimensionless step; coordinates that the step leaves out stay.

        A floating joint turns by the Cayley map of its rotation, and its quaternion is normalised.
        """
        found = list(q)
        model, scales = self.mechanism.model, self.mechanism.column_scale
        for i in range(1, model.njoints):
            iq, iv = model.idx_qs[i], model.idx_vs[i]
            if model.nvs[i] == 1:
                if iv in step:
                    found[iq] = q[iq] + scales[iv] * step[iv]
                continue
            if not any(iv + k in step for k in range(6)):
                continue
            change = [step.get(iv + k, self.graph.constant(0.0)) for k in range(6)]
            for k in range(3):
                found[iq + k] = q[iq + k] + self.mechanism.length * change[k]
            found[iq + 3 : iq + 7] = _turned(q[iq + 3 : iq + 7], change[3:])
        return found

    def own(self, entries: Entries) -> Entries:
        """A row of a Jacobian in Pinocchio's v: floating joints along the body's own axes."""
        found = dict(entries)
        model = self.mechanism.model
        zero = self.graph.constant(0.0)
        for i in range(1, model.njoints):
            if model.nvs[i] != 6:
                continue
            turned = rotation(self.q[model.idx_qs[i] + 3 : model.idx_qs[i] + 7])
            for first in (model.idx_vs[i], model.idx_vs[i] + 3):
                old = [entries.get(first + k, zero) for k in range(3)]
                for k, entry in enumerate(matvec(transposed(turned), old)):
                    found.pop(first + k, None)
                    if entry.value != 0.0:
                        found[first + k] = entry
        return found


def kinematics(
    mechanism: Mechanism, graph: Graph | None = None, first: int = 0, *, upright: bool = True
) -> Kinematics:
    """Expressions of a mechanism; its q are the inputs ``first`` and on of the graph."""
    g = graph or Graph()
    return Kinematics(mechanism, g, g.inputs(first, mechanism.model.nq), upright)


def _turned(quaternion: Sequence[Expr], by: Sequence[Expr]) -> list[Expr]:
    """Quaternion turned by a small rotation vector, along the axes outside."""
    turned = turned_quaternion(quaternion, by)
    size = (turned[0] * turned[0] + turned[1] * turned[1]) + (
        turned[2] * turned[2] + turned[3] * turned[3]
    )
    inverse = size.sqrt().recip()
    return [t * inverse for t in turned]


def _from_z(axis: Sequence[float]) -> np.ndarray:
    """Rotation that takes z onto an axis, with as many zeros as can be."""
    a = np.array(axis, dtype=float)
    a /= np.linalg.norm(a)
    k = int(np.abs(a).argmax())
    if np.abs(np.delete(a, k)).max() < ZERO:
        other = np.roll(np.eye(3)[k], 1)
        return np.stack([other, np.cross(a, other), a], axis=1)
    first = np.cross(a, np.eye(3)[int(np.abs(a).argmin())])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(a, first), a], axis=1)
