"""MJCF to a description: the tree, the loops, motors, named postures, shapes, and the notes."""

from __future__ import annotations

from typing import Any

import numpy as np

from closedchain.urdf import elements
from closedchain.urdf.checking import checked, fresh_closures, with_held, without_held
from closedchain.urdf.description import OUTPUTS, Description, Input, Task
from closedchain.urdf.errors import DescriptionError
from closedchain.urdf.formats.mjcf.compiled import Compiled, compile_text
from closedchain.urdf.formats.mjcf.equalities import Equalities, equalities_of
from closedchain.urdf.formats.mjcf.shapes import shapes_of_model
from closedchain.urdf.formats.mjcf.tree import WORLD, Tree, tree_of

TASK = "closedchain_task"
"""Name of the custom text in which a task is written; MuJoCo reads over it."""

_HOME = "home"


def read(text: str, file: str | None = None) -> Description:
    """Read an MJCF text; ``file`` is where it stands, for includes and meshes.

    Home is the keyframe of that name, else the reference posture (``qpos0``), in which MuJoCo too
    takes the loops for closed. Actuators of joints are the inputs.

    Raises
    ------
    DescriptionError
        The package mujoco is missing, or what MuJoCo refuses.
    """
    compiled = compile_text(text, file)
    tree = tree_of(compiled)
    equalities = equalities_of(compiled, tree)
    held = equalities.held
    notes = [*compiled.notes, *tree.notes, *equalities.notes]
    notes += [f"the joint {name!r} is held at {held[name]:g}: it is fixed" for name in held]
    inputs = _inputs(compiled, tree, equalities, notes)
    home, states = _postures(compiled, tree, set(held))
    notes += _read_over(compiled, equalities)
    shapes = shapes_of_model(compiled, tree.bodies, notes)
    description = Description(
        name=compiled.title or "mjcf",
        root=WORLD,
        links=tuple(tree.links),
        joints=with_held(tuple(tree.joints), held),
        closures=fresh_closures((*equalities.closures, *tree.closures)),
        couplings=tuple(c for c in equalities.couplings if not {c.joint, c.leader} & set(held)),
        relations=without_held(tuple(equalities.relations), held),
        inputs=tuple(item for item in inputs if item.joint not in held),
        task=_task(compiled, [link.name for link in tree.links]),
        home=home,
        states=states,
        notes=tuple(notes),
    )
    return checked(description, shapes)


def _inputs(
    compiled: Compiled, tree: Tree, equalities: Equalities, notes: list[str]
) -> list[Input]:
    """One input for each joint with an actuator, called as the actuator is."""
    model, kinds = compiled.model, compiled.mujoco.mjtTrn
    one = (compiled.mujoco.mjtJoint.mjJNT_HINGE, compiled.mujoco.mjtJoint.mjJNT_SLIDE)
    found: list[Input] = []
    names: set[str] = set()
    for index in range(model.nu):
        name = compiled.name("actuator", index)
        kind = int(model.actuator_trntype[index])
        joint = int(model.actuator_trnid[index][0])
        if kind == kinds.mjTRN_TENDON:
            joint = _behind_tendon(compiled, tree, equalities, joint)
        on_joint = kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT, kinds.mjTRN_TENDON)
        if not on_joint or joint < 0 or int(model.jnt_type[joint]) not in one:
            word = kinds(kind).name.removeprefix("mjTRN_").lower()
            what = "a ball or a free joint" if word.startswith("joint") else f"a {word}"
            notes.append(
                f"the actuator {name or index!r} acts on {what}: it is not taken as an input"
            )
            continue
        fresh, k = name or tree.joint_names[joint], 2
        while fresh in names:
            fresh, k = f"{name or tree.joint_names[joint]}_{k}", k + 1
        names.add(fresh)
        gear = float(model.actuator_gear[index][0])
        if kind == kinds.mjTRN_TENDON:
            notes.append(
                f"the actuator {fresh!r} acts on a tendon over joints that follow "
                f"{tree.joint_names[joint]!r}: it was taken as the input of this one"
            )
            gear = 1.0
        elif gear == 0.0:
            notes.append(f"the actuator {fresh!r} has a gear of zero: it was taken as 1")
        found.append(Input(fresh, tree.joint_names[joint], reduction=gear or 1.0))
    return found


def _behind_tendon(compiled: Compiled, tree: Tree, equalities: Equalities, tendon: int) -> int:
    """Joint that a tendon moves: its only one, or the one that its others follow; else -1."""
    model = compiled.model
    start, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    wraps = range(start, start + count)
    if any(int(model.wrap_type[w]) != compiled.mujoco.mjtWrap.mjWRAP_JOINT for w in wraps):
        return -1
    joints = [int(model.wrap_objid[w]) for w in wraps]
    follows = {coupling.joint: coupling.leader for coupling in equalities.couplings}
    leaders = {follows.get(tree.joint_names[j], tree.joint_names[j]) for j in joints}
    return tree.joint_names.index(leaders.pop()) if len(leaders) == 1 else -1


def _postures(
    compiled: Compiled, tree: Tree, held: set[str]
) -> tuple[dict[str, tuple[float, ...]], dict[str, dict[str, tuple[float, ...]]]]:
    """Home, and the other keyframes by name."""
    model = compiled.model
    home = _values(compiled, tree, model.qpos0, held)
    states: dict[str, dict[str, tuple[float, ...]]] = {}
    for index in range(model.nkey):
        name = compiled.name("key", index) or f"key_{index}"
        values = _values(compiled, tree, model.key_qpos[index], held)
        if name == _HOME:
            home = values
        else:
            states[name] = values
    return home, states


def _values(
    compiled: Compiled, tree: Tree, qpos: np.ndarray, held: set[str]
) -> dict[str, tuple[float, ...]]:
    """Values of the joints, as a home has them, in a configuration of MuJoCo."""
    model, kinds = compiled.model, compiled.mujoco.mjtJoint
    found: dict[str, tuple[float, ...]] = {}
    for joint, name in enumerate(tree.joint_names):
        start, kind = int(model.jnt_qposadr[joint]), int(model.jnt_type[joint])
        if name in held:
            continue
        if kind in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE):
            found[name] = (float(qpos[start]),)
            continue
        place = [0.0, 0.0, 0.0]
        if kind == kinds.mjJNT_FREE:
            place = [float(x) for x in qpos[start : start + 3]]
            start += 3
        quaternion = np.array(qpos[start : start + 4])
        w, x, y, z = (float(c) for c in quaternion / np.linalg.norm(quaternion))
        found[name] = (*place, x, y, z, w)
    return found


def _task(compiled: Compiled, links: list[str]) -> Task | None:
    """Task that was written as a custom text."""
    model = compiled.model
    for index in range(model.ntext):
        if compiled.name("text", index) != TASK:
            continue
        start, size = int(model.text_adr[index]), int(model.text_size[index])
        element = elements.document(_bytes(model.text_data)[start : start + size - 1].decode())
        base, tip = elements.text(element, "base"), elements.text(element, "tip")
        outputs = tuple(elements.text(element, "outputs").split())
        if base in links and tip in links and set(outputs) <= set(OUTPUTS):
            length = elements.number(element, "length", 0.0) or None
            return Task(base, tip, outputs, length)
        raise DescriptionError(
            f"the custom text {TASK!r} names links or outputs that are not there: {base}, {tip}"
        )
    return None


def _bytes(data: Any) -> bytes:
    return data if isinstance(data, bytes) else bytes(np.asarray(data).astype(np.uint8))


def _read_over(compiled: Compiled, equalities: Equalities) -> list[str]:
    """One sentence for each thing that MuJoCo computes with and this program does not."""
    model = compiled.model
    found = []
    if equalities.closures or equalities.couplings or equalities.relations:
        found.append(
            "equality constraints are soft in MuJoCo (solref, solimp); here they are exact"
        )
    springs = [
        compiled.name("joint", j) for j in range(model.njnt) if np.any(model.jnt_stiffness[j])
    ]
    if springs:
        found.append(f"springs of {len(springs)} joints were not read: {', '.join(springs[:4])}")
    kinds = compiled.mujoco.mjtJoint
    several = [
        d
        for d in range(model.nv)
        if int(model.jnt_type[model.dof_jntid[d]]) in (kinds.mjJNT_BALL, kinds.mjJNT_FREE)
    ]
    resisting = (model.dof_damping, model.dof_frictionloss, model.dof_armature)
    if any(np.any(numbers[several]) for numbers in resisting):
        found.append("damping, friction and armature of balls and free joints were not read")
    of_equalities = {
        int(model.eq_obj1id[e])
        for e in range(model.neq)
        if int(model.eq_type[e]) == compiled.mujoco.mjtEq.mjEQ_TENDON
    }
    tendons = [t for t in range(model.ntendon) if t not in of_equalities]
    if tendons:
        names = ", ".join(repr(compiled.name("tendon", t)) for t in tendons[:4])
        found.append(f"{len(tendons)} tendons were not read: {names}")
    colliding = int(np.count_nonzero(model.geom_contype | model.geom_conaffinity))
    if colliding or model.npair:
        found.append("contacts were not read: here bodies pass through each other")
    for count, what in ((model.nsensor, "sensors"), (model.nflex, "flexible bodies")):
        if count:
            found.append(f"{count} {what} were not read")
    return found
