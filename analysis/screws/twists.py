"""Spaces of twists: their dimension, their independent rotations and translations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.ranks import RANK_TOLERANCE, Rank

ANGULAR_TOLERANCE = 1e-8
"""Angular parts below this share of a unit twist are none: they come from orthonormal bases, whose
directions are known less well than the matrices that they were taken from."""


@dataclass(frozen=True, eq=False)
class TwistSpace:
    """A space of dimensionless twists (linear over the characteristic length, angular).

    Attributes
    ----------
    basis : (6, k) array
        Orthonormal.
    rank : Rank
        Why the dimension is k.
    angular : Rank
        Of the angular parts of the basis: the number of independent rotations.
    """

    basis: np.ndarray
    rank: Rank
    angular: Rank

    @property
    def dimension(self) -> int:
        """Independent twists."""
        return self.basis.shape[1]

    @property
    def rotations(self) -> int:
        """Independent rotations: rank of the angular parts, whichever point is looked at."""
        return self.angular.value

    @property
    def translations(self) -> int:
        """Independent translations with the rotations at rest, whichever point is looked at."""
        return self.dimension - self.rotations

    @property
    def dimensions(self) -> tuple[int, int]:
        """Translations and rotations, the exponents of t and r."""
        return self.translations, self.rotations

    @cached_property
    def slides(self) -> np.ndarray:
        """Orthonormal directions (3, translations) of the pure translations."""
        _, _, vt = np.linalg.svd(self.basis[3:], full_matrices=True)
        return column_space(self.basis[:3] @ vt[self.rotations :].T, self.translations)

    @cached_property
    def spins(self) -> np.ndarray:
        """Orthonormal directions (3, rotations) of the angular velocities."""
        return column_space(self.basis[3:], self.rotations)


def rank_against(s: np.ndarray, size: float, tolerance: float) -> Rank:
    """Rank decision from singular values ``s`` in falling order, against a given ``size``."""
    value = int(np.count_nonzero(s > tolerance * size))
    return Rank(
        value,
        float(s[value - 1]) if value else 0.0,
        float(s[value]) if value < s.size else 0.0,
    )


def twist_space(twists: np.ndarray) -> TwistSpace:
    """Span of dimensionless twists (6, n), each of a motion or a screw of about unit size."""
    if twists.shape[1] == 0:
        return TwistSpace(np.zeros((6, 0)), Rank(0, 0.0, 0.0), Rank(0, 0.0, 0.0))
    u, s, _ = np.linalg.svd(twists, full_matrices=False)
    rank = rank_against(s, max(float(s[0]), 1.0), RANK_TOLERANCE)
    basis = u[:, : rank.value]
    values = np.linalg.svd(basis[3:], compute_uv=False) if rank.value else np.zeros(0)
    return TwistSpace(basis, rank, rank_against(values, 1.0, ANGULAR_TOLERANCE))


def column_space(matrix: np.ndarray, dimension: int) -> np.ndarray:
    """Orthonormal basis (rows, dimension) of the columns, by their largest singular values."""
    if dimension == 0:
        return np.zeros((matrix.shape[0], 0))
    return np.asarray(np.linalg.svd(matrix, full_matrices=False)[0][:, :dimension])


def symbol(dimensions: tuple[int, int]) -> str:
    """Write (translations, rotations) as t^i r^j."""
    return f"t^{dimensions[0]} r^{dimensions[1]}"
