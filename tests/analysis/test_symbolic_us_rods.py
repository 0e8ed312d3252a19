"""Closed forms of legs with pairs of rods between universal joints and balls: a Delta robot."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

import closedchain as cc

DELTA = """<robot name="delta" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:include filename="$(arg closedchain)/joints.xacro"/>
  <xacro:arg name="arm" default="0.20"/> <xacro:arg name="rod" default="0.50"/>
  <xacro:property name="a" value="$(arg arm)"/> <xacro:property name="l" value="$(arg rod)"/>
  <xacro:property name="rb" value="0.15"/> <xacro:property name="rp" value="0.05"/>
  <link name="base"/> <link name="platform"/>
  <xacro:floating name="platform" base="base"/>
  <xacro:macro name="onerod" params="i s y">
    <link name="rod${i}${s}"/>
    <xacro:universal name="U${i}${s}" parent="arm${i}" child="rod${i}${s}" first="0 1 0"
                     second="0 0 1" xyz="${a} ${y} 0"/>
    <xacro:point name="E${i}${s}" on="rod${i}${s}" xyz="${l} 0 0"/>
    <xacro:point name="P${i}${s}" on="platform"
                 xyz="${rp*cos(t)-y*sin(t)} ${rp*sin(t)+y*cos(t)} 0"/>
    <xacro:point_closure name="S${i}${s}" parent="E${i}${s}" child="P${i}${s}"/>
  </xacro:macro>
  <xacro:macro name="leg" params="i">
    <xacro:property name="t" value="${2*pi*(i-1)/3}" scope="parent"/>
    <link name="arm${i}"/>
    <xacro:revolute name="A${i}" parent="base" child="arm${i}" axis="0 1 0"
                    xyz="${rb*cos(t)} ${rb*sin(t)} 0" rpy="0 0 ${t}"/>
    <xacro:onerod i="${i}" s="a" y="0.04"/> <xacro:onerod i="${i}" s="b" y="-0.04"/>
    <xacro:input name="q${i}" joint="A${i}"/>
  </xacro:macro>
  <xacro:leg i="1"/> <xacro:leg i="2"/> <xacro:leg i="3"/>
  <task base="base" tip="platform" outputs="x y z"/>
  <group_state name="home">
    <joint name="platform_pose" value="0 0 -0.5 0 0 0 1"/>
    <joint name="A1" value="0.3"/> <joint name="A2" value="0.3"/> <joint name="A3" value="0.3"/>
    <joint name="U1a1" value="1.8"/> <joint name="U1b1" value="1.8"/>
    <joint name="U2a1" value="1.8"/> <joint name="U2b1" value="1.8"/>
    <joint name="U3a1" value="1.8"/> <joint name="U3b1" value="1.8"/>
  </group_state>
</robot>"""


@pytest.fixture(scope="module")
def delta() -> cc.Mechanism:
    return cc.load_urdf(DELTA)


def test_a_drive_vanishes_where_its_rods_meet_the_motor_s_axis(delta: cc.Mechanism) -> None:
    """Jq of a leg is the arm times the rods' force at right angles to it, and nothing else."""
    found = cc.symbolic_singularities(delta)
    symbols = {str(symbol): symbol for symbol in found.legend}
    for i, leg in enumerate(found.legs, 1):
        along, aside = symbols[f"q_U{i}a1"], symbols[f"q_U{i}a2"]
        expected = symbols["arm"] * sympy.sin(along) * sympy.cos(aside)
        (lever,) = leg.levers.values()
        assert lever in (expected, -expected)


def test_rods_at_right_angles_to_the_arms_are_not_singular(delta: cc.Mechanism) -> None:
    """There the rods push the arms best; the couple that a leg bears beside has no part in it."""
    q = delta.home.copy()
    held = {f"U{i}{s}1": math.pi / 2 for i in (1, 2, 3) for s in "ab"}
    for name, value in held.items():
        q[delta.model.joints[delta.model.getJointId(name)].idx_q] = value
    s = cc.close(delta, q, fixed={f"U{i}a1": math.pi / 2 for i in (1, 2, 3)}).raise_if_failed()
    found = cc.classify(delta, s.q)
    assert found.kinds == frozenset()
    singular = np.linalg.svd(cc.velocity(delta, s.q).twist_map, compute_uv=False)
    assert singular[0] / singular[-1] < 3.0
