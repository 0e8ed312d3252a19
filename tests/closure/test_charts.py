"""Charts: coordinates mean what they say, and charts that fix no posture are refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.closure.chart import Chart, joint_index, joint_names
from closedchain.closure.charting import chart_of, coordinate_names, straight
from closedchain.closure.solve.continuation import follow
from closedchain.closure.solve.newton import correct


def moved(chart: Chart, values: Sequence[float]) -> np.ndarray:
    """Posture at coordinates, along the branch of the chart's start."""
    begin = chart.values(chart.start)
    here = correct(chart.equations(begin), chart.start)
    path = follow(straight(chart, begin, np.array(values)), here)
    assert path.refusal is None
    return path.last.q


CASES = [
    ("d1", "q1 q3", {}, None, (0.50, 0.53)),
    ("d1", "x z", {"y": -0.95}, "x y z rx rz", (0.03, 0.02)),
    ("d1", "rx z", {}, "x y z rx rz", (0.1, 0.02)),
    ("d1", "passive1_P q5", {}, None, None),
    ("eclipse", "tilt azimuth", {}, None, (0.3, 0.8)),
    ("eclipse", "rx ry rz", {"z": 0.11}, None, (0.1, -0.2, 0.15)),
    ("eclipse", "torsion tilt", {"azimuth": -0.4}, None, (0.2, 0.25)),
    ("linear_delta", "x y", {"z": -0.55}, None, (0.05, -0.1)),
    ("rpa3t", "theta1 theta3", {}, None, None),
    ("rus6", "x rz", {}, None, None),
]


@pytest.mark.parametrize(("robot", "names", "held", "outputs", "values"), CASES)
def test_postures_have_the_coordinates_asked_for(
    robot: str,
    names: str,
    held: dict[str, float],
    outputs: str | None,
    values: tuple[float, ...] | None,
    tol: Tolerances,
) -> None:
    m = cc.load(robot)
    chart = chart_of(m, names.split(), held, outputs)
    here = chart.values(chart.start)
    wanted = here + 0.01 * chart.scale if values is None else np.array(values)
    q = moved(chart, wanted)
    assert np.abs(cc.residual(m, q)).max() < tol.closure
    assert_close(chart.values(q), wanted, 1e-11)
    every = chart.every_value(q)
    for name, value in chart.held.items():
        assert abs(float(every[name]) - value) < 1e-11, name
        assert name not in held or value == pytest.approx(held[name], abs=1e-12)
    # as many coordinates as freedoms: the Jacobian in the unknowns has full column rank
    matrix = chart.equations(wanted).evaluate(q)[1]
    assert np.linalg.svd(matrix, compute_uv=False)[chart.free.size - 1] > 1e-6
    freedoms = m.model.nv - np.linalg.matrix_rank(cc.constraint_jacobian(m, m.home))
    assert len(chart.joints) + len(chart.outputs) == freedoms


def test_tilt_leans_the_tool_axis_towards_azimuth() -> None:
    m = cc.load("eclipse")
    chart = chart_of(m, ("tilt", "azimuth"))
    home = m.pose(m.home).rotation
    for tilt, azimuth in ((0.3, 0.8), (0.2, -2.5), (0.1, np.pi / 2)):
        turn = home.T @ m.pose(moved(chart, (tilt, azimuth))).rotation
        lean = np.array([np.cos(azimuth), np.sin(azimuth)])
        assert_close(turn[:2, 2], np.sin(tilt) * lean, 1e-11)
        assert turn[2, 2] == pytest.approx(np.cos(tilt), abs=1e-11)
        # no torsion: the shortest rotation that leans the axis so
        assert_close(pin.log3(turn), tilt * np.array([-lean[1], lean[0], 0.0]), 1e-10)


def test_upright_tip_has_any_azimuth() -> None:
    m = cc.load("eclipse")
    chart = chart_of(m, ("tilt", "azimuth"))
    postures = [moved(chart, (0.0, azimuth)) for azimuth in (-1.0, 0.0, 2.0)]
    for q in postures:
        assert_close(pin.difference(m.model, m.home, q), np.zeros(m.model.nv), 1e-10)


def test_the_two_rotations_of_an_axis_task_fix_its_direction() -> None:
    m = cc.load("d1")
    chart = chart_of(m, ("rx", "rz"), outputs="x y z rx rz")
    assert chart.outputs == ("x", "y", "z", "rx", "rz")
    assert chart.joints == ("q1",)  # one of six freedoms is left over, and held
    q = moved(chart, (0.1, -0.05))
    turn = m.pose(m.home).rotation.T @ m.pose(q).rotation
    expected = pin.exp3(np.array([0.1, 0.0, -0.05]))
    assert_close(turn[:, 1], expected[:, 1], 1e-11)
    assert m.input_values(q)[0] == m.input_values(m.home)[0]


def test_prescribed_poses_are_those_of_the_postures() -> None:
    m = cc.load("eclipse")
    chart = chart_of(m, ("x", "tilt"), {"azimuth": 0.5})
    values = np.array([[0.0, 0.1], [0.004, 0.2]])
    pins, turns, places = chart.prescribed(values)
    assert pins.shape == (2, len(chart.joints))
    for value, turn, place in zip(values, turns, places, strict=True):
        pose = m.pose(moved(chart, value))
        assert_close(pose.rotation, turn, 1e-11)
        assert_close(pose.translation, place, 1e-11)


def test_units_scales_and_ends() -> None:
    m = cc.load("d1")
    chart = chart_of(m, ("q1", "q2"))
    assert (chart.units, chart.folds) == (("m", "m"), "direct")
    assert_close(chart.scale, np.array([m.length, m.length]), 0.0)
    tip = chart_of(cc.load("eclipse"), ("z", "ry"))
    assert (tip.units, tip.folds) == (("m", "rad"), "inverse")
    assert chart_of(m, ("z",), outputs="x y z rx rz").folds is None
    assert chart_of(m, ("passive1_P",)).folds is None


def test_start_and_posture_set_the_branch() -> None:
    m = cc.load("d1")
    inputs = m.input_values(m.home) + np.array([0.01, 0, -0.01, 0, 0.01, 0])
    q = cc.direct(m, inputs).raise_if_failed().q
    for chart in (chart_of(m, ("q1",), q), chart_of(m, ("q1",), start=q)):
        assert_close(chart.start, q, 1e-12)
        assert chart.held["q3"] == pytest.approx(inputs[2], abs=1e-15)
    both = chart_of(m, ("q1",), {"q2": 0.53}, start=q)
    assert both.held["q2"] == 0.53
    assert both.held["q5"] == pytest.approx(inputs[4], abs=1e-15)


def test_joints_of_one_freedom_are_known_by_name() -> None:
    m = cc.load("d1")
    assert joint_names(m)[:6] == m.inputs
    index, column = joint_index(m, "q2")
    assert (index, column) == (m.input_q[1], m.input_v[1])
    with pytest.raises(KeyError):
        joint_index(m, "no such joint")
    floating = next(n for n, j in zip(m.model.names, m.model.joints, strict=True) if j.nv == 6)
    with pytest.raises(KeyError):
        joint_index(m, floating)
    assert {"x", "rz", "tilt", "torsion"} <= set(coordinate_names(m))


@pytest.mark.parametrize(
    ("robot", "names", "at", "outputs", "message"),
    [
        ("d1", (), None, None, "at least one coordinate must vary"),
        ("d1", ("q9",), None, None, "unknown coordinate 'q9'.*q1"),
        ("d1", ("q1", "q1"), None, None, "'q1' varies twice"),
        ("d1", ("q1",), {"q1": 0.5}, None, "'q1' both varies and is held"),
        ("d1", ("ry",), None, "x y z rx rz", "unknown output of the task.*'ry'"),
        ("eclipse", ("tilt", "rx"), None, None, "either as rx ry rz or as tilt"),
        ("linear_delta", ("tilt",), None, None, "two or three rotations"),
        ("linear_delta", ("x", "q1"), None, None, "4 coordinates.*3 freedoms"),
        ("d1", ("q1",), {"q2": float("nan")}, None, "must be finite"),
        ("linear_delta", ("y",), {"x": 5.0}, None, "cannot be reached from the start.*ends after"),
        ("d1", ("q1",), np.ones(3), None, r"shape \(35,\)"),
    ],
)
def test_charts_that_are_refused(
    robot: str, names: tuple[str, ...], at: object, outputs: str | None, message: str
) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        chart_of(cc.load(robot), names, at, outputs)


def test_open_posture_is_refused() -> None:
    m = cc.load("linear_delta")
    q = m.home.copy()
    q[m.input_q[0]] += 0.1
    with pytest.raises(cc.ClosureError, match="not closed"):
        chart_of(m, ("x",), q)


def test_coordinates_that_fail_at_the_start_are_refused() -> None:
    """At home D1's untilted stages cannot turn about their normal on their own inputs' account."""
    m = cc.load("d1")
    assert "inverse" in cc.classify(m, m.home).kinds
    with pytest.raises(cc.ClosureError, match="do not fix the posture at the start"):
        chart_of(m, ("x", "rz"))
