"""Joints that motors move through loops: a knee by hand, an ankle on two rods, both ways."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.analysis.forces.transmission_table import csv_text

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkage_text import Cut, J, load, urdf
from linkages import four_bar


def ankle(**more: object) -> cc.Mechanism:
    """A foot on a universal joint, pushed by two rods from cranks on the shank."""
    text = urdf(
        "ankle",
        [
            J("hip", "base", "shank", axis="0 1 0"),
            J("left", "shank", "crank_l", "0 0.04 0.2", axis="0 1 0"),
            J("right", "shank", "crank_r", "0 -0.04 0.25", axis="0 1 0"),
            J("pitch", "shank", "cross", axis="0 1 0"),
            J("roll", "cross", "foot", axis="1 0 0"),
        ],
        [
            Cut("rod_l", "crank_l", "foot", "0.05 0 0", "0.06 0.03 0", "distance", length=0.2),
            Cut("rod_r", "crank_r", "foot", "0.05 0 0", "0.06 -0.03 0", "distance", length=0.25),
        ],
        inputs={"q0": "hip", "q1": "left", "q2": "right"},
        tip="foot",
    )
    return cc.load_urdf(text, xacro=False, **more)


@pytest.fixture(scope="module")
def both() -> cc.Transmission:
    return cc.transmission(ankle(), ["pitch", "roll"])


def positions(n: int = 20) -> np.ndarray:
    return np.random.default_rng(0).uniform(-0.4, 0.4, (n, 2))


def test_the_motors_are_found(both: cc.Transmission) -> None:
    assert both.motor_names == ("q1", "q2")
    assert both.joint_units == both.motor_units == ("rad", "rad")
    knee = cc.transmission(four_bar(), ["D"])
    assert knee.motor_names == ("q1",)
    hip = cc.transmission(ankle(), ["hip"])
    assert hip.motor_names == ("q0",)
    assert_close(hip.motors([0.3]), [0.3], 1e-15)


def test_motors_by_hand(both: cc.Transmission) -> None:
    """Crank angle from the rod's length: a cos(t) + b sin(t) = c, for each leg alone."""
    x = positions()
    y = both.motors(x)
    for (pitch, roll), motors in zip(x, y, strict=True):
        turn_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0],
                           [-np.sin(pitch), 0, np.cos(pitch)]])  # fmt: skip
        turn_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)],
                           [0, np.sin(roll), np.cos(roll)]])  # fmt: skip
        for side, height, rod, angle in zip((1, -1), (0.2, 0.25), (0.2, 0.25), motors, strict=True):
            foot = turn_y @ turn_x @ [0.06, 0.03 * side, 0.0]
            crank = np.array([0.05 * np.cos(angle), 0.04 * side, height - 0.05 * np.sin(angle)])
            assert abs(np.linalg.norm(crank - foot) - rod) < 1e-12


def test_there_and_back(both: cc.Transmission) -> None:
    x = positions()
    assert_close(both.joints_at(both.motors(x)), x, 1e-11)
    one = both.motors(x[0])
    assert one.shape == (2,)
    assert_close(one, both.motors(x)[0], 0.0)


def test_jacobian_and_its_rate_by_differences(both: cc.Transmission) -> None:
    h = 1e-5
    x = positions(5)
    j = both.jacobian(x)
    for k in range(2):
        step = np.eye(2)[k] * h
        assert_close(j[:, :, k], (both.motors(x + step) - both.motors(x - step)) / (2 * h), 1e-8)
        slope = (both.jacobian(x[0] + step) - both.jacobian(x[0] - step)) / (2 * h)
        assert_close(both.hessian(x[0])[:, :, k], slope, 1e-7)
    rate = np.array([0.3, -0.7])
    ahead = (both.jacobian(x[0] + rate * h) - both.jacobian(x[0] - rate * h)) / (2 * h)
    assert_close(both.jacobian_rate(x[0], rate), ahead, 1e-7)


def test_efforts_are_those_of_statics(both: cc.Transmission) -> None:
    """A moment on the foot about both joints' axes, held by the motors."""
    m = both.mechanism
    x = np.array([0.2, -0.3])
    q = both.solutions(x).q[0]
    load_ = np.array([0.0, 0.0, 0.0, 1.0, 2.0, 0.0])
    # at the foot's frame, through which both axes pass: work on pitch and roll
    axes = np.array([[0.0, 1.0, 0.0], m.pose(q, "cross").rotation[:, 0]])
    joint_efforts = -axes @ load_[3:]
    needed = cc.statics(m, q, load_, gravity=False).inputs[1:]
    assert_close(both.motor_efforts(x, joint_efforts), needed, 1e-10)
    assert_close(both.joint_efforts(x, needed), joint_efforts, 1e-10)


def test_limits_of_motors_are_a_parallelogram_for_the_joints(both: cc.Transmission) -> None:
    x = np.array([0.2, -0.3])
    corners = both.effort_corners(x, [2.0, 3.0])
    assert corners.shape == (4, 2)
    for corner in corners:
        assert_close(np.abs(both.motor_efforts(x, corner)), [2.0, 3.0], 1e-10)
    low, high = both.effort_limits(x, [[-1.0, -3.0], [2.0, 3.0]])
    for joint in range(2):
        for value in (low[joint], high[joint]):
            motors = both.motor_efforts(x, value * np.eye(2)[joint])
            used = np.where(motors > 0, motors / [2.0, 3.0], motors / [-1.0, -3.0])
            assert abs(used.max() - 1.0) < 1e-10
    fast = both.speed_limits(x, [4.0, 5.0])
    for joint in range(2):
        rates = np.abs(both.jacobian(x)[:, joint] * fast[joint]) / [4.0, 5.0]
        assert abs(rates.max() - 1.0) < 1e-12


def test_reflected_inertia_is_the_rotors_kinetic_energy() -> None:
    text = ankle().description.text.replace(
        '<joint name="left"/>',
        '<joint name="left"/><actuator name="a"><mechanicalReduction>10</mechanicalReduction>'
        "<rotorInertia>1e-4</rotorInertia></actuator>",
    )
    t = cc.transmission(cc.load_urdf(text, xacro=False), ["pitch", "roll"])
    x, rate = np.array([0.1, 0.2]), np.array([0.5, -0.4])
    energy = 1e-4 * (10 * t.jacobian(x)[0] @ rate) ** 2 / 2
    assert abs(rate @ t.reflected_inertia(x) @ rate / 2 - energy) < 1e-15
    assert_close(t.reflected_inertia(x, [1.0, 2.0]), t.jacobian(x).T @ np.diag([1, 2])
                 @ t.jacobian(x), 1e-13)  # fmt: skip


def test_toggle_of_the_four_bar() -> None:
    """Crank and coupler in line: the rocker turns no further, J grows without bound."""
    t = cc.transmission(four_bar(), ["D"])
    end = np.pi - np.arccos((0.4**2 + 0.3**2 - 0.5**2) / (2 * 0.4 * 0.3))
    near = [float(t.toggle([end + gap])) for gap in (0.01, 0.001, 0.0001)]
    assert near[0] > 2 * near[1] > 4 * near[2] > 0
    # by the sine rule the crank's rate goes with the square root of the gap
    assert abs(near[1] / near[2] - np.sqrt(10)) < 0.1
    with pytest.raises(cc.ClosureError, match=r"D=.* is not reached"):
        t.motors([end - 0.05])


def test_no_effort_limits_where_the_motor_holds_nothing() -> None:
    """Crank and coupler in line, the motor on the rocker: the crank's torque meets the ground."""
    t = cc.transmission(four_bar({"q1": "D"}), ["A"])
    end = np.arccos((0.4**2 + 0.5**2 - 0.3**2) / (2 * 0.4 * 0.5))
    assert_close(t.jacobian([end]), [[0.0]], 1e-7)
    with pytest.raises(cc.ClosureError, match="a toggle"):
        t.effort_limits([end], [1.0])
    assert np.abs(t.effort_limits([end + 0.1], [1.0])).min() > 0.01


def test_table(both: cc.Transmission, tmp_path: Path) -> None:
    found = cc.transmission_table(
        both, {"pitch": (-0.3, 0.3), "roll": (-2.0, 2.0)}, {"pitch": 3, "roll": 9},
        efforts=[2.0, 3.0], speeds=[1.0, 1.0],
    )  # fmt: skip
    assert dict(found.sizes) == {"pitch": 3, "roll": 9, "motors": 2, "joints": 2,
                                 "joints_2": 2, "side": 2, "corner": 4}  # fmt: skip
    at = [float(found["pitch"][0]), float(found["roll"][4])]
    assert_close(found["effort_corners"].values[0, 4], both.effort_corners(at, [2.0, 3.0]), 1e-9)
    assert bool(found["reached"][1, 4])
    assert not found["reached"].all()
    assert np.isnan(found["motor"].values[~found["reached"].values]).all()
    at = [float(found["pitch"][2]), float(found["roll"][4])]
    assert_close(found["motor"].values[2, 4], both.motors(at), 1e-12)
    assert_close(found["effort_limits"].values[2, 4], both.effort_limits(at, [2.0, 3.0]), 1e-9)
    assert bool(found["same_side"][1, 4])
    assert not found["same_side"].values[found["reached"].values].all()  # rolled over
    text = csv_text(found)
    lines = text.splitlines()
    assert len(lines) == 1 + int(found["reached"].sum())
    assert lines[0].startswith("pitch,roll,motor q1,motor q2,d q1 / d pitch")
    assert "nan" not in text
    found.to_netcdf(tmp_path / "ankle.nc", engine="h5netcdf")


def test_programs_go_both_ways(both: cc.Transmission) -> None:
    m = both.driven_by_joints
    assert m.inputs == ("pitch", "roll", "hip")
    q = cc.direct(m, [0.2, 0.1, 0.0]).q
    assert_close(q[both.mechanism.input_q[1:]], both.motors([0.2, 0.1]), 1e-12)


@pytest.mark.parametrize(
    ("joints", "motors", "match"),
    [
        ([], None, "at least one"),
        (["nobody"], None, "nobody"),
        (["pitch", "pitch"], None, "twice"),
        (["pitch"], None, "name roll beside it, and q1, q2 determine all"),
        (["pitch", "roll"], ["q1"], "do not determine"),
        (["pitch", "roll"], ["q0"], "can move with the joints"),
        (["pitch", "roll", "left"], None, "tie the joints"),
        (["pitch", "roll"], ["q9"], "q9"),
    ],
)
def test_what_is_no_transmission(joints: list[str], motors: list[str] | None, match: str) -> None:
    with pytest.raises(cc.ClosureError, match=match):
        cc.transmission(ankle(), joints, motors)


def test_wrong_numbers_are_refused(both: cc.Transmission) -> None:
    for wrong in ([1.0], [[1.0, 2.0, 3.0]], [np.nan, 0.0], np.zeros((1, 1, 2))):
        with pytest.raises(cc.ClosureError, match="pitch roll"):
            both.motors(wrong)
    with pytest.raises(cc.ClosureError, match="limits must be"):
        both.effort_corners([0.0, 0.0], [1.0])
    with pytest.raises(cc.ClosureError, match="does not rise"):
        cc.transmission_table(both, {"pitch": (1.0, 0.0)})


def test_more_motors_than_joints() -> None:
    """Two motors on one joint: positions one way only, and least efforts."""
    m = load(
        "pair",
        [
            J("A", "base", "one"),
            J("B", "base", "two", "0.4 0 0"),
            J("C", "base", "three", "0 0.4 0"),
        ],
        [
            Cut("r1", "one", "two", "0.2 0 0", "0 0.2 0", "distance", length=0.45),
            Cut("r2", "three", "two", "0.2 0 0", "0 0.2 0", "distance", length=0.3),
        ],
        inputs={"q1": "A", "q2": "C"},
        tip="two",
    )
    t = cc.transmission(m, ["B"])
    assert t.motor_names == ("q1", "q2")
    assert t.motors(t.home).shape == (2,)
    efforts = t.motor_efforts(t.home, [1.0])
    assert_close(t.joint_efforts(t.home, efforts), [1.0], 1e-12)
    assert_close(efforts, t.jacobian(t.home)[:, 0] / (t.jacobian(t.home) ** 2).sum(), 1e-12)
    with pytest.raises(cc.ClosureError, match="cannot be given freely"):
        t.joints_at(t.motors(t.home))
