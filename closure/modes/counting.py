"""All complex solutions at real values: generic solutions, once a mechanism, and a path for each.

The generic solutions of a block of equations are kept on disk, so that the next question about the
same mechanism costs one path a solution.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from closedchain.closure.modes.blocks import Block, blocks_of
from closedchain.closure.modes.complex_equations import equations_of
from closedchain.closure.modes.loops import merged
from closedchain.closure.modes.monodromy import Generic, generic_solutions
from closedchain.closure.modes.paths import track
from closedchain.closure.modes.places import Place, random_place
from closedchain.closure.modes.shapes import Shapes, groups
from closedchain.closure.solve.problem import Problem
from closedchain.closure.tape import cache

FORMAT = "generic solutions 3"
TOGETHER = 512  # paths that are followed together


@dataclass(frozen=True, eq=False)
class Counted:
    """Complex solutions at real values.

    Attributes
    ----------
    q : (n, nq) complex array
        Each shape once: finite, regular, with no closed joint mirrored.
    generic : tuple of int
        Solutions of each block at generic values; their product is what can be at most.
    known : bool
        Whether the check of every block's generic solutions holds.
    infinite, lost : int
        Paths that went to infinity, and that ended elsewhere: at solutions that are singular.
    singular : (lost, nq) complex array
        Where these ended.
    """

    q: np.ndarray
    generic: tuple[int, ...]
    known: bool
    infinite: int
    lost: int
    singular: np.ndarray


def counted(
    problem: Problem,
    shapes: Shapes,
    targets: np.ndarray,
    report: Callable[[str, int], None] | None = None,
) -> Counted:
    """Complex solutions of a problem at targets (prescribed,).

    The kept rows must be as many as the unknowns.
    """
    equations = equations_of(problem)
    q = problem.mechanism.home[None].astype(complex)
    q[:, problem.pinned_q] = targets[: len(problem.pinned)]
    sizes, known, infinite, lost = [], True, 0, 0
    singular = q[:0]
    for number, block in enumerate(blocks_of(equations)):
        generic = _generic(block, shapes, number, report)
        sizes.append(len(generic.q))
        known = known and generic.known
        if report is not None:
            report("following solutions to the values asked for", len(q) * len(generic.q))
        wanted = len(q) * len(generic.q)
        q, ends = _followed(block, generic, shapes, targets, q)
        infinite, lost = infinite + wanted - len(q) - len(ends), lost + len(ends)
        singular = np.concatenate([singular, ends])
    q = q[equations.proper(q, targets)]
    if len(q):
        q = q[np.unique(groups(shapes.of(q)), return_index=True)[1]]
    return Counted(q, tuple(sizes), known, infinite, lost, singular)


def _followed(
    block: Block, generic: Generic, shapes: Shapes, targets: np.ndarray, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solutions of a block for each solution (n, nq) of those before; ends of paths that are lost.

    Where paths fail, all are followed once more by another way: what is at infinity on one may be
    near enough on the other.
    """
    rng = np.random.default_rng(1)
    found, lost = _route(block, [generic.place], generic.q, targets, q)
    if len(found) < len(q) * len(generic.q):
        around = [generic.place, random_place(block.equations.problem, rng)]
        more, ends = _route(block, around, generic.q, targets, q)
        found = merged(shapes.of, found, more)
        lost = lost if len(lost) >= len(ends) else ends
    return found, lost[: len(q) * len(generic.q) - len(found)]


def _route(
    block: Block, places: list[Place], starts: np.ndarray, targets: np.ndarray, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the paths from solutions through places to the targets: good ones, and lost ones."""
    for one, two in pairwise(places):
        arrived = track(block, one, two, starts)
        starts = arrived.q[arrived.good]
    every = np.repeat(starts[None], len(q), axis=0).reshape(-1, q.shape[1])
    given = np.repeat(q, len(starts), axis=0)
    found, lost = [q[:0]], [q[:0]]
    for begin in range(0, len(every), TOGETHER):
        part = slice(begin, begin + TOGETHER)
        end = Place(targets.astype(complex), given[part])
        arrived = track(block, places[-1], end, every[part])
        found.append(arrived.q[arrived.good])
        lost.append(arrived.q[~arrived.good & ~arrived.infinite])
    return np.concatenate(found), np.concatenate(lost)


def _generic(
    block: Block, shapes: Shapes, number: int, report: Callable[[str, int], None] | None
) -> Generic:
    """Generic solutions of a block: from disk where they are known."""
    name = cache.key(FORMAT, *_identity(block), str(number))
    kept = _read(name, block)
    if kept is not None:
        return kept

    def tell(count: int) -> None:
        if report is not None:
            report("finding solutions at generic values", count)

    found = generic_solutions(block, shapes, report=tell)
    file = io.BytesIO()
    np.savez(
        file,
        targets=found.place.targets,
        given=found.place.given,
        q=found.q,
        numbers=np.array([found.points, found.hits, found.known]),
    )
    cache.write(name, file.getvalue())
    return found


def _identity(block: Block) -> tuple[str, ...]:
    """All that decides the generic solutions of a block."""
    problem = block.equations.problem
    what = problem.mechanism.description
    parts = (problem.pinned, problem.goals, problem.kept, block.rows, block.columns)
    return (repr(what), *(repr(np.asarray(p, dtype=object).tolist()) for p in parts))


def _read(name: str, block: Block) -> Generic | None:
    data = cache.read(name)
    if data is None:
        return None
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as kept:
            points, hits, known = (int(x) for x in kept["numbers"])
            place = Place(kept["targets"], kept["given"])
            q = np.array(kept["q"])
    except (KeyError, ValueError, OSError):
        return None
    if q.ndim != 2 or q.shape[1] != block.equations.problem.mechanism.model.nq:
        return None
    return Generic(place, q, points, hits, bool(known))
