"""What tells one posture from another: where the joints stand, not which numbers say so.

A leg's hinges turned by half a turn with its slide reversed, or the other spelling of a universal
joint, put all points and axes in the same place: that is one shape. So a posture is told by the
points on its joints and by their axes without a sense, as polynomials in the cosines and sines of
q. These are the same on complex numbers, where conjugates must not be taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.closures import Closure, Coupling
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.complex_tape import ComplexTape, complex_tape
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.machine import Compiled, compiled
from closedchain.closure.tape.rows import Kinematics, kinematics
from closedchain.closure.tape.vectors import Pose, column

WHOLE = 1e-12
"""Of a ratio: nearer to a whole number than this it is one."""

SAME = 1e-6
"""Dimensionless: shapes that differ by less are one."""


@dataclass(frozen=True, eq=False)
class Shapes:
    """Numbers that tell the postures of a mechanism apart, dimensionless.

    ``used`` are those that count; idle motions, as the spin of a rod between two balls, change the
    others.
    """

    mechanism: Mechanism
    used: tuple[int, ...] | None = None

    @cached_property
    def _expressions(self) -> tuple[Graph, list[Expr]]:
        k = kinematics(self.mechanism)
        numbers = numbers_of_shapes(k)
        numbers += [k.q[i] * (1.0 / unit) for i, unit in turns_that_count(self.mechanism)]
        moving = [x for x in dict.fromkeys(numbers) if x.value is None]
        if self.used is not None:
            moving = [moving[i] for i in self.used]
        return k.graph, moving

    @cached_property
    def count(self) -> int:
        """How many numbers there are."""
        return len(self._expressions[1])

    @cached_property
    def _real(self) -> Compiled:
        graph, numbers = self._expressions
        return compiled(graph.tape(numbers, self.mechanism.model.nq), single=False)

    @cached_property
    def _complex(self) -> ComplexTape:
        graph, numbers = self._expressions
        return complex_tape(graph.tape(numbers, self.mechanism.model.nq))

    def of(self, q: np.ndarray) -> np.ndarray:
        """Numbers (n, count) of postures (n, nq), real or complex."""
        columns = np.ascontiguousarray(q.T)
        if not self.count:
            return np.zeros((len(q), 0), dtype=q.dtype)
        run = self._complex.run if np.iscomplexobj(q) else self._real.run
        return np.asarray(run(columns).T)

    def without(self, q: np.ndarray, motions: np.ndarray) -> Shapes:
        """Shapes that leave out what motions (nv, k) at a posture (nq,) change."""
        import pinocchio as pin

        if not motions.shape[1]:
            return self
        model, step = self.mechanism.model, 1e-6
        moved = [q] + [
            pin.integrate(model, q, step * sign * v) for v in motions.T for sign in (1.0, -1.0)
        ]
        found = self.of(np.array(moved))
        rates = np.abs(found[1::2] - found[2::2]).max(axis=0) / (2.0 * step)
        kept = np.flatnonzero(rates < 1e-4)
        if self.used is not None:
            kept = np.array(self.used)[kept]
        return Shapes(self.mechanism, tuple(int(i) for i in kept))


def numbers_of_shapes(k: Kinematics) -> list[Expr]:
    """Points on joints and axes without sense, bodies that float, and the tip."""
    model, m = k.mechanism.model, k.mechanism
    numbers: list[Expr] = []
    for i in range(1, model.njoints):
        if model.nvs[i] == 1:
            numbers += _line(k, k.poses[i])
        else:
            numbers += _body(k.poses[i])
    for closure in m.closures:
        if isinstance(closure, Closure):
            pose = k.frame(closure.joint1, closure.placement1)
            numbers += list(pose[1]) if closure.joint_kind.holds_point else _line(k, pose)
    if m.task is not None:
        numbers += _body(k.named(m.task.tip)[0])
    return numbers


def shapes_of(mechanism: Mechanism) -> Shapes:
    """Shapes of a mechanism, made once."""
    found: Shapes = mechanism.known.setdefault("modes.shapes", Shapes(mechanism))
    return found


def turns_that_count(mechanism: Mechanism) -> list[tuple[int, float]]:
    """Joints whose whole turns are other postures: index in q, and unit.

    Relations tie them to slides, or by ratios that are no whole numbers.
    """
    found = {
        part.q: float(mechanism.column_scale[part.v])
        for closure in mechanism.closures
        if isinstance(closure, Coupling) and not _whole(mechanism, closure)
        for part in closure.joints
    }
    return sorted(found.items())


def _whole(mechanism: Mechanism, relation: Coupling) -> bool:
    """Whether whole turns of the leaders are whole turns of the follower, or nothing turns."""
    slides = [bool(mechanism.translational[part.v]) for part in relation.joints]
    if all(slides):
        return True
    if any(slides):
        return False
    first = relation.joints[0].coefficients
    for part in relation.joints:
        if len(part.coefficients) > 2 and any(part.coefficients[2:]):
            return False
        ratio = part.coefficients[1] / first[1]
        if abs(ratio - round(ratio)) > WHOLE:
            return False
    return True


def groups(shapes: np.ndarray, tolerance: float = SAME) -> np.ndarray:
    """Number of the group of each shape (n, count), (n,): groups in the order they first appear."""
    from scipy.spatial import cKDTree

    if not len(shapes):
        return np.zeros(0, dtype=int)
    # large numbers, of complex postures, are known to fewer digits
    points = shapes / (1.0 + np.abs(shapes))
    points = np.hstack([points.real, points.imag]) if np.iscomplexobj(points) else points
    if not points.shape[1]:
        return np.zeros(len(shapes), dtype=int)
    near = cKDTree(points).query_ball_point(points, tolerance * np.sqrt(points.shape[1]))
    group, next_ = np.full(len(points), -1), 0
    for i in range(len(points)):
        if group[i] >= 0:
            continue
        pending = [i]
        while pending:
            j = pending.pop()
            if group[j] < 0:
                group[j] = next_
                pending += [k for k in near[j] if group[k] < 0]
        next_ += 1
    return group


def _line(k: Kinematics, pose: Pose) -> list[Expr]:
    """A point and an axis without sense: the products of its components."""
    x, y, z = column(pose[0], 2)
    g = k.graph
    products = [x * x, x * y, x * z, y * y, y * z, z * z]
    return [g.lift(n) for n in (*pose[1], *products)]


def _body(pose: Pose) -> list[Expr]:
    """A point and the axes of a body that stands one way only."""
    return [*pose[1], *(x for row in pose[0] for x in row)]
