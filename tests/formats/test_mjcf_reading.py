"""MJCF read by MuJoCo: every mechanism is compared with MuJoCo's own kinematics and constraints."""

import math
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from mujoco_side import at, opening, qpos_of, worst_pose

import closedchain as cc
from closedchain.urdf import DescriptionError

mujoco = pytest.importorskip("mujoco")

BODY = '<geom size=".02" contype="0" conaffinity="0"/>'
RODS = f"""
  <body name="crank"><joint name="A" ref="30"/>{BODY}
    <body name="rod" pos=".15 0 0" euler="0 0 -20"><joint name="B" pos=".01 .02 0"/>{BODY}
      <site name="rod_end" pos=".35 0 0" euler="0 0 10"/><site name="rod_up" pos=".35 0 .1"/>
    </body></body>
  <body name="rocker" pos=".4 0 0" euler="0 0 100"><joint name="D"/>{BODY}
    <site name="rocker_end" pos=".3 0 0"/><site name="rocker_side" pos="-.02 .05 0"/>
    <site name="rocker_up" pos=".3 0 .1"/></body>"""


def model(world: str, rest: str = "", compiler: str = "") -> str:
    return f"""<mujoco model="m"><compiler angle="degree" {compiler}/>
  <default><joint type="hinge" axis="0 0 1"/><default class="slider">
    <joint type="slide" axis="1 0 0"/></default></default>
  <worldbody>{world}</worldbody>{rest}</mujoco>"""


LOOPS = {
    "connect by bodies": (
        '<connect name="P" body1="rod" body2="rocker" anchor=".35 0 0"/>', "spherical", 1),
    "connect by sites": (
        '<connect name="P" site1="rod_end" site2="rocker_end"/>', "spherical", 1),
    "two connects": (
        '<connect name="P" body1="rod" body2="rocker" anchor=".35 0 0"/>'
        '<connect body1="rod" body2="rocker" anchor=".35 0 .1"/>', "revolute", 1),
    "two connects, turned": (
        '<connect name="P" site1="rod_end" site2="rocker_end"/>'
        '<connect site1="rocker_up" site2="rod_up"/>', "revolute", 1),
    "three connects": (
        '<connect name="P" body1="rod" body2="rocker" anchor=".35 0 0"/>'
        '<connect body1="rod" body2="rocker" anchor=".35 0 .1"/>'
        '<connect body1="rod" body2="rocker" anchor=".35 .2 .1"/>', "fixed", 0),
    "weld as it is": ('<weld name="P" body1="rod" body2="rocker"/>', "fixed", 0),
    "weld with a pose": (
        '<weld name="P" body1="rod" body2="rocker" relpose=".35 .1 0 1 0 0 .3" '
        'anchor=".02 -.03 0"/>',
        "fixed", 0),
    "weld by sites": ('<weld name="P" site1="rod_end" site2="rocker_side"/>', "fixed", 0),
}  # fmt: skip


@pytest.mark.parametrize("loop", LOOPS)
def test_a_loop(loop: str) -> None:
    equality, kind, mobility = LOOPS[loop]
    text = model(RODS, f'<equality>{equality}</equality><actuator><motor name="m" joint="A"/>'
                       "</actuator>")  # fmt: skip
    m = cc.load_file(text)
    (closure,) = m.closures
    assert (closure.name, closure.kind, m.inputs) == ("P", kind, ("m",))
    assert cc.mobility(m).mobility == mobility
    theirs = mujoco.MjModel.from_xml_string(text)
    home = at(theirs, qpos_of(m, theirs, m.home))
    assert opening(home) < 1e-9
    assert worst_pose(m, home, m.home) < 1e-12
    rng = np.random.default_rng(1)
    q = m.home + rng.uniform(-0.3, 0.3, m.model.nq)
    assert worst_pose(m, at(theirs, qpos_of(m, theirs, q)), q) < 1e-12
    if mobility:
        moved = cc.direct(m, {"m": 1.0}).raise_if_failed().q
        there = at(theirs, qpos_of(m, theirs, moved))
        assert opening(there) < 1e-9
        assert worst_pose(m, there, moved) < 1e-12
    assert any("soft in MuJoCo" in note for note in m.notes)
    if "connects" in loop:
        assert any("they were read as one" in note for note in m.notes)


JOINTS = f"""
  <body name="cart" pos="0 0 1" euler="10 20 30"><joint name="x" class="slider" ref=".2"/>
    <joint name="y" class="slider" axis="0 1 0" range="-1 2"/>
    <joint name="turn" axis="0 1 1" pos=".1 .2 .3" ref="40"/>{BODY}
    <body name="head" pos="0 .1 .2" quat="1 2 3 4"><joint name="neck" type="ball" pos="0 0 -.1"/>
      {BODY}
      <body name="hat" pos="0 0 .1">{BODY}</body></body></body>
  <body name="ball" pos="1 2 3" euler="50 0 0"><freejoint name="free"/>{BODY}</body>"""


def test_joints_of_all_kinds_and_several_on_a_body() -> None:
    m = cc.load_file(model(JOINTS))
    theirs = mujoco.MjModel.from_xml_string(model(JOINTS))
    rng = np.random.default_rng(2)
    assert worst_pose(m, at(theirs, qpos_of(m, theirs, m.home)), m.home) < 1e-12
    for _ in range(5):
        step = rng.uniform(-1.0, 1.0, m.model.nv)
        neck = m.model.joints[m.model.getJointId("neck")]
        step[neck.idx_v : neck.idx_v + 3] = 0.0  # the ball holds the floating joint's origin
        q = pin.integrate(m.model, m.home, step)
        assert worst_pose(m, at(theirs, qpos_of(m, theirs, q)), q) < 1e-12
    assert_close(m.home[:1], [0.2], 0.0)
    assert cc.mobility(m).mobility == 3 + 3 + 6
    bounds = {j.name: (j.lower, j.upper) for j in m.description.joints}
    assert bounds["y"] == (-1.0, 2.0)
    assert bounds["turn"] == (-math.inf, math.inf)
    masses = {link.name: link.inertial.mass for link in m.description.links if link.inertial}
    assert masses["head"] == pytest.approx(1000 * 4 / 3 * math.pi * 0.02**3)


PAIR = f"""<body name="a"><joint name="a" ref="20"/>{BODY}</body>
  <body name="b" pos="1 0 0"><joint name="b" ref="-10"/>{BODY}</body>
  <body name="c" pos="2 0 0"><joint name="c" class="slider" ref=".5"/>{BODY}
    <site name="sc" pos="0 .3 0"/></body><site name="s0" pos="1 1 0"/>"""
RELATIONS = {
    "gear": ('<equality><joint joint1="a" joint2="b" polycoef=".1 -2 0 0 0"/></equality>',
             "coupling", {"b": 0.3}),
    "curve": ('<equality><joint name="k" joint1="c" joint2="a" polycoef=".1 1 .5 -.2 .3"/>'
              "</equality>", "polynomial", {"a": 0.7}),
    "held": ('<equality><joint joint1="a" polycoef=".25 0 0 0 0"/></equality>', None, {"b": 0.4}),
    "sum": ('<tendon><fixed name="t"><joint joint="a" coef="2"/><joint joint="b" coef="-1"/>'
            '<joint joint="c" coef="3"/></fixed></tendon>'
            '<equality><tendon name="k" tendon1="t" polycoef=".2 0 0 0 0"/></equality>',
            "linear", {"b": 0.4, "c": 0.6}),
    "distance": ('<tendon><spatial name="t"><site site="s0"/><site site="sc"/></spatial></tendon>'
                 '<equality><tendon name="k" tendon1="t" polycoef="-.1 0 0 0 0"/></equality>',
                 "distance", {}),
}  # fmt: skip


@pytest.mark.parametrize("relation", RELATIONS)
def test_relations_of_joints(relation: str) -> None:
    rest, kind, given = RELATIONS[relation]
    m = cc.load_file(model(PAIR, rest))
    theirs = mujoco.MjModel.from_xml_string(model(PAIR, rest))
    assert [c.kind for c in m.closures] == ([] if kind is None else [kind])
    q = cc.close(m, fixed=given).raise_if_failed().q
    qpos = qpos_of(m, theirs, q)
    if kind is None:
        qpos[0] = math.radians(20) + 0.25
        assert not m.model.existJointName("a")
        assert any("the joint 'a' is held at 0.599" in note for note in m.notes)
    data = at(theirs, qpos)
    assert data.ne == 1
    assert opening(data) < 1e-9
    assert worst_pose(m, data, q) < 1e-12


def test_keyframes_are_postures_and_home() -> None:
    keys = '<keyframe><key name="up" qpos=".1 .2 .3"/><key name="home" qpos=".4 .5 .6"/></keyframe>'
    m = cc.load_file(model(PAIR, keys))
    assert list(m.postures) == ["home", "up"]
    assert_close(m.home, [0.4, 0.5, 0.6], 0.0)
    assert_close(m.posture("up"), [0.1, 0.2, 0.3], 0.0)


def test_actuators_are_inputs() -> None:
    actuators = """<tendon><fixed name="t"><joint joint="b" coef="1"/><joint joint="a" coef="1"/>
      </fixed></tendon><actuator>
      <motor joint="b"/><position name="p" joint="a"/><velocity name="v" joint="a"/>
      <motor name="pull" tendon="t"/></actuator>"""
    m = cc.load_file(model(PAIR, actuators))
    assert m.inputs == ("b", "p")
    text = "\n".join(m.notes)
    assert "'v'> is not taken as an input" in text
    assert "the actuator 'pull' acts on a tendon" in text
    assert "1 tendons were not read: 't'" in text


def test_a_driven_follower_leads() -> None:
    """b = 2 a + 0.1 with a motor on b: then a follows, and b is the input."""
    tied = """<equality><joint joint1="b" joint2="a" polycoef="0 2 0 0 0"/></equality><actuator>
      <motor name="m" joint="b"/>{}</actuator>"""
    m = cc.load_file(model(PAIR, tied.format("")))
    (coupling,) = m.description.couplings
    assert (coupling.joint, coupling.leader, coupling.multiplier) == ("a", "b", 0.5)
    assert m.inputs == ("m",)
    q = cc.close(m, fixed={"b": 0.4}).raise_if_failed().q
    a, b = math.radians(20), math.radians(-10)
    assert_close(q[0], a + (0.4 - b) / 2, 1e-12)
    both = cc.load_file(model(PAIR, tied.format('<motor name="n" joint="a"/>')))
    assert both.inputs == ("n",)
    assert "the input 'm' is left out: its joint 'b' follows 'a'" in both.notes


def test_an_actuator_of_a_tendon_moves_the_joint_that_the_others_follow() -> None:
    """As in a gripper whose two fingers are tied and driven by their sum."""
    split = """<tendon><fixed name="split"><joint joint="a" coef=".5"/><joint joint="b" coef=".5"/>
      </fixed></tendon><equality><joint joint1="b" joint2="a" polycoef="0 1 0 0 0"/></equality>
      <actuator><general name="fingers" tendon="split"/></actuator>"""
    m = cc.load_file(model(PAIR, split))
    assert [(i.name, i.joint) for i in m.description.inputs] == [("fingers", "a")]
    assert any("over joints that follow 'a'" in note for note in m.notes)


def test_what_mujoco_computes_with_is_noted() -> None:
    world = PAIR.replace('name="a" ref', 'name="a" stiffness="1" damping="2" ref')
    world = world.replace('contype="0" conaffinity="0"', "", 1)
    off = '<equality><connect name="off" body1="a" anchor="0 0 0" active="false"/></equality>'
    m = cc.load_file(model(world, off))
    text = "\n".join(m.notes)
    for phrase in ("springs of 1 joints", "contacts were not read",
                   "'off' is not active"):  # fmt: skip
        assert phrase in text
    assert m.closures == ()
    assert m.description.joints[0].damping == 2.0


def test_includes_and_meshes(tmp_path: Path) -> None:
    """A file includes another; one mesh is there, the other is not."""
    (tmp_path / "inner.xml").write_text(
        f'<mujoco><worldbody><body name="a"><joint name="a" axis="0 0 1"/>{BODY}'
        '<geom type="mesh" mesh="there" pos="1 2 3"/><geom type="mesh" mesh="gone"/></body>'
        "</worldbody></mujoco>"
    )
    (tmp_path / "meshes").mkdir()
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    (tmp_path / "meshes" / "there.obj").write_text(corners)
    file = tmp_path / "robot.xml"
    file.write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh file="there.obj" scale="2 2 2"/>'
        '<mesh file="gone.stl"/></asset><include file="inner.xml"/></mujoco>'
    )
    m = cc.load_file(file)
    assert "1 mesh not found, and left out: 'gone' (gone.stl)" in m.notes
    text = m.description.text
    assert str(tmp_path / "meshes" / "there.obj") in text
    assert 'scale="2.0 2.0 2.0"' in text
    xyz = text[text.index('<origin xyz="', text.index("there.obj") - 400) :].split('"')[1]
    assert_close([float(x) for x in xyz.split()], [1.0, 2.0, 3.0], 1e-6)


def test_shapes_have_their_colour() -> None:
    red = '<body name="a"><joint name="a"/><geom type="box" size="1 2 3" rgba="1 0 0 1"/></body>'
    text = cc.load_file(model(red)).description.text
    assert '<box size="2.0 4.0 6.0"/>' in text
    assert 'rgba="1.0 0.0 0.0 1.0"' in text


def test_mujoco_says_what_is_wrong() -> None:
    with pytest.raises(DescriptionError, match=r"MuJoCo: .*unrecognized attribute"):
        cc.load_file('<mujoco><worldbody><body mass="1"/></worldbody></mujoco>')


@pytest.mark.parametrize(
    ("old", "new"),
    [('ref="20"', 'ref="nan"'), ('pos="1 0 0"', 'pos="nan 0 0"'), ('ref=".5"', 'ref="1e30"')],
)
def test_numbers_that_are_none_are_refused(
    old: str,
    new: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture,
) -> None:
    """MuJoCo itself would warn on standard error and in a file where one happens to be."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DescriptionError, match="not finite or too large"):
        cc.load_file(model(PAIR.replace(old, new, 1)))
    assert capfd.readouterr().err == ""
    assert list(tmp_path.iterdir()) == []


def test_an_old_mujoco_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mujoco, "__version__", "3.9.1")
    with pytest.raises(DescriptionError, match=r"MuJoCo 3\.9\.1 is too old .* 3\.17 or later"):
        cc.load_file("<mujoco/>")


def test_without_mujoco_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(DescriptionError, match=r"pip install 'closedchain\[mjcf\]'"):
        cc.load_file("<mujoco/>")
