"""The direct problem of D1: reference numbers, branches, refusals, ranks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Reference, Tolerances, assert_close
from d1_solutions import FOLD, branch_of, check_entry, check_failure, check_solution, placed, se3

import closedchain as cc
from closedchain.closure.equations import Equations
from closedchain.closure.ranks import numerical_rank
from closedchain.urdf.errors import ClosureError

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
        ([[[0.5] * 6]], r"must have shape \(6,\)"),
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
    s = cc.close(d1, place=placed(entry))
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
