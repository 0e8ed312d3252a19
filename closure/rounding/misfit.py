"""What redundant rows miss by the numbers as printed, with the kept rows closed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.closure.equations import Equations
from closedchain.closure.ranks import Rank, independent_rows
from closedchain.closure.rounding.refit import Spot
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.newton import largest

_CLEAR = 0.1  # share of their size that singular values of the kept rows have where these are clear


@dataclass(frozen=True)
class Misfit:
    """Rows of some equations that are kept, their rank, and what the others miss [m, rad]."""

    kept: tuple[int, ...]
    rank: Rank
    missed: float


def misfit(equations: Equations, spots: Sequence[Spot]) -> Misfit:
    """What is missed at postures along the motions, the first of them beside home.

    Postures at which the kept rows are much less independent than all rows tell of the choice, not
    of the numbers, and are left out.
    """
    rank = spots[0].rank
    jacobians = np.array([equations.evaluate(spot.q)[1] for spot in spots])
    kept = independent_rows(jacobians, rank)
    others = [row for row in range(jacobians.shape[1]) if row not in kept]
    missed, above, below = 0.0, np.inf, 0.0
    for spot, jacobian in zip(spots, jacobians, strict=True):
        least = np.linalg.svd(jacobian[list(kept)], compute_uv=False)[-1] if rank else np.inf
        values = _kept_closed(equations, spot.q, kept)
        if values is not None and (spot is spots[0] or least > _CLEAR * spot.values[rank - 1]):
            missed = max(missed, largest(values[others]))
        above = min(above, float(spot.values[rank - 1]) if rank else np.inf)
        below = max(below, float(spot.values[rank]) if rank < spot.values.size else 0.0)
    return Misfit(kept, Rank(rank, above if rank else 0.0, below), missed)


def _kept_closed(equations: Equations, q: np.ndarray, kept: Sequence[int]) -> np.ndarray | None:
    """Rows (rows,) [m, rad] with the kept ones closed, by Newton steps of least length from q."""
    rows = list(kept)
    for _ in range(20):
        values, matrix = equations.evaluate(q)
        if largest(values[rows]) < 1e-13:
            return values
        scaled = values[rows] / equations.row_scale[rows]
        q = equations.move(q, -np.linalg.lstsq(matrix[rows], scaled, rcond=None)[0])
    return values if largest(values[rows]) < CLOSED else None
