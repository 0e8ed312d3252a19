"""Places: complex values of what is prescribed, and random ones.

Their size matters. Where lengths that are prescribed are small beside those of the mechanism, loops
of them go round next to nothing; so sizes are spread over orders of magnitude.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.complex_equations import normalised
from closedchain.closure.solve.problem import Problem

SPREAD = 0.7  # of the logarithm of sizes
HIGH = 0.3  # imaginary parts of angles and of quaternions


@dataclass(frozen=True, eq=False)
class Place:
    """What is prescribed of a block of equations, for one path or for each.

    Attributes
    ----------
    targets : (prescribed,) or (n, prescribed) complex array
    given : (nq,) or (n, nq) complex array
        Postures whose coordinates outside of the block are prescribed.
    """

    targets: np.ndarray
    given: np.ndarray

    def take(self, which: np.ndarray) -> Place:
        """Place of some of the paths."""
        one, two = self.targets, self.given
        return replace(
            self,
            targets=one if one.ndim == 1 else one[which],
            given=two if two.ndim == 1 else two[which],
        )

    @staticmethod
    def stacked(places: Sequence[Place], count: int) -> Place:
        """Places of single paths, each for ``count`` paths, one place after the other."""
        targets, given = (
            np.repeat(np.array([getattr(p, name) for p in places]), count, axis=0)
            for name in ("targets", "given")
        )
        return Place(targets, given)


def random_postures(
    mechanism: Mechanism, rng: np.random.Generator, count: int, wide: float = 1.0
) -> np.ndarray:
    """Complex postures (count, nq), angles all around, lengths ``wide`` characteristic ones."""
    m, model = mechanism, mechanism.model
    size = wide * m.length * np.exp(SPREAD * rng.standard_normal(count))
    high = HIGH * 1j * np.exp(SPREAD * rng.standard_normal(count))
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


def random_place(problem: Problem, rng: np.random.Generator, wide: float = 1.0) -> Place:
    """Random complex place with lengths of about ``wide`` characteristic ones."""
    m = problem.mechanism
    given = random_postures(m, rng, 1, wide)[0]
    poses = []
    for _ in problem.goals:
        turn = normalised(rng.standard_normal((1, 4)) + HIGH * 1j * rng.standard_normal((1, 4)))[0]
        size = wide * m.length * np.exp(SPREAD * rng.standard_normal())
        poses += [*(size * _normal(rng, 3)), *turn]
    targets = np.concatenate([given[problem.pinned_q], np.array(poses, dtype=complex)])
    return Place(targets, given)


def _normal(rng: np.random.Generator, size: int | tuple[int, ...]) -> np.ndarray:
    return np.asarray(rng.standard_normal(size) + 1j * rng.standard_normal(size))
