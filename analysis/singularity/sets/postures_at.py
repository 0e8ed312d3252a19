"""What measures and equations need at a posture, or at many of them: closures, tip, steps.

One posture goes through Pinocchio, many through machine code.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.system import code_of


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Closures and tip at a posture; a leading n before every shape where there are many.

    Attributes
    ----------
    residual : (rows,) array
        Closures, dimensionless.
    closures : (rows, nv) array
        K, dimensionless.
    tip : (6, nv) array
        Jacobian of the tip (linear, angular), world axes [m/s, rad/s]; empty without a task.
    place : (3,) array
        Origin of the tip in the world [m].
    attitude : (3, 3) array
        Rotation of the tip in the world.
    """

    residual: np.ndarray
    closures: np.ndarray
    tip: np.ndarray
    place: np.ndarray
    attitude: np.ndarray


def kinematics(mechanism: Mechanism, q: np.ndarray, *, tip: bool) -> Kinematics:
    """Evaluate closures and, where asked for, the tip at ``q`` (nq,) or (n, nq), unchecked."""
    if q.ndim == 1:
        values, jacobian = mechanism.workspace.evaluate(q)
        unit = mechanism.row_scale
        residual, closures = values / unit, jacobian * mechanism.column_scale / unit[:, None]
    else:
        residual, closures = _closures(mechanism, q)
    if not tip:
        some = q.shape[:-1]
        attitude = np.broadcast_to(np.eye(3), (*some, 3, 3))
        return Kinematics(
            residual, closures, np.zeros((*some, 6, 0)), np.zeros((*some, 3)), attitude
        )
    if q.ndim == 1:
        return Kinematics(residual, closures, *_tip(mechanism))
    moves, place = np.empty((len(q), 6, mechanism.model.nv)), np.empty((len(q), 3))
    attitude = np.empty((len(q), 3, 3))
    for i, one in enumerate(q):
        pin.computeJointJacobians(mechanism.model, mechanism.workspace.data, one)
        moves[i], place[i], attitude[i] = _tip(mechanism)
    return Kinematics(residual, closures, moves, place, attitude)


def _closures(mechanism: Mechanism, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Dimensionless residual (n, rows) and K (n, rows, nv) of postures (n, nq)."""
    code = code_of(mechanism, ())
    numbers = code.code.run(np.ascontiguousarray(q.T)).T
    rows = mechanism.rows
    closures = np.zeros((len(q), rows, mechanism.model.nv))
    closures[:, code.places[0], code.places[1]] = numbers[:, rows:]
    return numbers[:, :rows] / mechanism.row_scale, closures


def _tip(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Jacobian, place and attitude of the tip at the posture that was evaluated last."""
    model, data = mechanism.model, mechanism.workspace.data
    frame = model.frames[mechanism.frame_id(mechanism.required_task().tip)]
    if frame.parentJoint == 0:
        moves = np.zeros((6, model.nv))
    else:
        moves = np.array(
            pin.getFrameJacobian(
                model, data, frame.parentJoint, frame.placement, pin.LOCAL_WORLD_ALIGNED
            )
        )
    pose = data.oMi[frame.parentJoint] * frame.placement
    return moves, pose.translation.copy(), pose.rotation.copy()


def moved(mechanism: Mechanism, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Postures after steps v [m, rad]: ``pin.integrate`` for one (nq,) or many (n, nq)."""
    if q.ndim == 1:
        return np.asarray(pin.integrate(mechanism.model, q, v))
    if mechanism.model.nq == mechanism.model.nv:
        return np.asarray(q + v)
    return np.array([pin.integrate(mechanism.model, *both) for both in zip(q, v, strict=True)])


def apart(mechanism: Mechanism, one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Steps [m, rad] from postures to others, for one or many: ``pin.difference``."""
    if one.ndim == 1:
        found = np.asarray(pin.difference(mechanism.model, one, two))
    elif mechanism.model.nq == mechanism.model.nv:
        found = two - one
    else:
        every = [pin.difference(mechanism.model, *both) for both in zip(one, two, strict=True)]
        found = np.array(every).reshape(len(one), mechanism.model.nv)
    return found


def skew(vectors: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    out = np.zeros((*vectors.shape, 3))
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    out[..., 0, 1], out[..., 0, 2] = -z, y
    out[..., 1, 0], out[..., 1, 2] = z, -x
    out[..., 2, 0], out[..., 2, 1] = -y, x
    return out
