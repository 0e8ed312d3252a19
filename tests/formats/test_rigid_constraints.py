"""Closures as Pinocchio's own constraint models."""

import numpy as np
import pinocchio as pin
import pytest
from one_closure import mechanism

import closedchain as cc


def jacobian(m: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    """Pinocchio's Jacobian of its constraint models."""
    models = m.pinocchio_constraints()
    data = m.model.createData()
    zero = np.zeros(m.model.nv)
    pin.forwardKinematics(m.model, data, q, zero, zero)
    pin.computeJointJacobians(m.model, data, q)
    rows = []
    for model in models:
        constraint = model.createData()
        model.calc(m.model, data, constraint)
        size = 6 if model.type == pin.ContactType.CONTACT_6D else 3
        rows.append(np.array(pin.getConstraintJacobian(m.model, data, model, constraint))[:size])
    return np.vstack(rows)


def rank(matrix: np.ndarray) -> int:
    s = np.linalg.svd(matrix, compute_uv=False)
    return int((s > 1e-9 * s[0]).sum())


@pytest.mark.parametrize("name", ["d1", "linear_delta", "rpa3t", "eclipse"])
def test_they_leave_the_same_motions(name: str) -> None:
    m = cc.load(name)
    ours, theirs = cc.constraint_jacobian(m, m.home), jacobian(m, m.home)
    assert rank(ours) == rank(theirs) == rank(np.vstack([ours, theirs]))
    names = [model.name for model in m.pinocchio_constraints()]
    hinges = sum(c.kind == "revolute" for c in m.closures)
    assert len(names) == len(m.closures) + hinges
    assert set(names) >= {c.name for c in m.closures}


def test_constrained_dynamics_of_pinocchio_accepts_them() -> None:
    """No closed point accelerates apart; the tree alone would let them."""
    m = cc.load("d1")
    model = m.model.copy()
    for joint in range(1, model.njoints):
        model.inertias[joint] = pin.Inertia.FromSphere(1.0, 0.1)
    models = pin.StdVec_RigidConstraintModel()
    datas = pin.StdVec_RigidConstraintData()
    for constraint in m.pinocchio_constraints():
        models.append(constraint)
        datas.append(constraint.createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, models, datas)
    zero = np.zeros(model.nv)
    a = pin.constraintDynamics(model, data, m.home, zero, zero, models, datas)
    assert np.abs(a).max() > 0.1
    assert np.abs(cc.constraint_jacobian(m, m.home) @ a).max() < 1e-8


def test_what_points_and_frames_cannot_say_is_refused() -> None:
    with pytest.raises(cc.ClosureError, match=r"'c' \(planar, base to body\)"):
        mechanism("planar").pinocchio_constraints()
    with pytest.raises(cc.ClosureError, match="coupling of joint"):
        cc.load("rus6").pinocchio_constraints()
    assert mechanism("fixed").pinocchio_constraints()[0].type == pin.ContactType.CONTACT_6D
