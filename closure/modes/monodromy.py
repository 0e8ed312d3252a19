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

from closedchain.closure.modes.complex_equations import normalised
from closedchain.closure.modes.paths import Block, Place, between, far, track
from closedchain.closure.modes.shapes import Shapes, groups
from closedchain.closure.solve.square_systems import solutions

QUIET = 4  # places one after the other that show nothing new, before the work ends
MOST_PLACES = 40
LOOPS = 2  # at each place
SPREAD = 0.7  # of the logarithm of the size of places and starts
MOST = 2000  # solutions
STARTS = 400  # random complex starts at once, for the check
ROUNDS = 12
HITS = 2  # for each solution, at least
NEWTON = 60
BOUND = 0.7  # dimensionless: longest step of Newton's method from afar
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
    rng = np.random.default_rng(seed)
    place = random_place(block, rng)
    q, hits = _struck(block, place, rng, 1)
    q = merged(shapes, q[:0], q)
    loops = quiet = total = 0
    for _ in range(MOST_PLACES):
        before = len(q)
        if quiet >= QUIET or not before or before > MOST:
            break
        for _ in range(LOOPS):
            q = merged(shapes, q, _looped(block, place, q, rng))
            loops += 1
        there = random_place(block, rng)
        moved = track(block, place, there, q)
        if not moved.good.all():
            quiet = 0 if len(q) > before else quiet
            continue
        place = there
        others, hits = _struck(block, place, rng, len(q))
        q = merged(shapes, moved.q, others)
        agreed = len(q) == before and hits >= HITS * before
        quiet, total = (quiet + 1, total + hits) if agreed else (0, 0)
        if report is not None:
            report(len(q))
    return Generic(place, q, loops, quiet, total, quiet >= QUIET)


def _looped(block: Block, place: Place, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Solutions that some become after a loop through two random places."""
    ways = [place, random_place(block, rng), random_place(block, rng), place]
    for one, two in pairwise(ways):
        end = track(block, one, two, q)
        q = end.q[end.good]
    return q


def _struck(
    block: Block, place: Place, rng: np.random.Generator, count: int
) -> tuple[np.ndarray, int]:
    """Solutions that Newton's method finds from random complex starts, and how many hits."""
    found = []
    hits = 0
    for _ in range(ROUNDS):
        q = _met(block, place, newton(block, place, random_postures(block, rng, STARTS)))
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
        step = -_toward(block, q[i], here.targets[i])
        size = np.abs(step).max(axis=1, initial=0.0)
        fine = np.isfinite(size)
        alive[i[~fine]] = False
        i, step, size = i[fine], step[fine], size[fine]
        step *= np.minimum(1.0, BOUND / np.maximum(size, BOUND))[:, None]
        q[i] = block.moved(q[i], step)
        done[i] = size < CLOSED
        alive[i] &= ~far(block, q[i])
    return np.asarray(q[done])


def _toward(block: Block, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Newton's steps (n, k); with more rows than unknowns those of Gauss and Newton, on all."""
    if not block.also.size:
        values, jacobian = block.at(q, targets)
        return solutions(jacobian, values[:, :, None])[:, :, 0]
    values, jacobian = block.equations.all_rows(q, targets)
    every = np.concatenate([np.array(block.equations.problem.kept)[block.rows], block.also])
    a = jacobian[:, every][:, :, block.columns]
    adjoint = a.conj().swapaxes(1, 2)
    right = adjoint @ values[:, every, None]
    return solutions(adjoint @ a + 1e-14 * np.eye(a.shape[2]), right)[:, :, 0]


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


def random_postures(block: Block, rng: np.random.Generator, count: int) -> np.ndarray:
    """Complex postures (count, nq), angles all around, lengths about the characteristic one."""
    m = block.equations.problem.mechanism
    model = m.model
    size = m.length * np.exp(SPREAD * rng.standard_normal(count))
    high = 0.3j * np.exp(SPREAD * rng.standard_normal(count))
    q = np.zeros((count, model.nq), dtype=complex)
    for j in range(1, model.njoints):
        first = model.idx_qs[j]
        if model.nqs[j] == 1:
            if m.translational[model.idx_vs[j]]:
                q[:, first] = size * _normal(rng, count)
            else:
                q[:, first] = rng.uniform(-np.pi, np.pi, count) + high * rng.standard_normal(count)
            continue
        q[:, first : first + 3] = size[:, None] * _normal(rng, (count, 3))
        q[:, first + 3 : first + 7] = normalised(
            rng.standard_normal((count, 4)) + high[:, None] * rng.standard_normal((count, 4))
        )
    return q


def random_place(block: Block, rng: np.random.Generator) -> Place:
    """Random complex place."""
    problem = block.equations.problem
    m = problem.mechanism
    given = random_postures(block, rng, 1)[0]
    poses = []
    for _ in problem.goals:
        turn = normalised(rng.standard_normal((1, 4)) + 0.3j * rng.standard_normal((1, 4)))[0]
        size = m.length * np.exp(SPREAD * rng.standard_normal())
        poses += [*(size * _normal(rng, 3)), *turn]
    targets = np.concatenate([given[problem.pinned_q], np.array(poses, dtype=complex)])
    return Place(targets, given)


def _normal(rng: np.random.Generator, size: int | tuple[int, ...]) -> np.ndarray:
    return np.asarray(rng.standard_normal(size) + 1j * rng.standard_normal(size))
