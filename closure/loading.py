"""From a description to a mechanism: Pinocchio model, closures, task, length, closed home."""

from __future__ import annotations

import os
from functools import partial

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure, CoupledJoint, Coupling
from closedchain.closure.length import characteristic_length
from closedchain.closure.mechanism import Mechanism, TaskFrame
from closedchain.closure.named import Postures
from closedchain.closure.nearest import closed_beside
from closedchain.closure.tree import Tree, build_tree, se3, z_onto
from closedchain.urdf.description import Coupling as MimicSpec
from closedchain.urdf.description import Description, JointRelation, LoopClosure, ParameterValue
from closedchain.urdf.errors import DescriptionError


def load_urdf(
    source: str | os.PathLike[str], *, xacro: bool = True, **parameters: ParameterValue
) -> Mechanism:
    """Load a closed-chain mechanism from a URDF or xacro file, or from its text.

    A xacro file is code: it evaluates Python expressions. ``xacro=False`` reads plain URDF only
    and is there for text that is not trusted.

    Parameters
    ----------
    source : path or str
        A file, or the text itself (it begins with ``<``).
    parameters : numbers, strings or booleans
        Values for the file's ``<xacro:arg>``.

    Raises
    ------
    DescriptionError
        Anything wrong with the file or the parameters, with line, element and name.
    """
    from closedchain.urdf import load_description

    return mechanism_from_description(load_description(source, parameters, xacro=xacro))


def mechanism_from_description(description: Description) -> Mechanism:
    """Build the mechanism that a description describes and close its home posture.

    Raises
    ------
    DescriptionError
        The loops cannot be closed from the stated home posture; names the closure that stays open.
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
    # the length of the stated posture closes home, whose own length then holds
    mechanism = mechanism.with_home(stated, _length(mechanism, stated))
    home = _closed_home(mechanism, stated)
    return mechanism.with_home(home, _length(mechanism, home))


def _length(mechanism: Mechanism, q: np.ndarray) -> float:
    """Characteristic length [m]: as stated by the task, else that of a posture (nq,)."""
    task = mechanism.description.task
    if task is not None and task.length is not None:
        return task.length
    data = mechanism.workspace.data
    return characteristic_length(mechanism.model, data, mechanism.closures, q)


def _closed_home(mechanism: Mechanism, stated: np.ndarray) -> np.ndarray:
    if not mechanism.closures:
        return stated
    solution = closed_beside(mechanism, stated)
    if not solution.converged:
        raise DescriptionError(
            f"the home posture of {mechanism.name!r} cannot be closed: {solution.message}; give "
            'parameters that fit, or joint values nearer to closure in <group_state name="home">'
        )
    return solution.q


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
