"""Solutions that others become when what is prescribed goes round loops of complex values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from closedchain.closure.modes.paths import Arrived, Paths
from closedchain.closure.modes.places import Place
from closedchain.closure.modes.shapes import groups

Telling = Callable[[np.ndarray], np.ndarray]
"""Numbers (n, k) that tell postures (n, m) apart."""


def closed_under(
    paths: Paths,
    telling: Telling,
    ways: Sequence[Sequence[Place]],
    q: np.ndarray,
    most: int,
    tell: Callable[[int], None],
) -> np.ndarray:
    """Solutions (n, nq) at a place and all that they become on ways from there and back.

    Each goes each way once, so do those that appear; those given come first and stay. Ends when
    there are more than ``most``. ``tell`` gets their number now and then.
    """
    gone = 0
    while gone < len(q) <= most:
        tell(len(q))
        begin, gone = gone, len(q)
        ends = _gone(paths, ways, q[begin:])
        q = merged(telling, q, ends.q[ends.good])
    return q


def merged(telling: Telling, known: np.ndarray, more: np.ndarray) -> np.ndarray:
    """Postures of two lists (n, nq), each shape once; those of the first stay as they are."""
    every = np.concatenate([known, more])
    group = groups(telling(every))
    return every[np.unique(group, return_index=True)[1]]


def carried(
    paths: Paths, telling: Telling, one: Place, others: Sequence[Place], q: np.ndarray
) -> np.ndarray:
    """Solutions (n, nq) brought to the last of some places.

    What is lost straight on the way is tried once more by way of each of the others.
    """
    *between, two = others
    end = paths.track(one, two, q)
    found, left = merged(telling, q[:0], end.q[end.good]), q[~end.good]
    for middle in between:
        if not len(left):
            break
        end = _gone(paths, [(one, middle, two)], left)
        found, left = merged(telling, found, end.q[end.good]), left[~end.good]
    return found


def _gone(paths: Paths, ways: Sequence[Sequence[Place]], q: np.ndarray) -> Arrived:
    """Ends of all solutions (n, nq) on all ways, (ways n, nq), one way after the other."""
    every = np.tile(q, (len(ways), 1))
    good = np.ones(len(every), dtype=bool)
    for legs in zip(*(pairwise(way) for way in ways), strict=True):
        one, two = (Place.stacked([leg[k] for leg in legs], len(q)) for k in (0, 1))
        left = np.flatnonzero(good)
        end = paths.track(one.take(left), two.take(left), every[left])
        every[left], good[left] = end.q, end.good
    return Arrived(every, good, ~good)
