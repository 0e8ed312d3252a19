"""The curve tracer on plane and space curves whose shape is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from closedchain.closure.solve.branching import leaving
from closedchain.closure.solve.curve import Path, trace
from closedchain.closure.solve.solution_set import Bound, settle, tangents

Function = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Plain:
    """F(z) = 0 in a vector space."""

    function: Function
    size: int = 2

    def frame(self, z: np.ndarray) -> None:
        return None

    def evaluate(self, z: np.ndarray, frame: None) -> tuple[np.ndarray, np.ndarray]:
        values, jacobian = self.function(z)
        return np.atleast_1d(values).astype(float), np.atleast_2d(jacobian).astype(float)

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        return z + step

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        return two - one


def circle(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.array(z @ z - 1.0), 2.0 * z


def eight(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lemniscate of Gerono, y^2 = x^2 - x^4: crosses itself at the origin."""
    x, y = z
    return np.array(y**2 - x**2 + x**4), np.array([-2 * x + 4 * x**3, 2 * y])


def three_lines(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x, y = z
    return np.array(x * y * (x - y)), np.array([2 * x * y - y**2, x**2 - 2 * x * y])


def cusp(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smooth space curve (t, t^2, t^3), whose projection on its last two unknowns has a cusp."""
    t, x, y = z
    return np.array([x - t**2, y - t**3]), np.array([[-2 * t, 1, 0], [-3 * t**2, 0, 1]])


def doubled(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The circle with a dependent row."""
    value, row = circle(z)
    return np.array([value, 2.0 * value]), np.array([row, 2.0 * row])


STEPS = np.array([0.1, 0.1])


def both_ways(system: Plain, z: np.ndarray, longest: np.ndarray, bounds: list[Bound]) -> list[Path]:
    t = tangents(system, z)[:, 0]
    return [trace(system, z, sign * t, longest, bounds) for sign in (1.0, -1.0)]


@pytest.mark.parametrize("function", [circle, doubled])
def test_closed_loop(function: Function) -> None:
    system = Plain(function)
    path = trace(system, np.array([1.0, 0.0]), np.array([0.0, 1.0]), STEPS)
    points = np.array(path.points)
    assert path.end == "closed"
    assert np.abs((points**2).sum(axis=1) - 1.0).max() < 1e-11
    angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert (np.diff(angles) > 0.0).all()  # never back
    assert 6.0 < angles[-1] < 2.0 * np.pi  # once round, the start not repeated
    assert np.abs(np.diff(points, axis=0)).max() < 0.105
    assert not path.crossings


def test_ends_on_the_bound_exactly() -> None:
    bounds = [Bound(0, 0, 1.0, -0.7, 0.3, "left or right")]
    up, down = both_ways(Plain(circle), np.array([0.0, 1.0]), STEPS, bounds)
    assert up.end == down.end == "left or right"
    assert {round(float(p.points[-1][0]), 12) for p in (up, down)} == {-0.7, 0.3}


def test_thin_ellipse_is_followed_round_its_tips() -> None:
    """Ten times narrower than the longest step."""

    def thin(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array(z[0] ** 2 + (z[1] / 0.01) ** 2 - 1.0), np.array([2 * z[0], 2e4 * z[1]])

    path = trace(Plain(thin), np.array([0.0, 0.01]), np.array([1.0, 0.0]), STEPS)
    points = np.array(path.points)
    assert path.end == "closed"
    assert points[:, 0].max() > 0.999
    assert points[:, 0].min() < -0.999
    assert points[:, 1].min() < -0.0099


def test_branch_point_is_passed_and_located() -> None:
    start = settle(Plain(eight), np.array([0.7, 0.5]))
    assert start.good
    path = trace(Plain(eight), start.posture, np.array([1.0, 0.0]), STEPS)
    assert path.end == "closed"
    points = np.array(path.points)
    assert len(path.crossings) == 2  # the whole eight, twice through the middle
    assert np.abs(points[path.crossings]).max() < 1e-6
    assert points[:, 0].min() < -0.99


@pytest.mark.parametrize(
    ("function", "slopes"),
    [(eight, (1.0, -1.0)), (three_lines, (0.0, np.inf, 1.0))],
    ids=["two", "three"],
)
def test_curves_that_leave_a_branch_point(function: Function, slopes: tuple[float, ...]) -> None:
    found = leaving(Plain(function), np.zeros(2), 0.05)
    assert len(found) == 2 * len(slopes)
    for z in found:
        assert 0.04 < np.linalg.norm(z) < 0.06
        with np.errstate(divide="ignore"):
            angle = np.arctan(np.float64(z[1]) / np.float64(z[0]))
        assert min(abs(np.sin(angle - np.arctan(s))) for s in slopes) < 5e-3


def test_no_curve_leaves_an_isolated_point() -> None:
    def point(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array(z @ z), 2.0 * z

    assert leaving(Plain(point), np.zeros(2), 0.05) == []


def test_crossing_of_three_lines_is_noticed() -> None:
    """Two others cross at once, so that the determinant keeps its sign."""
    bounds = [Bound(0, 0, 1.0, -1.0, 1.0, "edge")]
    path = trace(Plain(three_lines), np.array([-0.93, 0.0]), np.array([1.0, 0.0]), STEPS, bounds)
    assert path.end == "edge"
    assert np.abs(np.array(path.points)[:, 1]).max() < 1e-9
    assert len(path.crossings) == 1
    assert np.abs(path.points[path.crossings[0]]).max() < 1e-3


def test_cusp_of_the_projection_is_no_obstacle() -> None:
    bounds = [Bound(2, 2, 1.0, -0.5, 0.5, "edge")]
    system = Plain(cusp, 3)
    path = trace(
        system, np.array([-0.7, 0.49, -0.343]), np.array([1.0, 0.0, 0.0]), np.full(3, 0.1), bounds
    )
    assert path.end == "edge"
    assert path.points[-1][2] == pytest.approx(0.5, abs=1e-12)
    assert not path.crossings


def test_degenerate_curve_is_told() -> None:
    """x^2 = 0 is a line along which the equation has no rank."""

    def flat(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array(z[0] ** 2), np.array([2.0 * z[0], 0.0])

    path = trace(Plain(flat), np.zeros(2), np.array([0.0, 1.0]), STEPS)
    assert path.end == "degenerate"
    assert len(path.points) == 1


def test_settle_gives_nothing_where_there_is_nothing() -> None:
    def none(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array(z @ z + 1.0), 2.0 * z

    found = settle(Plain(none), np.array([0.3, 0.2]))
    assert not found.good
    assert not found.ending.good
