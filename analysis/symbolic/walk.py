"""Screws of the joints in a row, symbolically.

A walk is a list of steps: fixed displacements, turns and slides. Turns about parallel axes that
follow each other add up to one angle, so that planar chains keep few cosines. Screws are those of
the papers, (angular; linear at O), O being the origin of the frame that the walk sets out from.

The screws are written here, not taken from ``closure.tape.rows``: a tape folds a description's
sizes into numbers, where closed forms keep them as named parameters, and it knows every joint by
its own angle, where a walk adds the angles of parallel axes before any cosine is taken.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.symbolic.exact import Exact
from closedchain.analysis.symbolic.parameters import Affine, number
from closedchain.analysis.symbolic.ring import PI, Angle, Matrix, Ring, Vector, upright

_PARALLEL = 1e-11

Laws = tuple[Affine, Affine, Affine]


@dataclass(frozen=True, eq=False)
class Fixed:
    """Displacement between two frames of one body: translation, then rotation.

    The rotation is by roll, pitch, yaw, then by ``matrix``; ``inverse`` is the way back.
    """

    translation: Laws
    rpy: tuple[Angle, Angle, Angle]
    matrix: tuple[tuple[Exact, ...], ...] | None = None
    inverse: bool = False


@dataclass(frozen=True, eq=False)
class Turn:
    """Rotation by ``angle`` about ``axis``; its screw is ``sense`` times the axis."""

    column: str
    axis: Laws
    angle: Angle
    sense: int


@dataclass(frozen=True, eq=False)
class Slide:
    """Translation by ``sense`` times the coordinate ``column`` along ``axis``."""

    column: str
    axis: Laws
    sense: int


Step = Fixed | Turn | Slide


def backwards(steps: Sequence[Step]) -> list[Step]:
    """The same walk from its end; screws keep their sense."""
    out: list[Step] = []
    for step in reversed(steps):
        if isinstance(step, Fixed):
            out.append(Fixed(step.translation, step.rpy, step.matrix, not step.inverse))
        elif isinstance(step, Turn):
            out.append(Turn(step.column, step.axis, step.angle * -1, step.sense))
        else:
            out.append(_Back(step.column, step.axis, step.sense))
    return out


class _Back(Slide):
    """A slide passed backwards: it moves the other way, its screw stays."""


@dataclass(eq=False)
class Walked:
    """Screws by column, the pose of the end, and all angles met."""

    screws: dict[str, Vector]
    points: dict[str, Vector]
    rotation: Matrix
    position: Vector
    angles: tuple[Angle, ...]


def angles_of(steps: Sequence[Step], values: Mapping[str, float]) -> tuple[Angle, ...]:
    """Angles whose cosines a walk needs; ``values`` are those of the parameters."""
    return _Walker(None, values).run(steps).angles


def walk(steps: Sequence[Step], ring: Ring, values: Mapping[str, float]) -> Walked:
    """Screws along the steps, in the frame that they set out from."""
    return _Walker(ring, values).run(steps)


class _Walker:
    """State of a walk: pose (R0, p0), then a turn about ``axis``, then offset d and rotation F.

    Without a ring only the angles are collected. Whether axes are parallel is decided on numbers,
    with all joints at rest.
    """

    def __init__(self, ring: Ring | None, values: Mapping[str, float]) -> None:
        self.ring, self.values = ring, values
        self.met: dict[Angle, None] = {}
        self.f = np.eye(3)
        self.axis_number = np.zeros(3)
        self.angle = Angle()
        if ring is not None:
            zero = [ring.zero] * 3
            self.R0, self.p0, self.d, self.F = ring.identity(), zero, zero, ring.identity()
            self.axis: Vector = zero

    def run(self, steps: Sequence[Step]) -> Walked:
        """Take all steps."""
        screws: dict[str, Vector] = {}
        points: dict[str, Vector] = {}
        for step in steps:
            if isinstance(step, Fixed):
                self._fixed(step)
                continue
            axis_number = self.f @ np.array([self._value(x) for x in step.axis])
            ring = self.ring
            if isinstance(step, Turn):
                self._turn_to(axis_number, step)
            if ring is None:
                continue
            along = ring.apply(self.F, [law(ring, x) for x in step.axis])
            turned = self._turned()
            direction = ring.apply(turned, along)
            direction = [x * step.sense for x in direction]
            if isinstance(step, Turn):
                here = self._add(self.p0, ring.apply(turned, self.d))
                screws[step.column] = [*direction, *ring.cross(here, direction)]
                points[step.column] = here
                self.angle = self.angle + step.angle * self._same
            else:
                screws[step.column] = [ring.zero] * 3 + direction
                sense = -step.sense if isinstance(step, _Back) else step.sense
                by = ring.values[step.column] * sense
                self.d = self._add(self.d, [ring.mul(by, x) for x in along])
        self._meet(self.angle)
        ring = self.ring
        if ring is None:
            return Walked({}, {}, [], [], tuple(self.met))
        turned = self._turned()
        position = self._add(self.p0, ring.apply(turned, self.d))
        return Walked(screws, points, ring.product(turned, self.F), position, tuple(self.met))

    def _turn_to(self, axis_number: np.ndarray, step: Turn) -> None:
        """Make the pending turn one about the step's axis; settle the last where it is another."""
        along = float(axis_number @ self.axis_number)
        if abs(abs(along) - 1.0) < _PARALLEL:
            self._same = 1 if along > 0 else -1
            ring = self.ring
            if ring is not None:
                self.p0 = self._add(self.p0, ring.apply(self._turned(), self.d))
                self.d = [ring.zero] * 3
        else:
            ring = self.ring
            if ring is not None:
                turned = self._turned()
                self.p0 = self._add(self.p0, ring.apply(turned, self.d))
                self.R0, self.d = turned, [ring.zero] * 3
                self.axis = ring.apply(self.F, [law(ring, x) for x in step.axis])
            self.axis_number, self._same = axis_number, 1
            self._meet(self.angle)
            self.angle = Angle()
        if self.ring is None:
            self._meet(self.angle)
            self.angle = self.angle + step.angle * self._same
            self._meet(self.angle)

    def _fixed(self, step: Fixed) -> None:
        angles = step.rpy
        for angle in angles:
            self._meet(angle)
        number_rotation = np.eye(3)
        for k, angle in ((2, angles[2]), (1, angles[1]), (0, angles[0])):
            number_rotation = number_rotation @ _rotation(k, self._angle_value(angle))
        if step.matrix is not None:
            number_rotation = number_rotation @ [[number(x) for x in row] for row in step.matrix]
        self.f = self.f @ (number_rotation.T if step.inverse else number_rotation)
        ring = self.ring
        if ring is None:
            return
        rotation = ring.identity()
        for k, angle in ((2, angles[2]), (1, angles[1]), (0, angles[0])):
            axis = [ring.one if i == k else ring.zero for i in range(3)]
            if angle.terms:
                rotation = ring.product(rotation, ring.rotation(axis, angle))
        if step.matrix is not None:
            turned = [[ring.number(x) for x in row] for row in step.matrix]
            rotation = ring.product(rotation, turned)
        translation = [law(ring, x) for x in step.translation]
        if step.inverse:
            self.F = ring.product(self.F, [list(column) for column in zip(*rotation, strict=True)])
            self.d = self._add(self.d, [-x for x in ring.apply(self.F, translation)])
        else:
            self.d = self._add(self.d, ring.apply(self.F, translation))
            self.F = ring.product(self.F, rotation)

    def _turned(self) -> Matrix:
        assert self.ring is not None
        if not self.angle.terms:
            return self.R0
        return self.ring.product(self.R0, self.ring.rotation(self.axis, self.angle))

    def _meet(self, angle: Angle) -> None:
        rest = angle.variable
        if rest.terms:
            self.met[upright(rest)[0]] = None

    def _value(self, x: Affine) -> float:
        return number(x.constant) + sum(number(s) * self.values[k] for k, s in x.slopes.items())

    def _angle_value(self, angle: Angle) -> float:
        """Value of an angle of origins: parameters, pi and numbers."""
        known = {PI: np.pi, "1": 1.0, **self.values}
        return float(sum(float(v) * known[k] for k, v in angle.terms))

    @staticmethod
    def _add(a: Vector, b: Vector) -> Vector:
        return [x + y for x, y in zip(a, b, strict=True)]


def law(ring: Ring, x: Affine) -> object:
    """Element of an affine law."""
    out = ring.number(x.constant)
    for name, slope in x.slopes.items():
        out += ring.mul(ring.number(slope), ring.values[name])
    return out


def _rotation(axis: int, angle: float) -> np.ndarray:
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.eye(3)
    out[[i, j], [i, j]] = np.cos(angle)
    out[i, j], out[j, i] = -np.sin(angle), np.sin(angle)
    return out
