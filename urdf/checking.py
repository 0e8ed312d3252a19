"""The last step of every reader that is not URDF's own: checks, and the URDF that says the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from closedchain.urdf._bodies import ONE_DOF
from closedchain.urdf._checks import (
    check_closures,
    check_relations,
    check_roles,
    known_couplings,
    refuse_duplicates,
    root_of,
    without_second_drives,
)
from closedchain.urdf.description import (
    Coupling,
    Description,
    Input,
    Joint,
    JointRelation,
    LoopClosure,
)
from closedchain.urdf.errors import DescriptionError
from closedchain.urdf.formats.missing_loops import are_loops_missing
from closedchain.urdf.link_poses import moved
from closedchain.urdf.magnitudes import check_magnitudes
from closedchain.urdf.poses import origin_of, pose_of
from closedchain.urdf.shapes import Shapes
from closedchain.urdf.writing import urdf_text

_NOTHING: Shapes = MappingProxyType({})


def checked(description: Description, shapes: Shapes = _NOTHING) -> Description:
    """Description that was made from another format, checked as the reader of URDF checks.

    Its text is the URDF that says the same. Closures that hold what is rigid anyway are noted and
    left out.

    Raises
    ------
    DescriptionError
        Names used twice, unknown links or joints, no tree, numbers that are too large.
    """
    d = description
    check_magnitudes(d)
    notes = list(d.notes)
    for things, element in ((d.links, "link"), (d.joints, "joint")):
        refuse_duplicates(things, element)
    top = root_of(d.name, None, d.links, d.joints)
    joints = {joint.name: joint for joint in d.joints}
    check_roles(d, joints)
    couplings = known_couplings(d.couplings, joints, ONE_DOF, notes)
    check_relations(d.relations, joints, ONE_DOF)
    closures = []
    for closure in d.closures:
        try:
            check_closures((closure,), d.links, d.joints)
        except DescriptionError as error:
            if "rigidly connected" not in str(error):
                raise
            notes.append(f"the closure {closure.name!r} holds what is rigid anyway; it is left out")
        else:
            closures.append(closure)
    refuse_duplicates((*closures, *d.relations), "constraint")
    inputs = without_second_drives(d.inputs, notes)
    couplings, inputs = _with_driven_leaders(couplings, inputs, notes)
    closed = bool(closures or d.relations)
    notes += are_loops_missing(d.links, d.joints, couplings, closed)
    found = replace(
        d,
        root=top,
        couplings=couplings,
        closures=tuple(closures),
        inputs=inputs,
        notes=tuple(notes),
    )
    return replace(found, text=urdf_text(found, shapes))


def _with_driven_leaders(
    couplings: tuple[Coupling, ...], inputs: tuple[Input, ...], notes: list[str]
) -> tuple[tuple[Coupling, ...], tuple[Input, ...]]:
    """Couplings turned around where the follower is driven, as an input follows no other joint.

    Where the leader is driven too, or follows a third joint, the input is noted and left out.
    """
    driven = {item.joint for item in inputs}
    followers = {coupling.joint for coupling in couplings}
    turned: list[Coupling] = []
    lost: dict[str, str] = {}
    for coupling in couplings:
        if coupling.joint not in driven:
            turned.append(coupling)
        elif coupling.leader in driven | followers or coupling.multiplier == 0.0:
            lost[coupling.joint] = coupling.leader
            turned.append(coupling)
        else:
            ratio = 1.0 / coupling.multiplier
            turned.append(
                Coupling(coupling.leader, coupling.joint, ratio, -coupling.offset * ratio)
            )
            followers.add(coupling.leader)
    notes += [
        f"the input {item.name!r} is left out: its joint {item.joint!r} follows "
        f"{lost[item.joint]!r}"
        for item in inputs
        if item.joint in lost
    ]
    return tuple(turned), tuple(item for item in inputs if item.joint not in lost)


def with_held(joints: tuple[Joint, ...], held: Mapping[str, float]) -> tuple[Joint, ...]:
    """Joints, those that are held at a value made fixed there."""
    return tuple(
        replace(
            joint,
            type="fixed",
            origin=origin_of(pose_of(joint.origin) @ moved(joint, (held[joint.name],))),
        )
        if joint.name in held
        else joint
        for joint in joints
    )


def without_held(
    relations: tuple[JointRelation, ...], held: Mapping[str, float]
) -> tuple[JointRelation, ...]:
    """Relations that no held joint takes part in."""
    return tuple(r for r in relations if not any(joint in held for joint in r.joints))


def fresh_closures(closures: tuple[LoopClosure, ...]) -> tuple[LoopClosure, ...]:
    """Closures whose names differ: a number is added to a name that is there already."""
    taken: set[str] = set()
    found = []
    for closure in closures:
        name, k = closure.name, 2
        while name in taken:
            name, k = f"{closure.name}_{k}", k + 1
        taken.add(name)
        found.append(replace(closure, name=name))
    return tuple(found)
