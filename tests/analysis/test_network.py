"""Davies' network matrix: rank, signs, and rates against those of the constraint Jacobian."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from linkages import arm_with_parallelogram, five_bar, four_bar
from scipy.spatial.transform import Rotation

import closedchain as cc
from closedchain.analysis import screws
from closedchain.analysis.screws.network import VIRTUAL, Network, network
from closedchain.analysis.structure.postures import wander
from closedchain.robots.eclipse import ECLIPSE, inverse, trajectory, wrist_angles
from closedchain.robots.eclipse import screws as eclipse

ROBOTS = ("d1", "eclipse", "eclipse2", "rpa3t", "linear_delta", "rus6")
SIZES = {  # rows, columns, rank
    "d1": (42, 48, 42),
    "eclipse": (12, 18, 12),
    "eclipse2": (12, 18, 12),
    "rpa3t": (24, 23, 20),
    "linear_delta": (30, 21, 18),
    "rus6": (32, 39, 32),
}
load = cache(cc.load)


@cache
def postures(robot: str) -> list[np.ndarray]:
    return wander(load(robot), 3, seed=4)


@pytest.mark.parametrize("robot", ROBOTS)
def test_size_and_rank(robot: str) -> None:
    """On Eclipse N is 12 x 18 of rank 12; planar loops make rows of rpa3t and Delta redundant."""
    m = load(robot)
    for q in postures(robot):
        n = network(m, q)
        assert (*n.matrix.shape, n.rank.value) == SIZES[robot]
        assert n.rank.gap > 1e6
        assert n.mobility == cc.mobility(m).mobility
        assert n.secondary_rank.value == len(n.secondary) == len(n.joints) - len(m.inputs)
        assert set(n.primary) | set(n.secondary) == set(n.joints)
        assert n.N_p.shape[1] + n.N_s.shape[1] == n.matrix.shape[1]
        assert "circuit 1: +" in n.text


@pytest.mark.parametrize("robot", ROBOTS)
def test_rates_are_those_of_the_constraint_jacobian(robot: str) -> None:
    m = load(robot)
    rng = np.random.default_rng(7)
    for q in postures(robot):
        v = rng.normal(size=len(m.inputs))
        motion = cc.acceleration(m, q, v, np.zeros(v.size))
        n = network(m, q)
        rates = dict(zip(n.secondary, n.secondary_rates(v), strict=True))
        size = 1.0 + np.abs(motion.qdot).max()
        for name, rate in rates.items():
            if m.model.existJointName(name):
                column = m.model.idx_vs[m.model.getJointId(name)]
                assert abs(rate - motion.qdot[column]) < 1e-10 * size, name
        pin.forwardKinematics(m.model, m.workspace.data, q, motion.qdot)
        for closure in m.closures:
            if closure.kind == "spherical":
                one, two = (
                    pin.getVelocity(m.model, m.workspace.data, j, pin.WORLD).angular
                    for j in (closure.joint1, closure.joint2)
                )
                turning = [rates[f"{closure.name}.{axis}"] for axis in "xyz"]
                assert_close(turning, two - one, 1e-10 * size, closure.name)


@pytest.mark.parametrize("robot", ROBOTS)
def test_virtual_chain_tells_the_tip_motion(robot: str) -> None:
    """It adds a circuit and no freedom; its rates are the tip's twist."""
    m = load(robot)
    for q in postures(robot):
        plain, n = network(m, q), network(m, q, "3P3R")
        assert n.mobility == plain.mobility
        assert len(n.circuits) == len(plain.circuits) + 1
        v = np.linspace(0.5, -0.4, len(m.inputs))
        twist = cc.acceleration(m, q, v, 0 * v).tip_twist
        rates = dict(zip(n.secondary, n.secondary_rates(v), strict=True))
        chain = np.array([rates[name] for name in VIRTUAL])
        moved = screws.shifted(n.screws[n.columns("virtual")].T @ chain, m.point(q, m.task.tip))
        assert_close(moved, twist[[3, 4, 5, 0, 1, 2]], 1e-10 * (1 + np.abs(chain).max()))
        assert_close(chain[:3], twist[:3], 1e-10 * (1 + np.abs(chain).max()))


def test_circuits_close() -> None:
    """Rates times a circuit's screws, with its signs, add up to no motion."""
    m = load("rus6")
    n = network(m, postures("rus6")[0], "3P3R")
    v = np.linspace(-1.0, 1.0, 7)
    rates = dict(zip(n.primary, v, strict=True))
    rates |= dict(zip(n.secondary, n.secondary_rates(v), strict=True))
    assert rates["leg2_F"] == pytest.approx(rates["leg1_F"], abs=1e-10)
    for number in range(len(n.circuits)):
        names, signed = n.circuit_screws(number)
        total = signed.T @ [rates[name] for name in names]
        assert_close(total, np.zeros(6), 1e-10)
    whole = n.matrix @ [rates[name] for name in n.joints]
    assert_close(whole, np.zeros(len(whole)), 1e-10)


# --- the paper's network of Eclipse ------------------------------------------------------------


def eclipse_posture(k: int) -> tuple[cc.Mechanism, np.ndarray, np.ndarray, np.ndarray]:
    """Eclipse at step ``k`` of eq. (20): configuration, screws of the legs, platform position."""
    m = load("eclipse")
    p = trajectory.position(trajectory.TIMES[k])
    rotation = trajectory.rotation()
    found = inverse(p, rotation, ECLIPSE)
    inputs, q_r = found.inputs[0], found.q_r[0]
    q = m.home.copy()
    q[m.input_q] = inputs
    for leg, value in zip("abc", q_r, strict=True):
        q[m.model.joints[m.model.getJointId(f"{leg}_R")].idx_q] = value
    start = m.model.joints[m.model.getJointId("platform_pose")].idx_q
    q[start : start + 3], q[start + 3 : start + 7] = p, Rotation.from_matrix(rotation).as_quat()
    wrist = wrist_angles(inputs, q_r, rotation, ECLIPSE, 1.0)
    return m, q, eclipse.leg_screws(inputs, q_r, wrist, ECLIPSE, 1.0), p


def paper_order(n: Network) -> np.ndarray:
    names = [f"{leg}_{joint}" for leg in "abc" for joint in ("Pc", "Pv", "R", "S")]
    return n.columns(names)


@pytest.mark.parametrize("k", [0, 37, 80])
def test_eclipse_network_is_the_papers(k: int) -> None:
    """Circuits a-b and a-c as in eq. (5), the wrist's three hinges taken for the sphere."""
    m, q, legs, _ = eclipse_posture(k)
    n = network(m, q)
    assert [str(c) for c in n.circuits] == [
        f"+a_Pc +a_Pv +a_R +a_S -{x}_S -{x}_R -{x}_Pv -{x}_Pc" for x in "bc"
    ]
    ours, theirs = n.matrix[:, paper_order(n)], eclipse.network(legs)
    for leg in range(3):
        joints = slice(6 * leg, 6 * leg + 3)
        assert_close(ours[:, joints], theirs[:, joints], 1e-10)
    for circuit in (slice(0, 6), slice(6, 12)):
        for leg in range(3):  # the same space of turns about S
            wrist = slice(6 * leg + 3, 6 * leg + 6)
            one, two = ours[circuit, wrist], theirs[circuit, wrist]
            turn = np.linalg.lstsq(one, two, rcond=None)[0]
            assert_close(one @ turn, two, 1e-10)
    assert np.linalg.matrix_rank(theirs) == n.rank.value == 12


@pytest.mark.parametrize("k", [0, 37, 80])
def test_eclipse_led_by_its_plate(k: int) -> None:
    """Eqs (7), (16): with the virtual chain leading, M_j qdot_j = M_1 xdot in every leg."""
    m, q, legs, p = eclipse_posture(k)
    n = network(m, q, "3P3R", primary=VIRTUAL)
    assert n.matrix.shape == (18, 24)
    assert [str(c) for c in n.circuits] == [
        f"+{x}_Pc +{x}_Pv +{x}_R +{x}_S -virtual" for x in "abc"
    ]
    chain = eclipse.virtual_screws(p, trajectory.ANGLES)
    assert_close(n.screws[n.columns(VIRTUAL)].T, chain, 1e-10)
    lead = np.concatenate([trajectory.velocity(trajectory.TIMES[k]), [0.3, -0.2, 0.1]])
    rates = dict(zip(n.secondary, n.secondary_rates(lead), strict=True))
    for leg, columns in zip("abc", legs, strict=True):
        wanted = np.linalg.solve(columns, chain @ lead)
        ours = [rates[f"{leg}_{joint}"] for joint in ("Pc", "Pv", "R")]
        assert_close(ours, wanted[:3], 1e-9)
        turn = [rates[f"{leg}_S.{axis}"] for axis in "xyz"]
        assert_close(turn, columns[:3, 3:] @ wanted[3:], 1e-9)


# --- other linkages, questions that have no answer ------------------------------------------------


def test_small_linkages() -> None:
    n = network(m := four_bar(), m.home)
    assert (*n.matrix.shape, n.rank.value, n.mobility) == (6, 4, 3, 1)
    n = network(m := five_bar(coupled=True), m.home)
    assert (n.matrix.shape[0], n.mobility) == (7, 1)  # the coupling is a row of its own
    n = network(m := arm_with_parallelogram(), m.home)
    assert n.mobility == cc.mobility(m).mobility


def test_what_is_not_determined_is_named() -> None:
    m = load("eclipse")
    n = network(m, m.home, primary=("a_Pc", "a_Pv"))
    with pytest.raises(cc.ClosureError, match=r"do not determine the others.*b_Pc"):
        n.secondary_rates([0.1, 0.2])
    n = network(m, m.home, primary=(*network(m, m.home).primary, "a_R"))
    with pytest.raises(cc.ClosureError, match="contradict each other"):
        n.secondary_rates([0.1, 0.0, 0.0, 0.2, 0.0, 0.0, 5.0])
    with pytest.raises(cc.ClosureError, match="no rate for primary joint"):
        n.secondary_rates({"a_R": 1.0})
    with pytest.raises(cc.ClosureError, match="'a_X'"):
        network(m, m.home, primary=("a_X",))
    with pytest.raises(cc.ClosureError, match="named twice"):
        network(m, m.home, primary=("a_R", "a_R"))
    with pytest.raises(cc.ClosureError, match="3P3R"):
        network(m, m.home, "6R")  # type: ignore[arg-type]
