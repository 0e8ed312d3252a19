"""SDF graphs: where things are, which joints are cut, what is refused by name."""

import math
import re

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.urdf import DescriptionError
from closedchain.urdf.formats.sdf import reading

Z = "<axis><xyz>0 0 1</xyz></axis>"


def sdf(inner: str, *, version: str = "1.11", model: str = "") -> str:
    return f'<sdf version="{version}"><model name="m" {model}>{inner}</model></sdf>'


def link(name: str, pose: str = "", more: str = "") -> str:
    return f'<link name="{name}">{pose and f"<pose>{pose}</pose>"}{more}</link>'


def joint(name: str, kind: str, parent: str, child: str, inner: str = Z) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>'
        f"{inner}</joint>"
    )


BASE, CRANK, COUPLER, ROCKER = 0.4, 0.15, 0.35, 0.3


def angles(crank: float) -> tuple[float, float]:
    """Angles of coupler and rocker against the base, from where two circles meet."""
    b = np.array([CRANK * math.cos(crank), CRANK * math.sin(crank)])
    to = np.array([BASE, 0.0]) - b
    far = float(np.linalg.norm(to))
    along = (COUPLER**2 - ROCKER**2 + far**2) / (2.0 * far)
    across = math.sqrt(COUPLER**2 - along**2)
    p = b + along * to / far + across * np.array([-to[1], to[0]]) / far
    return math.atan2(*(p - b)[::-1]), math.atan2(p[1], p[0] - BASE)


def four_bar(loop: str = "revolute", order: int = 0) -> str:
    """Links where they are with the crank at 1 rad; ``order`` turns the list of joints around."""
    coupler, rocker = angles(1.0)
    bx, by = CRANK * math.cos(1.0), CRANK * math.sin(1.0)
    joints = [
        joint("A", "revolute", "base", "crank"),
        joint("B", "revolute", "crank", "rod"),
        joint("D", "revolute", "base", "rocker"),
        joint("P", loop, "rod", "rocker", f"<pose>{ROCKER} 0 0 0 0 0</pose>{Z}"),
    ]
    return sdf(
        link("base") + link("crank", "0 0 0 0 0 1") + link("rod", f"{bx} {by} 0 0 0 {coupler}")
        + link("rocker", f"{BASE} 0 0 0 0 {rocker}") + "".join(joints[order:] + joints[:order])
        + "<plugin name='c'><joint_name>A</joint_name></plugin>"
    )  # fmt: skip


@pytest.mark.parametrize(
    ("loop", "order", "cut"),
    [("revolute", 0, "P"), ("ball", 0, "P"), ("revolute", 2, "B"), ("revolute", 1, "P")],
)
def test_a_second_joint_on_a_link_is_the_loop(loop: str, order: int, cut: str) -> None:
    m = cc.load_file(four_bar(loop, order))
    (closure,) = m.closures
    assert (closure.name, closure.kind) == (cut, "spherical" if loop == "ball" else "revolute")
    assert cc.mobility(m).mobility == 1
    assert_close(m.home, [0.0, 0.0, 0.0], 0.0)
    assert m.inputs == ("A",)  # driven joints are in the tree, wherever they stand in the file
    turned = cc.direct(m, {"A": 0.3}).raise_if_failed().q
    rocker = m.pose(turned, "rocker").rotation
    assert math.atan2(rocker[1, 0], rocker[0, 0]) == pytest.approx(angles(1.3)[1], abs=1e-9)


def test_a_driven_joint_that_must_be_cut_is_no_input() -> None:
    """All four hinges are driven: one closes the loop, and has no value to give."""
    plugins = "".join(
        f"<plugin name='c'><joint_name>{name}</joint_name></plugin>" for name in "BDP"
    )
    m = cc.load_file(four_bar().replace("</model>", f"{plugins}</model>"))
    assert m.inputs == ("A", "B", "D")
    assert "the input 'P' is left out: its joint 'P' closes a loop and was cut" in m.notes


def test_joints_that_are_gone_through_backwards_keep_their_value() -> None:
    """Relative poses of two links at the same joint value, whichever is the base."""
    axis = "<axis><xyz>1 2 3</xyz><limit><lower>-1</lower><upper>2</upper></limit></axis>"
    inner = f"<pose>0.1 0.2 0.3 0.4 0.5 0.6</pose>{axis}"
    for kind in ("revolute", "prismatic"):
        poses = []
        for first in ("a", "b"):
            m = cc.load_file(
                sdf(link("a", "1 0 0 0 0 0.5") + link("b", "0 2 0 0.3 0 0")
                    + joint("j", kind, "a", "b", inner), model=f'canonical_link="{first}"')
            )  # fmt: skip
            assert m.description.root == first
            lower, upper = m.limits
            assert (lower[0], upper[0]) == (-1.0, 2.0)
            q = np.array([0.7])
            poses.append((m.pose(q, "a").inverse() * m.pose(q, "b")).homogeneous)
        assert_close(poses[0], poses[1], 1e-14)


def test_frames_and_relative_to() -> None:
    """Every pose is written in another frame; where they are follows by multiplication."""
    text = sdf(
        '<frame name="f"><pose>1 0 0 0 0 0.5</pose></frame>'
        '<frame name="g" attached_to="b"><pose relative_to="f">0 1 0 0.2 0 0</pose></frame>'
        + link("a")
        + '<link name="b"><pose relative_to="f" degrees="true">0 0 1 30 0 90</pose></link>'
        + '<link name="c"><pose relative_to="j" rotation_format="quat_xyzw">0 0 0.5 0 0 1 1</pose>'
        "</link>"
        + joint("j", "revolute", "a", "b",
                '<pose relative_to="g">0.1 0 0 0 0 0</pose><axis><xyz expressed_in="f">0 1 0</xyz>'
                "</axis>")
        + joint("k", "fixed", "g", "c", "")
    )  # fmt: skip
    m = cc.load_file(text)

    def pose(x: float, y: float, z: float, r: float, p: float, w: float) -> pin.SE3:
        return pin.SE3(pin.rpy.rpyToMatrix(r, p, w), np.array([x, y, z]))

    f = pose(1, 0, 0, 0, 0, 0.5)
    g = f * pose(0, 1, 0, 0.2, 0, 0)
    b = f * pose(0, 0, 1, math.radians(30), 0, math.radians(90))
    j = g * pose(0.1, 0, 0, 0, 0, 0)
    c = j * pose(0, 0, 0.5, 0, 0, math.pi / 2)
    for name, expected in (("b", b), ("g", g), ("c", c)):
        assert_close(m.pose(m.home, name).homogeneous, expected.homogeneous, 1e-14, name)
    q = np.array([0.8])
    axis = f.rotation @ [0, 1, 0]
    turned = pin.SE3(pin.AngleAxis(0.8, axis).toRotationMatrix(), np.zeros(3))
    about = pin.SE3(np.eye(3), j.translation)
    for name, start in (("b", b), ("g", g), ("c", c)):
        expected = about * turned * about.inverse() * start
        assert_close(m.pose(q, name).homogeneous, expected.homogeneous, 1e-14, name)


@pytest.mark.parametrize(
    ("version", "inner", "expected"),
    [
        ("1.6", "<xyz>1 0 0</xyz>", [0, 1, 0]),
        ("1.6", "<xyz>1 0 0</xyz><use_parent_model_frame>1</use_parent_model_frame>", [1, 0, 0]),
        ("1.4", "<xyz>1 0 0</xyz>", [1, 0, 0]),
    ],
)
def test_the_frame_of_an_axis(version: str, inner: str, expected: list[float]) -> None:
    quarter = f"0 0 0 0 0 {math.pi / 2!r}"
    found = reading.read(
        sdf(link("a") + link("b", quarter)
            + joint("j", "revolute", "a", "b", f"<axis>{inner}</axis>"), version=version)
    )  # fmt: skip
    (moving,) = found.joints
    assert_close(pin.rpy.rpyToMatrix(*moving.origin.rpy) @ moving.axis, expected, 1e-15)


@pytest.mark.parametrize(
    ("kind", "inner", "freedoms"),
    [
        ("universal", f"{Z}<axis2><xyz>1 0 0</xyz></axis2>", 2),
        ("revolute2", f"{Z}<axis2><xyz>1 1 0</xyz></axis2>", 2),
        ("screw", f"{Z}<screw_thread_pitch>0.01</screw_thread_pitch>", 1),
        ("screw", f"{Z}<thread_pitch>{-2 * math.pi / 0.01}</thread_pitch>", 1),
        ("ball", "", 3),
        ("continuous", f"{Z}", 1),
    ],
)
def test_other_joints_in_the_tree(kind: str, inner: str, freedoms: int) -> None:
    m = cc.load_file(sdf(link("a") + link("b", "1 2 3 0 0 0") + joint("j", kind, "a", "b", inner)))
    assert cc.mobility(m).mobility == freedoms
    assert_close(m.point(m.home, "b"), [1.0, 2.0, 3.0], 1e-15)
    if kind == "screw":
        turned = cc.close(m, fixed={"j_turn": math.pi}).raise_if_failed().q
        assert_close(m.point(turned, "b"), [1.0, 2.0, 3.005], 1e-12)


def test_a_platform_on_balls_is_placed_by_a_floating_joint() -> None:
    balls = "".join(
        joint(f"S{k}", "ball", "a", "top", f"<pose>{k} {k * k} 0 0 0 0</pose>") for k in range(2)
    )
    m = cc.load_file(sdf(link("a") + link("top", "0 0 1 0 0 0") + balls))
    assert [c.kind for c in m.closures] == ["spherical"] * 2
    assert cc.mobility(m).mobility == 1
    assert_close(m.home[:3], [0.0, 0.0, 1.0], 0.0)


def test_ball_constraints_of_drake() -> None:
    ends = "".join(
        f"<d:ball_constraint_body_{end}>{name}</d:ball_constraint_body_{end}>"
        f"<d:ball_constraint_p_{point}>{x} 0 0</d:ball_constraint_p_{point}>"
        for end, point, name, x in (("A", "AP", "rod", COUPLER), ("B", "BQ", "rocker", ROCKER))
    )
    ball = f"<d:ball_constraint>{ends}</d:ball_constraint>"
    text = re.sub(r'<joint name="P".*?</joint>', ball, four_bar(), flags=re.S)
    text = text.replace("<model", '<model xmlns:d="drake.mit.edu"')
    m = cc.load_file(text.replace("</model>", "<d:proximity/></model>"))
    assert [(c.name, c.kind) for c in m.closures] == [("ball", "spherical")]
    assert cc.mobility(m).mobility == 1
    assert_close(m.home, [0.0, 0.0, 0.0], 1e-9)
    assert "<d:proximity> was not read" in m.notes
    with pytest.raises(DescriptionError, match="did you mean 'rocker'"):
        cc.load_file(text.replace(">rocker</d:", ">rokcer</d:"))


def test_the_base() -> None:
    arm = link("a", "0 0 1 0 0 0") + link("b", "0 0 2 0 0 0") + joint("j", "revolute", "a", "b")
    loose = reading.read(sdf(arm))
    assert loose.root == "a"
    assert any("no joint holds the model to the world" in note for note in loose.notes)
    fixed = reading.read(sdf(arm + joint("w", "fixed", "world", "b", "")))
    assert (fixed.root, fixed.joints[0].name, fixed.joints[0].parent) == ("b", "j", "b")
    on_rails = cc.load_file(
        sdf("<pose>5 0 0 0 0 0</pose>" + arm + joint("w", "prismatic", "world", "a"))
    )
    assert on_rails.description.root == "world"
    assert_close(on_rails.point(on_rails.home, "b"), [5.0, 0.0, 2.0], 1e-15)
    free = reading.read(sdf(arm + link("c")))
    assert any("the link 'c' is held by no joint" in note for note in free.notes)


def test_mimic_and_bounds() -> None:
    follower = (
        '<axis><xyz>0 0 1</xyz><mimic joint="j"><multiplier>2</multiplier><offset>0.1</offset>'
        "<reference>0.5</reference></mimic><limit><lower>-1e16</lower><upper>1e16</upper></limit>"
        "</axis>"
    )
    m = cc.load_file(
        sdf(link("a") + link("b") + link("c") + joint("j", "revolute", "a", "b")
            + joint("k", "revolute", "b", "c", follower))
    )  # fmt: skip
    assert m.limits[0].tolist() == [-math.inf, -math.inf]
    q = cc.close(m, fixed={"j": 0.7}).raise_if_failed().q
    assert_close(q, [0.7, 2 * (0.7 - 0.5) + 0.1], 1e-12)


@pytest.mark.parametrize(
    ("turned", "axis", "sense"), [(False, 1, 1), (True, 1, -1), (False, -1, -1)]
)
def test_a_gearbox_ties_two_hinges(turned: bool, axis: int, sense: int) -> None:
    """theta2 = -ratio theta1, whichever way round the hinges are written."""
    ends = ("rotor", "base") if turned else ("base", "rotor")
    hinge = f"<axis><xyz>0 0 {axis}</xyz></axis>"
    gear = (
        "<gearbox_reference_body>base</gearbox_reference_body><gearbox_ratio>3</gearbox_ratio>"
        f"{Z}<axis2><xyz>0 0 1</xyz></axis2>"
    )
    m = cc.load_file(
        sdf(
            link("base")
            + link("rotor")
            + link("arm")
            + joint("motor", "revolute", *ends, hinge)
            + joint("out", "revolute", "base", "arm")
            + joint("gear", "gearbox", "rotor", "arm", gear)
        )
    )
    assert [(c.name, c.kind) for c in m.closures] == [("gear", "linear")]
    q = cc.close(m, fixed={"motor": 0.2}).raise_if_failed().q
    angle = q[m.model.joints[m.model.getJointId("out")].idx_q]
    assert angle == pytest.approx(-3 * 0.2 * sense, abs=1e-12)


def test_what_is_not_kinematics_is_noted() -> None:
    gear = joint("g", "gearbox", "a", "b", "<gearbox_reference_body>a</gearbox_reference_body>" + Z)
    spring = joint("j", "revolute", "a", "b", "<axis><xyz>0 0 1</xyz><dynamics><spring_stiffness>3"
                   "</spring_stiffness></dynamics></axis>")  # fmt: skip
    plane = "<visual name='v'><geometry><plane/></geometry></visual>"
    notes = "\n".join(
        reading.read(
            sdf(link("a", "", plane) + link("b") + gear + spring + "<allow_auto_disable/>")
        ).notes
    )
    for phrase in ("the gearbox joint 'g' was not read", "the spring of the joint 'j'",
                   "<allow_auto_disable> was not read", "a shape of the link 'a' is not drawn",
                   "there are no inputs"):  # fmt: skip
        assert phrase in notes


def test_shapes() -> None:
    visual = (
        "<visual name='v'><pose>0 0 1 0 0 0</pose><geometry><mesh><uri>model://pkg/x.stl</uri>"
        "<scale>1 2 3</scale></mesh></geometry><material><diffuse>1 0 0 1</diffuse></material>"
        "</visual>"
    )
    text = reading.read(sdf(link("a", "0 0 5 0 0 0", visual))).text
    assert 'filename="package://pkg/x.stl" scale="1.0 2.0 3.0"' in text
    assert '<origin xyz="0.0 0.0 1.0"/>' in text
    assert 'rgba="1.0 0.0 0.0 1.0"' in text


HOOP = link("a") + link("b") + joint("j", "fixed", "a", "b", "")
REFUSED = {
    "nested": (sdf('<model name="inner"><link name="x"/></model>' + link("a")),
               "the nested model 'inner'"),
    "include": (sdf("<include><uri>model://gripper</uri></include>" + link("a")),
                "the nested model 'model://gripper'"),
    "two models": ('<sdf version="1.9"><model name="a"/><model name="b"/></sdf>', "has 2"),
    "no model": ('<sdf version="1.9"><world name="w"/></sdf>', r"has 0 \(none\)"),
    "no link": (sdf(""), "has no <link>"),
    "type": (sdf(link("a") + link("b") + joint("j", "hinge", "a", "b")),
             "unknown joint type 'hinge'"),
    "link": (sdf(link("arm") + joint("j", "revolute", "arm", "arn")), "did you mean 'arm'"),
    "frame": (sdf('<link name="a"><pose relative_to="q">0 0 0 0 0 0</pose></link>'),
              "unknown frame 'q'"),
    "circle": (sdf('<link name="a"><pose relative_to="b">0 0 0 0 0 0</pose></link>'
                   '<link name="b"><pose relative_to="a">0 0 0 0 0 0</pose></link>'),
               "frames in a circle: a -> b -> a"),
    "inner link": (sdf(link("a") + joint("j", "revolute", "a", "inner::b")),
                   "links of nested models are not read"),
    "screw that closes": (
        sdf(HOOP + joint("s", "screw", "a", "b", f"{Z}<screw_thread_pitch>1</screw_thread_pitch>")),
        "closes a loop and cannot be cut"),
    "axis": (sdf(link("a") + link("b") + joint("j", "revolute", "a", "b", "")), "needs its <axis>"),
    "numbers": (sdf(link("a", "0 0 x 0 0 0")), "'x' is not a number"),
    "canonical": (sdf(link("a"), model='canonical_link="b"'), "unknown canonical link 'b'"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused_by_name(case: str) -> None:
    text, phrase = REFUSED[case]
    with pytest.raises(DescriptionError, match=phrase):
        cc.load_file(text)
