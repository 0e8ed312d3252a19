"""Events on a curve, located to rounding: where something changes sign, or touches zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

PATIENCE = 6  # halvings after which a least value that is no zero has shown itself
MOST = 60  # looks at the curve for one event
FINER = 17  # points looked at where something dips; odd, so that one is the middle

Seen = tuple[float, np.ndarray]
"""A value at a point of the curve, and the point."""
Between = Callable[[np.ndarray, np.ndarray, float], "Seen | None"]
"""What is seen at about a share of the way from one point of the curve to another."""


def zero(between: Between, low: Seen, high: Seen, enough: float = 0.0) -> Seen:
    """Zero of a function on a curve, of opposite sign at the ends, by Illinois steps.

    Ends where the value is smaller than ``enough``, or rounding lets it fall no more.
    """
    best, idle = min(low, high, key=_size), 0
    weights = [1.0, 1.0]
    for _ in range(MOST):
        if _size(best) < enough or best[0] == 0.0 or low[0] * high[0] > 0.0 or idle > PATIENCE:
            break
        a, b = low[0] * weights[0], high[0] * weights[1]
        found = between(low[1], high[1], float(np.clip(a / (a - b), 0.01, 0.99)))
        if found is None:
            break  # the equations are singular at the event itself: near enough
        idle = 0 if _size(found) < _size(best) else idle + 1
        best = min(best, found, key=_size)
        if found[0] * low[0] > 0.0:
            low, weights = found, [1.0, 0.5 * weights[1]]
        else:
            high, weights = found, [0.5 * weights[0], 1.0]
    return best


def least(between: Between, low: Seen, high: Seen, enough: float = 0.0) -> Seen:
    """Least size of a function on a curve, by shrinking around the best of three.

    A zero is halved with its bracket; what stays, over some halvings, is none.
    """
    best = between(low[1], high[1], 0.5) or min(low, high, key=_size)
    earlier = [np.inf] * PATIENCE
    for _ in range(MOST):
        if _size(best) < enough or _size(best) > 0.5 * earlier[-PATIENCE]:
            break
        earlier.append(_size(best))
        before, after = between(low[1], best[1], 0.5), between(best[1], high[1], 0.5)
        if before is None or after is None:
            break
        if min(_size(before), _size(after)) >= _size(best):
            low, high = before, after
        elif _size(before) < _size(after):
            best, high = before, best
        else:
            low, best = best, after
    return best


def _size(seen: Seen) -> float:
    return abs(seen[0])


class Sight(Protocol):
    """What is seen of an event at a point: ``size`` vanishes there and has a sign beside it."""

    @property
    def size(self) -> float:
        """How far away the event is, in its own measure; not negative."""

    @property
    def vanished(self) -> bool:
        """Whether the size is zero to rounding."""

    def parted_from(self, other: Any, /) -> float:
        """-1 where the sign differs from that of ``other``, 1 where not, 0 where there is none."""


@dataclass(frozen=True, eq=False)
class Event:
    """An event to look for: how a point looks, and how one between two others is found."""

    look: Callable[[np.ndarray], Sight]
    place: Callable[[np.ndarray, np.ndarray, float], np.ndarray]

    def between(self, begin: Sight, one: np.ndarray, two: np.ndarray, share: float) -> Seen:
        """Size on the way, with the sign that it has against ``begin`` (1 where there is none)."""
        z = self.place(one, two, share)
        sight = self.look(z)
        return (begin.parted_from(sight) or 1.0) * sight.size, z

    def crossed(self, one: np.ndarray, two: np.ndarray) -> np.ndarray | None:
        """Where the sign changes between two neighbours; None where it jumps elsewhere."""
        begin = self.look(one)
        ends = (begin.size, one), (-self.look(two).size, two)
        z = zero(lambda a, b, share: self.between(begin, a, b, share), *ends)[1]
        return z if self.look(z).vanished else None

    def dips(self, points: Sequence[np.ndarray]) -> list[tuple[int, np.ndarray]]:
        """Zeros over three neighbours of one sign, each with the neighbour that it follows.

        Two changes of sign near each other, or else one place where zero is touched.
        """
        low, middle, high = points
        half = np.linspace(0.0, 1.0, FINER // 2 + 1)
        finer = [self.place(low, middle, float(t)) for t in half]
        finer += [self.place(middle, high, float(t)) for t in half[1:]]
        seen = [self.look(z) for z in finer]
        found = []
        for k in range(FINER - 1):
            if seen[k].parted_from(seen[k + 1]) < 0.0:
                z = self.crossed(finer[k], finer[k + 1])
                found += [] if z is None else [(int(k >= FINER // 2), z)]
        if found:
            return found
        k = int(np.clip(np.argmin([s.size for s in seen]), 1, FINER - 2))
        ends = (seen[k - 1].size, finer[k - 1]), (seen[k + 1].size, finer[k + 1])
        begin = seen[k - 1]
        z = least(lambda a, b, share: self.between(begin, a, b, share), *ends)[1]
        return [(int(k >= FINER // 2), z)] if self.look(z).vanished else []


def along(
    points: Sequence[np.ndarray], event: Event, *, closed: bool
) -> tuple[list[int], list[tuple[int, np.ndarray]]]:
    """Events on a curve.

    Parameters
    ----------
    points : sequence of arrays
        Neighbours on the curve in order; the last and the first one are neighbours on a loop.

    Returns
    -------
    here : list of int
        Points at which it happens themselves.
    between : list of (i, point)
        Others, beyond point i and before the next one, in order.
    """
    seen = [event.look(z) for z in points]
    here = [i for i, s in enumerate(seen) if s.vanished]
    n = len(points)
    between: list[tuple[int, np.ndarray]] = []
    done: set[int] = set()
    for i in range(n if closed else n - 1):
        j = (i + 1) % n
        if seen[i].vanished or seen[j].vanished:
            done.add(i)
        elif seen[i].parted_from(seen[j]) < 0.0:
            z = event.crossed(points[i], points[j])
            if z is not None:
                between.append((i, z))
                done.add(i)
    for i in range(0 if closed else 1, n if closed else n - 1):
        before, after = (i - 1) % n, (i + 1) % n
        if done & {before, i}:
            continue
        sides = seen[before].size, seen[after].size
        # a zero beside the point shows in one of its neighbours by twice the value here
        if seen[i].size <= min(sides) and 2.0 * seen[i].size <= max(sides):
            zeros = event.dips((points[before], points[i], points[after]))
            between.extend((i if later else before, z) for later, z in zeros)
            done |= {before, i} if zeros else set()
    return here, sorted(between, key=lambda item: item[0])
