"""Inverse dynamics and the equation of motion of the inputs: energy, free bodies, by hand."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from heavy import moved, potential, weighed

import closedchain as cc
from closedchain.closure.closures import Closure

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkages import four_bar, spinning_rod

FALL = np.array([0.0, 0.0, -9.81])
PUSH = np.array([3.0, -2.0, 5.0, 0.4, -0.3, 0.2])


@pytest.fixture(scope="module", params=["d1", "eclipse", "rpa3t", "linear_delta", "rus6"])
def robot(request: pytest.FixtureRequest) -> cc.Mechanism:
    return weighed(cc.load(request.param))


def rates(m: cc.Mechanism, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return 0.1 * rng.standard_normal((2, len(m.inputs)))


def energy(m: cc.Mechanism, q: np.ndarray, v: np.ndarray) -> float:
    data = m.model.createData()
    return pin.computeKineticEnergy(m.model, data, q, v) + potential(m, q, FALL)


def test_power_is_the_rate_of_energy(robot: cc.Mechanism) -> None:
    """Along inputs of constant acceleration; the energy by differences, at three moments."""
    q = moved(robot)
    va, aa = rates(robot)
    found = cc.inverse_dynamics(robot, q, va, aa)
    h, energies = 1e-3, []
    for t in (h, -h, 2 * h, -2 * h):
        at = cc.direct(robot, robot.input_values(q) + va * t + aa * t * t / 2, q)
        v = cc.inverse_dynamics(robot, at.raise_if_failed().q, va + aa * t, aa).v
        energies.append(energy(robot, at.q, v))
    near, far = energies[0] - energies[1], energies[2] - energies[3]
    slope = (8 * near - far) / (12 * h)
    assert abs(found.powers.sum() - slope) < 1e-6 * max(1.0, np.abs(found.powers).max())


def test_every_body_obeys_newton_and_euler(robot: cc.Mechanism) -> None:
    """All joints cut: what the joints carry makes each body accelerate as it does."""
    q = moved(robot)
    va, aa = rates(robot)
    found = cc.inverse_dynamics(robot, q, va, aa, PUSH)
    m, model, data = robot, robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q, found.v, found.a)
    assert np.abs(cc.constraint_jacobian(m, q) @ found.v).max() < 1e-9
    drift = cc.constraint_drift(m, q, found.v)
    assert np.abs(cc.constraint_jacobian(m, q) @ found.a + drift).max() < 1e-8
    left = np.zeros((model.njoints, 6))

    def act(body: int, place: pin.SE3, wrench: np.ndarray, sign: float = 1.0) -> None:
        left[body] += sign * place.act(pin.Force(wrench)).vector

    for i in range(1, model.njoints):
        inertia, place = model.inertias[i], data.oMi[i]
        # momentum about the world's origin, by differences of Newton and Euler's own terms
        rate = inertia * data.a[i] + data.v[i].cross(inertia * data.v[i])
        act(i, place, rate.vector, -1.0)
        weight = np.concatenate([inertia.mass * FALL, np.zeros(3)])
        act(i, pin.SE3(np.eye(3), place.act(np.array(inertia.lever))), weight)
        if model.names[i] in found.forces.joints:
            act(i, place, found.forces.joints[model.names[i]])
            act(model.parents[i], place, found.forces.joints[model.names[i]], -1.0)
    tip = model.frames[m.frame_id(m.task.tip)]
    at = data.oMi[tip.parentJoint] * tip.placement
    act(tip.parentJoint, pin.SE3(np.eye(3), at.translation), PUSH)
    for closure in m.closures:
        if isinstance(closure, Closure):
            one = data.oMi[closure.joint1] * closure.placement1
            two = data.oMi[closure.joint2] * closure.placement2
            place = pin.SE3(one.rotation, two.translation)
            act(closure.joint2, place, found.forces.closures[closure.name])
            act(closure.joint1, place, found.forces.closures[closure.name], -1.0)
    scale = max(np.abs(w).max() for w in found.forces.joints.values())
    assert np.abs(left[1:]).max() < 1e-9 * max(1.0, scale)


def test_terms_add_up_to_the_inverse_dynamics(robot: cc.Mechanism) -> None:
    q = moved(robot)
    va, aa = rates(robot)
    d = cc.input_dynamics(robot, q, va)
    whole = cc.inverse_dynamics(robot, q, va, aa).inputs
    scale = np.abs(whole).max()
    assert_close(d.mass @ aa + d.coriolis + d.gravity + d.friction, whole, 1e-9 * scale)
    assert_close(d.mass, d.mass.T, 1e-12 * np.abs(d.mass).max())
    assert np.linalg.eigvalsh(d.mass)[0] > 0.0
    assert_close(d.mass, cc.mass_matrix(robot, q), 0.0)
    assert_close(d.gravity, cc.statics(robot, q).inputs, 1e-9 * scale)


def test_coriolis_by_differences_of_the_mass_matrix(robot: cc.Mechanism) -> None:
    """c_k = sum_ij (dM_ki/dx_j - dM_ij/dx_k / 2) v_i v_j, Lagrange's equations."""
    q = moved(robot)
    va, _ = rates(robot)
    n, h = len(robot.inputs), 1e-5
    slopes = np.zeros((n, n, n))  # dM / dx_k
    for k in range(n):
        step = np.eye(n)[k] * h
        ends = [
            cc.mass_matrix(robot, cc.direct(robot, robot.input_values(q) + s * step, q).q)
            for s in (1, -1)
        ]
        slopes[k] = (ends[0] - ends[1]) / (2 * h)
    expected = np.einsum("jki,i,j->k", slopes, va, va) - np.einsum("kij,i,j->k", slopes, va, va) / 2
    found = cc.input_dynamics(robot, q, va).coriolis
    assert_close(found, expected, 1e-6 * max(1.0, np.abs(expected).max()))


def test_slider_crank_by_hand() -> None:
    """Only the slider has a mass m: M = m x'^2, c = m x' x'' w^2, x by the crank's angle."""
    r, rod = 0.1, 0.3
    text = f"""<robot name="sc"><link name="base"/><link name="crank"/>
      <link name="slider"><inertial><mass value="2"/>
        <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
      <joint name="A" type="continuous"><parent link="base"/><child link="crank"/>
        <axis xyz="0 0 1"/><dynamics damping="0.02" friction="0.3" armature="0.001"/></joint>
      <joint name="S" type="prismatic"><parent link="base"/><child link="slider"/>
        <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
        <dynamics damping="5" friction="2"/></joint>
      <constraint name="rod" type="distance" length="{rod}"><parent link="crank"/>
        <parent_origin xyz="{r} 0 0"/><child link="slider"/></constraint>
      <transmission name="q"><joint name="A"/><actuator name="motor">
        <mechanicalReduction>-20</mechanicalReduction><rotorInertia>1e-5</rotorInertia>
      </actuator></transmission>
      <task base="base" tip="slider" outputs="x"/>
      <group_state name="home"><joint name="A" value="0.7"/><joint name="S" value="0.36"/>
      </group_state></robot>"""
    m = cc.load_urdf(text, xacro=False)
    a, w, acc = m.home[0], 3.0, -5.0
    s, c = np.sin(a), np.cos(a)
    root = np.sqrt(rod**2 - (r * s) ** 2)
    slope = -r * s - r**2 * s * c / root
    bend = -r * c - r**2 * (c * c - s * s) / root - r**4 * (s * c) ** 2 / root**3
    d = cc.input_dynamics(m, m.home, [w])
    rotor = 0.001 + 400 * 1e-5
    assert_close(d.mass, [[2 * slope**2 + rotor]], 1e-12)
    assert_close(d.reflected_inertia, [[rotor]], 1e-15)
    assert_close(d.coriolis, [2 * slope * bend * w**2], 1e-11)
    assert_close(d.gravity, [0.0], 1e-12)
    dry = 0.3 + 2 * np.sign(slope) * slope
    assert_close(d.friction, [0.02 * w + 5 * slope**2 * w + dry], 1e-12)
    found = cc.inverse_dynamics(m, m.home, [w], [acc])
    whole = d.mass[0, 0] * acc + d.coriolis[0] + d.friction[0]
    assert_close(found.inputs, [whole], 1e-11)
    assert_close(found.motors, [whole / -20], 1e-11)
    # the rod carries what the slider needs
    force = 2 * (slope * acc + bend * w**2) + 5 * slope * w + 2 * np.sign(slope)
    along = root / rod
    assert abs(np.linalg.norm(found.forces.closures["rod"][:3]) - abs(force / along)) < 1e-10
    assert any("motors of 'q'" in note for note in m.notes)


def test_idle_spins_accelerate_as_inertia_has_it() -> None:
    """A rod between two balls, its mass off its line: gravity turns it."""
    m = weighed(spinning_rod(), seed=5)
    found = cc.inverse_dynamics(m, m.home, [0.0], [0.0])
    assert found.forces.carried, found.forces.text
    assert np.abs(found.a).max() > 0.1
    assert found.a[0] == 0.0
    assert_close(found.v, np.zeros(4), 1e-12)
    assert cc.mass_matrix(m, m.home)[0, 0] > 0.0
    assert not cc.statics(m, m.home).carried


def test_payload_counts_as_mass() -> None:
    m = weighed(cc.load("linear_delta"))
    q = moved(m)
    tip = m.task.tip
    twist_map = cc.velocity(m, q, "x y z").twist_map
    more = cc.mass_matrix(m, q, payload={tip: 2.0}) - cc.mass_matrix(m, q)
    assert_close(more, 2.0 * twist_map.T @ twist_map, 1e-10)


def test_questions_without_an_answer_are_refused() -> None:
    m = four_bar({"q1": "D"})
    d = np.pi - np.arccos((0.4**2 + 0.3**2 - 0.5**2) / (2 * 0.4 * 0.3))
    q = np.array([np.arctan2(0.3 * np.sin(d), 0.4 + 0.3 * np.cos(d)), 0.0, d])
    with pytest.raises(cc.ClosureError, match=r"direct singularity.*joints A, B"):
        cc.inverse_dynamics(m, q, [0.1], [0.0])
    spare = four_bar({"q1": "A", "q2": "D"})
    with pytest.raises(cc.ClosureError, match="more inputs than freedoms"):
        cc.inverse_dynamics(spare, spare.home, [1.0, 0.0], [0.0, 0.0])
    with pytest.raises(cc.ClosureError, match="more inputs than freedoms"):
        cc.mass_matrix(spare, spare.home)
    with pytest.raises(cc.ClosureError, match="too few inputs"):
        cc.mass_matrix(four_bar({}), four_bar({}).home)
