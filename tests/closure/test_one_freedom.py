"""A mechanism with one joint in its tree, and closures of several rows beside it."""

import numpy as np
import pinocchio as pin
import pytest

import closedchain as cc
from closedchain.analysis.singularity.maps.mapping import singularity_map

AXES = {
    "revolute": '<parent_axis xyz="0 0 1"/>',
    "cylindrical": '<parent_axis xyz="0 0 1"/>',
    "universal": '<parent_axis xyz="0 0 1"/><child_axis xyz="1 0 0"/>',
    "planar": '<parent_axis xyz="0 0 1"/>',
    "in_plane": '<parent_axis xyz="0 0 1"/>',
    "point_on_line": '<parent_axis xyz="0 0 1"/>',
    "spherical": "",
}


def hinge(closure: str, kind: str = "continuous") -> str:
    """A door on one hinge about z, held by a second joint above it."""
    axis = AXES[closure]
    return f"""<robot name="door"><link name="wall"/><link name="leaf"/>
  <joint name="hinge" type="{kind}"><parent link="wall"/><child link="leaf"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <constraint name="upper" type="{closure}">
    <parent link="wall"/><parent_origin xyz="0 0 0.5"/>{axis.split("<child")[0]}
    <child link="leaf"/><child_origin xyz="0 0 0.5"/>{axis[len(axis.split("<child")[0]) :]}
  </constraint>
  <transmission name="angle"><joint name="hinge"/></transmission>
  <task base="wall" tip="leaf" outputs="rz"/></robot>"""


@pytest.mark.parametrize("closure", sorted(AXES))
def test_a_door_on_two_hinges_turns(closure: str) -> None:
    door = cc.load_urdf(hinge(closure))
    assert cc.constraint_jacobian(door, door.home).shape == (door.rows, 1)
    found = cc.mobility(door)
    assert (found.mobility, found.redundant_rows) == (1, door.rows)
    turned = cc.direct(door, np.array([[0.3], [1.2], [-1.9]]))
    assert turned.converged.all()
    assert turned.q[:, 0] == pytest.approx([0.3, 1.2, -1.9], abs=1e-12)
    tip = door.pose(turned.q[1])
    assert pin.log3(tip.rotation) == pytest.approx([0.0, 0.0, 1.2], abs=1e-12)
    back = cc.inverse(door, tip)
    assert back.converged
    assert back.q == pytest.approx(turned.q[1], abs=1e-12)
    rates = cc.velocity(door, turned.q[1])
    assert rates.twist_map == pytest.approx(np.array([[1.0]]), abs=1e-12)


def test_a_door_is_singular_nowhere() -> None:
    door = cc.load_urdf(hinge("revolute"))
    here = cc.classify(door, np.array([0.7]))
    assert here.kinds == frozenset()
    # a turn of the leaf by 1 turns both hinges by 1: the motion of unit norm has an input rate of
    # 1 / sqrt(2), and so has the tip
    assert here.sigma_direct == pytest.approx(np.sqrt(0.5), abs=1e-12)
    assert here.sigma_inverse == pytest.approx(np.sqrt(0.5), abs=1e-12)
    cells = singularity_map(door, {"angle": np.linspace(-1.0, 1.0, 5)}, progress=False)
    assert (cells["status"] == 0).all()
    assert cells["sigma_direct"].to_numpy() == pytest.approx(np.full(5, np.sqrt(0.5)), abs=1e-12)


@pytest.mark.parametrize("closure", ["revolute", "spherical", "point_on_line"])
def test_rows_of_an_open_door_have_their_derivative(closure: str) -> None:
    """A pin beside the axis: the rows change with the angle, and K and its drift say how."""
    text = hinge(closure).replace('<child_origin xyz="0 0 0.5"/>', '<child_origin xyz="0.1 0 0"/>')
    text = text.replace('<parent_origin xyz="0 0 0.5"/>', '<parent_origin xyz="0.1 0 0"/>')
    pinned = cc.load_urdf(text)
    step, q = 1e-6, np.array([0.4])

    def rows(angle: float) -> np.ndarray:
        return cc.residual(pinned, np.array([angle]))

    slope = (rows(0.4 + step) - rows(0.4 - step)) / (2.0 * step)
    assert cc.constraint_jacobian(pinned, q)[:, 0] == pytest.approx(slope, abs=1e-9)
    assert np.abs(slope).max() > 0.05
    drift = cc.constraint_drift(pinned, q, np.array([1.0]))
    at = [cc.constraint_jacobian(pinned, q + d)[:, 0] for d in (step, -step)]
    assert drift == pytest.approx((at[0] - at[1]) / (2.0 * step), abs=1e-8)
    assert cc.mobility(pinned).mobility == 0
    assert "mobility 0" in cc.mobility(pinned).text


def test_every_question_has_an_answer_of_one_column() -> None:
    door = cc.load_urdf(hinge("revolute"))
    q = np.array([0.2])
    assert cc.network(door, q).text
    assert cc.structure(door).mobility == 1
    assert cc.poc(door).rotations == 1
    moved = cc.acceleration(door, q, np.array([2.0]), np.array([3.0]))
    assert moved.tip_twist == pytest.approx([0, 0, 0, 0, 0, 2.0], abs=1e-12)
    assert moved.tip_acceleration == pytest.approx([0, 0, 0, 0, 0, 3.0], abs=1e-12)
    assert cc.symbolic_singularities(door).text


def test_an_input_that_the_loops_hold_still_is_named() -> None:
    """A triangle with a loose bar: the input cannot move, and nothing else is prescribed."""
    text = """<robot name="locked"><link name="base"/><link name="a"/>
      <link name="b"/><link name="c"/>
      <joint name="one" type="continuous"><parent link="base"/><child link="a"/>
        <axis xyz="0 0 1"/></joint>
      <joint name="two" type="continuous"><parent link="base"/><child link="b"/>
        <origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
      <joint name="loose" type="continuous"><parent link="a"/><child link="c"/>
        <origin xyz="0.8 0 0"/><axis xyz="0 0 1"/></joint>
      <constraint name="apex" type="revolute"><parent link="c"/><parent_axis xyz="0 0 1"/>
        <child link="b"/><child_origin xyz="-0.7 0 0"/></constraint>
      <transmission name="q1"><joint name="one"/></transmission>
      <task base="base" tip="c" outputs="x y"/>
      <group_state name="home"><joint name="one" value="0.6"/></group_state></robot>"""
    m = cc.load_urdf(text)
    angle = float(m.input_values(m.home)[0])
    assert np.cos(angle) == pytest.approx((1 + 0.64 - 0.49) / 1.6, abs=1e-12)  # law of cosines
    held = cc.direct(m, [angle + 0.01])
    assert not held.converged
    assert held.message.startswith(
        f"the loops hold the inputs still: q1 would have to be {angle:.6g}"
    )
