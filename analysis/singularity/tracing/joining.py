"""One curve from two paths that leave the same point, closed where they meet again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from closedchain.analysis.singularity.tracing.corrector import System, settle
from closedchain.analysis.singularity.tracing.path import Path

CLOSED = "closed"
SAME = 1e-8  # dimensionless: two points nearer than this are one
CLOSER = 20  # steps along a curve towards a point that may lie on it


@dataclass(frozen=True, eq=False)
class Joined:
    """Points in order, index of the start, both ends, and indices of branch points."""

    points: list[np.ndarray]
    start: int
    ends: tuple[str, str]
    crossings: tuple[int, ...]


def joined(system: System, behind: Path, ahead: Path) -> Joined:
    """One curve from two paths that leave the same point; a loop where they meet again.

    A loop along which a joint makes a whole turn may meet a limit before it closes, one way or
    both; both together then pass some points twice, a turn apart.
    """
    ends = behind.end, ahead.end
    if ahead.end == CLOSED:
        ends, behind = (CLOSED, CLOSED), Path(behind.points[:1], CLOSED)
    elif behind.end == CLOSED:
        ends, ahead = (CLOSED, CLOSED), Path(ahead.points[:1], CLOSED)
    else:
        met = _meeting(system, behind.points, ahead.points)
        if met is not None:
            ends = CLOSED, CLOSED
            kept = [i for i in behind.crossings if i < met]
            behind = Path(behind.points[:met], CLOSED, kept)
    k = len(behind.points) - 1
    crossings = {k - i for i in behind.crossings} | {k + i for i in ahead.crossings}
    points = [*behind.points[::-1], *ahead.points[1:]]
    return Joined(points, k, ends, tuple(sorted(crossings)))


def _meeting(
    system: System, behind: Sequence[np.ndarray], ahead: Sequence[np.ndarray]
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
        z: np.ndarray | None = one
        for _ in range(CLOSER):
            if z is None or np.linalg.norm(system.difference(one, z)) ** 2 > 2.0 * square:
                break
            gap = system.difference(z, last)
            if np.linalg.norm(gap) < SAME:
                return k
            z = settle(system, system.move(z, (gap @ chord) / square * chord))
    return None
