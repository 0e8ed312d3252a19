"""The inverse problem of D1: round trips, refusals, goal rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Reference, Tolerances, assert_close
from d1_solutions import check_failure, check_solution, near_postures, se3

import closedchain as cc
from closedchain.closure.task import goal, goal_rows
from closedchain.urdf.errors import ClosureError

# -- inverse --------------------------------------------------------------------------------------


def test_inverse_returns_to_the_posture_near_the_guess(d1: cc.Mechanism, tol: Tolerances) -> None:
    """Six outputs: isolated solutions, and the guess's own is the nearest."""
    rng = np.random.default_rng(22)
    for q in near_postures(d1, 20, 23):
        guess = pin.integrate(d1.model, q, 1e-5 * rng.standard_normal(33))
        s = cc.inverse(d1, d1.pose(q), guess=guess)
        check_solution(d1, s, tol)
        assert_close(d1.pose(s.q).homogeneous, d1.pose(q).homogeneous, 1e-11)
        assert_close(d1.input_values(s.q), d1.input_values(q), 1e-8)


def test_inverse_from_home_where_it_is_singular(d1: cc.Mechanism, tol: Tolerances) -> None:
    reached = 0
    for q in near_postures(d1, 10, 24):
        pose = d1.pose(q)
        s = cc.inverse(d1, pose)
        check_solution(d1, s, tol)
        assert "inverse singularity" in s.message
        assert_close(d1.pose(s.q).homogeneous, pose.homogeneous, 1e-11)
        d = cc.direct(d1, d1.input_values(s.q), guess=s.q)
        check_solution(d1, d, tol)
        assert_close(d1.pose(d.q).homogeneous, pose.homogeneous, 1e-10)
        reached += 1
    assert reached == 10


def test_inverse_of_the_home_pose_is_home(d1: cc.Mechanism, tol: Tolerances) -> None:
    s = cc.inverse(d1, d1.pose(d1.home))
    check_solution(d1, s, tol)
    assert_close(s.q, d1.home, 1e-9)
    assert s.rank == 32, "one short of the 33 equations: home is an inverse singularity"


def test_inverse_lands_on_a_listed_solution(
    d1: cc.Mechanism, reference: Reference, tol: Tolerances
) -> None:
    for case in reference("d1")["ik"]:
        listed = [r for r in case["real"] if r["mode"] == "ZT-ZT"]
        pose = se3(case["quatC"], case["pC"]) * pin.SE3(np.eye(3), np.array([0.0, -0.25, 0.0]))
        s = cc.inverse(d1, pose)
        check_solution(d1, s, tol)
        off = [np.abs(d1.input_values(s.q) - r["q"]).max() for r in listed]
        assert min(off) < tol.reference
        found = listed[int(np.argmin(off))]
        for i in range(3):
            assert_close(d1.point(s.q, f"S{i + 1}"), found["S1_3"][i], tol.reference)
            assert_close(d1.point(s.q, f"R{i + 4}"), found["R4_6"][i], tol.reference)


def test_inverse_of_five_outputs(d1: cc.Mechanism, tol: Tolerances) -> None:
    """Position and tool axis: regular at home, so the branch is followed."""
    for q in near_postures(d1, 20, 25):
        pose = d1.pose(q)
        s = cc.inverse(d1, pose, outputs="x y z rx rz")
        check_solution(d1, s, tol)
        assert "on the branch of the guess" in s.message
        here = d1.pose(s.q)
        assert_close(here.translation, pose.translation, 1e-11)
        assert_close(here.rotation[:, 1], pose.rotation[:, 1], 1e-11, "tool axis")
        assert s.rank == 32


def test_inverse_follows_the_drilling_task(
    d1: cc.Mechanism, reference: Reference, tol: Tolerances
) -> None:
    """Tool vertical at every waypoint, one after the other."""
    guess = d1.home
    for waypoint in reference("d1")["task_drill"]["waypoints"]:
        s = cc.inverse(d1, pin.SE3(np.eye(3), np.array(waypoint)), guess, "x y z rx rz")
        check_solution(d1, s, tol)
        assert_close(d1.point(s.q, "T"), waypoint, 1e-11)
        guess = s.q


@pytest.mark.parametrize("outputs", ["x y z rx rz", "x y z"])
def test_pose_beyond_the_limits(d1: cc.Mechanism, outputs: str, tol: Tolerances) -> None:
    """Three metres aside: geometry closes with longer legs, which the answer names."""
    far = d1.pose(d1.home)
    far.translation = d1.point(d1.home, "T") + np.array([3.0, 0.0, 0.0])
    s = cc.inverse(d1, far, outputs=outputs)
    check_solution(d1, s, tol)
    assert {"leg4_P", "leg5_P", "leg6_P"} <= set(s.beyond_limits)
    assert "beyond their limits" in s.message


def test_unreachable_pose(d1: cc.Mechanism, tol: Tolerances) -> None:
    """Without a branch to follow, only postures within the limits count as found."""
    far = d1.pose(d1.home)
    far.translation = d1.point(d1.home, "T") + np.array([3.0, 0.0, 0.0])
    s = cc.inverse(d1, far)
    check_failure(d1, s, "beyond the joint limits", "leg4_P")
    aside = d1.pose(d1.home)
    aside.translation = d1.point(d1.home, "T") + np.array([1.0, 0.0, 0.0])
    s = cc.inverse(d1, aside)
    check_solution(d1, s, tol)
    assert s.beyond_limits == ()
    assert_close(d1.pose(s.q).homogeneous, aside.homogeneous, 1e-11)


@pytest.mark.parametrize(
    ("pose", "outputs", "message"),
    [
        (np.eye(4), None, "pose must be a pin.SE3"),
        (None, None, "pose must be a pin.SE3"),
        (pin.SE3(np.eye(3), np.array([np.nan, 0, 0])), None, "finite"),
        (pin.SE3(np.full((3, 3), np.inf), np.zeros(3)), None, "finite"),
        (pin.SE3.Identity(), "x w", "w"),
        (pin.SE3.Identity(), "", "at least one"),
    ],
)
def test_malformed_poses_are_refused(
    d1: cc.Mechanism, pose: Any, outputs: str | None, message: str
) -> None:
    with pytest.raises(ClosureError, match=message):
        cc.inverse(d1, pose, outputs=outputs)


@pytest.mark.parametrize(
    "outputs", ["x y z", "x y z rx rz", "x y z rx ry rz", "rz", "y ry", "rx ry"]
)
@pytest.mark.parametrize("frame", ["T", "S1", "leg4_rod", "base"])
def test_goal_rows_are_exact(frame: str, outputs: str, d1: cc.Mechanism, tol: Tolerances) -> None:
    """At any distance from the goal short of a half turn, where log3 has no derivative."""
    rng = np.random.default_rng(26)
    model, data = d1.model, d1.workspace.data
    step = 1e-6
    for _ in range(10):
        q = pin.integrate(model, d1.home, 0.5 * rng.standard_normal(33))
        turn = rng.standard_normal(3)
        turn *= rng.uniform(0, 2.8) / np.linalg.norm(turn)
        target = d1.pose(q, frame) * pin.SE3(pin.exp3(turn), rng.standard_normal(3))
        g = goal(d1, frame, target, d1.outputs(outputs))

        def rows(at: np.ndarray, g: Any = g) -> tuple[np.ndarray, np.ndarray]:
            pin.computeJointJacobians(model, data, at)
            return goal_rows(d1, g)

        values, jacobian = rows(q)
        assert values.shape == (len(g.outputs),)
        assert g.translational.shape == values.shape
        expected = np.array(
            [
                (rows(pin.integrate(model, q, step * e))[0]
                 - rows(pin.integrate(model, q, -step * e))[0]) / (2 * step)
                for e in np.eye(33)
            ]
        ).T  # fmt: skip
        size = max(1.0, float(np.abs(jacobian).max()))
        assert_close(jacobian, expected, tol.finite_difference * size, outputs)
        met, _ = rows(q, goal(d1, frame, d1.pose(q, frame), g.outputs))
        assert_close(met, np.zeros(values.size), 1e-12, "met where it is")
