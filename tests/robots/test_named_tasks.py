"""Tasks by name: tips over time that begin where the robots are at home."""

import numpy as np
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.robots.named_tasks import named_task, named_tasks, task_outputs

NAMED = [(robot, task) for robot in cc.robots() for task in named_tasks(robot)]


def test_which_there_are() -> None:
    assert named_tasks("d1") == ("drill", "hexagon", "step", "periodic")
    assert named_tasks("rus6") == ("turn",)
    assert named_tasks("a robot of one's own") == ()
    assert task_outputs("d1") == "x y z rx rz"
    assert task_outputs("rus6") is None
    with pytest.raises(cc.DescriptionError, match=r"unknown task of d1 'mill'.*known: drill"):
        named_task("d1", "mill")


@pytest.mark.parametrize(("robot", "name"), NAMED)
def test_tasks_begin_and_end_at_home(robot: str, name: str) -> None:
    m, task = cc.load(robot), named_task(robot, name)
    home = m.pose(m.home)
    assert (np.diff(task.times) > 0.0).all()
    assert task.positions.shape == (task.times.size, 3)
    for end in (0, -1):
        assert_close(task.positions[end], home.translation, 1e-12, name)
        if task.axes is not None:
            assert_close(task.axes[end], home.rotation[:, 1], 1e-12, name)
        if task.rotations is not None:
            assert_close(task.rotations[end], home.rotation, 1e-12, name)


def test_the_periodic_task_is_the_motion_by_periodic_inputs(d1: cc.Mechanism) -> None:
    from closedchain.robots.d1 import geometry, periodic

    task = named_task("d1", "periodic")
    track = cc.track(d1, periodic(task.times, geometry()).inputs, times=task.times)
    assert task.axes is not None
    for q, place, axis in zip(track.q, task.positions, task.axes, strict=True):
        pose = d1.pose(q)
        assert_close(pose.translation, place, 1e-10)
        assert_close(pose.rotation[:, 1], axis, 1e-10)
