"""Joints with one freedom, one after the other at one place: what a joint of more is taken for."""

from __future__ import annotations

from collections.abc import Sequence

from closedchain.urdf.description import Joint, JointType, Origin, Vector3


def in_series(
    ends: Sequence[str], origin: Origin, steps: Sequence[tuple[str, JointType, Vector3]]
) -> tuple[Joint, ...]:
    """Joints (name, kind, axis) along links ``ends``, one more than they are, without limits.

    The first stands at an origin in its parent, the others where it does.
    """
    return tuple(
        Joint(name, kind, ends[k], ends[k + 1], origin if k == 0 else Origin(), axis)
        for k, (name, kind, axis) in enumerate(steps)
    )
