"""D1's tasks: one input locked as in the paper, and the redundancy put to use."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from d1_follows import AXIS_TASK, d1_comparison, d1_robot, d1_task

import closedchain as cc
from closedchain.analysis.motion.follow import follow
from closedchain.robots.d1 import geometry, vertical_tool

CLOSED = 1e-12
TASKS = ("drill", "hexagon", "step")


@pytest.mark.parametrize("name", ["drill", "hexagon"])
def test_the_papers_tasks_with_q3_locked(name: str) -> None:
    """All six inputs over time are those of the closed form, on the task to rounding."""
    m, task = d1_robot(), d1_task(name)
    found = follow(m, task, outputs=AXIS_TASK, lock="q3").raise_if_failed()
    form = vertical_tool(task.positions, geometry())
    assert form.converged.all()
    assert_close(found.inputs, form.inputs, 1e-10)
    assert_close(found.inputs[:, 2], np.full(201, m.input_values(m.home)[2]), 0.0)
    assert found.residual.max() < CLOSED
    assert found.task_error.max() < CLOSED
    assert found.times.size == 201
    # the tool stays vertical, though the task does not prescribe its spin
    assert_close(m.pose(found.q[77]).rotation, np.eye(3), 1e-10)
    assert np.abs(found.input_speeds[:, 2]).max() < 1e-12
    # speeds are those of the closed form along the spline through the samples, at the ends as well
    assert_close(found.input_speeds, _speeds_of_the_form(found), 1e-7)


def _speeds_of_the_form(found: cc.Follow) -> np.ndarray:
    """Speeds (n, 6) of the closed form, by differences over a much shorter time than a sample."""
    route, h = found.problem.route, 1e-5 * found.times[-1]
    inner = found.times.clip(found.times[0] + h, found.times[-1] - h)
    ends = [
        vertical_tool(
            np.array([route.between(0, t).value.translation for t in inner + s * h]), geometry()
        ).inputs
        for s in (1.0, -1.0)
    ]
    return np.asarray((ends[0] - ends[1]) / (2.0 * h))


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
def test_redundancy_keeps_further_from_singularities_than_any_lock(name: str) -> None:
    table = d1_comparison(name)
    assert [r.name for r in table.rows] == [f"q{i} locked" for i in range(1, 7)] + [
        "gradient",
        "path",
    ]
    for n in ("q4", "q5", "q6"):  # the vertical tool leaves them no part in the null motion
        row = table.row(f"{n} locked")
        assert not row.converged
        assert "the other inputs do not produce all outputs" in row.message
    gradient, path = table.row("gradient"), table.row("path")
    assert gradient.converged
    assert path.converged
    assert path.smallest >= gradient.smallest - 1e-6
    # 1.049 is the most that the self-motion of the hardest sample of drill allows
    assert gradient.smallest > 1.025 * table.best_locked
    assert path.smallest > 1.04 * table.best_locked
    assert table.gain == pytest.approx(path.smallest - table.best_locked)
    # not an effect of the measure: that of all inputs is larger as well
    for n in ("q1", "q2", "q3"):
        row = table.row(f"{n} locked")
        both = min(row.sigma_direct, row.sigma_inverse)
        assert min(gradient.sigma_direct, gradient.sigma_inverse) > 1.025 * both
    for run in table.follows[-2:]:
        assert run.residual.max() < CLOSED
        assert run.task_error.max() < CLOSED
        tips = np.array([d1_robot().point(q, "T") for q in run.q[::20]])
        assert_close(tips, d1_task(name, 10).positions[::20], 1e-11)
    assert f"{table.best_free:.4f} with the redundancy" in table.text


@pytest.mark.slow
def test_figures_of_the_table() -> None:
    """What the documentation states."""
    drill, hexagon, step = (d1_comparison(n) for n in TASKS)
    for table, figures in (
        (drill, (0.1275, 0.1275, 0.1275, 0.1314, 0.1338)),
        (hexagon, (0.1277, 0.1277, 0.1277, 0.1314, 0.1338)),
        (step, (0.0, 0.0, 0.0, 0.0916, 0.0940)),
    ):
        rows = [table.row(n) for n in ("q1 locked", "q2 locked", "q3 locked", "gradient", "path")]
        assert_close([r.smallest for r in rows], figures, 2e-4)
    stops = [run.stopped for run in step.follows[:3]]
    assert_close(stops, [2.5, 3.4, 2.2], 0.05)
    assert step.best_locked == 0.0


@pytest.mark.slow
def test_the_harder_task_ends_at_singularities_with_a_lock() -> None:
    table = d1_comparison("step")
    assert "an inverse singularity with q3 locked" in table.row("q3 locked").message
    for n in ("q1", "q2", "q3"):
        row = table.row(f"{n} locked")
        assert not row.converged
        assert 2.0 < row.reached < 3.5  # on the way up, and along the raised hexagon
    run = table.follows[2]
    assert run.stopped == pytest.approx(2.22087, abs=1e-4)
    assert run.reached == 23
    # the pose asked for next is out of reach with that lock, but for another assembly far away
    m, task = d1_robot(), d1_task("step", 10)
    q3 = float(m.input_values(m.home)[2])
    there = cc.close(m, guess=run.q[-1], fixed={"q3": q3}, place={"T": task.poses[23]})
    assert "descent from the guess does not lead to it" in there.message
    gap = m.pose(there.q, "coupler").translation - m.pose(run.q[-1], "coupler").translation
    assert np.linalg.norm(gap) > 0.3
    # a singularity of direct type is met by q1: the determinant changes sign there
    before = table.follows[0]
    again = follow(m, task, outputs=AXIS_TASK, lock="q1")
    assert again.stopped == before.stopped
    assert "direct singularity" in before.message


@pytest.mark.slow
@pytest.mark.parametrize(("name", "best"), [("drill", 0.1302), ("step", 0.0918)])
def test_no_other_value_of_the_lock_does_as_well(name: str, best: float) -> None:
    m, task = d1_robot(), d1_task(name, 4)
    values = np.linspace(0.30, 0.62, 17)
    runs = [follow(m, task, outputs=AXIS_TASK, lock={"q3": v}) for v in values]
    locked = [r.smallest if r.converged else 0.0 for r in runs]
    assert max(locked) == pytest.approx(best, abs=3e-3)
    # the gradient is ahead of a lock found by search by little, or not at all; the whole path is
    assert follow(m, task, outputs=AXIS_TASK, method="path").smallest > 1.01 * max(locked)


def test_lock_at_another_value() -> None:
    m, task = d1_robot(), d1_task("hexagon", 4)
    found = follow(m, task, outputs=AXIS_TASK, lock={"q3": 0.45}).raise_if_failed()
    assert_close(found.inputs[:, 2], np.full(41, 0.45), 0.0)
    assert_close(found.inputs, vertical_tool(task.positions, geometry(), q3=0.45).inputs, 1e-9)
    assert found.locked == {"q3": 0.45}


def test_objectives_do_what_they_say() -> None:
    m, task = d1_robot(), d1_task("drill", 4)
    runs = {
        name: follow(m, task, outputs=AXIS_TASK, objective=name).raise_if_failed()
        for name in ("singularity", "range", "speed")
    }
    speeds = {n: np.sum(np.diff(r.inputs, axis=0) ** 2) for n, r in runs.items()}
    assert speeds["speed"] == min(speeds.values())
    margins = {n: _margin(r.inputs[20:]) for n, r in runs.items()}
    assert margins["range"] == max(margins.values())
    assert runs["range"].measure[-1] == pytest.approx(_margin(runs["range"].inputs[-1:]))
    assert runs["singularity"].smallest == max(r.smallest for r in runs.values())
    assert_close(
        runs["singularity"].measure, runs["singularity"].distance, 1e-12, "measure is the distance"
    )


def _margin(inputs: np.ndarray) -> float:
    """Least distance of inputs from their limits, 0 and 1.5 m, over half the range."""
    return float(np.minimum(inputs, 1.5 - inputs).min()) / 0.75


def test_pseudo_inverse_motion_is_the_least_speed() -> None:
    """Any null motion added to a step of the "speed" objective makes its inputs move further."""
    m, task = d1_robot(), d1_task("hexagon", 8)
    found = follow(m, task, outputs=AXIS_TASK, objective="speed")
    for i in (5, 33, 60):
        null = cc.redundancy(m, found.q[i + 1], AXIS_TASK).inputs[:, 0]
        step = found.inputs[i + 1] - found.inputs[i]
        assert abs(null @ step) < 2e-3 * np.linalg.norm(step) + 1e-9


def test_a_callable_objective() -> None:
    m, task = d1_robot(), d1_task("hexagon", 4)
    at = m.input_q[0]

    def near(q: np.ndarray) -> float:
        return -20.0 * abs(q[at] - 0.47) ** 2

    found = follow(m, task, outputs=AXIS_TASK, objective=near, gain=40.0).raise_if_failed()
    assert found.objective == "near"
    assert abs(found.inputs[-1, 0] - 0.47) < 0.01
    whole = follow(m, task, outputs=AXIS_TASK, objective=near, method="path").raise_if_failed()
    assert np.abs(whole.inputs[:, 0] - 0.47).max() < 0.01
    with pytest.raises(cc.ClosureError, match="must be finite"):
        follow(m, task, outputs=AXIS_TASK, objective=lambda q: float("nan"))


@pytest.mark.parametrize("method", ["gradient", "path"])
def test_limits_are_kept(method: str) -> None:
    m, task = d1_robot(), d1_task("drill", 4)
    limits = {"q1": (0.47, 0.56), "q5": (0.50, 0.60)}
    found = follow(
        m, task, outputs=AXIS_TASK, limits=limits, speed_limits={"q1": 0.03}, method=method
    ).raise_if_failed()
    for name, (low, high) in limits.items():
        values = found.inputs[:, m.inputs.index(name)]
        assert low - 1e-6 <= values.min()
        assert values.max() <= high + 1e-6
    steps = np.abs(np.diff(found.inputs[:, 0])) / np.diff(found.times)
    assert steps.max() <= 0.03 * (1.0 + 1e-5)
    means = np.gradient(found.inputs[:, 0], found.times)
    assert np.abs(means).max() <= 0.03 * (1.0 + 1e-5)
    free = follow(m, task, outputs=AXIS_TASK)
    assert (
        np.abs(np.diff(free.inputs[:, 0])).max() > 1.2 * np.abs(np.diff(found.inputs[:, 0])).max()
    )


def test_input_speeds_give_the_velocity_of_the_tip() -> None:
    """At every sample, the ends included, and also where the task leaves a freedom."""
    m, task = d1_robot(), d1_task("drill", 10)
    found = follow(m, task, outputs=AXIS_TASK).raise_if_failed()
    route = found.problem.route
    assert found.problem.freedoms == 1
    for i in (0, 1, 17, found.reached - 2, found.reached - 1):
        wanted = route.between(min(i, route.size - 2), found.times[i]).rate[:3]
        twist_map = cc.velocity(m, found.q[i], "x y z").twist_map
        assert_close(twist_map @ found.input_speeds[i], wanted, 1e-9)


@pytest.mark.parametrize("method", ["gradient", "path"])
def test_speed_limits_that_cannot_be_kept(method: str) -> None:
    """On the axis the vertical feed is q4, q5 and q6 alone: no null motion slows them down."""
    m = d1_robot()
    times = np.linspace(0.0, 1.0, 21)
    poses = [_at(0.0, -1.0 - 0.05 * t, 0.0) for t in times]
    found = follow(m, poses, times=times, outputs=AXIS_TASK, method=method, speed_limits=0.04)
    assert not found.converged
    assert found.stopped == pytest.approx(0.05)
    assert found.reached == 1
    assert "the speed limit of q" in found.message
    assert "allowed 0.04" in found.message
    fine = follow(m, poses, times=times, outputs=AXIS_TASK, method=method, speed_limits=0.05)
    assert fine.converged


@pytest.mark.parametrize("kwargs", [{}, {"lock": "q3"}, {"method": "path"}])
def test_poses_out_of_reach(kwargs: dict[str, str]) -> None:
    m = d1_robot()
    times = np.linspace(0.0, 2.0, 21)
    poses = [_at(0.6 * t, -1.0, 0.0) for t in times]
    found = follow(m, poses, times=times, outputs=AXIS_TASK, **kwargs)
    assert not found.converged
    assert 0 < found.reached < 21
    assert found.stopped is not None
    assert found.times[-1] <= found.stopped <= times[found.reached]
    assert f"{found.reached} of 21 samples reached" in found.message
    assert "singular" in found.message
    assert found.residual.max() < CLOSED
    with pytest.raises(cc.ClosureError, match="samples reached"):
        found.raise_if_failed()


def _at(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def test_tilted_tools() -> None:
    """A cone of tool axes, tip at rest: any spin about the tool is left to the mechanism."""
    from closedchain.analysis.motion.follow import task_path

    m = d1_robot()
    times = np.linspace(0.0, 2.0, 41)
    angle, tilt = np.pi * times, 0.2 * np.sin(0.5 * np.pi * times) ** 2
    axes = np.stack(
        [np.sin(tilt) * np.cos(angle), np.cos(tilt), np.sin(tilt) * np.sin(angle)], axis=1
    )
    task = task_path(m, times, np.tile([0.0, -1.0, 0.0], (41, 1)), axes=axes, outputs=AXIS_TASK)
    found = follow(m, task, outputs=AXIS_TASK).raise_if_failed()
    assert found.task_error.max() < CLOSED
    assert_close([m.pose(q).rotation[:, 1] for q in found.q], axes, 1e-11)
    assert found.smallest > 0.10  # by the rates of all joints
