"""The points of a self-motion, joined from two traces, marked and cut at singularities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.motion.self_motion.folds import direct_singularity
from closedchain.analysis.motion.self_motion.held_task import HeldTask
from closedchain.closure.solve.events import along
from closedchain.closure.solve.joining import Joined
from closedchain.closure.solve.outcome import Ending
from closedchain.urdf.errors import ClosureError

CLOSED, DEGENERATE = Ending.CLOSED.word, Ending.DEGENERATE.word
SINGULARITY = Ending.SINGULARITY.word
LOOSE = 1e-9  # residual at which a curve of singular postures is no self-motion any more


@dataclass(frozen=True, eq=False)
class Curve:
    """Points in order.

    Attributes
    ----------
    points : tuple of (nq,) arrays
    start : int
        Index of the start.
    ends : (str, str)
        In words, as the tracer has them, or that of ``Ending.SINGULARITY``.
    crossings, singular : tuples of int
        Branch points and direct singularities.
    """

    points: tuple[np.ndarray, ...]
    start: int
    ends: tuple[str, str]
    crossings: tuple[int, ...]
    singular: tuple[int, ...] = ()

    @property
    def closed(self) -> bool:
        """Whether it is a loop, whose last point is a neighbour of the first."""
        return self.ends == (CLOSED, CLOSED)

    def cut(self, first: int, last: int, ends: tuple[str, str]) -> Curve:
        """Points ``first`` to ``last`` alone."""

        def kept(marks: tuple[int, ...]) -> tuple[int, ...]:
            return tuple(i - first for i in marks if first <= i <= last)

        points = self.points[first : last + 1]
        return Curve(points, self.start - first, ends, kept(self.crossings), kept(self.singular))

    def opened(self, first: int) -> Curve:
        """The loop as an open curve from a point back to it, the start between."""
        n = len(self.points)

        def moved(marks: tuple[int, ...]) -> tuple[int, ...]:
            return tuple(sorted((i - first) % n for i in marks))

        points = (*self.points[first:], *self.points[: first + 1])
        singular = (*moved(self.singular), n)
        ends = SINGULARITY, SINGULARITY
        return Curve(points, (self.start - first) % n, ends, moved(self.crossings), singular)


def polished(system: HeldTask, traced: Joined) -> Curve:
    """A traced curve with the last rounding taken out of its points."""
    points = tuple(system.polished(z) for z in traced.points)
    return Curve(points, traced.start, traced.ends, traced.crossings)


def while_closed(system: HeldTask, curve: Curve) -> Curve:
    """The part around the start on which all equations hold, dependent ones included."""
    good = [max(system.residuals(z)) < LOOSE for z in curve.points]
    if all(good):
        return curve
    first, last, n = curve.start, curve.start, len(good)
    while first > 0 and good[first - 1]:
        first -= 1
    while last < n - 1 and good[last + 1]:
        last += 1
    ends = (
        DEGENERATE if first > 0 or curve.closed else curve.ends[0],
        DEGENERATE if last < n - 1 or curve.closed else curve.ends[1],
    )
    return curve.cut(first, last, ends)


def marked(system: HeldTask, curve: Curve) -> Curve:
    """The curve with its direct singularities among its points."""
    here, between = along(curve.points, direct_singularity(system), closed=curve.closed)
    points, start, crossings, singular = list(curve.points), curve.start, curve.crossings, here
    for i, z in reversed(between):
        points.insert(i + 1, z)
        start += start > i
        crossings = tuple(c + (c > i) for c in crossings)
        singular = [s + (s > i) for s in singular] + [i + 1]
    return Curve(tuple(points), start, curve.ends, crossings, tuple(sorted(singular)))


def driven(curve: Curve) -> Curve:
    """The part of a marked curve between the direct singularities next to the start.

    Raises
    ------
    ClosureError
        The start is one itself.
    """
    if not curve.singular:
        return curve
    if curve.start in curve.singular:
        raise ClosureError(
            "the start is a direct singularity, where no input need move and two ways lead on; "
            "through=True traces the whole curve"
        )
    if curve.closed:
        before = [s for s in curve.singular if s < curve.start]
        curve = curve.opened(max(before or curve.singular))
    before = [s for s in curve.singular if s < curve.start]
    after = [s for s in curve.singular if s > curve.start]
    return curve.cut(
        max(before, default=0),
        min(after, default=len(curve.points) - 1),
        (SINGULARITY if before else curve.ends[0], SINGULARITY if after else curve.ends[1]),
    )
