"""The algebra of screws: identities, reciprocity, and agreement with Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from hypothesis import given
from hypothesis import strategies as st

import closedchain as cc
from closedchain.analysis import screws as sc

NUMBERS = st.floats(-5.0, 5.0, allow_nan=False, width=32)
SCREWS = st.lists(NUMBERS, min_size=6, max_size=6).map(np.array)
POINTS = st.lists(NUMBERS, min_size=3, max_size=3).map(np.array)


@given(SCREWS, SCREWS, SCREWS, NUMBERS, NUMBERS)
def test_lie_algebra(a: np.ndarray, b: np.ndarray, c: np.ndarray, x: float, y: float) -> None:
    scale = 1.0 + max(np.abs(v).max() for v in (a, b, c)) ** 3 * (1 + abs(x) + abs(y))
    small = 1e-13 * scale
    assert_close(sc.lie(a, a), np.zeros(6), small, "nilpotent")
    assert_close(sc.lie(a, b), -sc.lie(b, a), small, "anti-commutative")
    assert_close(sc.lie(a, x * b + y * c), x * sc.lie(a, b) + y * sc.lie(a, c), 10 * small)
    jacobi = sc.lie(a, sc.lie(b, c)) + sc.lie(c, sc.lie(a, b)) + sc.lie(b, sc.lie(c, a))
    assert_close(jacobi, np.zeros(6), 10 * small, "Jacobi")
    # both forms are invariant: {[a b]; c} = {a; [b c]}, the same for the Killing form
    for form in (sc.klein, sc.killing):
        assert_close(form(sc.lie(a, b), c), form(a, sc.lie(b, c)), 10 * small)


def test_the_printed_lie_product_is_not_nilpotent() -> None:
    """Without the minus sign, as printed, [1 1] does not vanish."""
    a = np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    printed = np.cross(a[:3], a[3:]) + np.cross(a[:3], a[3:])
    assert np.linalg.norm(printed) > 1.0
    assert_close(sc.lie(a, a), np.zeros(6), 0.0)


@given(SCREWS, SCREWS, POINTS)
def test_klein_form_does_not_depend_on_the_reference_point(
    a: np.ndarray, b: np.ndarray, point: np.ndarray
) -> None:
    moved = sc.klein(sc.shifted(a, point), sc.shifted(b, point))
    assert_close(moved, sc.klein(a, b), 1e-10)
    assert_close(sc.klein(a, b), a[:3] @ b[3:] + a[3:] @ b[:3], 1e-10)
    assert_close(sc.shifted(sc.shifted(a, point), -point), a, 1e-10)


@given(SCREWS, SCREWS)
def test_lie_product_is_pinocchios(a: np.ndarray, b: np.ndarray) -> None:
    theirs = sc.to_motion(a).cross(sc.to_motion(b))
    assert_close(sc.from_motion(theirs), sc.lie(a, b), 1e-12 * (1 + np.abs(a).max() ** 2 * 40))


@given(SCREWS, SCREWS)
def test_power_is_pinocchios(a: np.ndarray, b: np.ndarray) -> None:
    power = sc.to_force(a).dot(sc.to_motion(b))
    assert_close(sc.klein(a, b), power, 1e-10)
    assert_close(sc.from_force(sc.to_force(a)), a, 0.0)


def test_frames_change_as_pinocchios() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        pose, a = pin.SE3.Random(), rng.standard_normal(6)
        assert_close(sc.transformed(a, pose), sc.from_motion(pose.act(sc.to_motion(a))), 1e-12)
        assert_close(sc.transformed(a, pose), sc.from_force(pose.act(sc.to_force(a))), 1e-12)


def test_joints_have_their_pitch_and_axis() -> None:
    rng = np.random.default_rng(1)
    direction, point = rng.standard_normal((50, 3)), rng.standard_normal((50, 3))
    h = rng.standard_normal(50)
    found = sc.helical(direction, point, h)
    assert found.shape == (50, 6)
    assert_close(sc.pitch(found), h, 1e-12)
    s, nearest = sc.axis(found)
    assert_close(np.linalg.norm(s, axis=1), np.ones(50), 1e-12)
    assert_close(np.cross(point - nearest, s), np.zeros((50, 3)), 1e-12)  # on the same line
    assert_close((nearest * s).sum(axis=1), np.zeros(50), 1e-12)
    assert np.isinf(sc.pitch(sc.prismatic(direction))).all()
    assert_close(sc.pitch(sc.revolute(direction, point)), np.zeros(50), 1e-12)
    moved, place = sc.axis(sc.prismatic(direction))
    assert_close(moved, s, 1e-12)
    assert_close(place, np.zeros((50, 3)), 0.0)


@pytest.mark.parametrize("bad", [[1.0, 2.0], np.full(6, np.nan), np.zeros((6, 5)), 3.0])
def test_malformed_screws_are_refused(bad: object) -> None:
    with pytest.raises(cc.ClosureError, match=r"shape \(\.\.\., 6\)"):
        sc.pitch(bad)  # type: ignore[arg-type]


def test_zero_axis_is_refused() -> None:
    with pytest.raises(cc.ClosureError, match="must not be zero"):
        sc.revolute([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    with pytest.raises(cc.ClosureError, match="must not be zero"):
        sc.axis(np.zeros(6))


# -- reciprocal systems ----------------------------------------------------------------------------


def test_reciprocal_systems_have_complementary_dimension() -> None:
    rng = np.random.default_rng(2)
    for n in range(7):
        system = rng.standard_normal((n, 6))
        found, rank = sc.reciprocal(system, length=0.3)
        assert rank.value == n
        assert found.shape == (6 - n, 6)
        assert_close(sc.klein(found[:, None], system[None]), np.zeros((6 - n, n)), 1e-12)
        again, _ = sc.reciprocal(found, length=0.3)
        both = np.vstack([again, system])
        assert np.linalg.matrix_rank(both, tol=1e-9) == n  # the reciprocal of the reciprocal


def test_redundant_screws_are_seen() -> None:
    """Four parallel revolutes span a system of order three: the planar motions."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 3, 5.0]])
    planar = sc.revolute(np.array([0, 0, 1.0]), points)
    found, rank = sc.reciprocal(planar)
    assert rank.value == 3
    assert rank.gap > 1e10
    # a force along z and the two couples across it do no work on them
    expected = np.array([[0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0.0]])
    assert np.linalg.matrix_rank(np.vstack([found, expected]), tol=1e-9) == 3


def test_geometric_shortcuts(d1: cc.Mechanism, tol: Tolerances) -> None:
    """An RPS leg exerts one constraint: the force through S along the revolute axis.

    A force is reciprocal to a revolute whose axis it meets or parallels, and to a prismatic joint
    across it.
    """
    rng = np.random.default_rng(3)
    q = cc.direct(d1, d1.input_values(d1.home) + 0.01 * rng.standard_normal(6)).q
    for i in (1, 2, 3):
        r, s = d1.point(q, f"R{i}"), d1.point(q, f"S{i}")
        turn = d1.pose(q, f"R{i}").rotation[:, 2]
        leg = np.vstack([sc.revolute(turn, r), sc.prismatic(s - r), sc.revolute(np.eye(3), s)])
        found, rank = sc.reciprocal(leg, length=d1.length)
        assert rank.value == 5
        assert_close(np.abs(sc.pitch(found)), np.zeros(1), 1e-10)
        direction, _ = sc.axis(found[0])
        assert_close(np.abs(direction @ turn), 1.0, tol.algebra)
        assert_close(sc.klein(sc.revolute(turn, s), leg), np.zeros(5), 1e-12)
