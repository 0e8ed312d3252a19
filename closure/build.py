"""From a description to a mechanism, home as stated: Pinocchio model, closures, task, length."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure, CoupledJoint, Coupling
from closedchain.closure.length import characteristic_length
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.named import Postures
from closedchain.closure.task_frame import TaskFrame
from closedchain.closure.tree import Tree, build_tree, se3, z_onto
from closedchain.urdf.description import Coupling as MimicSpec
from closedchain.urdf.description import Description, JointRelation, LoopClosure


def as_stated(description: Description) -> Mechanism:
    """Mechanism of a description, its home where the description states it, closed or not.

    Its length is that of the stated posture.

    Raises
    ------
    DescriptionError
        A body with an inertia that is none.
    """
    tree = build_tree(description)
    closures: tuple[Closure | Coupling, ...] = (
        *(_closure(tree, spec) for spec in description.closures),
        *(_mimic(tree, description, spec) for spec in description.couplings),
        *(_relation(tree, description, spec) for spec in description.relations),
    )
    task = description.task
    stated = _stated_home(tree, description)
    mechanism = Mechanism(
        name=description.name,
        model=tree.model,
        closures=closures,
        inputs=tuple(spec.name for spec in description.inputs),
        task=None if task is None else TaskFrame(task.base, task.tip, task.outputs),
        home=stated,
        parameters=description.parameters,
        length=1.0,
        description=description,
        named=Postures,
    )
    return mechanism.with_home(stated, length_at(mechanism, stated))


def length_at(mechanism: Mechanism, q: np.ndarray) -> float:
    """Characteristic length [m]: as stated by the task, else that of a posture (nq,)."""
    task = mechanism.description.task
    if task is not None and task.length is not None:
        return task.length
    data = mechanism.workspace.data
    return characteristic_length(mechanism.model, data, mechanism.closures, q)


def _closure(tree: Tree, spec: LoopClosure) -> Closure:
    joint1, placement1 = tree.supports[spec.parent]
    joint2, placement2 = tree.supports[spec.child]
    return Closure(
        name=spec.name,
        kind=spec.type,
        joint1=joint1,
        placement1=placement1 * se3(spec.parent_origin) * z_onto(spec.parent_axis),
        joint2=joint2,
        placement2=placement2 * se3(spec.child_origin) * z_onto(spec.child_axis),
        parent=spec.parent,
        child=spec.child,
        sizes=dict(spec.sizes),
    )


def _mimic(tree: Tree, description: Description, spec: MimicSpec) -> Coupling:
    return Coupling(
        name=f"{spec.joint}_mimic",
        kind="coupling",
        joints=(
            _coupled(tree, spec.joint, (0.0, 1.0)),
            _coupled(tree, spec.leader, (-spec.offset, -spec.multiplier)),
        ),
        length_row=_slides(description, spec.joint),
    )


def _relation(tree: Tree, description: Description, spec: JointRelation) -> Coupling:
    if spec.type == "linear":
        slopes = spec.coefficients
        terms: list[tuple[float, ...]] = [(-spec.offset, slopes[0])]
        terms += [(0.0, slope) for slope in slopes[1:]]
    else:
        terms = [(0.0, 1.0), tuple(-c for c in spec.coefficients)]
    return Coupling(
        name=spec.name,
        kind=spec.type,
        joints=tuple(map(partial(_coupled, tree), spec.joints, terms)),
        length_row=_slides(description, spec.joints[0]),
    )


def _slides(description: Description, joint: str) -> bool:
    return any(j.name == joint and j.type == "prismatic" for j in description.joints)


def _coupled(tree: Tree, joint: str, coefficients: tuple[float, ...]) -> CoupledJoint:
    number = tree.model.getJointId(joint)
    return CoupledJoint(joint, tree.model.idx_qs[number], tree.model.idx_vs[number], coefficients)


def _stated_home(tree: Tree, description: Description) -> np.ndarray:
    home = np.array(pin.neutral(tree.model))
    for name, values in description.home.items():
        joint = tree.model.joints[tree.model.getJointId(name)]
        home[joint.idx_q : joint.idx_q + joint.nq] = values
    return home
