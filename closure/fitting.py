"""Points as near as the loops allow: constrained least squares on the closed postures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from closedchain.closure.equations import Equations
from closedchain.closure.ranks import null_space
from closedchain.closure.solve.descend import Descent, descend

MET = 1e-9  # misfit that is none
LOOK = 1e-5  # dimensionless: how far away the slope of the misfit's gradient is taken
FLAT = 1e-7  # share of the largest curvature below which a direction has none
LONGEST = 0.3  # dimensionless
ROUNDING = 1e-10  # of steps and gradients
NEWTON_STEPS = 40


@dataclass(frozen=True, eq=False)
class Fit:
    """A posture on the closed ones, what its points still miss, and that by motions.

    Attributes
    ----------
    soft : (rows,) array
        Dimensionless misfits, with their Jacobian (rows, free).
    """

    found: Descent
    soft: np.ndarray
    jacobian: np.ndarray

    @property
    def size(self) -> float:
        """Root of the sum of squares."""
        return float(np.linalg.norm(self.soft))


def fit(equations: Equations, start: Descent, n_points: int) -> Descent:
    """Close loops and placed bodies exactly, and bring the last ``n_points`` goals as near.

    Gauss and Newton's steps first; then Newton's, which settle where points stay off, and which
    leave a misfit that is stationary without being least, as of a point just behind a stretched
    arm.
    """
    hard = replace(equations, goals=equations.goals[: len(equations.goals) - n_points])
    found = descend(hard, start.q)
    count = start.evaluations + found.evaluations
    if found.closed:
        problem = _Fitting(equations, hard)
        best = problem.least(problem.settled(problem.misfit(found)))
        found, count = best.found, count + problem.evaluations
    return replace(found, evaluations=count)


class _Fitting:
    """The misfit on the closed postures; counts evaluations."""

    def __init__(self, equations: Equations, hard: Equations) -> None:
        self._all, self._hard = equations, hard
        self.evaluations = 0

    def misfit(self, found: Descent) -> Fit:
        rows = found.values.size
        values, matrix = self._all.evaluate(found.q)
        return Fit(found, values[rows:] / self._all.row_scale[rows:], matrix[rows:])

    def moved(self, at: Fit, step: np.ndarray) -> Fit:
        """Closed posture after a step (free,) along the closed motions."""
        found = descend(self._hard, self._all.move(at.found.q, step))
        self.evaluations += found.evaluations
        return self.misfit(found)

    def settled(self, best: Fit) -> Fit:
        """Gauss and Newton's steps while they lower the misfit."""
        share = 1.0
        for _ in range(200):
            basis, _ = null_space(best.found.system)
            if not basis.shape[1]:
                break
            along = np.linalg.lstsq(best.jacobian @ basis, -best.soft, rcond=1e-9)[0]
            if np.linalg.norm(along) < ROUNDING or share < 1e-6:
                break
            length = min(share, 0.5 / float(np.linalg.norm(along)))
            there = self.moved(best, length * (basis @ along))
            if there.found.closed and there.size < best.size:
                best, share = there, min(1.0, 2.0 * share)
            else:
                share *= 0.5
        return best

    def least(self, best: Fit) -> Fit:
        """Newton's steps, downwards along every direction, until nothing near is lower."""
        for _ in range(NEWTON_STEPS):
            basis, _ = null_space(best.found.system)
            if best.size < MET or not basis.shape[1]:
                break
            for step in self._steps(best, basis):
                there = self.moved(best, step)
                if there.found.closed and there.size < best.size:
                    best = there
                    break
            else:
                break
        return best

    def _steps(self, best: Fit, basis: np.ndarray) -> Iterator[np.ndarray]:
        """Steps to be tried, long ones first."""
        here = self._gradient(best, basis)
        columns = [
            (self._gradient(self.moved(best, LOOK * along), basis) - here) / LOOK
            for along in basis.T
        ]
        curvatures, axes = np.linalg.eigh(0.5 * (np.array(columns) + np.array(columns).T))
        curved = np.abs(curvatures) > FLAT * np.abs(curvatures).max(initial=1e-300)
        sizes = np.where(curved, np.abs(curvatures), 1.0)
        downhill = -axes @ ((axes.T @ here) / sizes)
        tries = [downhill] if np.linalg.norm(downhill) > ROUNDING else []
        if curvatures[0] < -FLAT and np.linalg.norm(here) < 1e-6:
            tries += [LONGEST * axes[:, 0], -LONGEST * axes[:, 0]]
        for along in tries:
            length = float(np.linalg.norm(along))
            step = basis @ along * min(1.0, LONGEST / length)
            for halvings in range(12):
                yield step * 0.5**halvings

    def _gradient(self, at: Fit, basis: np.ndarray) -> np.ndarray:
        """Slope of half the squared misfit along the closed motions nearest to a basis there."""
        motions, _ = null_space(at.found.system)
        if motions.shape != basis.shape:
            return np.zeros(basis.shape[1])
        along = np.linalg.lstsq((basis.T @ motions).T, (at.jacobian @ motions).T @ at.soft)[0]
        return np.asarray(along)
