"""How the axes on one body lie to each other, as far as printed numbers tell: parallel, meeting ...

Mechanisms that move against the count are seldom alone: those with parallel axes lie beside others
whose axes meet far away, and where several such families touch, rows hardly change with the numbers
that lead from one into the other. The numbers then fit by halves, and better and better but never.
What a draughtsman means is where the families touch, and there axes are parallel, at right angles,
meet, or are one. So what printed numbers cannot tell from that is asked for beside the rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from closedchain.closure.joint_kinds import JOINT_KINDS, TREE_KINDS, JointKind, Screw, Slide, X, Y, Z
from closedchain.closure.rounding.number_twists import across, of_origin
from closedchain.closure.tree import se3
from closedchain.urdf.constraint_element import SPELLINGS
from closedchain.urdf.description import Description, Origin, Vector3
from closedchain.urdf.digits import Number, Part

_IMAGINARY = 1e-20  # step of a derivative by complex numbers
_ROUNDING = 1e-12  # of relations between numbers that are printed in full

Place = tuple[str, Part]  # owner of an origin, and which of its origins
Function = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def _parallel(o1: np.ndarray, u1: np.ndarray, o2: np.ndarray, u2: np.ndarray) -> np.ndarray:
    return np.cross(u1, u2)


def _square(o1: np.ndarray, u1: np.ndarray, o2: np.ndarray, u2: np.ndarray) -> np.ndarray:
    return np.sum(u1 * u2, axis=1, keepdims=True)


def _meeting(o1: np.ndarray, u1: np.ndarray, o2: np.ndarray, u2: np.ndarray) -> np.ndarray:
    normal = np.cross(u1, u2)
    size = np.sqrt(np.sum(normal * normal, axis=1, keepdims=True))
    return np.asarray(np.sum((o2 - o1) * normal, axis=1, keepdims=True) / size)


def _one(o1: np.ndarray, u1: np.ndarray, o2: np.ndarray, u2: np.ndarray) -> np.ndarray:
    return np.cross(o2 - o1, u1)


@dataclass(frozen=True)
class _Axis:
    """An axis on a body: the origins that lead to it (``back``: inverted), and where it is written.

    ``placed`` says that it is a line, not a direction.
    """

    body: str
    owner: str
    way: tuple[tuple[Place, bool], ...]
    part: Part
    placed: bool


@dataclass(frozen=True)
class _Found:
    """A point and the direction of an axis in its body, (6,), and their derivative by numbers."""

    line: np.ndarray
    columns: np.ndarray
    slopes: np.ndarray


@dataclass(frozen=True, eq=False)
class Relations:
    """Relations of axes that some printed numbers cannot be told from.

    Attributes
    ----------
    length : float
        Unit of lengths [m].
    pairs : mapping of function to pairs of axes
    """

    numbers: tuple[Number, ...]
    length: float
    axes: tuple[_Axis, ...]
    pairs: Mapping[Function, tuple[tuple[int, int], ...]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many there are."""
        return sum(len(pairs) for pairs in self.pairs.values())

    def none(self) -> Relations:
        """The same numbers with no relations."""
        return Relations(self.numbers, self.length, self.axes)

    def at(self, description: Description) -> tuple[np.ndarray, np.ndarray]:
        """Dimensionless rows (k,), 0 where the relations hold, and their derivative (k, n)."""
        found = _lines(description, self.axes, self.numbers)
        rows, slopes = [np.zeros(0)], [np.zeros((0, len(self.numbers)))]
        for function, pairs in self.pairs.items():
            if pairs:
                value, slope = self._of(function, pairs, found)
                rows.append(value.ravel())
                slopes.append(slope.reshape(-1, len(self.numbers)))
        return np.concatenate(rows), np.concatenate(slopes)

    def _of(
        self, function: Function, pairs: Sequence[tuple[int, int]], found: Sequence[_Found]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Values (pairs, rows) and slopes (pairs, rows, n) of one kind of relation."""
        ends = np.array([[found[i].line, found[j].line] for i, j in pairs]).reshape(-1, 4, 3)
        unit = self.length if function in _LENGTHS else 1.0
        value = function(*ends.transpose(1, 0, 2)) / unit
        slope = np.zeros((*value.shape, len(self.numbers)))
        for k in range(12):
            moved = ends.astype(complex)
            moved[:, k // 3, k % 3] += 1j * _IMAGINARY
            partial = function(*moved.transpose(1, 0, 2)).imag / (_IMAGINARY * unit)
            for row, pair in enumerate(pairs):
                one = found[pair[k // 6]]
                slope[row][:, one.columns] += np.outer(partial[row], one.slopes[k % 6])
        return value, slope


_LENGTHS = frozenset({_meeting, _one})


def relations(
    description: Description,
    numbers: Sequence[Number],
    slack: np.ndarray,
    owners: frozenset[str],
    length: float,
) -> Relations:
    """Relations of the axes of ``owners`` that hold but for what the numbers may be off, ``slack``.

    Parameters
    ----------
    slack : (n,) array
        How far each number may be from what is meant.
    owners : frozenset of str
        Joints and closures.
    """
    axes = tuple(axis for axis in _axes(description) if axis.owner in owners)
    empty = Relations(tuple(numbers), length, axes)
    found = _lines(description, axes, numbers)
    every = [
        (i, j)
        for i in range(len(axes))
        for j in range(i)
        if axes[i].body == axes[j].body and axes[i].owner != axes[j].owner
    ]

    def held(function: Function, pairs: list[tuple[int, int]]) -> list[tuple[int, int]]:
        if not pairs:
            return []
        value, slope = empty._of(function, pairs, found)
        most = np.abs(slope) @ slack + _ROUNDING
        return [pair for pair, near in zip(pairs, (np.abs(value) <= most).all(axis=1)) if near]

    parallel = held(_parallel, every)
    crossing = sorted(set(every) - set(parallel))
    placed = [pair for pair in crossing if axes[pair[0]].placed and axes[pair[1]].placed]
    return Relations(
        tuple(numbers),
        length,
        axes,
        {
            _parallel: tuple(parallel),
            _square: tuple(held(_square, crossing)),
            _meeting: tuple(held(_meeting, placed)),
            _one: tuple(
                held(_one, [p for p in parallel if axes[p[0]].placed and axes[p[1]].placed])
            ),
        },
    )


def _axes(description: Description) -> Iterator[_Axis]:
    """Axes of joints on both of their bodies, and those of closures."""
    places = _places(description)
    for joint in description.joints:
        if joint.type in {"fixed", "floating"}:
            continue
        placed = _is_line(TREE_KINDS[joint.type])
        body, way = places[joint.parent]
        own: tuple[Place, bool] = ((joint.name, "origin"), False)
        yield _Axis(body, joint.name, (*way, own), "axis", placed)
        body, way = places[joint.child]
        yield _Axis(body, joint.name, way, "axis", placed)
    for spec in description.closures:
        spelling, placed = SPELLINGS[spec.type], _is_line(JOINT_KINDS[spec.type])
        if spelling.parent_axis:
            body, way = places[spec.parent]
            own = ((spec.name, "parent_origin"), False)
            yield _Axis(body, spec.name, (*way, own), "parent_axis", placed)
        if spelling.child_axis != "none":
            body, way = places[spec.child]
            own = ((spec.name, "child_origin"), False)
            yield _Axis(body, spec.name, (*way, own), "child_axis", placed)


def _is_line(kind: JointKind) -> bool:
    return {Slide(X), Slide(Y)} <= set(kind.equations) and Screw("R", Z) in kind.screws


def _places(description: Description) -> dict[str, tuple[str, tuple[tuple[Place, bool], ...]]]:
    """Body that each link belongs to, and the way from its first link to that link."""
    ways: dict[str, list[tuple[str, tuple[tuple[Place, bool], ...]]]] = {}

    def join(one: str, two: str, way: tuple[tuple[Place, bool], ...]) -> None:
        back = tuple((place, not inverted) for place, inverted in reversed(way))
        ways.setdefault(one, []).append((two, way))
        ways.setdefault(two, []).append((one, back))

    for joint in description.joints:
        if joint.type == "fixed":
            join(joint.parent, joint.child, (((joint.name, "origin"), False),))
    for spec in description.closures:
        if spec.type == "fixed":
            way = (((spec.name, "parent_origin"), False), ((spec.name, "child_origin"), True))
            join(spec.parent, spec.child, way)
    found: dict[str, tuple[str, tuple[tuple[Place, bool], ...]]] = {}
    for link in (link.name for link in description.links):
        pending: list[tuple[str, tuple[tuple[Place, bool], ...]]] = [(link, ())]
        while pending:
            here, way = pending.pop()
            if here not in found:
                found[here] = (link, way)
                pending += [(there, (*way, *more)) for there, more in ways.get(here, [])]
    return found


def _lines(
    description: Description, axes: Sequence[_Axis], numbers: Sequence[Number]
) -> list[_Found]:
    columns: dict[tuple[str, str], list[int]] = {}
    for i, number in enumerate(numbers):
        columns.setdefault((number.owner, number.part), []).append(i)
    origins, directions = _written(description)
    return [_line(axis, origins, directions, numbers, columns) for axis in axes]


def _line(
    axis: _Axis,
    origins: Mapping[Place, Origin],
    directions: Mapping[Place, Vector3],
    numbers: Sequence[Number],
    columns: Mapping[tuple[str, str], Sequence[int]],
) -> _Found:
    pose, own, twists = pin.SE3.Identity(), [], [np.zeros((6, 0))]
    for place, inverted in axis.way:
        origin, mine = origins[place], columns.get(place, ())
        turned = of_origin(origin, [numbers[i].index for i in mine])
        before = pose
        pose = before * (se3(origin).inverse() if inverted else se3(origin))
        twists.append(-before.action @ turned if inverted else pose.action @ turned)
        own += mine
    point, written = pose.translation, np.array(directions[axis.owner, axis.part])
    along = pose.rotation @ written
    spatial = np.hstack(twists)
    slopes = [
        np.vstack(
            [
                spatial[:3] + np.cross(spatial[3:].T, point).T,
                np.cross(spatial[3:].T, along).T,
            ]
        )
    ]
    for i in columns.get((axis.owner, axis.part), ()):
        turn = pose.rotation @ across(written, numbers[i].index)
        slopes.append(np.array([[0.0, 0.0, 0.0, *turn]]).T)
        own.append(i)
    return _Found(np.concatenate([point, along]), np.array(own, dtype=int), np.hstack(slopes))


def _written(
    description: Description,
) -> tuple[dict[Place, Origin], dict[Place, Vector3]]:
    origins: dict[Place, Origin] = {}
    directions: dict[Place, Vector3] = {}
    for joint in description.joints:
        origins[joint.name, "origin"] = joint.origin
        directions[joint.name, "axis"] = joint.axis
    for spec in description.closures:
        origins[spec.name, "parent_origin"] = spec.parent_origin
        origins[spec.name, "child_origin"] = spec.child_origin
        directions[spec.name, "parent_axis"] = spec.parent_axis
        directions[spec.name, "child_axis"] = spec.child_axis
    return origins, directions
