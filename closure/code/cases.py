"""Numbers that a program must find again: requests and answers of ``direct`` and ``inverse``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.code.program import Program
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import Follower, follower_of
from closedchain.closure.solve.problem import Problem

MOST = 4  # of each problem


@dataclass(frozen=True, eq=False)
class Case:
    """A problem by its name, what is given (inputs, or a pose), a guess and the posture (nq,)."""

    way: str
    given: np.ndarray
    guess: np.ndarray
    q: np.ndarray


def cases_of(program: Program) -> list[Case]:
    """Ways from a regular posture to a third of the way to others, those that arrive."""
    found: list[Case] = []
    for way, tapes in program.ways:
        exact = follower_of(tapes.problem)
        samples = by_conditioning(tapes.problem)
        known = (_case(way, exact, guess, guess) for guess in samples)
        start = next((case for case in known if case is not None), None)
        if start is not None:
            some = [_case(way, exact, start.guess, there) for there in samples]
            found += [case for case in some if case is not None][:MOST]
    return found


def by_conditioning(problem: Problem) -> np.ndarray:
    """Samples (n, nq) of a problem, the one whose Jacobian is furthest from losing rank first."""
    values = np.linalg.svd(problem.sampled_jacobians, compute_uv=False)
    rank = len(problem.kept)
    if rank == 0:
        return problem.samples
    shares = values[:, rank - 1] / np.maximum(values[:, 0], 1e-300)
    return np.asarray(problem.samples[np.argsort(-shares, kind="stable")])


def _case(way: str, follower: Follower, guess: np.ndarray, there: np.ndarray) -> Case | None:
    """One case, or none where the way does not arrive."""
    begin, end = follower.place.run(np.stack([guess, there], axis=1)).T
    given = begin + (end - begin) / 3.0
    if way == "inverse":
        given[3:] /= np.linalg.norm(given[3:])
    one = follower.alone(guess, None, given)
    good = one.code == Ending.ARRIVED.code and one.residual < CLOSED
    good = good and one.sense >= 0.0 and one.facing >= 0.0
    return Case(way, given, guess, one.q) if good else None
