"""What a mechanism can do at a posture: ellipsoids, compliance, and efforts for unit loads.

All follow from the twist map T, tip twist = T input rates, whose transpose takes a wrench at the
tip to the efforts that hold it, tau = -T^T w. Twists and wrenches are (linear, angular),
world-aligned at the tip's origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.forces.input_efforts import PIVOT, effort_code
from closedchain.analysis.velocity import velocity
from closedchain.closure.given import finite_vector, real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

ALL = "x y z rx ry rz"
SINGULAR = 1e-9  # share of the largest singular value below which there is no inverse


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """What unit input rates, or unit efforts, can do: half axes of an ellipsoid.

    Attributes
    ----------
    axes : (3, 3) array
        Directions in the world, one a column, the longest first.
    radii : (3,) array
        Half lengths; infinite where nothing bounds.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> push = cc.capabilities(m, m.home).force
    >>> print(np.abs(push.axes[:, 0]).round(3))  # the platform pushes hardest along z
    [0. 0. 1.]
    >>> print(push.radii.round(3))  # [N] by efforts with sum of squares 1
    [1.732 0.535 0.535]
    """

    axes: np.ndarray
    radii: np.ndarray


@dataclass(frozen=True, eq=False)
class Capabilities:
    """Ellipsoids at a posture; input rates or efforts have the sum of squares 1, in SI units.

    Attributes
    ----------
    twist_map : (6, n_inputs) array
    velocity, angular_velocity : Ellipsoid
        Of the tip's origin [m/s], and of its rotation [rad/s].
    force, moment : Ellipsoid
        That such efforts hold at the tip [N, N m], with the other half of the wrench at zero;
        infinite in directions that the structure itself carries.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> can = cc.capabilities(m, m.home)
    >>> print(can.velocity.radii.round(3))  # half axes [m/s] for input rates with sum of squares 1
    [1.871 1.871 0.577]
    """

    twist_map: np.ndarray
    velocity: Ellipsoid
    angular_velocity: Ellipsoid
    force: Ellipsoid
    moment: Ellipsoid


def capabilities(mechanism: Mechanism, q: ArrayLike) -> Capabilities:
    """Velocity and force ellipsoids of the tip at a closed posture (nq,).

    Raises
    ------
    ClosureError
        Malformed or open posture, no task, or a direct singularity.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> can = cc.capabilities(m, m.home)
    >>> print(can.force.radii.round(3))  # half axes [N] for efforts with sum of squares 1
    [1.732 0.535 0.535]
    """
    t = _twist_map(mechanism, q)
    sizes = np.linalg.norm(t[:3], 2), mechanism.length * np.linalg.norm(t[3:], 2)
    nothing = SINGULAR * float(max(sizes))
    force, moment = _held(t[:3], nothing), _held(t[3:], nothing / mechanism.length)
    return Capabilities(t, _reach(t[:3]), _reach(t[3:]), force, moment)


def compliance(mechanism: Mechanism, q: ArrayLike, stiffness: ArrayLike) -> np.ndarray:
    """How the tip gives way to a wrench when the drives do: C = T k^-1 T^T, twist = C wrench.

    Links and passive joints are rigid, and the posture carries no load beside: then its weight on
    the geometry would add a term.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    stiffness : (n_inputs,) array
        Of each input [N/m or N m/rad], above zero; infinite for a rigid one.

    Returns
    -------
    (6, 6) array
        [m/N, rad/N, m/(N m), rad/(N m)], symmetric; world-aligned at the tip's origin.

    Raises
    ------
    ClosureError
        As ``capabilities``; stiffnesses that are not above zero.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> C = cc.compliance(m, m.home, [1e5, 1e5, 1e5])  # each drive gives way by 1 m at 1e5 N
    >>> print((C[:3, :3] * 1e6).round(2) + 0.0)  # [um/N]
    [[35.    0.    0.  ]
     [ 0.   35.    0.  ]
     [ 0.    0.    3.33]]
    """
    k = drive_stiffness(mechanism, stiffness)
    t = _twist_map(mechanism, q)
    return np.asarray((t / k) @ t.T)


def stiffness(mechanism: Mechanism, q: ArrayLike, drives: ArrayLike) -> np.ndarray:
    """Stiffness of the tip in its outputs, K = T^-T k T^-1, where these are as many as the inputs.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    drives : (n_inputs,) array
        Stiffness of each input [N/m or N m/rad].

    Returns
    -------
    (d, d) array
        In the task's outputs, [N/m, N m/rad]; rotations as ``TaskFrame`` says.

    Raises
    ------
    ClosureError
        As ``compliance``; outputs that are more or fewer than the inputs, or an inverse
        singularity: the tip is rigid in some direction, and only its compliance is finite.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> K = cc.stiffness(m, m.home, [1e5, 1e5, 1e5])
    >>> C = cc.compliance(m, m.home, [1e5, 1e5, 1e5])
    >>> bool(np.allclose(K @ C[:3, :3], np.eye(3)))
    True
    """
    k = drive_stiffness(mechanism, drives)
    t = velocity(mechanism, q).twist_map
    if t is None:
        raise ClosureError("the inputs do not determine the tip there (a direct singularity)")
    s = np.linalg.svd(t, compute_uv=False)
    if t.shape[0] != t.shape[1] or s[-1] < SINGULAR * s[0]:
        raise ClosureError(
            f"{t.shape[1]} inputs and {t.shape[0]} outputs, rank {int((s > SINGULAR * s[0]).sum())}"
            ": the stiffness has no inverse of the twist map; ask for cc.compliance"
        )
    root = np.linalg.solve(t.T, np.diag(np.sqrt(k)))  # T^-T k^1/2
    return np.asarray(root @ root.T)


def twist_maps(mechanism: Mechanism, postures: ArrayLike) -> np.ndarray:
    """Twist maps (n, 6, n_inputs) at closed postures (n, nq), infinite at direct singularities.

    By machine code where the inputs are as many as the freedoms.

    Raises
    ------
    ClosureError
        Malformed postures, or no task.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> q = cc.direct(m, np.linspace([-0.2, -0.2, -0.2], [-0.1, -0.1, -0.1], 7)).q
    >>> cc.twist_maps(m, q).shape
    (7, 6, 3)
    """
    q = np.atleast_2d(mechanism.configurations(postures))
    code = effort_code(mechanism, (mechanism.required_task().tip,))
    found = np.full((len(q), 6, len(mechanism.inputs)), np.inf)
    doubtful = np.ones(len(q), dtype=bool)
    if code.serves:
        for i in range(6):
            told = code.run(q, np.concatenate([np.zeros(3), np.eye(6)[i]]))
            found[:, i] = -told[2:].T
        doubtful = ~(np.abs(told[0]) > PIVOT)
    for k in np.flatnonzero(doubtful):
        here = velocity(mechanism, q[k], ALL).twist_map
        found[k] = np.inf if here is None else here
    return found


def _twist_map(mechanism: Mechanism, q: ArrayLike) -> np.ndarray:
    mechanism.required_inputs()
    found = velocity(mechanism, q, ALL).twist_map
    if found is None:
        raise ClosureError("the inputs do not determine the tip there (a direct singularity)")
    return found


def drive_stiffness(mechanism: Mechanism, values: ArrayLike) -> np.ndarray:
    """Check the stiffness of each input (n_inputs,). Raises ``ClosureError``."""
    k = real_array(values, "stiffness")
    names = " ".join(mechanism.inputs)
    if k.shape == (len(mechanism.inputs),) and (k > 0.0).all():
        return k
    finite_vector(values, len(mechanism.inputs), "stiffness", names)
    raise ClosureError(f"stiffness must be above zero for each of {names}, got {k}")


def _reach(half: np.ndarray) -> Ellipsoid:
    """Image of the unit ball of input rates."""
    u, s, _ = np.linalg.svd(half)
    return Ellipsoid(u, np.concatenate([s, np.zeros(3 - s.size)]))


def _held(half: np.ndarray, nothing: float) -> Ellipsoid:
    """Loads whose efforts lie in the unit ball: the velocities' directions, lengths inverted."""
    reach = _reach(half)
    with np.errstate(divide="ignore"):
        radii = 1.0 / np.where(reach.radii <= nothing, 0.0, reach.radii)
    return Ellipsoid(reach.axes[:, ::-1], radii[::-1])
