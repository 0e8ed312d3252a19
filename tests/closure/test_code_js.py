"""Mechanisms exported as JavaScript: run by node, and compared with Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from exported import AGREE, NODE, Asked, asked, heavy, run_js
from small_linkages import build, joint, loop

import closedchain as cc

pytestmark = pytest.mark.skipif(NODE is None, reason="no node here")

WRENCH, FALL = [1.0, -2.0, 3.0, 0.3, 0.2, -0.1], [0.5, 9.0, -1.0]
EVERYTHING = """
const {targets, poses, postures} = given;
return {
    direct: targets.map((u) => robot.direct(u)),
    inverse: poses.map((pose) => robot.inverse(pose, postures[0])),
    tips: postures.map(robot.tip),
    inputs: postures.map(robot.inputsOf),
    bodies: robot.bodies(postures[0]),
    measures: postures.map(robot.measure),
    home: robot.measure(robot.home),
    weights: postures.map((q) => robot.efforts(q)),
    efforts: postures.map((q) => robot.efforts(q, given.wrench, given.fall)),
    named: [robot.inputs.map((x) => x.name), robot.outputs, robot.coordinates.length],
};
"""


@pytest.fixture(scope="module", params=("d1", "rpa3t"))
def case(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Asked, dict]:
    wanted = asked(cc.load(request.param), 20, 0.1)
    given = {"targets": wanted.targets, "poses": wanted.poses, "postures": wanted.postures}
    given |= {"wrench": WRENCH, "fall": FALL}
    found = run_js(tmp_path_factory.mktemp("js"), wanted.mechanism, EVERYTHING, given)
    return wanted, found


def test_position_problems_agree(case: tuple[Asked, dict]) -> None:
    wanted, found = case
    for way, solved in (("direct", wanted.solved), ("inverse", wanted.posed)):
        agreeing = 0
        for known, answer in zip(solved, found[way], strict=True):
            if answer["converged"]:
                assert_close(answer["q"], known.q, AGREE)
                assert answer["residual"] < 1e-12
                agreeing += 1
        assert agreeing >= 0.9 * sum(known.converged for known in solved) > 4


def test_postures_are_told_alike(case: tuple[Asked, dict]) -> None:
    wanted, found = case
    m = wanted.mechanism
    for q, pose, tip, inputs in zip(
        wanted.postures, wanted.poses, found["tips"], found["inputs"], strict=True
    ):
        sign = np.sign(np.dot(tip[3:], pose[3:]))
        assert_close(tip, pose * [1, 1, 1, *[sign] * 4], AGREE)
        assert inputs == m.input_values(q).tolist()
    assert found["named"] == [list(m.inputs), list(m.outputs()), m.model.nq]


def test_bodies_stand_where_pinocchio_has_them(case: tuple[Asked, dict]) -> None:
    wanted, found = case
    m, data = wanted.mechanism, wanted.mechanism.model.createData()
    pin.forwardKinematics(m.model, data, wanted.postures[0])
    bodies = np.reshape(found["bodies"], (-1, 4, 3))
    assert len(bodies) == m.model.njoints - 1
    for pose, body in zip(list(data.oMi)[1:], bodies, strict=True):
        assert_close(body[:3].T, pose.rotation, AGREE)
        assert_close(body[3], pose.translation, AGREE)


def test_measures_agree(case: tuple[Asked, dict]) -> None:
    wanted, found = case
    m = wanted.mechanism
    told = [*zip(wanted.postures[:8], found["measures"], strict=False), (m.home, found["home"])]
    for q, measures in told:
        known, velocity = cc.classify(m, q), cc.velocity(m, q)
        assert_close(measures["twistMap"], velocity.twist_map, AGREE)
        assert abs(measures["sigmaDirect"] - known.sigma_direct) < AGREE
        assert abs(measures["sigmaInverse"] - known.sigma_inverse) < AGREE
        for name, other in (("detDirect", known.det_direct), ("detInverse", known.det_inverse)):
            assert (measures[name] is None) == (other is None)
            if other is not None:
                assert measures[name] == pytest.approx(other, rel=1e-11, abs=1e-9)


def test_efforts_agree(case: tuple[Asked, dict]) -> None:
    wanted, found = case
    m = wanted.mechanism
    for q, weight, effort in zip(
        wanted.postures[:6], found["weights"], found["efforts"], strict=False
    ):
        assert_close(weight, cc.statics(m, q).inputs, 1e-11)
        known = cc.statics(m, q, WRENCH, gravity=FALL)
        assert (effort is not None) == known.carried
        if known.carried:
            assert_close(effort, known.inputs, 1e-11)


def test_weights_are_held(tmp_path: Path) -> None:
    links = "base a b c"
    parts = [joint("crank", "base", "a"), joint("elbow", "a", "b", "1 0 0"),
             joint("rocker", "base", "c", "2 0 0"),
             loop("revolute", "b", "2.5 0 0", "c", "2 0 0")]  # fmt: skip
    task = '<task base="base" tip="b" outputs="rz"/>'
    start = {"crank": 1.0, "elbow": -1.0, "rocker": 1.5}
    m = heavy(build(links, parts, start, inputs="crank", task=task))
    body = "return robot.efforts(robot.home, undefined, given.fall);"
    found = run_js(tmp_path, m, body, {"fall": FALL})
    known = cc.statics(m, m.home, gravity=FALL).inputs
    assert abs(known[0]) > 0.1
    assert_close(found, known, 1e-11)


def test_a_way_through_a_singularity_ends_before_it(tmp_path: Path) -> None:
    m = cc.load("d1")
    home = m.input_values(m.home)
    far = home + np.array([0.1, -0.05, 0.15, 0.3, -0.3, 0.1])
    known = cc.direct(m, far)
    assert not known.converged
    body = "const found = robot.direct(given.far); return {...found, near: robot.measure(found.q)};"
    found = run_js(tmp_path, m, body, {"far": far})
    assert not found["converged"]
    assert 0.0 < found["reached"] < 1.0
    assert found["sentence"]
    assert found["near"]["sigmaDirect"] < 1e-3
    assert np.abs(cc.residual(m, np.array(found["q"]))).max() < 1e-9
    partway = home + found["reached"] * (far - home)
    assert_close(m.input_values(np.array(found["q"])), partway, 1e-12)


def test_the_other_side_of_a_direct_singularity(tmp_path: Path) -> None:
    m = cc.load("d1")
    far = m.input_values(m.home) + np.array([0.1, -0.05, 0.15, 0.3, -0.3, 0.1])
    body = 'const {q} = robot.direct(given.far); return [q, robot.across(q, "direct")];'
    stopped, beyond = run_js(tmp_path, m, body, {"far": far})
    other = beside(m, stopped, beyond)
    here, there = (cc.classify(m, q) for q in (np.array(stopped), other))
    assert here.det_direct * there.det_direct < 0.0
    assert_close(m.input_values(other), m.input_values(np.array(stopped)), AGREE)


def test_the_other_side_of_an_inverse_singularity(tmp_path: Path) -> None:
    m = cc.load("linear_delta")
    body = """
    const start = robot.direct([-0.2, -0.1, -0.15]).q, pose = robot.tip(start);
    pose[0] += 1;
    const {q, converged} = robot.inverse(pose, start);
    return [q, robot.across(q, "inverse"), converged, robot.across(robot.home, "inverse")];
    """
    stopped, beyond, converged, nothing = run_js(tmp_path, m, body, {})
    assert not converged
    assert nothing is None
    other = beside(m, stopped, beyond)
    here, there = (cc.classify(m, q) for q in (np.array(stopped), other))
    assert here.det_inverse * there.det_inverse < 0.0
    assert_close(m.pose(other).translation, m.pose(np.array(stopped)).translation, AGREE)


def beside(m: cc.Mechanism, q: list[float], found: dict) -> np.ndarray:
    """Another closed posture near one."""
    assert found["converged"]
    other = np.array(found["q"])
    assert np.abs(cc.residual(m, other)).max() < 1e-12
    assert 1e-4 < np.abs(other - q).max() < 0.5
    return other


def test_numbers_that_are_none_are_refused(tmp_path: Path) -> None:
    m = cc.load("rpa3t")
    body = """
    const bad = [[NaN, 0, 0], [1, 2], [Infinity, 0, 0]];
    return [...bad.map((u) => robot.direct(u)), robot.direct(given.home, [1]),
            robot.inverse([0, 0, 0, 0, 0, 0, 0]), robot.inverse([0, 0, 0, 0, 0, 0, 1, 1])];
    """
    for answer in run_js(tmp_path, m, body, {"home": m.input_values(m.home)}):
        assert not answer["converged"]
        assert answer["ending"] == "untried"
        assert answer["q"] == m.home.tolist()
