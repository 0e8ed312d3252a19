"""Direct singularities on a curve of closed postures.

A curve of postures goes smoothly through them: a determinant of K_p changes sign there, or the
singular value that vanishes dips to zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.analysis.first_order import first_order
from closedchain.analysis.motion.self_motion.held_task import HeldTask
from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.events import Event
from closedchain.closure.solve.solution_set import settle


@dataclass(frozen=True, eq=False)
class Passive:
    """K_p of a posture, seen for its singularity.

    Attributes
    ----------
    matrix : (rows, n_p) array
        Dimensionless.
    left : (rows, r) array
        Basis of its columns where it is square but for redundant rows, else no column.
    size, largest : float
        The singular value that vanishes at direct singularities, and the largest one.
    """

    matrix: np.ndarray
    left: np.ndarray
    size: float
    largest: float

    @classmethod
    def of(cls, mechanism: Mechanism, q: np.ndarray) -> Passive:
        """Look at a closed posture (nq,)."""
        at = first_order(mechanism, q, task=False)
        r, n = generic_rank(mechanism), mechanism.passive_v.size
        none = np.zeros((len(at.K), 0))
        if min(r, n) == 0:
            return cls(at.K_passive, none, 1.0, 1.0)
        u, s, _ = np.linalg.svd(at.K_passive)
        sigma = float(s[min(r, n) - 1]) if min(r, n) <= s.size else 0.0
        return cls(at.K_passive, u[:, :r] if r == n else none, sigma, float(s[0]))

    @property
    def vanished(self) -> bool:
        """Whether the posture is a direct singularity."""
        return self.size <= SINGULAR * self.largest

    def parted_from(self, other: Passive) -> float:
        """Sign of det(U^T K_p) there times that here, U from here; 0 where there is none."""
        if not self.left.shape[1]:
            return 0.0
        signs = [np.linalg.slogdet(self.left.T @ p.matrix)[0] for p in (self, other)]
        return float(signs[0] * signs[1])


def direct_singularity(system: HeldTask) -> Event:
    """The event of meeting a direct singularity on a curve of closed postures."""

    def place(one: np.ndarray, two: np.ndarray, share: float) -> np.ndarray:
        guess = system.move(one, share * system.difference(one, two))
        settled = settle(system, guess)
        return system.polished(settled.posture if settled.good else guess)

    return Event(lambda z: Passive.of(system.mechanism, z), place)
