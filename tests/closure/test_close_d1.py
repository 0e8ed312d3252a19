"""Closing D1: nearest postures, held joints, placed bodies, fitted points."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Reference, Tolerances, assert_close
from d1_solutions import check_entry, check_failure, check_solution, near_postures, placed
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import closedchain as cc
from closedchain.closure.equations import Equations
from closedchain.closure.ranks import null_space
from closedchain.urdf.errors import ClosureError

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
    s = cc.close(d1, place=placed(entry))
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
