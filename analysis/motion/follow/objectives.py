"""What the freedoms beyond a task are used for: measures of a posture, and their slopes.

A measure is the smallest of several smooth numbers; larger is better. Steps climb a smooth stand-in
of it (a weighted mean that leans towards the smallest), whole paths raise the smallest itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.motion.follow.postures import Posture
from closedchain.analysis.motion.follow.problem import Problem
from closedchain.urdf.errors import ClosureError, known_names

OBJECTIVES = ("singularity", "range", "speed")
Measure = str | Callable[[np.ndarray], float]
_SHARP = 100.0  # how fast the weight of a number falls with its distance from the smallest
_STEP = 1e-5


class Objective(ABC):
    """A measure of a posture."""

    name: str

    @abstractmethod
    def numbers(self, problem: Problem, at: Posture) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (w,) whose smallest is the measure, and their slopes (w, k) along the basis."""

    def value(self, problem: Problem, at: Posture) -> float:
        """Measure of a posture."""
        return float(self.numbers(problem, at)[0].min())

    def ascent(self, problem: Problem, at: Posture) -> np.ndarray:
        """Direction (k,) in which the smooth measure grows, as long as its slope."""
        values, slopes = self.numbers(problem, at)
        weights = np.exp(-_SHARP * (values - values.min()))
        return np.asarray(weights @ slopes / weights.sum())


@dataclass(frozen=True)
class SingularityDistance(Objective):
    """The smaller one of sigma_direct and of sigma_inverse with the locked inputs at rest."""

    name: str = "singularity"

    def numbers(self, problem: Problem, at: Posture) -> tuple[np.ndarray, np.ndarray]:
        """Singular values of the posture."""
        return at.values, at.slopes


@dataclass(frozen=True)
class RangeMargin(Objective):
    """Distance of the inputs from their limits: 1 in the middle of the range, 0 at a limit."""

    name: str = "range"

    def numbers(self, problem: Problem, at: Posture) -> tuple[np.ndarray, np.ndarray]:
        """Margins to both limits of each input that has two and moves."""
        bounds, m = problem.bounds, problem.mechanism
        driven = set(m.input_q.tolist())
        use = np.array(
            [
                i
                for i in range(bounds.in_q.size)
                if bounds.in_q[i] in driven
                and np.isfinite([bounds.lower[i], bounds.upper[i]]).all()
                and bounds.in_v[i] in problem.free
            ],
            dtype=int,
        )
        if not use.size:
            raise ClosureError('objective "range" needs inputs with two limits: give limits=')
        half = 0.5 * (bounds.upper[use] - bounds.lower[use])
        x = at.q[bounds.in_q[use]]
        rows = joint_rows(problem, bounds.in_v[use], at.basis) / half[:, None]
        values = np.concatenate([(x - bounds.lower[use]) / half, (bounds.upper[use] - x) / half])
        return values, np.concatenate([rows, -rows])


@dataclass(frozen=True)
class InputSpeed(Objective):
    """Speed of the inputs (dimensionless, negative): a property of a motion, not of a posture."""

    name: str = "speed"

    def numbers(self, problem: Problem, at: Posture) -> tuple[np.ndarray, np.ndarray]:
        """Nothing: speeds are seen to by the stepping and by the whole path."""
        return np.zeros(1), np.zeros((1, at.basis.shape[1]))


@dataclass(frozen=True)
class Given(Objective):
    """A function of the configuration, with slopes by central differences."""

    function: Callable[[np.ndarray], float]
    name: str = "given"

    def numbers(self, problem: Problem, at: Posture) -> tuple[np.ndarray, np.ndarray]:
        """The function and its slopes."""
        slopes = []
        for motion in at.basis.T:
            ends = [self._at(problem.moved(at.q, h * motion)) for h in (_STEP, -_STEP)]
            slopes.append((ends[0] - ends[1]) / (2.0 * _STEP))
        return np.array([self._at(at.q)]), np.array(slopes).reshape(1, -1)

    def _at(self, q: np.ndarray) -> float:
        value = float(self.function(q))
        if not np.isfinite(value):
            raise ClosureError(f"the objective gave {value!r}; it must be finite")
        return value


def objective_of(objective: Measure) -> Objective:
    """Objective by name, or of a function. Raises ``ClosureError`` for unknown names."""
    if callable(objective):
        return Given(objective, getattr(objective, "__name__", "given"))
    known: dict[str, Objective] = {
        "singularity": SingularityDistance(),
        "range": RangeMargin(),
        "speed": InputSpeed(),
    }
    if objective not in known:
        raise ClosureError(
            f"{known_names(str(objective), 'objective', OBJECTIVES)}; or a function of q"
        )
    return known[objective]


def joint_rows(problem: Problem, columns: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Rates (len(columns), k) [m or rad] of joints, by columns of v, along a basis (free, k)."""
    every = np.zeros((problem.mechanism.model.nv, basis.shape[1]))
    every[problem.free] = basis * problem.unit[:, None]
    return np.asarray(every[columns])
