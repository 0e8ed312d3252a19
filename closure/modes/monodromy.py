"""All solutions at a generic complex place, from some: what is prescribed moves in loops.

Newton's method from random complex starts finds some. After a loop through random complex places
each solution has become one of the same place again, maybe another. Then all move on to another
place, large or small, where new random starts are made and new loops gone. The work ends when
several places, one after the other, have shown nothing new: neither loops nor starts, which know
nothing of each other. Where solutions fall into families that loops do not mix, as the operation
modes of a mechanism, the starts reach each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from closedchain.closure.modes.blocks import BOUND, Block
from closedchain.closure.modes.paths import Arrived, between, far, track
from closedchain.closure.modes.places import Place, random_place, random_postures
from closedchain.closure.modes.shapes import Shapes, groups
from closedchain.closure.solve.square_systems import solutions

QUIET = 1  # places one after the other that show nothing new, before the work ends
MOST_PLACES = 20
LOOPS = 8  # at each place
WIDE = (2.0, 4.0, 8.0)  # characteristic lengths: sizes of places on loops
DETOURS = 3
MOST = 2000  # solutions
STARTS = 400  # random complex starts at once, for the check
ROUNDS = 12
HITS = 2  # for each solution, at least
NEWTON = 60
CLOSED = 1e-7


@dataclass(frozen=True, eq=False)
class Generic:
    """Solutions of a generic member.

    Attributes
    ----------
    place : Place
    q : (n, nq) complex array
    loops : int
        That were gone.
    quiet : int
        Places, the last ones, at which nothing new appeared.
    hits : int
        Solutions that Newton's method found there from random complex starts, all of them known.
    known : bool
        Whether these places were as many as asked, with several hits for each solution.
    """

    place: Place
    q: np.ndarray
    loops: int
    quiet: int
    hits: int
    known: bool


def generic_solutions(
    block: Block, shapes: Shapes, seed: int = 0, report: Callable[[int], None] | None = None
) -> Generic:
    """Solutions of a generic member of a block's family, each shape once."""
    problem, rng = block.equations.problem, np.random.default_rng(seed)
    place = random_place(problem, rng)
    q, hits = _struck(block, place, rng, 1)
    q = merged(shapes, q[:0], q)
    loops = quiet = total = 0
    for _ in range(MOST_PLACES):
        before = len(q)
        if quiet >= QUIET or not before or before > MOST:
            break
        q, mixed = _mixed(block, shapes, place, q, rng)
        loops += LOOPS
        there = random_place(problem, rng)
        moved = carried(block, shapes, place, there, q, rng)
        if report is not None:
            report(len(q))
        if len(moved) < len(q):
            quiet = 0
            continue
        place = there
        others, hits = _struck(block, place, rng, len(q))
        q = merged(shapes, moved, others)
        agreed = mixed and len(q) == before and hits >= HITS * before
        quiet, total = (quiet + 1, total + hits) if agreed else (0, 0)
    return Generic(place, q, loops, quiet, total, quiet >= QUIET)


def _mixed(
    block: Block, shapes: Shapes, place: Place, q: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, bool]:
    """All that loops make of solutions; whether the loops permute them.

    Each solution goes once round each loop, so do those that appear.
    """
    problem = block.equations.problem
    ways = [
        (place, random_place(problem, rng, wide), random_place(problem, rng, wide), place)
        for wide in np.resize(WIDE, LOOPS)
    ]
    images = np.zeros((LOOPS, 0), dtype=int)  # number of what a solution becomes; -1: lost
    while images.shape[1] < len(q) <= MOST:
        begin, n = images.shape[1], len(q)
        ends = _looped(block, ways, q[begin:])
        every = np.concatenate([q, ends.q[ends.good]])
        group = groups(shapes.of(every))
        first = np.unique(group, return_index=True)[1]
        found = np.full(len(ends.q), -1)
        found[ends.good] = group[n:]
        q = every[first]
        images = np.hstack([images, found.reshape(LOOPS, n - begin)])
    one_to_one = all(np.unique(k[k >= 0]).size == (k >= 0).sum() for k in images)
    return q, one_to_one


def _looped(block: Block, ways: list[tuple[Place, ...]], q: np.ndarray) -> Arrived:
    """Ends of all solutions (n, nq) on all ways (loops * n, ...)."""
    n = len(q)
    every = np.tile(q, (len(ways), 1))
    good = np.ones(len(every), dtype=bool)
    for legs in zip(*(pairwise(way) for way in ways), strict=True):
        one, two = (Place.stacked([leg[k] for leg in legs], n) for k in (0, 1))
        at = np.flatnonzero(good)
        end = track(block, one.take(at), two.take(at), every[at])
        every[at], good[at] = end.q, end.good
    return Arrived(every, good, ~good)


def carried(
    block: Block,
    shapes: Shapes,
    one: Place,
    two: Place,
    q: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Solutions (n, nq) brought to another place; what is lost on one way is tried on others."""
    end = track(block, one, two, q)
    found, left = merged(shapes, q[:0], end.q[end.good]), q[~end.good]
    for _ in range(DETOURS):
        if not len(left):
            break
        between = random_place(block.equations.problem, rng)
        half = track(block, one, between, left)
        end = track(block, between, two, half.q[half.good])
        found = merged(shapes, found, end.q[end.good])
        arrived = np.flatnonzero(half.good)[end.good]
        left = np.delete(left, arrived, axis=0)
    return found


def _struck(
    block: Block, place: Place, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, int]:
    """Solutions that Newton's method finds from random complex starts, and how many hits."""
    found = []
    hits = 0
    for _ in range(ROUNDS):
        q = _met(
            block,
            place,
            newton(block, place, random_postures(block.equations.problem.mechanism, rng, STARTS)),
        )
        found.append(q)
        hits += len(q)
        if hits >= 3 * HITS * count:
            break
    return np.concatenate(found), hits


def newton(block: Block, place: Place, q: np.ndarray) -> np.ndarray:
    """Solutions (m, nq) that Newton's method, with bounded steps, reaches from postures (n, nq)."""
    here = between(block, place, place, q, np.zeros(len(q)))
    q, done = here.q, np.zeros(len(q), dtype=bool)
    alive = np.ones(len(q), dtype=bool)
    for _ in range(NEWTON):
        i = np.flatnonzero(alive & ~done)
        if not i.size:
            break
        step = _toward(block, q[i], here.targets[i])
        size = block.size(q[i], step)
        fine = np.isfinite(size)
        alive[i[~fine]] = False
        i, step, size = i[fine], step[fine], size[fine]
        step *= (BOUND / np.maximum(size, BOUND))[:, None]
        q[i] = block.moved(q[i], step)
        done[i] = size < CLOSED
        alive[i] &= ~far(block, q[i])
    return np.asarray(q[done])


def _toward(block: Block, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Newton's steps (n, k); with more rows than unknowns those of Gauss and Newton, on all."""
    if not block.also.size:
        return block.newton.at(q, targets)[1]
    values, jacobian = block.equations.all_rows(q, targets)
    every = np.concatenate([np.array(block.equations.problem.kept)[block.rows], block.also])
    a = jacobian[:, every][:, :, block.columns]
    adjoint = a.conj().swapaxes(1, 2)
    right = adjoint @ values[:, every, None]
    return -solutions(adjoint @ a + 1e-14 * np.eye(a.shape[2]), right)[:, :, 0]


def _met(block: Block, place: Place, q: np.ndarray) -> np.ndarray:
    """Those of postures (n, nq) that meet the other rows, too, with no closed joint mirrored."""
    if not len(q) or not block.also.size:
        return q
    targets = np.broadcast_to(place.targets, (len(q), place.targets.size))
    return np.asarray(q[block.equations.proper(q, targets)])


def merged(shapes: Shapes, known: np.ndarray, more: np.ndarray) -> np.ndarray:
    """Postures of two lists (n, nq), each shape once; those of the first stay as they are."""
    every = np.concatenate([known, more])
    group = groups(shapes.of(every))
    return every[np.unique(group, return_index=True)[1]]
