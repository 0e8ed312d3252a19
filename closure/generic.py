"""The generic rank of the closure rows, from postures around home."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import close
from closedchain.closure.ranks import Rank, numerical_rank

SAMPLES = 8
SPREAD = 0.15  # dimensionless standard deviation of the guesses around home


@dataclass(frozen=True)
class GenericRank:
    """Rank of the dimensionless constraint Jacobian on closed postures.

    Attributes
    ----------
    rank : Rank
        The largest, at the posture where its gap was smallest.
    at_home : int
    samples : int
        Postures looked at, home included.
    """

    rank: Rank
    at_home: int
    samples: int


_FOUND: WeakKeyDictionary[Mechanism, GenericRank] = WeakKeyDictionary()


def sampled_rank(mechanism: Mechanism) -> GenericRank:
    """Generic rank of a mechanism, found once."""
    if mechanism not in _FOUND:
        _FOUND[mechanism] = _sample(mechanism)
    return _FOUND[mechanism]


def dimensionless_jacobian(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """K (rows, nv) with lengths divided by the characteristic length, at ``q`` (nq,), unchecked."""
    jacobian = np.array(mechanism.workspace.evaluate(q)[1])
    return jacobian * mechanism.column_scale / mechanism.row_scale[:, None]


def _sample(mechanism: Mechanism) -> GenericRank:
    """Largest rank over home and random closed postures near it: rank can only drop elsewhere."""
    rng = np.random.default_rng(0)
    home = numerical_rank(dimensionless_jacobian(mechanism, mechanism.home))
    ranks = [home]
    for _ in range(SAMPLES):
        v = SPREAD * rng.standard_normal(mechanism.model.nv) * mechanism.column_scale
        found = close(mechanism, guess=pin.integrate(mechanism.model, mechanism.home, v))
        if found.converged:
            ranks.append(numerical_rank(dimensionless_jacobian(mechanism, found.q)))
    best = max(rank.value for rank in ranks)
    narrow = min((rank for rank in ranks if rank.value == best), key=lambda rank: rank.gap)
    return GenericRank(narrow, home.value, len(ranks))
