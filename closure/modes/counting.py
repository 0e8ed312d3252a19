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
from closedchain.closure.modes.places import Place, random_place
from closedchain.closure.modes.shapes import Shapes, groups
from closedchain.closure.solve.problem import Problem
from closedchain.closure.tape import cache

FORMAT = "generic solutions 6"
DETOURS = 3  # other ways for paths that were lost
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
    traced : bool
        Whether that check was the trace test for every block.
    infinite, lost : int
        Paths that went to infinity, and that ended elsewhere: at solutions that are singular.
    singular : (lost, nq) complex array
        Where these ended.
    """

    q: np.ndarray
    generic: tuple[int, ...]
    known: bool
    traced: bool
    infinite: int
    lost: int
    singular: np.ndarray

    @property
    def settled(self) -> bool:
        """Whether the count leaves nothing open."""
        return self.known and not self.lost


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
    sizes, known, traced, infinite, lost = [], True, True, 0, 0
    singular = q[:0]
    for number, block in enumerate(blocks_of(equations)):
        generic = _generic(block, shapes, number, report)
        sizes.append(len(generic.q))
        known, traced = known and generic.known, traced and generic.points > 0
        if report is not None:
            report("following solutions to the values asked for", len(q) * len(generic.q))
        followed = _followed(block, generic, shapes, targets, q)
        q, infinite = followed.q, infinite + followed.infinite
        lost, singular = lost + followed.lost, np.concatenate([singular, followed.ends])
    q = q[equations.proper(q, targets)]
    return Counted(q, tuple(sizes), known, traced, infinite, lost, singular)


@dataclass(frozen=True, eq=False)
class _Followed:
    """Where paths led: different solutions, how many went to infinity or were lost, and where."""

    q: np.ndarray
    infinite: int
    lost: int
    ends: np.ndarray


def _followed(
    block: Block, generic: Generic, shapes: Shapes, targets: np.ndarray, q: np.ndarray
) -> _Followed:
    """Solutions of a block for each solution (n, nq) of those before.

    Where paths fail, or end in the same solution, all are followed again by other ways: what is at
    infinity on one may be near enough on another. Only what is lost is worth more than one of them.
    """
    rng = np.random.default_rng(1)
    wanted = len(q) * len(generic.q)
    best = _route(block, shapes, [generic.place], generic.q, targets, q)
    for detour in range(DETOURS):
        if len(best.q) == wanted or (detour and not best.lost):
            break
        around = [generic.place, random_place(block.equations.problem, rng)]
        other = _route(block, shapes, around, generic.q, targets, q)
        found = merged(shapes.of, best.q, other.q)
        # what one way has lost, or taken for infinite, another may have found
        left = wanted - len(found)
        kept = min(best, other, key=lambda way: (left - min(way.infinite, left), way.infinite))
        infinite = min(kept.infinite, left)
        best = _Followed(found, infinite, left - infinite, kept.ends[: left - infinite])
    return best


def _route(
    block: Block,
    shapes: Shapes,
    places: list[Place],
    starts: np.ndarray,
    targets: np.ndarray,
    q: np.ndarray,
) -> _Followed:
    """Ends of the paths from solutions through places to the targets."""
    for one, two in pairwise(places):
        arrived = block.paths.track(one, two, starts)
        starts = arrived.q[arrived.good]
    every = np.repeat(starts[None], len(q), axis=0).reshape(-1, q.shape[1])
    given = np.repeat(q, len(starts), axis=0)
    found, ends, infinite = [q[:0]], [q[:0]], 0
    for begin in range(0, len(every), TOGETHER):
        part = slice(begin, begin + TOGETHER)
        end = Place(targets.astype(complex), given[part])
        arrived = block.paths.track(places[-1], end, every[part])
        found.append(arrived.q[arrived.good])
        ends.append(arrived.q[~arrived.good & ~arrived.infinite])
        infinite += int(arrived.infinite.sum())
    all_found = np.concatenate(found)
    first = np.unique(groups(shapes.of(all_found)), return_index=True)[1]
    again = np.delete(all_found, first, axis=0)  # ends in the same solution as another
    lost = np.concatenate([*ends, again])
    return _Followed(all_found[np.sort(first)], infinite, len(lost), lost)


def _generic(
    block: Block, shapes: Shapes, number: int, report: Callable[[str, int], None] | None
) -> Generic:
    """Generic solutions of a block, number so and so: those that are kept where there are any."""
    kept = _kept(block, number)
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
    cache.write(_name(block, number), file.getvalue())
    return found


def are_kept(problem: Problem) -> bool:
    """Whether the generic solutions of all blocks are known, so that counting is quick."""
    blocks = blocks_of(equations_of(problem))
    return all(_kept(block, i) is not None for i, block in enumerate(blocks))


def _kept(block: Block, number: int) -> Generic | None:
    """Generic solutions of a block on disk, read once for a mechanism."""
    problem = block.equations.problem
    known = problem.mechanism.known
    key = "modes.generic", problem.pinned, problem.goals, number
    if key not in known:
        found = _read(_name(block, number), block)
        if found is None:
            return None
        known[key] = found
    kept: Generic = known[key]
    return kept


def _name(block: Block, number: int) -> str:
    """Name of the file with a block's generic solutions."""
    return cache.key(FORMAT, *_identity(block), str(number))


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
