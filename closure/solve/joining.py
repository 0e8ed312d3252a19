"""One curve from two paths that leave the same point, closed where they meet again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from closedchain.closure.solve.curve import Path, trace
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.solution_set import Bound, SmoothEquations, settle

SAME = 1e-8  # dimensionless: two points nearer than this are one
CLOSER = 20  # steps along a curve towards a point that may lie on it


@dataclass(frozen=True, eq=False)
class Joined:
    """Points in order, index of the start, both ends, and indices of branch points.

    ``ends`` are in words, those of bounds their labels; ``endings`` say which kind each is.
    """

    points: list[np.ndarray]
    start: int
    ends: tuple[str, str]
    endings: tuple[Ending, Ending]
    crossings: tuple[int, ...]

    @property
    def closed(self) -> bool:
        """Whether it is a loop, whose last point is a neighbour of the first."""
        return self.endings == (Ending.CLOSED, Ending.CLOSED)


def both_ways(
    system: SmoothEquations,
    start: np.ndarray,
    towards: np.ndarray,
    longest: np.ndarray,
    bounds: Sequence[Bound] = (),
    most: int = 3000,
) -> Joined:
    """The whole curve through a point: ``curve.trace`` ahead and, if it does not close, behind."""
    ahead = trace(system, start, towards, longest, bounds, most)
    behind = Path([start], Ending.CLOSED)
    if ahead.ending is not Ending.CLOSED:
        behind = trace(system, start, -towards, longest, bounds, most)
    return joined(system, behind, ahead)


def joined(system: SmoothEquations, behind: Path, ahead: Path) -> Joined:
    """One curve from two paths that leave the same point; a loop where they meet again.

    A loop along which a joint makes a whole turn may meet a limit before it closes, one way or
    both; both together then pass some points twice, a turn apart.
    """
    if ahead.ending is Ending.CLOSED:
        behind = Path(behind.points[:1], Ending.CLOSED)
    elif behind.ending is Ending.CLOSED:
        ahead = Path(ahead.points[:1], Ending.CLOSED)
    else:
        met = _meeting(system, behind.points, ahead.points)
        if met is not None:
            kept = [i for i in behind.crossings if i < met]
            behind = Path(behind.points[:met], Ending.CLOSED, "", kept)
            ahead = Path(ahead.points, Ending.CLOSED, "", ahead.crossings)
    k = len(behind.points) - 1
    return Joined(
        points=[*behind.points[::-1], *ahead.points[1:]],
        start=k,
        ends=(behind.end, ahead.end),
        endings=(behind.ending, ahead.ending),
        crossings=tuple(
            sorted({k - i for i in behind.crossings} | {k + i for i in ahead.crossings})
        ),
    )


def _meeting(
    system: SmoothEquations, behind: Sequence[np.ndarray], ahead: Sequence[np.ndarray]
) -> int | None:
    """Index of the first point behind that lies beyond the last one ahead, or None."""
    if len(ahead) < 2:
        return None
    last = ahead[-1]
    onward = system.difference(ahead[-2], last)
    for k, (one, two) in enumerate(pairwise(behind), start=1):
        chord, gap = system.difference(one, two), system.difference(one, last)
        square = float(chord @ chord)
        if square == 0.0 or not 0.0 <= gap @ chord <= square or chord @ onward > 0.0:
            continue
        z = one
        for _ in range(CLOSER):
            gap = system.difference(z, last)
            if np.linalg.norm(gap) < SAME:
                return k
            closer = settle(system, system.move(z, (gap @ chord) / square * chord))
            z = closer.posture
            if not closer.good or np.linalg.norm(system.difference(one, z)) ** 2 > 2.0 * square:
                break
    return None
