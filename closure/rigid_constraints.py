"""Closures as Pinocchio's own rigid constraint models, for its dynamics and those built on it.

Pinocchio has two kinds, a shared point (3D) and a shared frame (6D). A hinge is two points on its
axis: six rows of rank five. Nothing else of the table of joint kinds can be said with them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure, Coupling
from closedchain.urdf.errors import ClosureError

_ON_AXIS = 0.1  # [m] between the two points of a hinge
_EXPRESSED = ("spherical", "fixed", "revolute")


def rigid_constraints(
    model: pin.Model, closures: Sequence[Closure | Coupling]
) -> tuple[pin.RigidConstraintModel, ...]:
    """Constraint models in the order of the closures; they carry the names of these.

    Raises
    ------
    ClosureError
        Closures that neither points nor frames express; names them.
    """
    lost = [c.describe() for c in closures if c.kind not in _EXPRESSED]
    if lost:
        raise ClosureError(
            "Pinocchio's rigid constraints are points and frames: they cannot say "
            f"{'; '.join(lost)}. Cut those loops at balls, hinges or welds instead"
        )
    found = []
    for closure in closures:
        assert isinstance(closure, Closure)
        kind = pin.ContactType.CONTACT_6D if closure.kind == "fixed" else pin.ContactType.CONTACT_3D
        shifts = (0.0, _ON_AXIS) if closure.kind == "revolute" else (0.0,)
        for shift in shifts:
            along = pin.SE3(np.eye(3), np.array([0.0, 0.0, shift]))
            constraint = pin.RigidConstraintModel(
                kind,
                model,
                closure.joint1,
                closure.placement1 * along,
                closure.joint2,
                closure.placement2 * along,
                pin.ReferenceFrame.LOCAL,
            )
            constraint.name = closure.name if not shift else f"{closure.name}_axis"
            found.append(constraint)
    return tuple(found)
