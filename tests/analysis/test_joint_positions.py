"""All joints from the driven ones: the branch is kept, singularities stop, names are understood."""

from typing import Any

import numpy as np
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc


def crank_slider() -> cc.Mechanism:
    """Crank 0.1, rod 0.3; the slider drives, which stands still where both are in line."""
    limit = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
    return cc.load_urdf(f"""<robot name="press">
      <link name="base"/><link name="crank"/><link name="rod"/><link name="piston"/>
      <joint name="a" type="revolute"><parent link="base"/><child link="crank"/>
        <axis xyz="0 0 1"/>{limit}</joint>
      <joint name="b" type="revolute"><parent link="crank"/><child link="rod"/>
        <origin xyz="0.1 0 0"/><axis xyz="0 0 1"/>{limit}</joint>
      <joint name="s" type="prismatic"><parent link="base"/><child link="piston"/>
        <axis xyz="1 0 0"/>{limit}</joint>
      <constraint name="pin" type="revolute">
        <parent link="rod"/><parent_origin xyz="0.3 0 0"/><parent_axis xyz="0 0 1"/>
        <child link="piston"/></constraint>
      <transmission name="push"><joint name="s"/></transmission>
      <task base="base" tip="crank" outputs="rz"/>
      <group_state name="home"><joint name="a" value="1"/><joint name="b" value="-1.3"/>
        <joint name="s" value="0.33"/></group_state></robot>""")


def angle(found: cc.JointPositions) -> float:
    return float(found.values[found.names.index("a")])


def crank_angle(s: float) -> float:
    """The upper posture of crank and rod, by the law of cosines."""
    return float(np.arccos((0.1**2 + s**2 - 0.3**2) / (2 * 0.1 * s)))


def test_a_walk_is_the_closed_form_and_keeps_its_branch(tol: Tolerances) -> None:
    m = crank_slider()
    q = m.home
    for s in (0.3, 0.39, 0.25, 0.36, 0.22):
        found = cc.joint_positions(m, {"push": s}, q)
        assert found.arrived
        assert found.residual < tol.closure
        assert_close(angle(found), crank_angle(s), tol.reference)
        q = found.q
    lower = cc.close(m, [-1.0, 1.3, 0.33], fixed={"s": 0.33}).raise_if_failed()
    below = cc.joint_positions(m, {"s": 0.28}, lower.q)
    assert_close(angle(below), -crank_angle(0.28), tol.reference)


def test_a_singularity_stops_and_the_next_values_go_on(tol: Tolerances) -> None:
    """Crank and rod in line at s = 0.4: no slider goes beyond, and none pushes from there."""
    m = crank_slider()
    before = cc.joint_positions(m, {"push": 0.35})
    stopped = cc.joint_positions(m, {"push": 0.45}, before.q)
    assert not stopped.arrived
    assert stopped.kinds == {"direct"}
    assert np.abs(stopped.q - before.q).max() < tol.reference
    assert "direct singularity after 50.0%, at push=0.4" in stopped.message
    back = cc.joint_positions(m, {"push": 0.3}, stopped.q)
    assert back.arrived
    assert back.message == "arrived"
    assert_close(angle(back), crank_angle(0.3), tol.reference)


def test_a_singular_start_is_told_and_not_left() -> None:
    m = crank_slider()
    flat = cc.close(m, [0.0, 0.0, 0.4]).raise_if_failed().q
    found = cc.joint_positions(m, {"push": 0.3}, flat)
    assert not found.arrived
    assert "singular" in found.message
    assert found.residual < 1e-12


def test_platforms_are_poses_and_all_joints_are_there(d1: cc.Mechanism) -> None:
    found = cc.joint_positions(d1, {"q1": d1.input_values(d1.home)[0] + 0.02})
    single = [j.type for j in d1.description.joints if j.name in found.names]
    assert len(found.names) == d1.model.nq - 7 * len(found.floating) == len(single)
    for name, pose in found.floating.items():
        body = next(j.child for j in d1.description.joints if j.name == name)
        assert_close(pose[:3], d1.point(found.q, body), 1e-12)
    assert found.branch in (-1, 1)
    with pytest.raises(ValueError, match="read-only"):
        found.values[0] = 1.0


def test_joints_beyond_their_limits_are_named() -> None:
    m = cc.load("linear_delta")
    found = cc.joint_positions(m, {"q1": -0.2, "q2": 0.1, "q3": 0.5})
    assert found.arrived
    assert found.beyond_limits == ("leg3_P",)
    assert found.message == "arrived; beyond their limits: leg3_P"


def test_inputs_that_the_loops_tie_say_what_would_do() -> None:
    m = cc.load_urdf(
        crank_slider().description.text.replace(
            "</robot>", '<transmission name="turn"><joint name="a"/></transmission></robot>'
        )
    )
    found = cc.joint_positions(m, {"push": 0.3})
    assert not found.arrived
    assert not found.kinds
    assert "contradict" in found.message
    assert cc.joint_positions(m, {"push": 0.3, "turn": crank_angle(0.3)}).arrived


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"q7": 1.0}, "unknown driven joint 'q7'.*leg1_P"),
        ({"q1": 0.5, "leg1_P": 0.5}, "same driven joint"),
        ({"q1": float("nan")}, r"the value of q1 must be a finite number \[m\] .* got nan"),
        ({"q1": 1e7}, "of 1e[+]06 at most"),
        ([0.5], r"values must be a mapping, such as \{'q1': 0.5\}, got \[0.5\]"),
        ({"q1": "x"}, "must be a finite number .* got 'x'"),
    ],
)
def test_wrong_values_are_refused(d1: cc.Mechanism, values: Any, words: str) -> None:
    with pytest.raises(cc.ClosureError, match=words):
        cc.joint_positions(d1, values)
