"""Second-order kinematics by screws: accelerators, Lie screws, the loop condition of second order.

Screws are those of ``screws``: (angular; linear at O) in SI units, O the world's origin, along the
world's axes. The accelerator of a body is the time derivative of its twist at fixed O:
(alpha; a_O - omega x v_O). It is Pinocchio's spatial acceleration in another order, and not the
classical acceleration of a point.

[Gallardo2010]_ J. Gallardo-Alvarado, DeLiA: a new family of redundant robot manipulators, 2010,
sections 5.2 and 5.4.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.screws import from_motion, lie, screw, shifted, to_motion, transformed
from closedchain.analysis.screws.chains import Circuits, circuits
from closedchain.analysis.structure.graph import Walk
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

_CONSISTENT = 1e-9  # dimensionless rate by which given input rates may miss the loops' demands

# -- algebra -------------------------------------------------------------------------------------


def lie_screw(twists: ArrayLike) -> np.ndarray:
    """Lie screw (..., 6) of a chain, [Gallardo2010]_ eqs (17) and (33).

    Each joint's twist with the sum of those behind it, L = sum_j [w_j $_j  sum_(k>j) w_k $_k]; the
    comma that parts the two factors is lost in the second bracket of (17).

    Parameters
    ----------
    twists : (..., n, 6) array
        Twist of each joint's next body against the one before, rate times screw, in order.
    """
    moving = np.asarray(twists, dtype=float)
    return np.asarray(lie(moving, _behind(moving, -2)).sum(axis=-2))


def lie_form(twists: ArrayLike) -> np.ndarray:
    """Symmetric bilinear form B (..., 6, m, m) of the Lie screw: u^T B u is that of motion u.

    Parameters
    ----------
    twists : (n, ..., m, 6) array
        Joint twists of a chain of n joints in each of m unit motions.
    """
    moving = np.asarray(twists, dtype=float)
    form = lie(moving[..., :, None, :], _behind(moving, 0)[..., None, :, :]).sum(axis=0)
    return np.asarray(np.moveaxis(form + np.swapaxes(form, -3, -2), -1, -3) / 2.0)


def composed(v_ab: ArrayLike, a_ab: ArrayLike, v_bc: ArrayLike, a_bc: ArrayLike) -> np.ndarray:
    """Accelerator (..., 6) of C against A from those of B against A and of C against B.

    A_AC = A_AB + A_BC + [V_AB V_BC], [Gallardo2010]_ eq. (31); each accelerator is the derivative
    that its own first body sees.
    """
    return np.asarray(np.asarray(a_ab) + np.asarray(a_bc) + lie(v_ab, v_bc))


def from_classical(acceleration: ArrayLike, twist: ArrayLike, point: ArrayLike) -> np.ndarray:
    """Accelerator (..., 6) of a body from the classical acceleration of one of its points.

    Parameters
    ----------
    acceleration : (..., 6)
        (linear, angular), world axes, as ``cc.acceleration`` gives it [m/s^2, rad/s^2].
    twist : (..., 6)
        Screw of the body's velocity at O.
    point : (..., 3)
        Position of the point [m].
    """
    a, v = np.asarray(acceleration, dtype=float), np.asarray(twist, dtype=float)
    spatial = a[..., :3] - np.cross(v[..., :3], _velocity(v, point))
    return shifted(screw(a[..., 3:], spatial), -np.asarray(point, dtype=float))


def to_classical(accelerator: ArrayLike, twist: ArrayLike, point: ArrayLike) -> np.ndarray:
    """Classical acceleration (..., 6), (linear, angular), of a point: ``from_classical`` undone."""
    v = np.asarray(twist, dtype=float)
    there = shifted(accelerator, point)
    linear = there[..., 3:] + np.cross(v[..., :3], _velocity(v, point))
    return np.concatenate([linear, there[..., :3]], axis=-1)


def from_spatial(acceleration: pin.Motion, pose: pin.SE3 | None = None) -> np.ndarray:
    """Accelerator (6,) of Pinocchio's spatial acceleration, given at a frame.

    Parameters
    ----------
    acceleration : pin.Motion
        Of ``pin.getFrameAcceleration``, not of ``getFrameClassicalAcceleration``.
    pose : pin.SE3, optional
        None for ``pin.WORLD``, the frame's pose for ``pin.LOCAL``, its translation alone for
        ``pin.LOCAL_WORLD_ALIGNED``.
    """
    return transformed(from_motion(acceleration), pin.SE3.Identity() if pose is None else pose)


def to_spatial(accelerator: ArrayLike, pose: pin.SE3 | None = None) -> pin.Motion:
    """Pinocchio's spatial acceleration at a frame: ``from_spatial`` undone."""
    back = pin.SE3.Identity() if pose is None else pose.inverse()
    return to_motion(transformed(accelerator, back))


def _behind(moving: np.ndarray, axis: int) -> np.ndarray:
    """Sum of all entries behind each one."""
    return np.flip(np.cumsum(np.flip(moving, axis), axis), axis) - moving


def _velocity(twist: np.ndarray, point: ArrayLike) -> np.ndarray:
    return shifted(twist, point)[..., 3:]


# -- the motion of a mechanism -------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Accelerators:
    """First and second order motion of all bodies and pairs of a mechanism, by screws.

    Attributes
    ----------
    circuits : Circuits
    rates, second_rates : (freedoms,) arrays
        Of all pairs, cut ones too, stacked [m/s, rad/s] and [m/s^2, rad/s^2].

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> s = cc.accelerators(m, m.home, [0.1, 0.1, 0.1], [0.0, 0.0, 0.0])
    >>> print(s.twist("platform").round(3) + 0.0)  # angular, velocity at the origin
    [0.  0.  0.  0.  0.  0.1]
    """

    circuits: Circuits
    rates: np.ndarray
    second_rates: np.ndarray

    def chain(self, start: str, end: str, through: Iterable[str] | None = None) -> Walk:
        """Shortest chain between two links, of all pairs or of those named."""
        return self.circuits.chain(start, end, through)

    def chain_twist(self, walk: Walk) -> np.ndarray:
        """Twist (6,) of the end of a chain against its start, [Gallardo2010]_ eq. (14)."""
        return np.asarray(self._parts(walk).sum(axis=0))

    def chain_lie_screw(self, walk: Walk) -> np.ndarray:
        """Lie screw (6,) of a chain, eq. (17); of a pair passed backwards with its sign."""
        return lie_screw(self._parts(walk))

    def chain_accelerator(self, walk: Walk) -> np.ndarray:
        """Accelerator (6,) of the end of a chain as its start sees it, eq. (16)."""
        c = self.circuits
        out = self.chain_lie_screw(walk)
        for p, sign in walk:
            out = out + sign * (self.second_rates[c.columns[p]] @ c.screws[p])
        return out

    def twist(self, link: str, against: str | None = None) -> np.ndarray:
        """Twist (6,) of a link, against the base or another link, (angular; linear at O)."""
        return self.chain_twist(self._from(against, link))

    def accelerator(self, link: str, against: str | None = None) -> np.ndarray:
        """Accelerator (6,) of a link as the base, or another link, sees it."""
        return self.chain_accelerator(self._from(against, link))

    def classical(self, link: str) -> np.ndarray:
        """Acceleration (6,), (linear, angular), of the origin of a link, world axes."""
        point = self.circuits.mechanism.point(self.circuits.q, link)
        return to_classical(self.accelerator(link), self.twist(link), point)

    @property
    def qdot(self) -> np.ndarray:
        """Velocities (nv,) of the tree's joints in Pinocchio's tangent."""
        return self._tangent(self.rates, second=False)

    @property
    def qddot(self) -> np.ndarray:
        """Accelerations (nv,) of the tree's joints in Pinocchio's tangent."""
        return self._tangent(self.second_rates, second=True)

    def _parts(self, walk: Walk) -> np.ndarray:
        return self.circuits.twists(walk, self.rates[:, None])[:, 0]

    def _from(self, against: str | None, link: str) -> Walk:
        base = self.circuits.mechanism.description.root
        return self.chain(base if against is None else against, link)

    def _tangent(self, values: np.ndarray, *, second: bool) -> np.ndarray:
        c, m = self.circuits, self.circuits.mechanism
        out = np.zeros(m.model.nv)
        for pair, columns in zip(c.graph.pairs, c.columns, strict=True):
            for name, value in zip(pair.joints, values[columns], strict=False):
                out[m.model.idx_vs[m.model.getJointId(name)]] = value
        for joint in m.description.joints:
            if joint.type == "floating":  # no pair: what its body does against its parent
                of = self.accelerator if second else self.twist
                number = m.model.getJointId(joint.name)
                start, placed = m.model.idx_vs[number], _placement(m, c.q, number)
                motion = to_spatial(of(joint.child, joint.parent), placed)
                out[start : start + 6] = motion.vector
        return out


def accelerators(
    mechanism: Mechanism,
    q: ArrayLike,
    v_inputs: ArrayLike | Mapping[str, float],
    a_inputs: ArrayLike | Mapping[str, float],
) -> Accelerators:
    """Motion of all bodies for given input velocities and accelerations, by screws alone.

    Around every circuit the twists add up to zero, sum w $ = 0, and so do the accelerators:
    sum w' $ + L = 0 with the Lie screw L of the circuit, signs by direction. With the couplings,
    and what bent ones add to the second order, these give the passive rates, then the passive
    second rates. [Gallardo2010]_ eqs (34) and (35) are combinations of such conditions that leave
    the passive second rates out.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    v_inputs, a_inputs : (n_inputs,) arrays, or mappings of input name to value
        [m/s or rad/s] and [m/s^2 or rad/s^2].

    Raises
    ------
    ClosureError
        Malformed or open posture, a direct singularity, or, with more inputs than freedoms, rates
        that the loops contradict.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> rates = [0.1, 0.0, 0.0], [0.0, 0.0, 0.5]
    >>> s, a = cc.accelerators(m, m.home, *rates), cc.acceleration(m, m.home, *rates)
    >>> bool(np.allclose(s.qddot, a.qddot))  # screws and Jacobians agree
    True
    """
    at = circuits(mechanism, q)
    va = mechanism.input_vector(v_inputs, "input velocities")
    aa = mechanism.input_vector(a_inputs, "input accelerations")
    rates = _agreed(*at.solve(va[:, None]), "velocities")
    screws = [lie_screw(at.twists(walk, rates)[:, 0]) for walk in at.walks]
    bends = at.bends(rates)[:, :, 0]
    found = at.solve(aa[:, None], np.array(screws).reshape(-1, 6, 1), bends)
    return Accelerators(at, rates[:, 0], _agreed(*found, "accelerations")[:, 0])


def _agreed(rates: np.ndarray, miss: np.ndarray, what: str) -> np.ndarray:
    if miss.max() > _CONSISTENT:
        raise ClosureError(
            f"the input {what} contradict each other: the loops are violated at a rate of "
            f"{miss.max():.3g}; with more inputs than freedoms only some combinations are possible"
        )
    return rates


def _placement(mechanism: Mechanism, q: np.ndarray, joint: int) -> pin.SE3:
    data = mechanism.workspace.data
    pin.forwardKinematics(mechanism.model, data, q)
    return pin.SE3(data.oMi[joint])
