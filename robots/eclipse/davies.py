"""The paper's integration of the inverse kinematics along eq. (20), closure error fed back (11).

Primary joints are those of the 3P3R virtual chain that leads the plate, secondary the 18 joints of
the legs. Each leg closes its own circuit with the virtual chain, so that eq. (7) reads
``M_j qdot_j = M_1 xdot`` (the two chains run the circuit in opposite senses: eq. 16 needs a minus)
and eq. (11) falls into three steps of six joints. Euler's step drifts off; the feedback of the
error ``E = T_leg T_virtual^-1`` (eq. 15) with gain K holds it where ``0 < K dt < 2``; with
``K dt = 1`` it is Newton's step.

While a circuit is open it matters where screws are placed. Successive displacements along the
circuit (eq. 12) put the leg's behind the virtual chain, that is where ``E^-1`` moves them; seen
from the leg, E moves the lead of the virtual chain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from . import trajectory
from .geometry import FloatArray, Geometry
from .position import inverse
from .screws import leg_pose, leg_screws, virtual_screws, wrist_angles


@dataclass(frozen=True, eq=False)
class Run:
    """An integration of eq. (11) along eq. (20).

    Attributes
    ----------
    joints : ndarray (101, 3, 6)
        For legs a, b, c: theta, d (beta), q_r, q_x, q_y, q_z, rad and m.
    exact : ndarray (101, 3, 6)
        The same in closed form.
    errors : ndarray (101, 3, 6)
        Closure errors ``q_e`` per leg (eq. 15): XYZ angles, rad, then position, m.
    """

    joints: FloatArray
    exact: FloatArray
    errors: FloatArray


def exact_joints(g: Geometry, offset: float = 0.0) -> FloatArray:
    """Joints (101, 3, 6) along eq. (20) in closed form: links lowered, columns outside.

    ``offset`` is that of :func:`closedchain.robots.eclipse.wrist_angles`.
    """
    rotation = np.broadcast_to(trajectory.rotation(), (trajectory.TIMES.size, 3, 3))
    found = inverse(trajectory.position(trajectory.TIMES), rotation, g)
    inputs, q_r = found.inputs[:, 0], found.q_r[:, 0]
    wrist = wrist_angles(inputs, q_r, rotation, g, offset)
    first = np.stack([inputs[:, :3], inputs[:, 3:], q_r], axis=-1)
    return np.unwrap(np.concatenate([first, wrist], axis=-1), axis=0)


def integrate(
    g: Geometry, *, gain: float | None = None, inner: int = 0, offset: float = 0.0
) -> Run:
    """Integrate eq. (11) over the 100 steps of eq. (20), from the exact joints at t = 0.

    Parameters
    ----------
    g : Geometry
        Dimensions.
    gain : float or None
        ``K_e``, 1/s, for all six errors; None integrates eq. (8) without feedback.
    inner : int
        Newton iterations on the closure after each step ("several iterations" of section 2.5).
    offset : float
        Angle at which the three hinges of a spherical joint start, rad.
    """
    times = trajectory.TIMES
    step = float(times[1] - times[0])
    exact = exact_joints(g, offset)
    joints, errors = np.empty_like(exact), np.empty_like(exact)
    q = exact[0].copy()
    for k, t in enumerate(times):
        if k:
            before = times[k - 1]
            rates = np.concatenate([trajectory.velocity(before), np.zeros(3)])
            lead = virtual_screws(trajectory.position(before), trajectory.ANGLES) @ rates
            wanted = _displaced(errors[k - 1], lead)
            if gain is not None:
                wanted = wanted - gain * _error_twist(errors[k - 1])
            q = q + step * _solve(q, wanted, g, offset)
        for _ in range(inner if k else 0):
            error = closure_errors(q, trajectory.position(t), trajectory.rotation(), g, offset)
            q = q - _solve(q, _error_twist(error), g, offset)
        joints[k] = q
        errors[k] = closure_errors(q, trajectory.position(t), trajectory.rotation(), g, offset)
    return Run(joints, exact, errors)


def closure_errors(
    joints: FloatArray, position: FloatArray, rotation: FloatArray, g: Geometry, offset: float
) -> FloatArray:
    """Errors ``q_e`` (3, 6) of ``E = T_leg T_virtual^-1`` (eqs 14, 15): XYZ angles, position."""
    inputs, q_r, wrist = _split(joints)
    p, rot = leg_pose(inputs, q_r, wrist, g, offset)
    gap = rot @ rotation.T
    angles = Rotation.from_matrix(gap).as_euler("XYZ")
    return np.concatenate([angles, p - gap @ position], axis=-1)


def _error_twist(error: FloatArray) -> FloatArray:
    """Twists (3, 6) ``N_e q_e``, (angular; linear at O): the error chain's screws times errors."""
    return np.array([virtual_screws(e[3:], e[:3]) @ np.roll(e, 3) for e in error])


def _displaced(error: FloatArray, twist: FloatArray) -> FloatArray:
    """Twists (3, 6) of a twist (6,) that is moved along by E, (angular; linear at O)."""
    gap = Rotation.from_euler("XYZ", error[:, :3]).as_matrix()
    angular = gap @ twist[:3]
    return np.concatenate([angular, gap @ twist[3:] + np.cross(error[:, 3:], angular)], axis=-1)


def _solve(joints: FloatArray, twists: FloatArray, g: Geometry, offset: float) -> FloatArray:
    """Joint rates (3, 6) that give each leg's end its twist."""
    inputs, q_r, wrist = _split(joints)
    screws = leg_screws(inputs, q_r, wrist, g, offset)
    return np.asarray(np.linalg.solve(screws, twists[..., None])[..., 0])


def _split(joints: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    return np.concatenate([joints[:, 0], joints[:, 1]]), joints[:, 2], joints[:, 3:]
