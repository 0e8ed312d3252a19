"""Forces: efforts, accelerations and steps of a simulation, beside Pinocchio and MuJoCo.

Pinocchio's loop is its gravity torques for the tree and LAPACK for the closures; its constrained
dynamics take mechanisms that were cut at balls alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.util import find_spec

import numpy as np
import pinocchio as pin

import closedchain as cc
from benchmarks.cases import Case
from benchmarks.timing import OURS, Row, a_call, least
from closedchain.analysis.forces.integrating import State, Stepper
from closedchain.analysis.forces.plant import plant_under

ONE, BULK = "input efforts", "input efforts, in bulk"
FORWARD, STEP = "forward dynamics", "a step of a simulation"
STATES = "random closed states, one of many"
LOOP = "Pinocchio + LAPACK"
PUSH = np.array([10.0, -5.0, 20.0, 1.0, 0.5, -0.3])
MANY = 20_000


def rows(case: Case, repeats: int) -> Iterator[Row]:
    """Efforts that hold a wrench and the weights, and accelerations under none."""
    m, q = case.start()
    heavy = any(inertia.mass for inertia in m.model.inertias)
    peers = mujoco_calls(m, q) if heavy else {}
    yield Row(
        case.robot, ONE, OURS, a_call(lambda: cc.input_efforts(m, q, PUSH), repeats),
        note="checked, from Python",
    )  # fmt: skip
    yield Row(case.robot, ONE, LOOP, a_call(lambda: by_lapack(m, q), repeats))
    for tool in peers.keys() & {"MuJoCo mj_inverse"}:
        yield Row(case.robot, ONE, tool, a_call(peers[tool], repeats))
    many = np.tile(q, (MANY, 1))
    seconds = least(lambda: cc.input_efforts(m, many, PUSH), max(3, repeats // 200)) / MANY
    yield Row(case.robot, BULK, OURS, seconds)
    seconds = least(lambda: cc.resets(m, MANY, workers=1), 1) / MANY
    yield Row(case.robot, STATES, OURS, seconds, note="with velocities")
    if heavy:
        yield from forward(case.robot, m, q, repeats)
        for work, tool in ((FORWARD, "MuJoCo mj_forward"), (STEP, "MuJoCo mj_step")):
            if tool in peers:
                yield Row(case.robot, work, tool, a_call(peers[tool], repeats))


def mujoco_calls(m: cc.Mechanism, q: np.ndarray) -> dict[str, Callable[[], None]]:
    """MuJoCo's dynamics, where it is installed."""
    if find_spec("mujoco") is None:
        return {}
    from benchmarks.mujoco_forces import calls

    return calls(m, q, np.ones(len(m.inputs)))


def by_lapack(m: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    """Input efforts with what Pinocchio and NumPy bring."""
    data = m.workspace.data
    g = pin.computeGeneralizedGravity(m.model, data, q)
    tip = m.model.frames[m.frame_id(m.required_task().tip)]
    pin.computeJointJacobians(m.model, data, q)
    where = (m.model, data, tip.parentJoint, tip.placement, pin.LOCAL_WORLD_ALIGNED)
    needed = g - pin.getFrameJacobian(*where).T @ PUSH
    _, k = m.workspace.evaluate(q)
    p, a = m.passive_v, m.input_v
    multipliers = np.linalg.lstsq(k[:, p].T, needed[p], rcond=None)[0]
    return np.asarray(needed[a] - k[:, a].T @ multipliers)


def forward(robot: str, m: cc.Mechanism, q: np.ndarray, repeats: int) -> Iterator[Row]:
    """Accelerations from rest, and a step from there."""
    plant, v, tau = plant_under(m), np.zeros(m.model.nv), np.ones(len(m.inputs))
    yield Row(
        robot, FORWARD, OURS, a_call(lambda: plant.acceleration(q, v, tau), repeats),
        note="as a step of cc.simulate asks for it",
    )  # fmt: skip
    stepper, start = Stepper(plant, lambda t, q, v: tau), State(0.0, q, v, 0.0)
    yield Row(
        robot, STEP, OURS, a_call(lambda: stepper.step(start, 1e-3), repeats),
        note="seven stages, loops closed to 1e-12",
    )  # fmt: skip
    if {c.kind for c in m.closures} != {"spherical"}:
        return
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for c in m.closures:
        places = (c.joint1, c.placement1, c.joint2, c.placement2)
        models.append(
            pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, m.model, *places, pin.LOCAL)
        )
        datas.append(models[-1].createData())
    data, efforts = m.model.createData(), np.zeros(m.model.nv)
    efforts[m.input_v] = tau
    pin.initConstraintDynamics(m.model, data, models, datas)
    settings = pin.ProximalSettings(1e-12, 1e-10, 100)
    seconds = a_call(
        lambda: pin.constraintDynamics(m.model, data, q, v, efforts, models, datas, settings),
        repeats,
    )
    yield Row(robot, FORWARD, "Pinocchio constraintDynamics", seconds)
