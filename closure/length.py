"""The characteristic length of a mechanism that states none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure, Coupling

_NONE = 1e-9  # m: a mechanism of less extent has no length of its own


def characteristic_length(
    model: pin.Model, data: pin.Data, closures: Sequence[Closure | Coupling], q: np.ndarray
) -> float:
    """Root mean square distance [m] of all joints from their centroid at ``q`` (nq,).

    A joint stands at the frames of its two sides, each weighed with half its freedoms; a ball on a
    line or a plane at the ball, wherever these are said to begin. Floating joints, which only say
    where a body is, are left out. So the length does not depend on which joints were cut. 1 for a
    mechanism without extent.
    """
    pin.forwardKinematics(model, data, q)
    points, weights = [], []
    for joint in list(model.joints)[1:]:
        if joint.nv == 1:
            before = data.oMi[model.parents[joint.id]] * model.jointPlacements[joint.id]
            points += [before.translation, data.oMi[joint.id].translation]
            weights += [0.5, 0.5]
    for c in closures:
        if isinstance(c, Closure):
            one = (data.oMi[c.joint1] * c.placement1).translation
            two = (data.oMi[c.joint2] * c.placement2).translation
            points += [two if c.joint_kind.ball_slides else one, two]
            weights += [0.5 * c.joint_kind.freedoms] * 2
    total = sum(weights)
    if total == 0.0:
        return 1.0
    share = np.array(weights) / total
    spread = np.array(points) - share @ np.array(points)
    radius = float(np.sqrt(share @ np.sum(spread**2, axis=1)))
    return radius if radius > _NONE else 1.0
