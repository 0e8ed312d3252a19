"""How axes on one body lie to each other, where printed numbers cannot be told from it.

Mechanisms that move against the count are seldom alone: those with parallel axes lie beside others
whose axes meet far away, and where such families touch, rows hardly change with the numbers that
lead from one into the other. Numbers that are to fit then creep along between them, better and
better, and never well. What a draughtsman means is where the families touch, and there axes are
parallel, at right angles, meet, or are one. So what the digits leave open of that is asked for
beside the rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from closedchain.closure.rounding.body_axes import BodyAxis, Line, body_axes, lines
from closedchain.urdf.description import Description
from closedchain.urdf.digits import Number

_IMAGINARY = 1e-20  # step of a derivative by complex numbers
_CROSSING = 0.1  # sine from which on two axes cross clearly enough to say whether they meet
_ROUNDING = 1e-12  # of relations between numbers that are printed in full

Pair = tuple[int, int]


def _parallel(o1: np.ndarray, u1: np.ndarray, o2: np.ndarray, u2: np.ndarray) -> np.ndarray:
    return np.cross(u1, u2)


def _at_right_angles(o1: np.ndarray, u1: np.ndarray, o2: np.ndarray, u2: np.ndarray) -> np.ndarray:
    return np.asarray(np.sum(u1 * u2, axis=1, keepdims=True))


def _meet(o1: np.ndarray, u1: np.ndarray, o2: np.ndarray, u2: np.ndarray) -> np.ndarray:
    normal = np.cross(u1, u2)
    size = np.sqrt(np.sum(normal * normal, axis=1, keepdims=True))
    return np.asarray(np.sum((o2 - o1) * normal, axis=1, keepdims=True) / size)


def _are_one(o1: np.ndarray, u1: np.ndarray, o2: np.ndarray, u2: np.ndarray) -> np.ndarray:
    return np.cross(o2 - o1, u1)


@dataclass(frozen=True)
class Relation:
    """A way in which two axes may lie to each other.

    Attributes
    ----------
    rows : callable
        Rows (n, k), 0 where it holds, of n pairs: points and unit vectors (n, 3) of one axis, then
        of the other.
    of_lines : bool
        Whether it is one of lines, and a length; else it is one of directions.
    """

    rows: Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    of_lines: bool


PARALLEL = Relation(_parallel, of_lines=False)
AT_RIGHT_ANGLES = Relation(_at_right_angles, of_lines=False)
MEETING = Relation(_meet, of_lines=True)
ONE = Relation(_are_one, of_lines=True)


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
    pairs : mapping of relation to pairs of indices of axes
    """

    numbers: tuple[Number, ...]
    length: float
    axes: tuple[BodyAxis, ...]
    pairs: Mapping[Relation, Sequence[Pair]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many there are."""
        return sum(len(pairs) for pairs in self.pairs.values())

    def none(self) -> Relations:
        """The same, with nothing asked for."""
        return replace(self, pairs={})

    def at(self, description: Description) -> tuple[np.ndarray, np.ndarray]:
        """Dimensionless rows (k,), 0 where the relations hold, and their derivative (k, n)."""
        count = len(self.numbers)
        found = lines(description, self.axes, self.numbers)
        parts = [self.rows(relation, pairs, found) for relation, pairs in self.pairs.items()]
        rows = [np.zeros(0), *(value.ravel() for value, _ in parts)]
        slopes = [np.zeros((0, count)), *(slope.reshape(-1, count) for _, slope in parts)]
        return np.concatenate(rows), np.concatenate(slopes)

    def rows(
        self, relation: Relation, pairs: Sequence[Pair], found: Sequence[Line]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Dimensionless rows (pairs, k) of one relation, and their derivative (pairs, k, n).

        ``found`` are the axes as lines.
        """
        ends = np.array([[found[i].line, found[j].line] for i, j in pairs]).reshape(-1, 4, 3)
        unit = self.length if relation.of_lines else 1.0
        values = relation.rows(*ends.transpose(1, 0, 2)) / unit
        slopes = np.zeros((*values.shape, len(self.numbers)))
        for k in range(12):  # of both axes, the point and the direction
            moved = ends.astype(complex)
            moved[:, k // 3, k % 3] += 1j * _IMAGINARY
            partial = relation.rows(*moved.transpose(1, 0, 2)).imag / (_IMAGINARY * unit)
            for row, pair in enumerate(pairs):
                axis = found[pair[k // 6]]
                slopes[row][:, axis.columns] += np.outer(partial[row], axis.slopes[k % 6])
        return values, slopes

    def held(
        self, relation: Relation, pairs: Sequence[Pair], found: Sequence[Line], slack: np.ndarray
    ) -> list[Pair]:
        """Pairs that the relation holds for, but for what the numbers may be off (n,)."""
        if relation.of_lines:
            pairs = [pair for pair in pairs if all(self.axes[i].placed for i in pair)]
        if not pairs:
            return []
        values, slopes = self.rows(relation, pairs, found)
        near = np.abs(values) <= np.abs(slopes) @ slack + _ROUNDING
        return [pair for pair, holds in zip(pairs, near.all(axis=1), strict=True) if holds]


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
    every = [
        (i, j)
        for i in range(len(axes))
        for j in range(i)
        if axes[i].body == axes[j].body and axes[i].owner != axes[j].owner
    ]
    bare = Relations(tuple(numbers), length, axes)
    found = lines(description, axes, numbers)
    parallel = bare.held(PARALLEL, every, found, slack)
    crossing = [pair for pair in every if pair not in set(parallel)]
    clearly = [
        (i, j)
        for i, j in crossing
        if np.linalg.norm(np.cross(found[i].line[3:], found[j].line[3:])) > _CROSSING
    ]
    pairs = {
        PARALLEL: parallel,
        ONE: bare.held(ONE, parallel, found, slack),
        AT_RIGHT_ANGLES: bare.held(AT_RIGHT_ANGLES, crossing, found, slack),
        MEETING: bare.held(MEETING, clearly, found, slack),
    }
    return replace(bare, pairs=pairs)
