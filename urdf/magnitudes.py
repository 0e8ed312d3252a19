"""The sizes of numbers: what can be calculated with, whatever format a description came from."""

from __future__ import annotations

import math
from collections.abc import Iterator

from closedchain.urdf.description import Description
from closedchain.urdf.elements import LARGEST, LARGEST_ANGLE
from closedchain.urdf.errors import DescriptionError


def check_magnitudes(description: Description) -> None:
    """Refuse numbers that are not finite, or too large to calculate with; bounds may be infinite.

    For descriptions that come from other formats: the reader of URDF refuses them where they stand.

    Raises
    ------
    DescriptionError
        Naming the element and what would do.
    """
    angles = {j.name for j in description.joints if j.type in ("revolute", "continuous")}
    for element, name, line, what, values in _numbers(description):
        largest = LARGEST_ANGLE if what in ("home", "posture") and name in angles else LARGEST
        for value in values:
            if not abs(value) <= largest:  # NaN too
                raise DescriptionError(
                    f"{what}: {value:g} is too large; numbers here are at most {largest:g} in size "
                    "(SI units)",
                    line=line,
                    element=element,
                    name=name,
                )


_Found = tuple[str, str, int | None, str, tuple[float, ...]]


def _numbers(d: Description) -> Iterator[_Found]:
    """Numbers of a description: element, its name, its line, what they are, and they themselves."""
    for link in d.links:
        if link.inertial is not None:
            i = link.inertial
            moments = (i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz)
            place = (*i.origin.xyz, *i.origin.rpy)
            yield "link", link.name, link.line, "inertial", (i.mass, *moments, *place)
    for joint in d.joints:
        placed = (*joint.origin.xyz, *joint.origin.rpy, *joint.axis)
        yield "joint", joint.name, joint.line, "origin or axis", placed
        bounds = tuple(b for b in (joint.lower, joint.upper) if not math.isinf(b))
        yield "joint", joint.name, joint.line, "limit", bounds
    for c in d.closures:
        origins = (c.parent_origin, c.child_origin)
        ends = tuple(x for o in origins for x in (*o.xyz, *o.rpy))
        sizes = tuple(value for _, value in c.sizes)
        ends = (*ends, *c.parent_axis, *c.child_axis, *sizes)
        yield "constraint", c.name, c.line, "origin, axis or size", ends
    for r in d.relations:
        yield "constraint", r.name, r.line, "coefficients", (*r.coefficients, r.offset)
    for coupling in d.couplings:
        law = (coupling.multiplier, coupling.offset)
        yield "joint", coupling.joint, coupling.line, "mimic", law
    for what, states in (("home", (d.home,)), ("posture", tuple(d.states.values()))):
        for state in states:
            for name, given in state.items():
                yield "joint", name, None, what, given
