"""All complex solutions at real values: generic solutions, once a mechanism, and a path for each.

The generic solutions of a block of equations are kept on disk, so that the next question about the
same mechanism costs one path a solution.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedchain.closure.modes.blocks import blocks_of
from closedchain.closure.modes.complex_equations import ComplexEquations
from closedchain.closure.modes.monodromy import Generic, generic_solutions
from closedchain.closure.modes.paths import Block, Place, track
from closedchain.closure.modes.shapes import Shapes, groups
from closedchain.closure.solve.problem import Problem
from closedchain.closure.tape import cache

FORMAT = "generic solutions 1"
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
    """

    q: np.ndarray
    generic: tuple[int, ...]
    known: bool
    infinite: int
    lost: int


def counted(
    problem: Problem,
    shapes: Shapes,
    targets: np.ndarray,
    report: Callable[[str, int], None] | None = None,
) -> Counted:
    """Complex solutions of a problem at targets (prescribed,).

    The kept rows must be as many as the unknowns.
    """
    equations = ComplexEquations(problem)
    q = problem.mechanism.home[None].astype(complex)
    q[:, problem.pinned_q] = targets[: len(problem.pinned)]
    sizes, known, infinite, lost = [], True, 0, 0
    for number, block in enumerate(blocks_of(equations)):
        generic = _generic(block, shapes, number, report)
        sizes.append(len(generic.q))
        known = known and generic.known
        if report is not None:
            report("following solutions to the values asked for", len(q) * len(generic.q))
        q, away, gone = _followed(block, generic, targets, q)
        infinite, lost = infinite + away, lost + gone
    q = q[equations.proper(q, targets)]
    if len(q):
        q = q[np.unique(groups(shapes.of(q)), return_index=True)[1]]
    return Counted(q, tuple(sizes), known, infinite, lost)


def _followed(
    block: Block, generic: Generic, targets: np.ndarray, q: np.ndarray
) -> tuple[np.ndarray, int, int]:
    """Solutions of a block for each solution (n, nq) of those before; how many paths failed."""
    starts = np.repeat(generic.q[None], len(q), axis=0).reshape(-1, q.shape[1])
    given = np.repeat(q, len(generic.q), axis=0)
    found, infinite, lost = [q[:0]], 0, 0
    for begin in range(0, len(starts), TOGETHER):
        part = slice(begin, begin + TOGETHER)
        end = Place(targets.astype(complex), given[part])
        arrived = track(block, generic.place, end, starts[part])
        found.append(arrived.q[arrived.good])
        infinite += int(arrived.infinite.sum())
        lost += int((~arrived.good & ~arrived.infinite).sum())
    return np.concatenate(found), infinite, lost


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
        numbers=np.array([found.loops, found.quiet, found.hits, found.known]),
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
            loops, quiet, hits, known = (int(x) for x in kept["numbers"])
            place = Place(kept["targets"], kept["given"])
            q = np.array(kept["q"])
    except (KeyError, ValueError, OSError):
        return None
    if q.ndim != 2 or q.shape[1] != block.equations.problem.mechanism.model.nq:
        return None
    return Generic(place, q, loops, quiet, hits, bool(known))
