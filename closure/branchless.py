"""Postures where no branch leads: by descent from a guess and from starts scattered around it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from closedchain.closure.constraints import flipped_axes
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits, limit_note, open_closure
from closedchain.closure.solution import Solution
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.descend import Descent, descend
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.problem import Problem
from closedchain.closure.solve.starts import scattered
from closedchain.closure.solve.system import System
from closedchain.closure.task import Goal, faces_away


def closed_near(problem: Problem, q: np.ndarray) -> np.ndarray | None:
    """Closed posture (nq,) that descent from an open one leads to, joints pinned where they are."""
    m = problem.mechanism
    found = descend(System(m, np.array(problem.free, dtype=int)), q)
    return found.q if found.closed and not np.array_equal(found.q, q) else None


def anywhere(
    system: System, start: np.ndarray, why: str, evaluations: int, *, branchless: bool
) -> Solution:
    """Solve without a branch: from the start, then from starts scattered around it.

    ``branchless`` says that the guess had no branch; else a posture on another one is reported,
    not given as the answer.
    """
    best: Descent | None = None
    for q in scattered(system.mechanism, start):
        found = descend(system, q)
        evaluations += found.evaluations
        good = found.closed and _proper(system.mechanism, found.q, system.goals)
        if best is None or found.residual < best.residual or good:
            best = found
        if good:
            solution = _closed(system, found, evaluations, why)
            if branchless:
                return solution
            message = f"{why}; another branch reaches the pose: give a guess on it"
            return replace(solution, converged=False, message=message, ending=Ending.OTHER_BRANCH)
    assert best is not None
    where = "the joint limits, with a mirrored joint or with the tip reversed"
    return _failed(system, best, why, evaluations, where)


def not_closed(system: System, start: np.ndarray, why: str, evaluations: int) -> Solution:
    """Closest posture that descent from a start finds, and what is wrong with it."""
    found = descend(system, start)
    return _failed(system, found, why, evaluations + found.evaluations, "that singularity")


def _proper(mechanism: Mechanism, q: np.ndarray, goals: tuple[Goal, ...]) -> bool:
    """No joint beyond its limits, no mirrored closure, no goal met backwards."""
    return not (
        beyond_limits(mechanism, q)
        or flipped_axes(mechanism, q)
        or any(faces_away(mechanism, q, g) for g in goals)
    )


def _closed(system: System, found: Descent, evaluations: int, why: str) -> Solution:
    return Solution(
        q=found.q,
        residual=found.residual,
        converged=found.residual < CLOSED,
        iterations=evaluations,
        message=f"closed to {found.residual:.1e} by descent; {why}",
        jacobian=lambda q: system.evaluate(q)[1],
    )


def _failed(system: System, found: Descent, why: str, evaluations: int, where: str) -> Solution:
    mechanism = system.mechanism
    loops = found.values[: mechanism.rows]
    if found.closed:
        message = f"{why}; the loops close there only beyond {where}"
    elif loops.size and np.abs(loops).max() >= CLOSED:
        message = f"{why}; out of reach: {open_closure(mechanism, loops)}"
    else:
        message = f"{why}; out of reach: the tip stays off by {found.residual:.3g}"
    beyond = beyond_limits(mechanism, found.q)
    return Solution(
        q=found.q,
        residual=found.residual,
        converged=False,
        iterations=evaluations,
        message=message + limit_note(beyond),
        beyond_limits=beyond,
        ending=Ending.SINGULARITY if found.closed else Ending.OPEN,
        jacobian=lambda q: system.evaluate(q)[1],
    )
