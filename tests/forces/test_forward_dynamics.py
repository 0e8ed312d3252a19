"""Forward dynamics and simulation: Pinocchio's constrained dynamics, MuJoCo, energy, quadrature."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from heavy import moved, weighed
from scipy.integrate import quad

import closedchain as cc
from closedchain.closure.solve.outcome import Ending

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkage_text import J, load
from linkages import flat_parallelogram, four_bar

PUSH = np.array([3.0, -2.0, 5.0, 0.4, -0.3, 0.2])
DOWN = [0.0, -9.81, 0.0]


def state(m: cc.Mechanism, seed: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Posture, velocity that the loops allow, efforts."""
    rng = np.random.default_rng(seed)
    q = moved(m)
    rates, wanted = rng.standard_normal((2, len(m.inputs)))
    v = cc.inverse_dynamics(m, q, 0.3 * rates, 0 * rates).v
    return q, v, 10.0 * wanted


@pytest.mark.parametrize("name", ["d1", "eclipse"])
def test_accelerations_are_those_of_pinocchio(name: str) -> None:
    """Its solver of rigid constraints, for mechanisms that were cut at balls alone."""
    m = weighed(cc.load(name))
    assert {c.kind for c in m.closures} == {"spherical"}
    q, v, tau = state(m)
    found = cc.forward_dynamics(m, q, v, tau).a
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for c in m.closures:
        places = (c.joint1, c.placement1, c.joint2, c.placement2)
        ball = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, m.model, *places, pin.LOCAL)
        models.append(ball)
        datas.append(ball.createData())
    data = m.model.createData()
    pin.initConstraintDynamics(m.model, data, models, datas)
    efforts = np.zeros(m.model.nv)
    efforts[m.input_v] = tau
    settings = pin.ProximalSettings(1e-13, 1e-12, 200)
    expected = pin.constraintDynamics(m.model, data, q, v, efforts, models, datas, settings)
    assert_close(found, expected, 1e-8 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("name", ["d1", "rpa3t", "linear_delta"])
def test_forward_undoes_inverse(name: str) -> None:
    m = weighed(cc.load(name))
    q, _, wanted = state(m)
    rates = 0.03 * wanted
    there = cc.inverse_dynamics(m, q, rates, wanted, PUSH)
    back = cc.forward_dynamics(m, q, there.v, there.inputs, wrench=PUSH)
    assert_close(back.inputs, wanted, 1e-8 * np.abs(wanted).max())
    assert_close(back.a, there.a, 1e-8 * np.abs(there.a).max())


def swinging(**joints: str) -> cc.Mechanism:
    return weighed(four_bar({"q1": "A"}), seed=4)


def test_energy_is_kept_and_loops_stay_closed() -> None:
    m = weighed(cc.load("d1"), seed=3)
    r = cc.simulate(m, m.home, None, None, 0.3, limits=False)
    assert r.ending is Ending.ARRIVED
    assert len(r.t) == 101
    assert r.t[-1] == 0.3
    assert r.residual < 1e-12
    assert np.abs(r.energy - r.energy[0]).max() < 1e-9
    assert r.drift < 1e-8
    assert np.abs(r.v[-1]).max() > 0.01
    for q, v in zip(r.q[::20], r.v[::20], strict=True):
        assert np.abs(cc.constraint_jacobian(m, q) @ v).max() < 1e-12
    assert not r.work.any()


def test_work_of_efforts_and_friction_is_counted() -> None:
    text = swinging().description.text.replace(
        '<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics damping="0.05" armature="0.01"/>'
    )
    m = cc.load_urdf(text, xacro=False)
    push = {"coupler": [1.0, 2.0, 0, 0, 0, 0.3]}
    r = cc.simulate(m, m.home, None, lambda t, q, v: [0.3 * np.sin(9 * t)], 1.0,
                    gravity=DOWN, wrench=push, limits=False)  # fmt: skip
    assert r.drift < 1e-7
    assert np.abs(r.work).max() > 0.01
    assert_close(r.energy - r.energy[0], r.work, 1e-7)


def test_four_bar_by_quadrature() -> None:
    """One freedom: t is the integral of da / a', with a' from the energy and closed-form rates."""
    m = swinging()
    r = cc.simulate(m, m.home, None, None, 0.15, gravity=DOWN, limits=False)

    def posture(a: float) -> np.ndarray:
        """A, B, D by the triangle of the crank's end, D and C."""
        end = 0.15 * np.array([np.cos(a), np.sin(a)])
        way = np.array([0.4, 0.0]) - end
        size = np.hypot(*way)
        lean = np.arccos((0.35**2 + size**2 - 0.3**2) / (2 * 0.35 * size))
        coupler = np.arctan2(way[1], way[0]) + lean
        tip = end + 0.35 * np.array([np.cos(coupler), np.sin(coupler)])
        return np.array([a, coupler - a, np.arctan2(tip[1], tip[0] - 0.4)])

    assert_close(posture(m.home[0]), m.home, 1e-9)
    data = m.model.createData()
    lever = [np.array(i.lever) for i in m.model.inertias]

    def potential(q: np.ndarray) -> float:
        pin.forwardKinematics(m.model, data, q)
        return sum(i.mass * 9.81 * data.oMi[k].act(lever[k])[1]
                   for k, i in enumerate(m.model.inertias) if k)  # fmt: skip

    def per_rate(a: float) -> float:
        """1 / a' on the way, by the effective inertia and the energy."""
        q = posture(a)
        turn, rocker = q[0] + q[1], q[2]
        bend = 0.15 * np.sin(a - rocker) / (0.35 * np.sin(rocker - turn))
        swing = 0.15 * np.sin(a - turn) / (0.3 * np.sin(rocker - turn))
        v = np.array([1.0, bend - 1.0, swing])
        inertia = 2 * pin.computeKineticEnergy(m.model, data, q, v)
        return 1.0 / np.sqrt(2 * (potential(m.home) - potential(q)) / inertia)

    ends = r.q[[20, -1], 0]  # not from rest, where the integrand is infinite
    way = np.sign(ends[1] - ends[0])
    taken, _ = quad(per_rate, *ends, epsabs=1e-12, epsrel=1e-12)
    assert abs(way * taken - (r.t[-1] - r.t[20])) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "linear_delta"])
def test_motion_is_that_of_mujoco(name: str) -> None:
    """Its constraints are soft: postures agree to what these give way over a second."""
    mujoco = pytest.importorskip("mujoco")
    m = swinging() if name == "four_bar" else weighed(cc.load(name))
    fall = DOWN if name == "four_bar" else [0.0, 0.0, -2.0]
    text, _ = cc.export(m, "mjcf")
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep = 1e-4
    model.opt.gravity[:] = fall
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.eq_solref[:] = [4e-4, 1.0]
    model.eq_solimp[:] = [0.9999, 0.9999, 1e-4, 0.5, 2.0]
    data = mujoco.MjData(model)
    joints = {n: model.joint(n).qposadr[0] for n in list(m.model.names)[1:]}
    for n, at in joints.items():
        data.qpos[at] = m.home[m.model.idx_qs[m.model.getJointId(n)]]
    mujoco.mj_forward(model, data)
    r = cc.simulate(m, m.home, None, None, 1.0, gravity=fall, limits=False)
    while data.time < 1.0 - 1e-9:
        mujoco.mj_step(model, data)
    for n, at in joints.items():
        i = m.model.idx_qs[m.model.getJointId(n)]
        assert abs(data.qpos[at] - r.q[-1, i]) < 2e-3, n
    assert np.abs(r.q[-1] - m.home).max() > 0.05


def test_limits_end_a_motion_where_they_are_met() -> None:
    text = swinging().description.text.replace('lower="-9" upper="9"', 'lower="-9" upper="2.0"')
    m = cc.load_urdf(text, xacro=False)
    r = cc.simulate(m, m.home, None, [2.0], 5.0, gravity=False)
    assert r.ending is Ending.LIMIT
    assert "D" in r.message or "A" in r.message
    assert abs(r.q[-1].max() - 2.0) < 1e-8
    assert r.events[-1].kind == "limit"
    assert r.t[-1] < 5.0


def test_a_direct_singularity_is_passed_and_told() -> None:
    """Driven at the rocker; the crank runs through the line of crank and coupler."""
    m = weighed(four_bar({"q1": "D"}), seed=4)
    v = np.zeros(3)
    k = cc.constraint_jacobian(m, m.home)
    v = np.linalg.svd(k)[2][-1]
    v = 20.0 * v / v[0]
    r = cc.simulate(m, m.home, v, None, 0.3, gravity=False, limits=False)
    told = [event for event in r.events if event.kind == "direct"]
    assert told
    fine = cc.simulate(m, m.home, v, None, told[0].t, gravity=False, limits=False)
    _, b, _ = fine.q[-1]
    assert abs(np.sin(b)) < 1e-6  # crank and coupler in line
    assert r.ending is Ending.ARRIVED


def test_a_flat_parallelogram_is_a_constraint_singularity() -> None:
    """At the flat posture it could go on as parallelogram or as antiparallelogram."""
    m = weighed(flat_parallelogram(0.5), seed=6)
    for speed in (5.0, 5.1):
        v = [-speed, speed, -speed]
        r = cc.simulate(m, m.home, v, None, 0.2, gravity=False, limits=False)
        assert r.ending is Ending.SINGULARITY
        assert [event.kind for event in r.events][-1] == "constraint"
        assert abs(r.t[-1] - 0.5 / speed) < 1e-6
        assert np.abs(r.q[-1]).max() < 1e-5
        assert r.residual < 1e-12


def test_friction_brings_it_to_rest() -> None:
    text = swinging().description.text.replace(
        '<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><dynamics friction="0.2" damping="0.05"/>', 1
    )
    m = cc.load_urdf(text, xacro=False)
    v = np.linalg.svd(cc.constraint_jacobian(m, m.home))[2][-1]
    r = cc.simulate(m, m.home, v / v[0], None, 1.0, gravity=False, limits=False, accuracy=1e-7)
    assert r.energy[0] > 1e-4
    assert r.energy[-1] < 1e-8
    assert r.drift < 1e-6


def test_dataset() -> None:
    m = swinging()
    r = cc.simulate(m, m.home, None, None, 0.1, every=0.03, gravity=DOWN)
    assert_close(r.t, [0.0, 0.03, 0.06, 0.09, 0.1], 1e-15)
    found = r.to_dataset()
    assert dict(found.sizes) == {"time": 5, "coordinate": 3, "velocity": 3}
    assert_close(found["energy"].values, r.energy, 0.0)


def test_what_cannot_be_simulated_is_refused() -> None:
    m = swinging()
    with pytest.raises(cc.ClosureError, match="contradict the loops"):
        cc.forward_dynamics(m, m.home, [1.0, 0.0, 0.0])
    with pytest.raises(cc.ClosureError, match="contradict the loops"):
        cc.simulate(m, m.home, [1.0, 0.0, 0.0], None, 1.0)
    with pytest.raises(cc.ClosureError, match="no inertia"):
        cc.forward_dynamics(four_bar(), four_bar().home, np.zeros(3))
    with pytest.raises(cc.ClosureError, match="the loops are open there"):
        cc.simulate(m, m.home + 0.1, None, None, 1.0)
    with pytest.raises(cc.ClosureError, match="efforts"):
        cc.simulate(m, m.home, None, lambda t, q, v: [1.0, 2.0], 1.0)
    for words in ({"until": 0.0}, {"until": 1.0, "every": 2.0}, {"until": np.nan}):
        with pytest.raises(cc.ClosureError, match="above zero"):
            cc.simulate(m, m.home, None, None, **words)


def test_open_chains_too() -> None:
    """A pendulum: a'' = -(m g l / I) sin a, small swings in 2 pi sqrt(I / m g l)."""
    m = load("pendulum", [J("A", "base", "bob", axis="0 1 0")], inputs={"q": "A"}, tip="bob")
    text = m.description.text.replace(
        '<link name="bob"/>',
        '<link name="bob"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>'
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>',
    )
    m = cc.load_urdf(text, xacro=False)
    period = 2 * np.pi * np.sqrt((0.1 + 2 * 0.25) / (2 * 9.81 * 0.5))
    r = cc.simulate(m, [1e-4], None, None, period)
    assert_close(r.q[-1], [1e-4], 1e-9)
    assert_close(r.q[50], [-1e-4], 1e-9)
