"""Position solvers on four-bars: circuits, toggles, redundant closure rows."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from conftest import Tolerances, assert_close
from small_linkages import (
    GRASHOF,
    PARALLELOGRAM,
    ROCKING,
    four_bar,
    four_bar_angles,
    same_angles,
    toggle,
)

import closedchain as cc
from closedchain.closure.equations import Equations
from closedchain.closure.solve.factors import Range
from closedchain.closure.solve.newton import correct

# -- four-bar -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "rows"), [("revolute", 5), ("cylindrical", 4), ("spherical", 3)])
def test_four_bar_against_the_closed_form(kind: str, rows: int, tol: Tolerances) -> None:
    """Two unknowns: the rows out of the plane are redundant and do no harm."""
    m = four_bar(GRASHOF, 0.5, kind)
    assert m.rows == rows
    same_angles(m.home, four_bar_angles(GRASHOF, 0.5), tol.closure)
    for crank in np.linspace(-3.0, 3.5, 30):
        s = cc.direct(m, [crank])
        assert s.converged, s.message
        assert s.residual < tol.closure
        assert s.rank == 2
        assert s.rank_decision.gap > 1e6
        assert s.branch is None
        same_angles(s.q, four_bar_angles(GRASHOF, crank), 1e-11)


@pytest.mark.parametrize("side", [1, -1])
def test_a_crank_turns_round_on_its_branch(side: int, tol: Tolerances) -> None:
    """Step by step and in one call, both ways round."""
    m = four_bar(GRASHOF, 0.5)
    guess = np.array(four_bar_angles(GRASHOF, 0.5, side))
    start = guess
    for crank in 0.5 + np.linspace(0.0, 2 * np.pi, 73)[1:]:
        s = cc.direct(m, [crank], guess)
        assert s.converged, s.message
        same_angles(s.q, four_bar_angles(GRASHOF, crank, side), 1e-11)
        assert np.abs(s.q - guess).max() < 0.6, "angles run on, they do not wrap"
        guess = s.q
    for turns in (1, -1, 3):
        whole = cc.direct(m, [0.5 + 2 * np.pi * turns], start)
        assert whole.converged, whole.message
        assert whole.residual < tol.closure
        same_angles(whole.q, list(start), 1e-11)
        # against the ground the rod does not turn round: its joint runs against the crank's
        assert_close(whole.q[0] + whole.q[1], start[0] + start[1], 1e-9)


def test_toggle_of_a_rocking_crank() -> None:
    """The path ends at the fold, with the angle at which it is."""
    m = four_bar(ROCKING, 0.6)
    limit = toggle(ROCKING)
    for crank in (limit + 0.01, 1.5, 3.0, 0.6 + 2 * np.pi):
        s = cc.direct(m, [crank])
        assert not s.converged
        assert np.isfinite(s.q).all()
        assert f"direct singularity after {(limit - 0.6) / (crank - 0.6):.1%}" in s.message
        assert f"crank_joint={limit:.4f}"[:-1] in s.message
    out = cc.direct(m, [1.5])
    assert out.residual > 0.1
    assert "out of reach: closure 'loop' (revolute, rod to rocker)" in out.message
    near = cc.direct(m, [limit - 1e-4])
    assert near.converged, near.message
    same_angles(near.q, four_bar_angles(ROCKING, limit - 1e-4), 1e-9)


def test_a_leap_over_a_fold_is_refused() -> None:
    """Beyond both toggles the loop closes again, as if a whole turn had passed."""
    m = four_bar(ROCKING, 0.6)
    around = cc.direct(m, [0.6 + 2 * np.pi])
    assert not around.converged
    mirrored = cc.direct(m, [-0.6])
    assert not mirrored.converged
    assert "direct singularity" in mirrored.message


def test_a_narrow_gap_is_not_leapt_over() -> None:
    """Feasible on both sides, by a gap of a fiftieth of a radian: nothing there to see but rank."""
    bars = (1.0, 0.9, 0.6, 0.7005)
    m = four_bar(bars, 0.3)
    for crank in (-0.02, -0.1, -0.3, -1.0, -2.0):
        s = cc.direct(m, [crank])
        assert not s.converged, crank
        assert "direct singularity" in s.message


def test_parallelogram_stays_one_and_stops_at_its_change_point(tol: Tolerances) -> None:
    """Flat, it could go on as an antiparallelogram: the answer must not choose."""
    m = four_bar(PARALLELOGRAM, 1.0)
    for crank in (0.05, 0.5, 2.0, 3.1):
        s = cc.direct(m, [crank])
        assert s.converged, s.message
        assert_close(s.q, [crank, -crank, crank], 1e-9)
        assert_close(m.pose(s.q, "rod").rotation, np.eye(3), 1e-9, "the rod stays parallel")
    for crank, share in ((3.5, (np.pi - 1) / 2.5), (5.0, (np.pi - 1) / 4), (-1.0, 0.5)):
        s = cc.direct(m, [crank])
        assert not s.converged
        assert f"direct singularity after {share:.1%}" in s.message
    flat = cc.close(m, guess=np.zeros(3))
    assert flat.converged
    held = cc.close(m, guess=np.zeros(3), fixed={"crank_joint": 0.0})
    assert (held.converged, held.rank) == (True, 1)


def test_newton_is_quadratic_with_redundant_rows(tol: Tolerances) -> None:
    m = four_bar(GRASHOF, 0.5)
    equations = Equations(m, m.passive_v)
    expected = np.array(four_bar_angles(GRASHOF, 0.5))
    q = expected + np.array([0.0, 0.05, -0.05])
    errors = [np.abs(q - expected).max()]
    for _ in range(4):
        values, matrix = equations.evaluate(q)
        q = equations.move(q, Range.of(matrix).step(values / equations.row_scale))
        errors.append(np.abs(q - expected).max())
    for before, after in pairwise(errors):
        assert after < 3.0 * before**2 + 1e-14
    found = correct(equations, expected + np.array([0.0, 0.05, -0.05]))
    assert found.refusal is None
    assert found.evaluations <= 5
    assert_close(found.q, expected, tol.closure)


def test_redundant_steps_are_those_of_least_squares(tol: Tolerances) -> None:
    rng = np.random.default_rng(1)
    for shape, rank in (((5, 2), 2), ((7, 4), 3), ((3, 6), 3), ((6, 8), 4)):
        matrix = rng.standard_normal((shape[0], rank)) @ rng.standard_normal((rank, shape[1]))
        values = rng.standard_normal(shape[0])
        bases = Range.of(matrix)
        assert bases.s.size == rank
        expected = -np.linalg.lstsq(matrix, values, rcond=1e-9)[0]
        assert_close(bases.step(values), expected, tol.algebra)
        assert not bases.left_by(Range.of(matrix))
        assert not bases.left_by(Range.of(1.5 * matrix))
        assert bases.left_by(Range.of(-matrix)), "a singular one lies in between"
