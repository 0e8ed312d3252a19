"""How closure rows answer to small displacements of bodies: of all beyond a joint, or at a cut."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.rows import cut_rows
from closedchain.urdf.description import Joint


def responses(
    mechanism: Mechanism, q: np.ndarray
) -> tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray], Mapping[str, pin.SE3]]:
    """Derivatives of the closure rows by twists, at ``q`` (nq,), unchecked.

    Returns
    -------
    mapping of joint to (rows, 6) array
        By the twist (linear, angular) that all that hangs on a joint, fixed ones too, is given: at
        the world's origin, along its axes [m or rad a m or rad].
    mapping of closure to (rows, 6) array
        By the twist of frame 2 against frame 1, at the origin and along the axes of frame 1.
    mapping of closure to pin.SE3
        Pose of frame 2 in frame 1.
    """
    pin.forwardKinematics(mechanism.model, mechanism.workspace.data, q)
    placed = mechanism.workspace.data.oMi
    above = paths(mechanism.description.joints)
    joints = {joint.name: np.zeros((mechanism.rows, 6)) for joint in mechanism.description.joints}
    closures, gaps = {}, {}
    for closure, where in zip(mechanism.closures, mechanism.row_slices, strict=True):
        if not isinstance(closure, Closure):
            continue
        frame1 = placed[closure.joint1] * closure.placement1
        gap = frame1.actInv(placed[closure.joint2] * closure.placement2)
        wrenches = cut_rows(closure, gap)[1]
        seen = wrenches @ frame1.toActionMatrixInverse()
        one, two = above[closure.parent], above[closure.child]
        for name in one ^ two:
            joints[name][where] += seen if name in two else -seen
        own = np.zeros((mechanism.rows, 6))
        own[where] = wrenches
        closures[closure.name], gaps[closure.name] = own, gap
    return joints, closures, gaps


def link_poses(mechanism: Mechanism, q: np.ndarray) -> dict[str, pin.SE3]:
    """Pose of every link in the world at ``q`` (nq,), unchecked."""
    data = mechanism.workspace.data
    pin.forwardKinematics(mechanism.model, data, q)
    frames = mechanism.model.frames
    return {
        name: data.oMi[frames[i].parentJoint] * frames[i].placement
        for name, i in mechanism.frame_ids.items()
    }


def paths(joints: Sequence[Joint]) -> dict[str, set[str]]:
    """Joints, fixed ones too, between the root and every link."""
    above = {joint.child: joint for joint in joints}
    found: dict[str, set[str]] = {}
    for link in {*above, *(joint.parent for joint in joints)}:
        names, here = set(), link
        while here in above:
            names.add(above[here].name)
            here = above[here].parent
        found[link] = names
    return found
