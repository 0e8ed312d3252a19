"""Position solvers on D1: direct, inverse and nearest postures against the reference and laws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import closedchain as cc
from closedchain.closure.equations import Equations
from closedchain.closure.ranks import null_space, numerical_rank
from closedchain.closure.task import goal, goal_rows
from closedchain.urdf.errors import ClosureError

Reference = Callable[[str], dict[str, Any]]
FOLD = np.array([0.02858, -0.06320, 0.02858, 0.0, 0.0, 0.0])
"""Step of the inputs from home to the nearest known direct singularity of stage 1 [m]."""


def se3(quaternion_wxyz: Any, position: Any) -> pin.SE3:
    w, x, y, z = quaternion_wxyz
    rotation = pin.Quaternion(w, x, y, z).normalized().matrix()
    return pin.SE3(rotation, np.array(position, dtype=float))


def tool(entry: dict[str, Any]) -> pin.SE3:
    """Pose of the tip of a reference entry: rotation of the platform, position of T."""
    return se3(entry["quatC"], entry["tip"])


def check_entry(m: cc.Mechanism, q: np.ndarray, entry: dict[str, Any], atol: float) -> None:
    assert_close(m.input_values(q), entry["q"], atol, "inputs")
    for body, letter in (("coupler", "B"), ("platform", "C")):
        expected = se3(entry[f"quat{letter}"], entry[f"p{letter}"]).homogeneous
        assert_close(m.pose(q, body).homogeneous, expected, atol, body)
    for i, point in enumerate(entry["S"]):
        assert_close(m.point(q, f"S{i + 1}"), point, atol, f"S{i + 1}")
    for i, point in enumerate(entry["R4_6"]):
        assert_close(m.point(q, f"R{i + 4}"), point, atol, f"R{i + 4}")
    assert_close(m.point(q, "T"), entry["tip"], atol, "T")


def check_solution(m: cc.Mechanism, s: cc.Solution, tol: Tolerances) -> None:
    """A converged solution is what it says."""
    assert s.converged, s.message
    assert s.residual < tol.closure
    assert np.abs(cc.residual(m, s.q)).max() < tol.closure
    assert s.iterations > 0
    assert s.raise_if_failed() is s


def check_failure(m: cc.Mechanism, s: cc.Solution, *words: str) -> None:
    """A failure is finite, says so, and its posture and residual belong together."""
    assert not s.converged
    assert np.isfinite(s.q).all()
    assert np.isfinite(s.residual)
    m.configuration(s.q)
    for word in words:
        assert word in s.message
    with pytest.raises(ClosureError):
        s.raise_if_failed()


def branch_of(m: cc.Mechanism, q: np.ndarray) -> float:
    sign, _ = np.linalg.slogdet(Equations(m, m.passive_v).evaluate(q)[1])
    return float(sign)


# -- direct ---------------------------------------------------------------------------------------


def test_direct_against_the_reference(
    d1: cc.Mechanism, reference: Reference, tol: Tolerances
) -> None:
    ref = reference("d1")
    entries = [*ref["kinematics"], *(r["home_branch"] for r in ref["fk_random"]), ref["home"]]
    for entry in entries:
        s = cc.direct(d1, entry["q"])
        check_solution(d1, s, tol)
        check_entry(d1, s.q, entry, tol.reference)
        assert s.branch == branch_of(d1, d1.home)
        assert_close(d1.input_values(s.q), entry["q"], 0.0, "inputs are met exactly")


def test_direct_follows_the_periodic_motion(
    d1: cc.Mechanism, reference: Reference, tol: Tolerances
) -> None:
    for sample in reference("d1")["periodic"]["samples"]:
        s = cc.direct(d1, [sample[f"q{i}"] for i in range(1, 7)])
        check_solution(d1, s, tol)
        for body, letter in (("coupler", "B"), ("platform", "C")):
            quaternion = [sample[f"quat{letter}_{c}"] for c in "wxyz"]
            position = [sample[f"p{letter}_{c}"] for c in "xyz"]
            expected = se3(quaternion, position).homogeneous
            assert_close(d1.pose(s.q, body).homogeneous, expected, tol.reference, body)
        tip = [sample[f"tip_{c}"] for c in "xyz"]
        assert_close(d1.point(s.q, "T"), tip, tol.reference, "T")


@pytest.mark.parametrize("variant", ["printed_u", "circle_u"])
def test_direct_of_the_variants(variant: str, reference: Reference, tol: Tolerances) -> None:
    """Tip at a quarter of the periodic motion, where the inputs are home plus these steps."""
    ref = reference("d1")
    quarter = next(s for s in ref["periodic"]["samples"] if abs(s["t"] - np.pi / 2) < 1e-9)
    step = np.array([quarter[f"q{i}"] for i in range(1, 7)]) - ref["home"]["q"]
    m = cc.load("d1", variant=variant)
    s = cc.direct(m, m.input_values(m.home) + step)
    check_solution(m, s, tol)
    assert_close(m.point(s.q, "T"), ref["periodic"][variant]["tip_at_pi_2"], tol.reference, variant)


@pytest.mark.slow
def test_ten_thousand_steps_converge_on_the_branch_of_home(
    d1: cc.Mechanism, tol: Tolerances
) -> None:
    rng = np.random.default_rng(20)
    home = d1.input_values(d1.home)
    branch = branch_of(d1, d1.home)
    worst, evaluations = 0.0, 0
    for i in range(10_000):
        direction = rng.standard_normal(6)
        step = 0.04 * rng.uniform() ** (1 / 6) * direction / np.linalg.norm(direction)
        s = cc.direct(d1, home + step)
        assert s.converged, f"{step}: {s.message}"
        assert s.branch == branch
        worst, evaluations = max(worst, s.residual), evaluations + s.iterations
        if i % 500 == 0:
            assert branch_of(d1, s.q) == branch
            check_solution(d1, s, tol)
            back = cc.direct(d1, home, guess=s.q)
            assert_close(back.q, d1.home, 1e-10, "the way back leads home")
    assert worst < tol.closure
    assert evaluations < 8 * 10_000


def test_inputs_by_name(d1: cc.Mechanism) -> None:
    values = d1.input_values(d1.home) + np.array([0.01, -0.01, 0.0, 0.02, 0.0, 0.01])
    by_name = dict(zip(d1.inputs, values, strict=True))
    expected = cc.direct(d1, values)
    assert_close(cc.direct(d1, by_name).q, expected.q, 0.0)
    assert_close(cc.direct(d1, dict(reversed(by_name.items()))).q, expected.q, 0.0)


def test_direct_from_an_open_guess(d1: cc.Mechanism, tol: Tolerances) -> None:
    """A guess need not be closed to the last digit, nor have the inputs asked for."""
    rng = np.random.default_rng(21)
    values = d1.input_values(d1.home) + 0.005
    expected = cc.direct(d1, values).q
    for _ in range(20):
        guess = pin.integrate(d1.model, d1.home, 0.01 * rng.standard_normal(33))
        s = cc.direct(d1, values, guess=guess)
        check_solution(d1, s, tol)
        assert_close(s.q, expected, 1e-10)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (
            [1.4, 0.522, 0.522, 0.546, 0.546, 0.546],
            ("direct singularity after", "closure 'leg1_S'"),
        ),
        ([0.01, 0.522, 0.522, 0.546, 0.546, 0.546], ("direct singularity after", "closure 'leg")),
        ([-0.5] * 6, ("direct singularity after", "q4=")),
    ],
    ids=["long", "short", "negative"],
)
def test_out_of_reach(d1: cc.Mechanism, values: list[float], words: tuple[str, ...]) -> None:
    s = cc.direct(d1, values)
    check_failure(d1, s, *words)
    assert s.residual == pytest.approx(np.abs(cc.residual(d1, s.q)).max(), rel=1e-12)


def test_a_singularity_on_the_way_is_reported_where_it_is(d1: cc.Mechanism) -> None:
    home = d1.input_values(d1.home)
    s = cc.direct(d1, home + 1.5 * FOLD)
    check_failure(d1, s, "direct singularity after 66.7% of the way", "q2=0.4588")
    assert s.residual > 1e-3
    near = cc.direct(d1, home + 0.99 * FOLD)
    assert near.converged, near.message
    assert near.branch == branch_of(d1, d1.home)


def test_beyond_limits_is_reported(d1: cc.Mechanism, tol: Tolerances) -> None:
    """Legs of any length close the loops: the answer converges and names the joints."""
    s = cc.direct(d1, d1.input_values(d1.home))
    assert s.beyond_limits == ()
    s = cc.direct(d1, [9.0] * 6)
    check_solution(d1, s, tol)
    assert {"leg1_P", "leg4_P", "leg6_P"} <= set(s.beyond_limits)
    assert "beyond their limits: leg1_P" in s.message


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([0.5] * 5, r"input values must have shape \(6,\) \(q1 q2"),
        ([0.5] * 7, r"must have shape \(6,\)"),
        ([[0.5] * 6], r"must have shape \(6,\)"),
        (0.5, r"must have shape \(6,\)"),
        ([0.5] * 5 + [np.nan], r"not finite, at index \[5\]"),
        ([np.inf] + [0.5] * 5, r"not finite, at index \[0\]"),
        (["a"] * 6, "input values must be 6 numbers"),
        (None, "input values must"),
        ({"q1": 0.5}, "no value for input q2, q3, q4, q5, q6"),
        ({f"q{i}": 0.5 for i in range(1, 8)}, "q7.*q1"),
        ({1: 0.5}, "input"),
        ({**{f"q{i}": 0.5 for i in range(1, 6)}, "q6": "long"}, "input values must be 6 numbers"),
    ],
)
def test_malformed_inputs_are_refused(d1: cc.Mechanism, values: Any, message: str) -> None:
    with pytest.raises(ClosureError, match=message):
        cc.direct(d1, values)


@pytest.mark.slow
def test_absurd_inputs_neither_crash_nor_pass_for_solved(d1: cc.Mechanism) -> None:
    """Far beyond any path that can be followed: closed with those inputs, or not converged."""
    home = d1.input_values(d1.home)
    for factor in (1e2, 1e4):
        s = cc.direct(d1, factor * home)
        assert np.isfinite(s.q).all()
        if s.converged:
            assert_close(d1.input_values(s.q), factor * home, 0.0)
            assert np.abs(cc.residual(d1, s.q)).max() < 1e-12
        else:
            assert s.message


# -- rank -----------------------------------------------------------------------------------------


def test_rank_and_gap_at_home(d1: cc.Mechanism) -> None:
    s = cc.direct(d1, d1.input_values(d1.home))
    assert s.rank == 27
    assert s.rank_decision.value == 27
    assert s.rank_decision.gap == np.inf
    assert s.rank_decision.above > 1e-3


@pytest.mark.parametrize(("name", "rank"), [("S1_flat", 24), ("S2_leg_in_plane_45deg", 26)])
def test_rank_drops_at_direct_singularities(
    name: str, rank: int, d1: cc.Mechanism, reference: Reference, tol: Tolerances
) -> None:
    entry = reference("d1")["singular"][name]
    place = {
        "coupler": se3(entry["quatB"], entry["pB"]),
        "platform": se3(entry["quatC"], entry["pC"]),
    }
    s = cc.close(d1, place=place)
    check_solution(d1, s, tol)
    check_entry(d1, s.q, entry, tol.reference)
    decision = numerical_rank(Equations(d1, d1.passive_v).evaluate(s.q)[1])
    assert decision.value == rank
    assert decision.below < tol.singular
    assert decision.gap > 1e6
    # all columns: the mechanism itself is regular there
    assert numerical_rank(cc.constraint_jacobian(d1, s.q)).value == 27
    held = cc.close(d1, guess=s.q, fixed=dict(zip(d1.inputs, entry["q"], strict=True)))
    assert held.converged
    assert held.rank == rank


# -- inverse --------------------------------------------------------------------------------------


def near_postures(m: cc.Mechanism, count: int, seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    home = m.input_values(m.home)
    return [cc.direct(m, home + rng.uniform(-0.015, 0.015, 6)).q for _ in range(count)]


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


# -- close ----------------------------------------------------------------------------------------


def test_close_finds_the_nearest_posture(d1: cc.Mechanism, tol: Tolerances) -> None:
    """No motion that keeps the loops closed shortens the way to the guess."""
    rng = np.random.default_rng(27)
    scale = d1.column_scale
    for spread in (0.05, 0.05, 0.05, 0.05, 0.3, 0.3):
        v = spread * rng.standard_normal(33) * scale
        guess = pin.integrate(d1.model, d1.home, v)
        s = cc.close(d1, guess)
        check_solution(d1, s, tol)
        away = pin.difference(d1.model, s.q, guess) / scale
        assert np.linalg.norm(away) <= np.linalg.norm(v / scale) * (1 + 1e-9), "nearer than home"
        basis, decision = null_space(cc.constraint_jacobian(d1, s.q) * scale)
        assert decision.value == 27
        # the displacement's own derivative is not 1 where rotations differ
        derivative = pin.dDifference(d1.model, s.q, guess, pin.ARG0) * scale / scale[:, None]
        assert np.linalg.norm((derivative @ basis).T @ away) < 1e-6 * np.linalg.norm(away)


def test_close_leaves_a_closed_guess_alone(d1: cc.Mechanism, tol: Tolerances) -> None:
    assert_close(cc.close(d1).q, d1.home, 1e-12)
    for q in near_postures(d1, 3, 28):
        s = cc.close(d1, q)
        check_solution(d1, s, tol)
        assert_close(s.q, q, 1e-11)


def test_fixed_joints_are_kept_exactly(d1: cc.Mechanism, tol: Tolerances) -> None:
    fixed: dict[str, Any] = {"q1": 0.53, "leg2_P": 0.51, "leg4_U1": np.array([-1.97])}
    fixed["q5"] = np.float64(0.55)
    s = cc.close(d1, fixed=fixed)
    check_solution(d1, s, tol)
    inputs = d1.input_values(s.q)
    assert (inputs[0], inputs[1], inputs[4]) == (0.53, 0.51, 0.55)
    joint = d1.model.joints[d1.model.getJointId("leg4_U1")]
    assert s.q[joint.idx_q] == -1.97


def test_a_fixed_floating_joint(d1: cc.Mechanism, tol: Tolerances) -> None:
    posture = near_postures(d1, 1, 29)[0]
    pose = d1.pose(posture, "coupler")
    for value in (pose, pin.SE3ToXYZQUAT(pose)):
        s = cc.close(d1, fixed={"coupler_pose": value})
        check_solution(d1, s, tol)
        assert_close(d1.pose(s.q, "coupler").homogeneous, pose.homogeneous, 1e-14)
        assert_close(d1.input_values(s.q)[:3], d1.input_values(posture)[:3], 1e-11)


@pytest.mark.parametrize("name", ["S1_flat", "S2_leg_in_plane_45deg", "T1_home"])
def test_placed_bodies_give_the_inputs(
    name: str, d1: cc.Mechanism, reference: Reference, tol: Tolerances
) -> None:
    """Both bodies placed leave only the legs: singular examples are no harder than others."""
    entry = reference("d1")["singular"][name]
    place = {
        "coupler": se3(entry["quatB"], entry["pB"]),
        "platform": se3(entry["quatC"], entry["pC"]),
    }
    s = cc.close(d1, place=place)
    check_solution(d1, s, tol)
    check_entry(d1, s.q, entry, tol.reference)


def test_a_placed_leg_link_moves_the_rest(d1: cc.Mechanism, tol: Tolerances) -> None:
    """Placing works for bodies that no floating joint carries."""
    posture = near_postures(d1, 1, 30)[0]
    place = {"leg1_rod": d1.pose(posture, "leg1_rod")}
    s = cc.close(d1, near_postures(d1, 1, 32)[0], place=place)
    check_solution(d1, s, tol)
    expected = d1.pose(posture, "leg1_rod").homogeneous
    assert_close(d1.pose(s.q, "leg1_rod").homogeneous, expected, tol.closure)


def test_points_that_can_be_met_are_met(d1: cc.Mechanism, tol: Tolerances) -> None:
    posture = near_postures(d1, 1, 31)[0]
    names = ("S4", "S5", "S6")
    s = cc.close(d1, points={n: d1.point(posture, n) for n in names})
    check_solution(d1, s, tol)
    for name in names:
        assert_close(d1.point(s.q, name), d1.point(posture, name), 1e-11, name)
    assert "remain off" not in s.message


def test_points_that_cannot_be_met_are_fitted(d1: cc.Mechanism, tol: Tolerances) -> None:
    """S4 and S5 pulled apart: the platform is rigid; the misfit is least, and stated."""
    shift = np.array([0.01, 0.0, 0.0])
    goals = {
        "S4": d1.point(d1.home, "S4") + shift,
        "S5": d1.point(d1.home, "S5") - shift,
    }
    s = cc.close(d1, points=goals)
    check_solution_of_loops(d1, s, tol)
    off = [float(np.linalg.norm(d1.point(s.q, n) - xyz)) for n, xyz in goals.items()]
    assert max(off) < 0.011
    assert f"fitted points remain off by up to {max(off):.3g} m" in s.message
    # stationary: no motion that keeps the loops closed lowers the sum of squares
    equations = Equations(d1, np.arange(33))
    basis, _ = null_space(equations.evaluate(s.q)[1])

    def misfit(q: np.ndarray) -> float:
        return sum(float(np.sum((d1.point(q, n) - xyz) ** 2)) for n, xyz in goals.items())

    for direction in basis.T:
        ahead, behind = (misfit(equations.move(s.q, h * direction)) for h in (1e-5, -1e-5))
        assert abs(ahead - behind) / 2e-5 < 1e-6


def check_solution_of_loops(m: cc.Mechanism, s: cc.Solution, tol: Tolerances) -> None:
    """Loops close; fitted points may stay off."""
    assert s.converged, s.message
    assert np.abs(cc.residual(m, s.q)).max() < tol.closure


def test_unreachable_place(d1: cc.Mechanism) -> None:
    far = pin.SE3(np.eye(3), np.array([0.0, -9.0, 0.0]))
    s = cc.close(d1, place={"coupler": far}, fixed={"q1": 0.5})
    check_failure(d1, s)
    assert "does not close: closure" in s.message or "cannot be reached" in s.message
    # placed bodies against each other: torsion of one stage is not free
    turned = pin.SE3(pin.exp3(np.array([0.0, 0.5, 0.0])), np.array([0.0, -0.5, 0.0]))
    s = cc.close(d1, place={"coupler": turned})
    check_failure(d1, s)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"fixed": {"q9": 0.5}}, "q9.*q1"),
        ({"fixed": {"q1": np.nan}}, r"fixed\['q1'\].*finite"),
        ({"fixed": {"q1": "far"}}, r"fixed\['q1'\]"),
        ({"fixed": {"q1": None}}, r"fixed\['q1'\]"),
        ({"fixed": {"q1": [0.5, 0.5]}}, r"fixed\['q1'\]"),
        ({"fixed": {"q1": pin.SE3.Identity()}}, r"fixed\['q1'\]"),
        ({"fixed": {"coupler_pose": [0.0] * 7}}, "quaternion"),
        ({"fixed": {"universe": 0.0}}, "universe"),
        ({"place": {"nowhere": pin.SE3.Identity()}}, "nowhere"),
        ({"place": {"coupler": np.eye(4)}}, r"place\['coupler'\] must be a pin.SE3"),
        ({"place": {"coupler": pin.SE3(np.eye(3), np.full(3, np.nan))}}, "finite"),
        ({"points": {"S9": (0, 0, 0)}}, "S9"),
        ({"points": {"S1": (0, 0)}}, r"points\['S1'\]"),
        ({"points": {"S1": (0, 0, np.inf)}}, r"points\['S1'\]"),
        ({"points": {"S1": "here"}}, r"points\['S1'\]"),
    ],
)
def test_bad_arguments_of_close(d1: cc.Mechanism, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ClosureError, match=message):
        cc.close(d1, **arguments)


@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.1, 0.3))
def test_close_from_anywhere_closes_or_says_why(d1: cc.Mechanism, seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    guess = pin.integrate(d1.model, d1.home, size * rng.standard_normal(33))
    s = cc.close(d1, guess)
    assert np.isfinite(s.q).all()
    assert np.isfinite(s.residual)
    d1.configuration(s.q)
    if s.converged:
        assert s.residual < 1e-12
        assert np.abs(cc.residual(d1, s.q)).max() < 1e-12
    else:
        assert "closure '" in s.message
    for joint in s.beyond_limits:
        assert joint in s.message
