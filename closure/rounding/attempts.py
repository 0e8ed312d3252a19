"""What is tried with rounded numbers: which may move, from where, and what is to hold beside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from closedchain.closure.rounding.relations import Relations, relations
from closedchain.urdf.description import Description
from closedchain.urdf.digits import UNITS, Number, with_numbers


@dataclass(frozen=True, eq=False)
class Attempt:
    """Numbers that may move.

    Attributes
    ----------
    numbers : tuple of Number
        With the values that they begin with.
    weights : (n,) array
        How easily each moves, such as the unit of its last digit; 0 for those that stay.
    reach : (n,) array
        How far each may move.
    description : Description
        With these values.
    relations : Relations
        Of axes, that are asked for.
    """

    numbers: tuple[Number, ...]
    weights: np.ndarray
    reach: np.ndarray
    description: Description
    relations: Relations


def attempts(
    description: Description,
    numbers: Sequence[Number],
    tolerance: float,
    length: float,
    owners: frozenset[str],
) -> Iterator[Attempt]:
    """What is tried, one after the other.

    Angles printed for a multiple of 15 degrees are that first; then every rounded number moves as
    its last digit lets it; both with the relations that digits do not tell from holding, and where
    no numbers fit with these, without. Then every number moves.

    Parameters
    ----------
    tolerance, length : float
        What roundings may leave open, and the unit of lengths [m].
    owners : frozenset of str
        Joints and closures that the numbers belong to.
    """
    printed = np.array([n.value for n in numbers])
    snapped = np.array([n.meant for n in numbers])
    units = np.array([n.unit for n in numbers])
    every = np.array([tolerance if n.is_length else tolerance / length for n in numbers])

    def attempt(values: np.ndarray, weights: np.ndarray, slack: np.ndarray) -> Attempt:
        now = tuple(
            replace(n, value=float(v), meant=float(v)) for n, v in zip(numbers, values, strict=True)
        )
        described = with_numbers(description, numbers, values)
        held = relations(described, now, slack, owners, length)
        return Attempt(now, weights, every, described, held)

    rounded = []
    if (snapped != printed).any():
        steady = np.where(snapped != printed, 0.0, units)
        rounded.append((snapped, steady, steady))
    if units.any():
        rounded.append((printed, units, units))
    for kinds in (rounded, [(printed, every, every / UNITS)]):
        tried = []
        for kind in kinds:
            tried.append(attempt(*kind))
            yield tried[-1]
        for one in tried:
            if one.relations.count:
                yield replace(one, relations=one.relations.none())
