"""How axes lie to each other, where printed numbers cannot be told from it.

Mechanisms that move against the count are seldom alone: those with parallel axes lie beside others
whose axes meet far away, and where such families touch, rows hardly change with the numbers that
lead from one into the other. Numbers that are to fit then creep along between them, better and
better, and never well. What a draughtsman means is where the families touch, and there axes are
parallel, at right angles, meet, or are one, and common normals of a hinge's two neighbours meet it
in one point. So what the digits leave open of that is asked for beside the rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from closedchain.closure.rounding.body_axes import BodyAxis, Line, body_axes, lines
from closedchain.urdf.description import Description
from closedchain.urdf.digits import Number

_IMAGINARY = 1e-20  # step of a derivative by complex numbers
_CROSSING = 0.1  # sine from which on two axes cross clearly enough to say where
_ROUNDING = 1e-12  # of relations between numbers that are printed in full

Group = tuple[int, ...]  # axes


def _parallel(axes: np.ndarray) -> np.ndarray:
    return np.cross(axes[:, 0, 1], axes[:, 1, 1])


def _at_right_angles(axes: np.ndarray) -> np.ndarray:
    return _dot(axes[:, 0, 1], axes[:, 1, 1])


def _meet(axes: np.ndarray) -> np.ndarray:
    normal = _parallel(axes)
    return np.asarray(_dot(axes[:, 1, 0] - axes[:, 0, 0], normal) / np.sqrt(_dot(normal, normal)))


def _are_one(axes: np.ndarray) -> np.ndarray:
    return np.cross(axes[:, 1, 0] - axes[:, 0, 0], axes[:, 0, 1])


def _meet_in_a_plane(axes: np.ndarray) -> np.ndarray:
    return _foot(axes[:, :2]) - _foot(axes[:, 2:])


def _foot(axes: np.ndarray) -> np.ndarray:
    """Where the common normal of two axes meets the first, from its point."""
    normal = _parallel(axes)
    lever = np.cross(axes[:, 1, 0] - axes[:, 0, 0], axes[:, 1, 1])
    return np.asarray(_dot(lever, normal) / _dot(normal, normal))


def _dot(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    return np.asarray(np.sum(one * two, axis=1, keepdims=True))


@dataclass(frozen=True)
class Relation:
    """A way in which axes may lie to each other.

    Attributes
    ----------
    rows : callable
        Rows (n, k), 0 where it holds, of n groups of axes (n, axes, 2, 3): of each axis a point and
        the direction.
    of_lines : bool
        Whether it is one of lines, and a length; else it is one of directions.
    """

    rows: Callable[[np.ndarray], np.ndarray]
    of_lines: bool


PARALLEL = Relation(_parallel, of_lines=False)
AT_RIGHT_ANGLES = Relation(_at_right_angles, of_lines=False)
MEETING = Relation(_meet, of_lines=True)
ONE = Relation(_are_one, of_lines=True)
WITHOUT_OFFSET = Relation(_meet_in_a_plane, of_lines=True)
"""Of a hinge and another axis on one of its bodies, then on the other: both common normals meet the
hinge in one point."""


@dataclass(frozen=True, eq=False)
class Relations:
    """Relations that are asked for of the axes of a mechanism.

    Attributes
    ----------
    numbers : tuple of Number
        The n numbers that derivatives are by.
    length : float
        Unit of lengths [m].
    axes : tuple of BodyAxis
    groups : mapping of relation to groups of indices of axes
    """

    numbers: tuple[Number, ...]
    length: float
    axes: tuple[BodyAxis, ...]
    groups: Mapping[Relation, Sequence[Group]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many there are."""
        return sum(len(groups) for groups in self.groups.values())

    def none(self) -> Relations:
        """The same, with nothing asked for."""
        return replace(self, groups={})

    def at(self, description: Description) -> tuple[np.ndarray, np.ndarray]:
        """Dimensionless rows (k,), 0 where the relations hold, and their derivative (k, n)."""
        count = len(self.numbers)
        found = lines(description, self.axes, self.numbers)
        parts = [self.rows(relation, some, found) for relation, some in self.groups.items() if some]
        rows = [np.zeros(0), *(value.ravel() for value, _ in parts)]
        slopes = [np.zeros((0, count)), *(slope.reshape(-1, count) for _, slope in parts)]
        return np.concatenate(rows), np.concatenate(slopes)

    def rows(
        self, relation: Relation, groups: Sequence[Group], found: Sequence[Line]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Dimensionless rows (groups, k) of one relation, and their derivative (groups, k, n).

        ``found`` are the axes as lines; there is one group at least.
        """
        ends = np.array([[found[i].line.reshape(2, 3) for i in group] for group in groups])
        unit = self.length if relation.of_lines else 1.0
        values = relation.rows(ends) / unit
        slopes = np.zeros((*values.shape, len(self.numbers)))
        for axis, point, k in product(range(ends.shape[1]), range(2), range(3)):
            moved = ends.astype(complex)
            moved[:, axis, point, k] += 1j * _IMAGINARY
            partial = relation.rows(moved).imag / (_IMAGINARY * unit)
            for row, group in enumerate(groups):
                line = found[group[axis]]
                slopes[row][:, line.columns] += np.outer(partial[row], line.slopes[3 * point + k])
        return values, slopes

    def held(
        self, relation: Relation, groups: Sequence[Group], found: Sequence[Line], slack: np.ndarray
    ) -> list[Group]:
        """Groups that the relation holds for, but for what the numbers may be off (n,)."""
        if relation.of_lines:
            groups = [group for group in groups if all(self.axes[i].placed for i in group)]
        if not groups:
            return []
        values, slopes = self.rows(relation, groups, found)
        near = np.abs(values) <= np.abs(slopes) @ slack + _ROUNDING
        return [group for group, holds in zip(groups, near.all(axis=1), strict=True) if holds]


def relations(
    description: Description,
    numbers: Sequence[Number],
    slack: np.ndarray,
    owners: frozenset[str],
    length: float,
) -> Relations:
    """Relations of axes that hold but for what the numbers of a description may be off.

    Parameters
    ----------
    slack : (n,) array
        How far each number may be from what is meant.
    owners : frozenset of str
        Joints and closures whose axes are looked at.
    length : float
        Unit of lengths [m].
    """
    axes = tuple(axis for axis in body_axes(description) if axis.owner in owners)
    pairs = [
        (i, j)
        for i in range(len(axes))
        for j in range(i)
        if axes[i].body == axes[j].body and axes[i].owner != axes[j].owner
    ]
    bare = Relations(tuple(numbers), length, axes)
    found = lines(description, axes, numbers)
    parallel = bare.held(PARALLEL, pairs, found, slack)
    crossing = [
        (i, j)
        for i, j in pairs
        if np.linalg.norm(np.cross(found[i].line[3:], found[j].line[3:])) > _CROSSING
    ]
    groups = {
        PARALLEL: parallel,
        ONE: bare.held(ONE, parallel, found, slack),
        AT_RIGHT_ANGLES: bare.held(AT_RIGHT_ANGLES, crossing, found, slack),
        MEETING: bare.held(MEETING, crossing, found, slack),
        WITHOUT_OFFSET: bare.held(WITHOUT_OFFSET, _over_hinges(axes, crossing), found, slack),
    }
    return replace(bare, groups=groups)


def _over_hinges(axes: Sequence[BodyAxis], crossing: Sequence[Group]) -> list[Group]:
    """Each joint's axis with one that crosses it on one of its bodies, then on the other."""
    sides: dict[str, list[int]] = {}
    for i, axis in enumerate(axes):
        sides.setdefault(axis.owner, []).append(i)
    across: dict[int, list[int]] = {}
    for i, j in crossing:
        across.setdefault(i, []).append(j)
        across.setdefault(j, []).append(i)
    return [
        (one, first, two, second)
        for one, two in (pair for pair in sides.values() if len(pair) == 2)
        for first in across.get(one, [])
        for second in across.get(two, [])
    ]
