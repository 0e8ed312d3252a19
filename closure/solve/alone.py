"""Following one branch with all rows, by LAPACK: where no fixed choice of pivots suits it.

The machine code of a problem eliminates chosen rows in a fixed order. Where a pivot vanishes though
the Jacobian as a whole keeps its rank, nothing is singular but that choice.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.closure.solve.continuation import follow
from closedchain.closure.solve.control import LONGEST, MOST
from closedchain.closure.solve.newton import correct
from closedchain.closure.solve.problem import POSE, Problem
from closedchain.closure.solve.system import System
from closedchain.closure.task import goal
from closedchain.urdf.description import OUTPUTS

HEALTHY = 1e-2
"""Share of the largest singular value at which a Jacobian is well away from losing rank."""


def healthy(problem: Problem, q: np.ndarray) -> bool:
    """Whether the Jacobian of all rows is well away from losing rank at a posture (nq,)."""
    return least_share(problem, q) > HEALTHY


def least_share(problem: Problem, q: np.ndarray) -> float:
    """Least singular value of the Jacobian of all rows at ``q`` (nq,), as a share of the largest.

    Of those that count for the rank; 1 where there are no rows.
    """
    s = np.linalg.svd(problem.jacobian_at(q), compute_uv=False)
    rank = len(problem.kept)
    return float(s[rank - 1] / s[0]) if rank and s[0] > 0.0 else float(rank == 0)


@dataclass(frozen=True, eq=False)
class _Between:
    """The equations at shares of the way between two targets (prescribed,)."""

    problem: Problem
    begin: np.ndarray
    end: np.ndarray

    @cached_property
    def turns(self) -> list[slice]:
        """Where targets hold quaternions."""
        p = len(self.problem.pinned)
        return [slice(p + POSE * i + 3, p + POSE * (i + 1)) for i in range(len(self.problem.goals))]

    def __call__(self, q: np.ndarray, share: float) -> tuple[System, np.ndarray]:
        """System there, and a posture (nq,) with the pinned joints moved there."""
        problem, p = self.problem, len(self.problem.pinned)
        end = self.end.copy()
        for at in self.turns:
            end[at] *= -1.0 if self.begin[at] @ end[at] < 0.0 else 1.0
        target = end if share == 1.0 else self.begin + share * (end - self.begin)
        for at in self.turns:
            target[at] /= np.linalg.norm(target[at])
        goals = tuple(
            goal(
                problem.mechanism,
                frame,
                pin.XYZQUATToSE3(target[p + POSE * i : p + POSE * (i + 1)]),
                [OUTPUTS[k] for k in outputs],
            )
            for i, (frame, outputs) in enumerate(problem.goals)
        )
        moved = q.copy()
        moved[problem.pinned_q] = target[:p]
        return System(problem.mechanism, np.array(problem.free, dtype=int), goals), moved

    @property
    def travel(self) -> float:
        """Dimensionless length of the way."""
        m, p = self.problem.mechanism, len(self.problem.pinned)
        gap = np.abs(self.end - self.begin)
        travel = float((gap[:p] / m.column_scale[list(self.problem.pinned)]).max(initial=0.0))
        for at in self.turns:
            shift = float(np.linalg.norm(gap[at.start - 3 : at.start])) / m.length
            turn = min(
                float(np.linalg.norm(self.end[at] - side * self.begin[at])) for side in (-1.0, 1.0)
            )
            travel = max(travel, shift + 2.0 * turn)
        return travel


def close_alone(problem: Problem, q: np.ndarray, target: np.ndarray) -> np.ndarray | None:
    """Posture beside one (nq,) that is closed at a target (prescribed,), or None."""
    found = correct(*_Between(problem, target, target)(q, 1.0))
    return found.q if found.refusal is None else None


def system_at(problem: Problem, target: np.ndarray, q: np.ndarray) -> tuple[System, np.ndarray]:
    """Equations at a target (prescribed,); a posture (nq,) with what is pinned moved there."""
    return _Between(problem, target, target)(q, 1.0)


def follow_alone(
    problem: Problem, q: np.ndarray, begin: np.ndarray, end: np.ndarray, smallest: float
) -> tuple[np.ndarray, float]:
    """Follow the branch of a posture (nq,) from one target to another (prescribed,).

    Returns the last good posture and the share of the way that was gone, 1 where it arrived.
    """
    there = _Between(problem, begin, end)
    start = correct(*there(q, 0.0))
    if start.refusal is not None:
        return q, 0.0
    longest = min(1.0, max(LONGEST / max(there.travel, 1e-300), 1.0 / MOST))
    way = follow(there, start, smallest, longest, careful=True)
    return way.last.q, way.reached
