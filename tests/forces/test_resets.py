"""Random closed states: closed, within limits, on the branch, even, seeded; velocities that fit."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close

import closedchain as cc

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkages import four_bar


@pytest.fixture(scope="module")
def states(d1: cc.Mechanism) -> cc.Resets:
    return cc.resets(d1, 500, seed=7)


def test_states_are_closed_and_move_as_the_loops_allow(d1: cc.Mechanism, states: cc.Resets) -> None:
    assert states.q.shape == (500, d1.model.nq)
    assert states.v.shape == (500, d1.model.nv)
    assert states.residual < 1e-12
    lower, upper = d1.limits
    for q, v in zip(states.q[::10], states.v[::10], strict=True):
        assert np.abs(cc.residual(d1, q)).max() < 1e-12
        assert np.abs(cc.constraint_jacobian(d1, q) @ v).max() < 1e-10
        assert ((q >= lower) & (q <= upper)).all()
    assert_close(states.q[:, d1.input_q], states.values, 1e-12)


def test_states_are_on_the_branch_of_home(d1: cc.Mechanism, states: cc.Resets) -> None:
    """No way in the inputs leads to another sign of the determinant without a singularity."""
    signs = {np.sign(cc.classify(d1, q).det_direct) for q in states.q[::25]}
    assert signs == {np.sign(cc.classify(d1, d1.home).det_direct)}


def test_the_same_seed_gives_the_same_states(d1: cc.Mechanism, states: cc.Resets) -> None:
    again = cc.resets(d1, 500, seed=7, workers=2)
    assert np.array_equal(again.q, states.q)
    assert np.array_equal(again.v, states.v)
    assert not np.array_equal(cc.resets(d1, 500, seed=8).q, states.q)


def test_coordinates_are_even_where_everything_is_reached() -> None:
    m = cc.load("linear_delta")
    r = cc.resets(m, 4000, over={"q1": (-0.1, 0.1), "q2": (-0.1, 0.0), "q3": (0.0, 0.1)})
    assert r.accepted > 0.8
    share = (r.values - [-0.1, -0.1, 0.0]) / [0.2, 0.1, 0.1]
    for column in share.T:
        counts = np.histogram(column, 8, (0.0, 1.0))[0]
        assert np.abs(counts - 500).max() < 100  # four and a half standard deviations


def test_tip_coordinates_and_held_inputs() -> None:
    m = cc.load("linear_delta")
    r = cc.resets(m, 50, over={"x": (-0.05, 0.05), "y": (-0.02, 0.02)})
    for q, (x, y) in zip(r.q, r.values, strict=True):
        place = m.pose(q).translation
        assert_close(place, [x, y, m.pose(m.home).translation[2]], 1e-11)
    one = cc.resets(m, 20, over={"q2": None})
    home = m.input_values(m.home)
    assert_close(one.q[:, m.input_q[[0, 2]]], np.tile(home[[0, 2]], (20, 1)), 1e-12)


def test_spare_and_missing_inputs() -> None:
    """One of two inputs of a four-bar is drawn; without inputs a joint is."""
    spare = cc.resets(four_bar({"q1": "A", "q2": "D"}), 20)
    assert spare.names == ("q1",)
    assert spare.residual < 1e-12
    free = cc.resets(four_bar({}), 20)
    assert free.names == ("A",)
    assert np.ptp(free.q[:, 0]) > 0.2


def test_velocities_point_everywhere_alike() -> None:
    """The four-bar's motions are multiples of one: the projection of a Gaussian is a Gaussian."""
    m = four_bar()
    r = cc.resets(m, 3000, over={"q1": (1.0, 1.2)}, speed=2.0)
    sizes = np.linalg.norm(r.v, axis=1)
    assert abs(np.mean(sizes**2) - 4.0) < 0.4
    assert abs(np.mean(r.v[:, 0] > 0) - 0.5) < 0.05
    assert not cc.resets(m, 5, speed=0.0).v.any()


def test_several_branches() -> None:
    m = four_bar()
    other = cc.close(m, np.array([1.1, -2.0, -1.8]), fixed={"A": 1.1}).q
    r = cc.resets(m, 200, start=[m.home, other], over={"q1": (0.9, 1.3)})
    assert set(r.branch.tolist()) == {0, 1}
    turned = np.array([np.sin(q[1] + q[0] - q[2]) > 0 for q in r.q])
    expected = [np.sin(q[1] + q[0] - q[2]) > 0 for q in (m.home, other)]
    assert expected[0] != expected[1]
    assert np.array_equal(turned, np.array(expected)[r.branch])


def test_as_mujoco_has_them(d1: cc.Mechanism, states: cc.Resets) -> None:
    names = list(d1.model.names)[1:]
    floating = next(n for n in names if d1.model.joints[d1.model.getJointId(n)].nq == 7)
    slide = d1.model.names[list(d1.model.idx_vs).index(int(d1.input_v[0]))]
    qpos, qvel = states.arranged([slide, floating])
    assert qpos.shape == (500, 8)
    assert qvel.shape == (500, 7)
    assert_close(qpos[:, 0], states.q[:, d1.input_q[0]], 0.0)
    child = next(j.child for j in d1.description.joints if j.name == floating)
    q, v, h = states.q[3], states.v[3], 1e-6
    pose = d1.pose(q, child)
    assert_close(qpos[3, 1:4], pose.translation, 1e-14)
    assert_close(pin.Quaternion(*qpos[3, 4:]).matrix(), pose.rotation, 1e-13)
    ends = [d1.pose(pin.integrate(d1.model, q, s * h * v), child) for s in (1, -1)]
    assert_close(qvel[3, 1:4], (ends[0].translation - ends[1].translation) / (2 * h), 1e-8)
    spin = pin.log3(ends[1].rotation.T @ ends[0].rotation) / (2 * h)
    assert_close(qvel[3, 4:], spin, 1e-8)
    with pytest.raises(cc.ClosureError, match="nobody"):
        states.arranged(["nobody"])


def test_dataset(d1: cc.Mechanism, states: cc.Resets) -> None:
    found = states.to_dataset()
    assert_close(found["q"].values, states.q, 0.0)
    assert len(set(found["coordinate"].values.tolist())) == d1.model.nq


@pytest.mark.parametrize(
    ("words", "match"),
    [
        ({"n": 0}, "whole number"),
        ({"n": 5, "speed": -1.0}, "speed"),
        ({"n": 5, "over": {"nobody": None}}, "nobody"),
        ({"n": 5, "over": {"q1": (1.0, 0.0)}}, "does not rise"),
        (
            {"n": 5, "over": {"q1": (0.3, 0.4), "q2": (-1.2, -1.1)}},
            r"none of 5 states were found in .* draws of q1 q2",
        ),
        (
            {"n": 5, "over": {"q1": (5.0, 6.0)}},
            "all values of 'q1', 5 to 6, lie beyond its joint limits -1.2 to 0.4",
        ),
        ({"n": 5, "start": np.zeros(16)}, "open by"),
    ],
)
def test_wrong_questions_are_refused(words: dict[str, object], match: str) -> None:
    with pytest.raises(cc.ClosureError, match=match):
        cc.resets(cc.load("linear_delta"), **words)


def test_mujoco_finds_the_loops_closed(d1: cc.Mechanism, states: cc.Resets) -> None:
    """Its own equalities, in the file that is exported, at positions and velocities arranged."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(cc.export(d1, "mjcf")[0])
    data = mujoco.MjData(model)
    order = sorted(list(d1.model.names)[1:], key=lambda n: model.joint(n).qposadr[0])
    qpos, qvel = states.arranged(order)
    assert qpos.shape[1] == model.nq
    for k in (0, 100, 499):
        data.qpos[:], data.qvel[:] = qpos[k], qvel[k]
        mujoco.mj_forward(model, data)
        assert data.nefc >= d1.rows
        assert np.abs(data.efc_pos[: d1.rows]).max() < 1e-9
        assert np.abs(data.efc_vel[: d1.rows]).max() < 1e-9


HANGING = """<mujoco model="hanging"><worldbody>
  <body name="a" pos="0 0 1"><joint name="first" axis="0 1 0" ref="0.3"/>
    <geom type="capsule" size="0.01 0.1"/>
    <body name="rod" pos="0.2 0 0"><joint name="ball" type="ball"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.01"/><site name="end" pos="0 0 -0.3"/>
    </body></body>
  <body name="b" pos="0.3 0.1 0.8"><joint name="slide" type="slide" axis="0 0 1"/>
    <joint name="turn" axis="0 0 1"/><joint name="lean" axis="1 0 0"/>
    <joint name="tilt" axis="0 1 0"/><geom type="sphere" size="0.02"/>
    <site name="on_b" pos="-0.1 -0.1 -0.1"/></body>
</worldbody><equality><weld site1="end" site2="on_b"/></equality></mujoco>"""


def test_order_and_balls_of_an_mjcf_file(tmp_path: Path) -> None:
    """A ball in the tree, a reference value: MuJoCo finds the loop closed at qpos and qvel."""
    mujoco = pytest.importorskip("mujoco")
    from closedchain.urdf.formats.mjcf.joint_order import joint_order

    file = tmp_path / "hanging.xml"
    file.write_text(HANGING)
    m = cc.load_file(file)
    r = cc.resets(m, 20, seed=1)
    order = joint_order(file)
    assert order == ("first", "ball", "slide", "turn", "lean", "tilt")
    qpos, qvel = r.arranged(order)
    assert qpos.shape == (20, 9)
    assert qvel.shape == (20, 8)
    assert_close(r.arranged()[0], qpos, 0.0)  # the tree has its order
    model = mujoco.MjModel.from_xml_string(HANGING)
    data = mujoco.MjData(model)
    for k in range(20):
        data.qpos[:], data.qvel[:] = qpos[k], qvel[k]
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos[:6]).max() < 1e-9
        assert np.abs(data.efc_vel[:6]).max() < 1e-9
    file.write_text(HANGING.replace(' name="slide"', ""))
    with pytest.raises(cc.DescriptionError, match="no name"):
        joint_order(file)
