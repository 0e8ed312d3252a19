"""The wrench that a cut joint carries, from the multipliers of its rows.

A row with multiplier l puts the wrench l (f, m) on the child at frame 2's origin, with (f, m) the
row's derivative in the table of joint kinds, and the opposite on the parent at the same place: the
power of both is l times the rate of the row.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from closedchain.analysis.forces.loads import no_forces
from closedchain.closure.closures import Closure, Coupling
from closedchain.closure.mechanism import Mechanism


def row_wrenches(mechanism: Mechanism, q: np.ndarray) -> dict[str, np.ndarray]:
    """Wrenches (6, rows) of each cut joint's rows for unit multipliers, by name.

    (force, moment) on the child at frame 2's origin, along the axes of frame 1.
    """
    data = mechanism.workspace.data
    pin.forwardKinematics(mechanism.model, data, q)
    found = {}
    for closure in mechanism.closures:
        if isinstance(closure, Closure):
            gap = _frame_one(closure, data).actInv(data.oMi[closure.joint2] * closure.placement2)
            found[closure.name] = _wrenches(closure, gap)
    return found


def _wrenches(closure: Closure, gap: pin.SE3) -> np.ndarray:
    if closure.kind == "fixed":
        # the row is log6 of the gap; its derivative is by the twist at frame 1's origin
        rows = pin.Jlog6(gap) @ gap.inverse().action
        force, moment = rows[:, :3], rows[:, 3:] - np.cross(gap.translation, rows[:, :3])
        return np.hstack([force, moment]).T
    p, r = gap.translation.tolist(), gap.rotation.tolist()
    pairs = closure.joint_kind.wrenches(p, r, closure.sizes)
    return np.array([[*f, *m] for f, m in pairs]).T


def _frame_one(closure: Closure, data: pin.Data) -> pin.SE3:
    return data.oMi[closure.joint1] * closure.placement1


def cut_wrenches(
    mechanism: Mechanism, rows: Mapping[str, np.ndarray], multipliers: np.ndarray
) -> dict[str, np.ndarray]:
    """Wrench (6,) or wrenches (6, k) of each cut joint on its child, by name.

    Parameters
    ----------
    rows : mapping
        From ``row_wrenches``.
    multipliers : (rows,) or (rows, k) array
    """
    return {
        closure.name: rows[closure.name] @ multipliers[where]
        for closure, where in zip(mechanism.closures, mechanism.row_slices, strict=True)
        if isinstance(closure, Closure)
    }


def coupling_efforts(
    mechanism: Mechanism, q: np.ndarray, multipliers: np.ndarray
) -> dict[str, dict[str, float]]:
    """Efforts [N, N m] that each coupling puts on its joints, by name."""
    found: dict[str, dict[str, float]] = {}
    for closure, where in zip(mechanism.closures, mechanism.row_slices, strict=True):
        if isinstance(closure, Coupling):
            (multiplier,) = multipliers[where]
            efforts: dict[str, float] = {}
            for part in closure.joints:
                effort = float(multiplier * part.slope(q[part.q]))
                efforts[part.joint] = efforts.get(part.joint, 0.0) + effort
            found[closure.name] = efforts
    return found


def on_bodies(mechanism: Mechanism, wrenches: Mapping[str, np.ndarray]) -> list[pin.Force]:
    """Forces on the joints' bodies, at the joints' frames, from wrenches (6,) of the cut joints.

    Pinocchio's placements must be up to date.
    """
    data = mechanism.workspace.data
    forces = no_forces(mechanism.model)
    for closure in mechanism.closures:
        if not isinstance(closure, Closure):
            continue
        one, two = _frame_one(closure, data), data.oMi[closure.joint2] * closure.placement2
        place = pin.SE3(one.rotation, two.translation)
        force = place.act(pin.Force(np.array(wrenches[closure.name])))
        for joint, sign in ((closure.joint1, -1.0), (closure.joint2, 1.0)):
            if joint:
                forces[joint] += data.oMi[joint].actInv(pin.Force(sign * force.vector))
    return forces
