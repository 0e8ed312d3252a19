"""The parts of following a task: slopes, held equations, bounds, task paths, export, refusals."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from d1_follows import AXIS_TASK, d1_robot, d1_task

import closedchain as cc
from closedchain.analysis.motion.follow import follow, read_task_path, task_path
from closedchain.analysis.motion.follow.bounding import excess, rows_of, within
from closedchain.analysis.motion.follow.objectives import objective_of
from closedchain.analysis.motion.follow.postures import posture
from closedchain.analysis.motion.follow.problem import Problem, bounds_of
from closedchain.analysis.motion.follow.stepping import corrected
from closedchain.analysis.motion.follow.task_path import as_route, tool_axis
from closedchain.analysis.singularity.classify import classify


def problem_at(q: np.ndarray, locked: tuple[str, ...] = (), **bounds: Any) -> Problem:
    """D1's axis task, standing still at the pose of ``q``."""
    m = d1_robot()
    pose = m.pose(q)
    way = as_route(m, [pose, pose], [0.0, 1.0])
    limits, speeds = bounds.get("limits"), bounds.get("speeds")
    return Problem(m, m.outputs(AXIS_TASK), way, locked, bounds_of(m, limits, speeds))


@pytest.fixture
def tilted(reference: Callable[[str], Any]) -> np.ndarray:
    return cc.direct(d1_robot(), reference("d1")["kinematics"][0]["q"]).raise_if_failed().q


@pytest.mark.parametrize("objective", ["singularity", "range"])
def test_slopes_are_those_along_the_self_motion(tilted: np.ndarray, objective: str) -> None:
    problem = problem_at(tilted)
    here = posture(problem, tilted, 0.0)
    measure = objective_of(objective)
    h = 1e-4
    ends = []
    for s in (h, -h):
        moved = corrected(problem, here, np.array([s]), 0)
        assert moved is not None
        assert moved.residual < 1e-12
        assert_close(d1_robot().point(moved.q, "T"), d1_robot().point(tilted, "T"), 1e-12)
        ends.append(measure.numbers(problem, moved)[0])
    slopes = measure.numbers(problem, here)[1][:, 0]
    assert_close((ends[0] - ends[1]) / (2.0 * h), slopes, 1e-6)
    assert np.abs(slopes).max() > 1e-2


def test_singular_values_are_those_of_classify(tilted: np.ndarray) -> None:
    m = d1_robot()
    found = classify(m, tilted, AXIS_TASK)
    free, locked = (posture(problem_at(tilted, names), tilted, 0.0) for names in ((), ("q2",)))
    for at in (free, locked):
        assert at.sigmas.direct == pytest.approx(found.sigma_direct, rel=1e-12)
        assert at.sigmas.inverse == pytest.approx(found.sigma_inverse, rel=1e-12)
        assert at.sigmas.constraint == pytest.approx(found.sigma_constraint, rel=1e-12)
    assert free.sigmas.driven == free.sigmas.inverse
    assert 0.0 < locked.sigmas.driven < locked.sigmas.inverse
    assert locked.basis.shape[1] == 0


def test_derivative_of_held_equations(tilted: np.ndarray, tol: Tolerances) -> None:
    """The coordinates along a basis, and their exact derivative, far from the anchor too."""
    problem = problem_at(tilted)
    m = problem.mechanism
    basis = posture(problem, tilted, 0.0).basis
    rng = np.random.default_rng(2)
    held = problem.held(m.pose(tilted), tilted, basis)
    q = problem.moved(tilted, 0.2 * rng.standard_normal(m.model.nv))
    values, matrix = held.evaluate(q)
    assert values.size == matrix.shape[0] == matrix.shape[1] == m.model.nv
    step = 1e-6
    for _ in range(4):
        way = rng.standard_normal(m.model.nv)
        ends = [held.evaluate(held.move(q, s * way))[0] for s in (step, -step)]
        rates = (ends[0] - ends[1]) / (2.0 * step) / held.row_scale
        assert_close(rates, matrix @ way, 30 * tol.finite_difference)


def test_steps_within_bounds(tilted: np.ndarray) -> None:
    m = d1_robot()
    q1 = m.input_values(tilted)[0]
    problem = problem_at(tilted, limits={"q1": (q1 - 0.001, q1 + 0.002)}, speeds=0.01)
    at = posture(problem, tilted, 0.0)
    inside = within(problem, at, np.array([1e-3]), tilted, 0)
    assert_close(inside, [1e-3], 0.0)
    cut = within(problem, at, np.array([0.3]), tilted, 0)
    rows, lower, upper = rows_of(problem, at, tilted, 0)
    assert abs(cut[0]) < 0.1
    room = np.minimum(upper - rows @ cut, rows @ cut - lower)
    assert room.min() == pytest.approx(0.0, abs=1e-9)  # as far as a bound lets it
    # outside already: the step that leaves the least excess
    narrow = problem_at(tilted, limits={"q1": (q1 + 0.001, q1 + 0.002)})
    back = within(narrow, at, np.zeros(1), None, 0)
    moved = corrected(narrow, at, back, 0)
    assert excess(narrow, tilted, None, 0).name == "q1"
    assert m.input_values(moved.q)[0] == pytest.approx(q1 + 0.001, abs=1e-5)


def test_task_path_from_axes(d1: cc.Mechanism) -> None:
    axes = np.array([[0.0, 1.0, 0.0], [0.3, 0.9, -0.1], [0.0, -1.0, 0.0]])
    places = np.tile([0.0, -1.0, 0.0], (3, 1))
    path = task_path(d1, [0.0, 1.0, 2.0], places, axes=axes, outputs=AXIS_TASK, name="cone")
    unit = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    assert tool_axis(d1, AXIS_TASK) == 1
    for pose, axis in zip(path.poses, unit, strict=True):
        assert_close(pose.rotation[:, 1], axis, 1e-14)
        assert_close(pose.rotation @ pose.rotation.T, np.eye(3), 1e-14)
    assert_close(path.positions, places, 0.0)
    given = task_path(d1, [0.0, 1.0, 2.0], places, rotations=path.poses[1].rotation)
    assert_close(given.poses[2].rotation, path.poses[1].rotation, 0.0)
    plain = task_path(d1, [0.0, 1.0, 2.0], places)
    assert_close(plain.poses[0].rotation, d1.pose(d1.home).rotation, 0.0)


def test_task_as_a_tuple_of_arrays() -> None:
    m, times = d1_robot(), np.linspace(0.0, 1.0, 4)
    places = np.array([[0.0, -1.0, 0.01 * t] for t in times])
    axes = np.array([[0.1 * t, 1.0, 0.0] for t in times])
    by_axes = follow(m, (times, places, axes), outputs=AXIS_TASK)
    path = task_path(m, times, places, axes=axes, outputs=AXIS_TASK)
    assert_close(by_axes.q, follow(m, path, outputs=AXIS_TASK).q, 0.0)
    rotations = np.array([p.rotation for p in path.poses])
    assert_close(by_axes.q, follow(m, (times, places, rotations), outputs=AXIS_TASK).q, 1e-12)
    plain = follow(m, (times, places), outputs=AXIS_TASK)
    upright = follow(m, (times, places, [0.0, 1.0, 0.0]), outputs=AXIS_TASK)
    assert_close(plain.q, upright.q, 1e-12)
    with pytest.raises(cc.ClosureError, match="got 4 entries"):
        follow(m, (times, places, axes, axes), outputs=AXIS_TASK)


def test_task_path_from_a_file(d1: cc.Mechanism, tmp_path: Path) -> None:
    file = tmp_path / "slot.csv"
    file.write_text("t,x,y,z,ax,ay,az\n0,0,-1,0,0,1,0\n1,0.01,-1,0,0.1,1,0\n")
    found = read_task_path(d1, file, outputs=AXIS_TASK)
    assert found.name == "slot"
    assert_close(found.times, [0.0, 1.0], 0.0)
    assert found.poses[1].rotation[0, 1] == pytest.approx(0.1 / np.hypot(1.0, 0.1))
    assert follow(d1, found, outputs=AXIS_TASK).converged
    file.write_text("t,x,y\n0,0,-1\n")
    with pytest.raises(cc.ClosureError, match="no column z"):
        read_task_path(d1, file)
    file.write_text("t,x,y,z\n0,0,-1,0\n1,0,here,0\n")
    with pytest.raises(cc.ClosureError, match="line 3: not a number"):
        read_task_path(d1, file)
    file.write_text("t,x,y,z\n")
    with pytest.raises(cc.ClosureError, match="no rows"):
        read_task_path(d1, file)


def test_export(tmp_path: Path) -> None:
    m, task = d1_robot(), d1_task("hexagon", 2)
    found = follow(m, task, outputs=AXIS_TASK, lock="q1")
    data = found.to_dataset()
    assert data.sizes == {"time": 21, "input": 6, "configuration": m.model.nq}
    assert_close(data["inputs"].sel(input="q4"), found.inputs[:, 3], 0.0)
    assert data["inputs"].attrs["units"] == "m m m m m m"
    assert data.attrs["locked"] == "q1"
    assert data.attrs["outputs"] == AXIS_TASK
    data.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with found.to_csv(tmp_path / "run.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0][:5] == ["t [s]", "x [m]", "y [m]", "z [m]", "q1 [m]"]
    table = np.array(rows[1:], dtype=float)
    assert_close(table[:, 1:4], task.positions, 1e-12)
    assert_close(table[:, 4:10], found.inputs, 0.0)
    assert_close(table[:, 10:16], found.input_speeds, 0.0)
    assert_close(table[:, rows[0].index("sigma_driven")], found.sigma_driven, 0.0)
    with pytest.raises(ValueError, match="read-only"):
        found.q[0, 0] = 1.0


def test_nothing_reached_is_exported_too(tmp_path: Path) -> None:
    found = follow(d1_robot(), d1_task("hexagon", 2), outputs=AXIS_TASK, lock="q4")
    assert (found.reached, found.smallest, found.stopped) == (0, 0.0, 0.0)
    assert found.to_dataset().sizes["time"] == 0
    assert len(found.to_csv(tmp_path / "none.csv").read_text().splitlines()) == 1


def test_a_function_of_time_and_a_start_elsewhere(d1: cc.Mechanism) -> None:
    task = d1_task("hexagon", 2)

    def pose(t: float) -> pin.SE3:
        return pin.SE3(np.eye(3), np.array([0.0, -1.0 - 0.01 * t, 0.0]))

    times = np.linspace(0.0, 1.0, 6)
    begin = follow(d1, task, outputs=AXIS_TASK, lock={"q3": 0.45}).q[-1]
    found = follow(d1, pose, times=times, outputs=AXIS_TASK, start=begin, lock="q3")
    assert_close(found.inputs[:, 2], np.full(6, 0.45), 1e-12)
    single = follow(d1, [pose(0.0)], times=[0.0], outputs=AXIS_TASK, method="path")
    assert single.reached == 1
    assert single.converged
    assert single.input_speeds.shape == (1, 6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "newton"}, "newton"),
        ({"objective": "beauty"}, "or a function of q"),
        ({"lock": "q7"}, "q7"),
        ({"lock": "q1 q1"}, "named twice"),
        ({"lock": "q1 q2"}, "q1, q2 cannot all be locked: the outputs x y z rx rz leave 1"),
        ({"lock": {"q1": np.inf}}, "must be finite"),
        ({"limits": {"q1": (1.0, 0.5)}}, "two rising numbers"),
        ({"limits": {"p1": (0.0, 0.5)}}, "p1"),
        ({"speed_limits": -1.0}, "must be positive"),
        ({"speed_limits": [1.0, 2.0]}, "one for each of q1"),
        ({"speed_limits": {"p": 1.0}}, "'p'"),
        ({"gain": -1.0}, "gain must not be negative"),
        ({"nodes": 2}, "4 nodes"),
        ({"times": [0.0]}, "has its own"),
        ({"outputs": "x y w"}, "w"),
    ],
)
def test_refusals(options: dict[str, Any], message: str) -> None:
    arguments = {"outputs": AXIS_TASK} | options
    with pytest.raises(cc.ClosureError, match=message):
        follow(d1_robot(), d1_task("drill", 1), **arguments)


def test_start_must_be_closed_and_outputs_possible(d1: cc.Mechanism) -> None:
    open_posture = np.array(d1.home)
    open_posture[d1.input_q[0]] += 0.01
    with pytest.raises(cc.ClosureError, match="the start posture is not closed: closure"):
        follow(d1, d1_task("drill", 1), outputs=AXIS_TASK, start=open_posture)
    m = cc.load("linear_delta")
    with pytest.raises(cc.ClosureError, match="are 6 outputs; 'linear_delta' has 3 freedoms"):
        follow(m, [m.pose(m.home)], times=[0.0], outputs="x y z rx ry rz")
    # home is singular for six outputs of D1: said, not raised
    found = follow(d1, [d1.pose(d1.home)] * 2, times=[0.0, 1.0])
    assert not found.converged
    assert "it is an inverse singularity" in found.message


def test_malformed_tasks(d1: cc.Mechanism) -> None:
    place = np.array([[0.0, -1.0, 0.0]] * 2)
    for kwargs, message in (
        ({"axes": [0.0, 0.0, 0.0], "outputs": AXIS_TASK}, "length zero"),
        ({"axes": [0.0, 1.0, 0.0]}, "have no tool axis"),
        ({"axes": [[0.0, 1.0]], "outputs": AXIS_TASK}, "axes must have shape"),
        ({"rotations": 2.0 * np.eye(3)}, "rotation matrices"),
        ({"rotations": np.eye(3), "axes": [0.0, 1.0, 0.0]}, "not both"),
    ):
        with pytest.raises(cc.ClosureError, match=message):
            task_path(d1, [0.0, 1.0], place, **kwargs)
    with pytest.raises(cc.ClosureError, match="times must rise"):
        task_path(d1, [1.0, 1.0], place)
    with pytest.raises(cc.ClosureError, match="a task needs times"):
        follow(d1, [d1.pose(d1.home)], outputs=AXIS_TASK)
    with pytest.raises(cc.ClosureError, match="for one of inputs use cc"):
        follow(d1, np.zeros((2, 6)), times=[0.0, 1.0], outputs=AXIS_TASK)


def test_range_without_limits_says_what_to_give() -> None:
    """Inputs with one limit have no middle of their range."""
    m = cc.load("rus6")
    with pytest.raises(cc.ClosureError, match="give limits="):
        follow(
            m,
            [m.pose(m.home)] * 2,
            times=[0.0, 1.0],
            objective="range",
            limits=dict.fromkeys(m.inputs, (-np.inf, 1.0)),
        )


def test_a_comparison_reports_every_run() -> None:
    seen: dict[str, int] = {}
    cc.compare(
        *(d1_robot(), d1_task("hexagon", 2)),
        outputs=AXIS_TASK,
        methods=("gradient",),
        progress=lambda what, done, total: seen.update({what: done}),
    )
    assert {name: seen.get(f"{name}: follow") for name in ("q1 locked", "gradient")} == {
        "q1 locked": 21,
        "gradient": 21,
    }
    assert not any(name.startswith("q4") for name in seen)  # not begun
