"""Hessians: how tip accelerations depend on products of input rates, from Lie products of screws.

[Zenebe2013]_ derives them for the linear Delta, eqs (27)-(32): a limb's Hessian has the Lie bracket
of joint twists j and k at (j, k). Here both orders share it, so that every layer is symmetric.
The diagonal is zero as long as each joint's screw stands still in the body before it. It is not for
a parallelogram taken for one joint along a curved path; its centripetal term, which the source
leaves out, comes by itself where the parallelogram is four joints and one more circuit.

[Zenebe2013]_ K. Z. Zenebe, Formulation of a generalized Jacobian and inverse acceleration analysis
of a linear Delta manipulator based on reciprocal screws method, 2013.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.screws import shifted
from closedchain.analysis.screws.accelerators import lie_form
from closedchain.analysis.screws.chains import circuits
from closedchain.closure.given import finite_vector
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank
from closedchain.urdf.errors import ClosureError


@dataclass(frozen=True, eq=False)
class Hessian:
    """Second-order input-output map of a frame: acceleration = T a + v^T H v.

    With more inputs than freedoms it holds for input rates v and accelerations a that the loops
    allow, and for no others.

    Attributes
    ----------
    frame : str
    T : (6, n_inputs) array
        Twist of the frame per unit input rate, (linear, angular), world axes, at its origin.
    H : (6, n_inputs, n_inputs) array
        Classical acceleration of the origin, and angular acceleration, per product of two input
        rates; symmetric in the last two axes.
    rank : Rank
        Of the circuits' conditions on the joints that are no inputs, dimensionless.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> h = cc.hessian(m, m.home)
    >>> h.T.shape, h.H.shape, h.frame
    ((6, 3), (6, 3, 3), 'P')
    """

    frame: str
    T: np.ndarray
    H: np.ndarray
    rank: Rank

    def acceleration(self, v_inputs: ArrayLike, a_inputs: ArrayLike) -> np.ndarray:
        """Acceleration (6,) for input rates and accelerations (n_inputs,) each, in order."""
        v, a = (finite_vector(x, self.T.shape[1], "inputs", "rates") for x in (v_inputs, a_inputs))
        return np.asarray(self.T @ a + np.einsum("cij,i,j->c", self.H, v, v))


def limb_hessian(screws: ArrayLike) -> np.ndarray:
    """Hessian (..., 6, n, n) of a serial limb, [Zenebe2013]_ eq. (29) made symmetric.

    The accelerator of the last body is S^T s' + s^T H s for rates s: H_jk = [$_j $_k] / 2 for
    j < k, the same at (k, j), and zero on the diagonal.

    Parameters
    ----------
    screws : (..., n, 6) array
        Joint screws in order from the base, (angular; linear at O).

    Raises
    ------
    ClosureError
        Not an array of screws.
    """
    of = np.asarray(screws, dtype=float)
    if of.ndim < 2 or of.shape[-1] != 6:
        raise ClosureError(f"the screws of a limb must have shape (..., n, 6), got {of.shape}")
    unit_motions = of[..., :, None, :] * np.eye(of.shape[-2])[:, :, None]  # (..., joint, motion, 6)
    return lie_form(np.moveaxis(unit_motions, -3, 0))


def hessian(mechanism: Mechanism, q: ArrayLike, frame: str | None = None) -> Hessian:
    """Twist map and Hessian of the tip, or of another link, in the inputs.

    Each unit input rate moves all joints; the Lie screw of a circuit or chain is a quadratic form
    in these motions, whose symmetric bilinear form is taken. The circuits' forms give the second
    rates of the passive joints, and the chain to the frame adds up what it passes.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    frame : str, optional
        Link or named point; the tip by default.

    Raises
    ------
    ClosureError
        Malformed or open posture, no task and no frame, an unknown frame, or inputs that do not
        determine the motion (a direct singularity, too few inputs).

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> v = np.array([0.1, 0.0, 0.0])
    >>> h, a = cc.hessian(m, m.home), cc.acceleration(m, m.home, v, [0.0, 0.0, 0.0])
    >>> bool(np.allclose(np.einsum("kij,i,j", h.H, v, v), a.tip_acceleration))
    True
    """
    name = mechanism.required_task().tip if frame is None else frame
    at = circuits(mechanism, q)
    n = at.inputs.size
    chain = at.chain(mechanism.description.root, name)
    rates, _ = at.solve(np.eye(n))
    forms = [lie_form(at.twists(walk, rates)) for walk in at.walks]
    bends = at.bends(rates).reshape(-1, n * n)
    second, _ = at.solve(np.zeros((n, n * n)), np.array(forms).reshape(-1, 6, n * n), bends)
    moving = at.twists(chain, rates)
    form = lie_form(moving)
    for p, sign in chain:
        form += sign * (at.screws[p].T @ second[at.columns[p]]).reshape(6, n, n)
    point = mechanism.point(at.q, name)
    twists = shifted(moving.sum(axis=0), point)
    spatial = shifted(np.moveaxis(form, 0, -1), point)
    turning = np.cross(twists[:, None, :3], twists[None, :, 3:])
    linear = spatial[..., 3:] + 0.5 * (turning + np.swapaxes(turning, 0, 1))
    symmetric = np.concatenate([linear, spatial[..., :3]], axis=-1)
    return Hessian(
        frame=name,
        T=np.concatenate([twists[:, 3:], twists[:, :3]], axis=-1).T,
        H=np.moveaxis(symmetric, -1, 0),
        rank=at.rank,
    )
