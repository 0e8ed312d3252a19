"""Direct singularities on a curve of closed postures.

A curve of postures goes smoothly through them. They are found where a determinant of K_p changes
sign between neighbours, and where the singular value that vanishes there dips to zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.analysis.first_order import first_order
from closedchain.analysis.motion.self_motion.held_task import HeldTask
from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.analysis.singularity.tracing.path import settle
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.mechanism import Mechanism

FINER = 17  # postures looked at where a singular value dips; odd, so that one is the middle


@dataclass(frozen=True, eq=False)
class Passive:
    """K_p of a posture, seen for its singularity.

    Attributes
    ----------
    matrix : (rows, n_p) array
        Dimensionless.
    left : (rows, r) array
        Basis of its columns where it is square but for redundant rows, else no column.
    sigma, largest : float
        The singular value that vanishes at direct singularities, and the largest one.
    """

    matrix: np.ndarray
    left: np.ndarray
    sigma: float
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
    def singular(self) -> bool:
        """Whether the posture is a direct singularity."""
        return self.sigma <= SINGULAR * self.largest

    def parted_from(self, other: Passive) -> float:
        """Sign of det(U^T K_p) there times that here, U from here; 0 where there is none."""
        if not self.left.shape[1]:
            return 0.0
        signs = [np.linalg.slogdet(self.left.T @ p.matrix)[0] for p in (self, other)]
        return float(signs[0] * signs[1])


def direct_singularities(
    system: HeldTask, points: Sequence[np.ndarray], *, closed: bool
) -> tuple[list[int], list[tuple[int, np.ndarray]]]:
    """Direct singularities on a curve.

    Parameters
    ----------
    points : sequence of (nq,) arrays
        Neighbours on the curve in order; the last and the first one are neighbours on a loop.

    Returns
    -------
    here : list of int
        Points that are singular themselves.
    between : list of (i, posture)
        Others, beyond point i and before the next one, in order.
    """
    seen = [Passive.of(system.mechanism, z) for z in points]
    here = [i for i, s in enumerate(seen) if s.singular]
    n = len(points)
    between: list[tuple[int, np.ndarray]] = []
    done: set[int] = set()
    for i in range(n if closed else n - 1):
        j = (i + 1) % n
        if seen[i].singular or seen[j].singular:
            done.add(i)
        elif seen[i].parted_from(seen[j]) < 0.0:
            z = _zero(system, points[i], points[j], seen[i])
            if _vanishes(system, z):
                between.append((i, z))
                done.add(i)
    for i in range(0 if closed else 1, n if closed else n - 1):
        before, after = (i - 1) % n, (i + 1) % n
        if done & {before, i}:
            continue
        sides = seen[before].sigma, seen[after].sigma
        # a zero beside the point shows in one of its neighbours by twice the value here
        if seen[i].sigma <= min(sides) and 2.0 * seen[i].sigma <= max(sides):
            zeros = _dip(system, points[before], points[i], points[after])
            between.extend((before if share < 1.0 else i, z) for share, z in zeros)
            done |= {before, i} if zeros else set()
    return here, sorted(between, key=lambda item: item[0])


def _vanishes(system: HeldTask, z: np.ndarray) -> bool:
    seen = Passive.of(system.mechanism, z)
    return seen.sigma <= 10.0 * SINGULAR * seen.largest


def _between(system: HeldTask, one: np.ndarray, two: np.ndarray, share: float) -> np.ndarray:
    """Point of the curve at about that share of the way between two neighbours."""
    guess = system.move(one, share * system.difference(one, two))
    settled = settle(system, guess)
    return system.polished(guess if settled is None else settled)


def _zero(system: HeldTask, one: np.ndarray, two: np.ndarray, begin: Passive) -> np.ndarray:
    from scipy.optimize import brentq

    def signed(share: float) -> float:
        seen = Passive.of(system.mechanism, _between(system, one, two, share))
        return begin.parted_from(seen) * seen.sigma

    share = brentq(signed, 0.0, 1.0, xtol=1e-15, rtol=1e-14)
    return _between(system, one, two, float(share))


def _dip(
    system: HeldTask, low: np.ndarray, middle: np.ndarray, high: np.ndarray
) -> list[tuple[float, np.ndarray]]:
    """Zeros on the way over three neighbours whose ends have the same sign, with shares (0 to 2).

    Two changes of sign near each other, or else one place where zero is touched.
    """
    from scipy.optimize import minimize_scalar

    def place(t: float) -> np.ndarray:
        if t < 1.0:
            return _between(system, low, middle, t)
        return _between(system, middle, high, t - 1.0)

    shares = np.linspace(0.0, 2.0, FINER)
    finer = [place(float(t)) for t in shares]
    seen = [Passive.of(system.mechanism, z) for z in finer]
    found = []
    for k in range(FINER - 1):
        if seen[k].parted_from(seen[k + 1]) < 0.0:
            z = _zero(system, finer[k], finer[k + 1], seen[k])
            found += [(float(shares[k]), z)] if _vanishes(system, z) else []
    if found:
        return found
    least = minimize_scalar(
        lambda t: Passive.of(system.mechanism, place(t)).sigma,
        bounds=(0.0, 2.0),
        method="bounded",
        options={"xatol": 1e-13},
    )
    z = place(float(least.x))
    return [(float(least.x), z)] if _vanishes(system, z) else []
