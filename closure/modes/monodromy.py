"""All solutions at a generic complex place, and a check that they are all.

Newton's method from random complex starts finds some. After a loop through random complex places
each has become one of the same place again, maybe another. Loops must be large beside the
mechanism: small ones go round next to nothing.

Then the trace test [Leykin2018]_, which needs no luck with loops. The solutions become points of
a slice of a curve, see ``slices``; loops of slices find its other points. When the slice moves
on, the sums of z and of y over all points go straight: they have no poles, and grow no faster.
Sums over some points only bend, unless these are all the points of a component. So a straight
trace says that no solution is missing that those known could become. Solutions of other
components, as the operation modes of a mechanism, are reached by random starts, which are made at
another place, too.

[Leykin2018]_ A. Leykin, J. I. Rodriguez, F. Sottile, Trace test, Arnold Mathematical Journal 4,
2018.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedchain.closure.modes.blocks import Block
from closedchain.closure.modes.loops import carried, closed_under, merged
from closedchain.closure.modes.places import Place, random_place
from closedchain.closure.modes.random_solutions import random_solutions
from closedchain.closure.modes.shapes import Shapes
from closedchain.closure.modes.slices import Slices

MOST_PLACES = 8
QUIET = 3  # places one after the other with nothing new, where the trace test cannot be had
LOOPS = 4  # of places at once
WIDE = (4.0, 8.0, 2.0, 6.0)  # characteristic lengths: places on loops
LOOPS_OF_SLICES = 2
WIDE_SLICES = (1.0, 3.0)
DETOURS = 3
MOST = 2000  # solutions
POINTS = (500, 20)  # of a slice at most: so many, and so many for each solution
TRIALS = 6  # of the trace test, each with more loops
S, STEPS = 1.0, (400.0 + 300.0j, 12.0 + 9.0j, 0.4 + 0.3j)
"""s at first, and its steps, the longest first: points next to infinity move in long ones only."""

BENT = 1e-6
"""Share of their bends, added without signs, that the sum over all points may bend."""


@dataclass(frozen=True, eq=False)
class Generic:
    """Solutions of a generic member.

    Attributes
    ----------
    place : Place
    q : (n, nq) complex array
    points : int
        Of the slice whose trace is straight; 0 where it cannot be had, or never was.
    hits : int
        Solutions from random starts at the last place, all of them known.
    known : bool
        Whether the trace is straight, and starts at another place have led to nothing else; or,
        where the trace cannot be had, whether several places have shown nothing new.
    """

    place: Place
    q: np.ndarray
    points: int
    hits: int
    known: bool


def generic_solutions(
    block: Block, shapes: Shapes, seed: int = 0, report: Callable[[int], None] | None = None
) -> Generic:
    """Solutions of a generic member of a block's family, each shape once."""
    problem, rng = block.equations.problem, np.random.default_rng(seed)
    tell = report or (lambda count: None)
    place = random_place(problem, rng)
    struck = random_solutions(block, place, rng, 1)
    q = merged(shapes.of, struck[:0], struck)
    points: int | None = 0
    hits, quiet = len(struck), 0
    for _ in range(MOST_PLACES):
        tell(len(q))
        if not len(q) or len(q) > MOST:
            break
        before = len(q)
        q = closed_under(block.paths, shapes.of, _loops(block, place, rng), q, MOST, tell)
        tell(len(q))
        if points is not None:
            q, points = _traced(block, shapes, place, q, rng, tell)
        ways = [random_place(problem, rng) for _ in range(DETOURS + 1)]
        moved = carried(block.paths, shapes.of, place, ways, q)
        if len(moved) < len(q):
            quiet = 0
            continue
        place = ways[-1]
        struck = random_solutions(block, place, rng, len(q))
        traced, hits = len(q), len(struck)
        q = merged(shapes.of, moved, struck)
        if points and len(q) == traced:
            return Generic(place, q, points, hits, True)
        quiet = quiet + 1 if len(q) == before else 0
        if points is None and quiet >= QUIET:
            return Generic(place, q, 0, hits, True)
    return Generic(place, q, 0, hits, False)


def _loops(block: Block, place: Place, rng: np.random.Generator) -> list[tuple[Place, ...]]:
    """Loops from a place through two others that are large."""
    problem = block.equations.problem
    return [
        (place, *(random_place(problem, rng, wide) for _ in range(2)), place)
        for wide in np.resize(WIDE, LOOPS)
    ]


def _traced(
    block: Block,
    shapes: Shapes,
    place: Place,
    q: np.ndarray,
    rng: np.random.Generator,
    tell: Callable[[int], None],
) -> tuple[np.ndarray, int | None]:
    """All solutions at a place that a slice through them has, and its points if all are there.

    None where they are too many, or some cannot be followed, as next to infinity.
    """
    slices = Slices(block, place, q)

    def telling(points: np.ndarray) -> np.ndarray:
        return np.hstack([shapes.of(points[:, :-1]), points[:, -1:]])

    start = slices.through(q[0], rng)
    begin = np.hstack([q, np.full((len(q), 1), start.given[-1])])
    here = slices.at(start, S)
    moved = slices.paths.track(start, here, begin)
    points = moved.q[moved.good]
    most = POINTS[0] + POINTS[1] * len(q)
    goes: bool | None = False
    for _ in range(TRIALS):
        tell(len(q))
        if not len(points):
            break
        ways = [
            (here, *(slices.random(rng, wide) for _ in range(2)), here)
            for wide in np.resize(WIDE_SLICES, LOOPS_OF_SLICES)
        ]
        points = closed_under(slices.paths, telling, ways, points, most, lambda _: tell(len(q)))
        if len(points) > most:
            return q, None
        goes = straight(slices, here, points)
        if not goes:
            continue
        back = slices.paths.track(here, start, points)
        home = back.q[back.good]
        home = home[np.abs(home[:, -1] - start.given[-1]) < 1e-6]
        every = merged(shapes.of, q, home[:, :-1])
        return every, len(points) if len(home) == len(every) else 0
    return q, None if goes is None else 0


def straight(slices: Slices, here: Place, points: np.ndarray) -> bool | None:
    """Whether the sums of z and of y over points go straight as the slice moves.

    Where not all points can be followed a long step, a shorter one decides. None where they cannot
    be followed at all, and the sums are bent: those next to infinity hardly move, and taken where
    their paths stopped, they do not bend a sum that is straight.
    """
    for step in STEPS:
        found, all_good = [np.stack([points[:, -1], slices.y(here, points)])], True
        place, q = here, points
        for k in (1, 2):
            there = slices.at(place, S + k * step)
            end = slices.paths.track(place, there, q)
            all_good = all_good and bool(end.good.all())
            place, q = there, end.q
            found.append(np.stack([q[:, -1], slices.y(place, q)]))
        bends = found[0] - 2.0 * found[1] + found[2]
        size = np.abs(bends).sum(axis=1)
        goes = bool((np.abs(bends.sum(axis=1)) <= BENT * size + 1e-9).all())
        if goes or all_good:
            return goes
    return None
