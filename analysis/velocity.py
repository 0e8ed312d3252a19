"""The velocity equation Jx V = Jq qdot_a, from the left null space of the passive columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.singularity.deciding import Deciding
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank, decomposed

_IDLE = 1e-9  # dimensionless rate below which the tip, or a loop, counts as at rest


@dataclass(frozen=True, eq=False)
class Velocity:
    """Velocity equation of a mechanism at a posture.

    Attributes
    ----------
    Jx : (k, d) array
        Factor of the output rates V, in the order of ``outputs`` [V in m/s, rad/s].
    Jq : (k, n_inputs) array
        Factor of the input rates.
    twist_map : (d, n_inputs) array or None
        V = twist_map @ qdot_a; None where the inputs do not determine the tip's motion. Idle
        freedoms, such as the spin of a rod between two spherical joints, do no harm. With more
        inputs than freedoms it holds for the input rates that the loops allow, and for no others.
    outputs : tuple of str
    rank : Rank
        Of the dimensionless passive columns K_p: why there is a twist map, or none.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> found = cc.velocity(m, m.home)
    >>> found.outputs, found.Jx.shape, found.Jq.shape
    (('x', 'y', 'z'), (3, 3), (3, 3))
    """

    Jx: np.ndarray
    Jq: np.ndarray
    twist_map: np.ndarray | None
    outputs: tuple[str, ...]
    rank: Rank


def velocity(
    mechanism: Mechanism,
    q: ArrayLike,
    outputs: str | tuple[str, ...] | list[str] | None = None,
) -> Velocity:
    """Relate the rates of outputs and inputs at a closed posture.

    With W = [W_K; W_J] spanning the left null space of [K_p; J_p], less what K_p alone leaves
    undetermined: Jx = W_J^T and Jq = W_J^T J_a + W_K^T K_a, since W_K^T (K_a qdot_a + K_p qdot_p) =
    0 and W_J^T (J_a qdot_a + J_p qdot_p - V) = 0 add up to it. The rows are orthonormal in
    dimensionless form; any regular combination of them says the same.

    Parameters
    ----------
    q : (nq,) array
    outputs : str, optional
        "x y z rx ry rz" or some of them; those of the task by default. V = (x y z) is the velocity
        of the tip's origin; rotations as ``TaskFrame`` says.

    Raises
    ------
    ClosureError
        Malformed or open posture, unknown outputs, no task.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> T = cc.velocity(m, m.home).twist_map
    >>> print((T @ [0.1, 0.1, 0.1]).round(6) + 0.0)  # all sliders up at 0.1 m/s: so is the tip
    [0.  0.  0.1]
    """
    return velocity_at(Deciding(first_order(mechanism, q, outputs)))


def velocity_at(decided: Deciding) -> Velocity:
    """Relate the rates at a posture whose ranks are decided, see ``velocity``."""
    at, mechanism = decided.at, decided.at.mechanism
    a, p = mechanism.input_v, mechanism.passive_v
    rows = at.K.shape[0]
    # rows that combine closures only, W_J = 0, hold identically and are left out
    idle = decided.factors.left_kernel(rows - decided.closures.rank.value)
    idle = np.vstack([idle, np.zeros((at.J.shape[0], idle.shape[1]))])
    count = rows + at.J.shape[0] - idle.shape[1] - p.size + decided.unseen
    left = decomposed(np.vstack([at.stacked[:, p].T, idle.T])).kernel(count)
    w_closures, w_outputs = left[:rows].T, left[rows:].T
    jx = w_outputs / at.output_unit
    jq = (w_outputs @ at.J[:, a] + w_closures @ at.K[:, a]) / at.column_unit[a]
    rank, factors = decided.locked.rank, decided.passive_factors
    passive = factors.solve(-at.K[:, a], rank.value)
    free = factors.kernel(p.size - rank.value)
    # idle motions, such as a rod's spin between its two spherical joints, leave the tip at rest
    moved = np.abs(at.J[:, p] @ free).max(initial=0.0)
    missed = np.abs(at.K_passive @ passive + at.K[:, a]).max(initial=0.0)
    twist_map = None
    if not free.shape[1] or (moved < _IDLE and missed < _IDLE):
        dimensionless = at.J[:, a] + at.J[:, p] @ passive
        twist_map = dimensionless * at.output_unit[:, None] / at.column_unit[a]
    return Velocity(jx, jq, twist_map, at.outputs, rank)
