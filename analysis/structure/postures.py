"""Closed postures on one motion component: reached from one another by short closed strides."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.closure.constraints import flipped_axes
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.ranks import Rank, null_space
from closedchain.closure.solve.descend import descend
from closedchain.closure.solve.system import System
from closedchain.urdf.errors import ClosureError

STRIDE = 0.2  # largest entry of a stride in the tangent space, lengths over ``length``
STRIDES = 3  # from one posture to the next
TRIES = 12


def wander(
    mechanism: Mechanism, count: int, start: ArrayLike | None = None, seed: int = 0
) -> list[np.ndarray]:
    """Walk from ``start`` (nq,), home by default, and keep ``count`` closed postures (nq,).

    Each stride follows the null space of K and closes the loops again; it is taken only if the
    correction is short against it, so that all postures belong to one motion. The start itself,
    often a special posture, is kept only where nothing can move.

    Raises
    ------
    ClosureError
        ``start`` is malformed or open, or no stride leads away from it.
    """
    rng = np.random.default_rng(seed)
    q = mechanism.configuration(mechanism.home if start is None else start)
    basis, _ = tangent(mechanism, q)
    if basis.shape[1] == 0:
        return [q]
    inside = not beyond_limits(mechanism, q)
    found: list[np.ndarray] = []
    while len(found) < count:
        heading = rng.standard_normal(mechanism.model.nv)
        for _ in range(STRIDES):
            taken = _stride(mechanism, q, heading, inside, rng)
            if taken is None:
                raise ClosureError(
                    f"{mechanism.name}: no motion leads on from a posture near the start; "
                    "give another one, away from singularities and joint limits"
                )
            q, heading = taken
        found.append(q)
    return found


def tangent(mechanism: Mechanism, q: np.ndarray) -> tuple[np.ndarray, Rank]:
    """Orthonormal dimensionless motions (nv, k) that keep the loops closed, and rank of K."""
    return null_space(first_order(mechanism, q, task=False).K)


def _stride(
    mechanism: Mechanism,
    q: np.ndarray,
    heading: np.ndarray,
    inside: bool,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray] | None:
    """One stride as nearly along ``heading`` as the loops allow; elsewhere where it fails."""
    model, scale = mechanism.model, mechanism.column_scale
    basis, _ = tangent(mechanism, q)
    equations = System(mechanism, np.arange(model.nv))
    length = STRIDE
    for attempt in range(TRIES):
        along = basis @ (basis.T @ heading)
        along *= length / np.abs(along).max()
        guess = pin.integrate(model, q, along * scale)
        found = descend(equations, guess)
        correction = pin.difference(model, guess, found.q) / scale
        if (
            found.closed
            and np.abs(correction).max() < 0.5 * length
            and not (inside and beyond_limits(mechanism, found.q))
            and not flipped_axes(mechanism, found.q)
        ):
            return found.q, heading
        heading = rng.standard_normal(model.nv)
        length = STRIDE * 0.5 ** (attempt / 2)
    return None
