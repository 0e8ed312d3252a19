"""The bodies of a mechanism as expressions: where they stand and how they move.

Everything is an expression in the numbers of q, in dimensionless lengths (divided by
``mechanism.length``). Motions are coordinates of the tangent: rates of hinges [rad] and slides
[lengths], and for a floating joint the velocity of its origin and its angular velocity, both along
the axes of the frame that it floats in. Pinocchio's v has the body's own axes there: ``own`` turns
a row of a Jacobian into those. That changes no determinant and no singular value, and most entries
of the Jacobian vanish with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin

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
class Bodies:
    """Bodies of a mechanism as expressions in the numbers ``q`` of a graph.

    Attributes
    ----------
    graph : Graph
    q : list of nq expressions
        Lengths in m, angles in rad, quaternions x y z w.
    """

    mechanism: Mechanism
    graph: Graph
    q: list[Expr]
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

    def row(
        self,
        force: Sequence[Number],
        moment: Sequence[Number],
        moved: dict[int, tuple[Vector, Vector]],
    ) -> Entries:
        """Row that a wrench makes of motions ``moved``, as ``relative`` gives them."""
        g = self.graph
        f, m = [g.lift(x) for x in force], [g.lift(x) for x in moment]
        entries = {}
        for v, (linear, angular) in moved.items():
            entry = dot(f, linear) + dot(m, angular)
            if entry.value != 0.0:
                entries[v] = entry
        return entries

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
        """A motion, or a row of a Jacobian, in Pinocchio's v: floating joints along own axes."""
        return self._turned(entries, outside=False)

    def outside(self, entries: Entries) -> Entries:
        """The other way round: a motion in Pinocchio's v as one along the axes outside."""
        return self._turned(entries, outside=True)

    def _turned(self, entries: Entries, *, outside: bool) -> Entries:
        found, model, zero = dict(entries), self.mechanism.model, self.graph.constant(0.0)
        for i in range(1, model.njoints):
            if model.nvs[i] != 6:
                continue
            turn = rotation(self.q[model.idx_qs[i] + 3 : model.idx_qs[i] + 7])
            for first in (model.idx_vs[i], model.idx_vs[i] + 3):
                old = [entries.get(first + k, zero) for k in range(3)]
                new = matvec(turn if outside else transposed(turn), old)
                found |= {first + k: self.graph.lift(x) for k, x in enumerate(new)}
        return {v: x for v, x in found.items() if x.value != 0.0}


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
