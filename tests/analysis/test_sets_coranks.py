"""Singular sets along which several ranks are lost at once, self-motions, whole turns, seeds."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from singular_points import check_points, joint

import closedchain as cc
from closedchain.analysis.singularity.sets.bordered import Measure, corner
from closedchain.analysis.singularity.sets.curves import is_everywhere
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.charting import chart_of
from closedchain.closure.solve.curve import trace
from closedchain.closure.solve.joining import joined
from closedchain.closure.solve.solution_set import Bound, settle, tangents

EDGE = "edge of the range"


# -- measures --------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(5, 5), (4, 6)])
def test_corner_of_two_ranks(shape: tuple[int, int]) -> None:
    """All entries vanish with two ranks, not with one; their slopes are -W^T dA V."""
    rng = np.random.default_rng(3)
    m, n = shape
    u, s, vt = np.linalg.svd(rng.standard_normal(shape))
    borders = u[:, -2:], vt[m - 2 :].T
    turn = np.linalg.qr(rng.standard_normal((m, m)))[0]
    for lost in (1, 2):
        values = s.copy()
        values[-lost:] = 0.0
        g = corner((u * values) @ vt[:m], borders)[0]
        assert g.shape == (2, n - m + 2)
        assert (np.abs(g).max() < 1e-13) == (lost == 2)
    a, rows = (u * s) @ vt[:m], turn @ rng.standard_normal(shape)
    _, w, v = corner(a, borders)
    ahead, behind = (corner(a + t * rows, borders)[0] for t in (1e-6, -1e-6))
    assert np.abs((ahead - behind) / 2e-6 + w.T @ rows @ v).max() < 1e-7


def test_corner_of_singular_borders() -> None:
    """One border is too few for a loss of two ranks: an error, or no number among many."""
    a = np.diag([1.0, 2.0, 0.0, 0.0])
    borders = np.eye(4)[:, -1:], np.eye(4)[:, -1:]
    with pytest.raises(np.linalg.LinAlgError):
        corner(a, borders)
    many = corner(np.stack([a, np.diag([1.0, 2.0, 3.0, 0.0])]), borders)[0]
    assert np.isnan(many[0]).all()
    assert abs(many[1]).max() < 1e-15


@pytest.mark.parametrize("robot", ["eclipse2", "rus6"])
def test_gradients_of_a_loss_of_two_ranks(robot: str) -> None:
    m = cc.load(robot)
    chart = chart_of(m, ("x", "y"))
    system = Slice(chart, (Measure(m, "inverse", m.outputs(None), corank=2),))
    rows, columns = system.measures[0].shape
    assert system.codimension == 2 * (abs(rows - columns) + 2)
    z = system.point(m.home)
    frame = system.frame(z)
    rng = np.random.default_rng(5)
    z = system.move(z, 0.02 * rng.standard_normal(system.size))
    values, jacobian = system.evaluate(z, frame)
    assert len(values) == len(jacobian)
    for i in range(0, system.size, 3):
        e = np.zeros(system.size)
        e[i] = 1e-5
        ahead, behind = (system.evaluate(system.move(z, t * e), frame)[0] for t in (1.0, -1.0))
        assert np.abs((ahead - behind) / 2e-5 - jacobian[:, i]).max() < 1e-5


def test_none_of_the_equations_escapes_as_an_error() -> None:
    """Where one border is too few, a trace has an end instead."""

    class Twice:
        size = 2

        def frame(self, z: np.ndarray) -> None:
            return None

        def evaluate(self, z: np.ndarray, frame: None) -> tuple[np.ndarray, np.ndarray]:
            if z[0] > 0.5:
                raise np.linalg.LinAlgError
            return np.array([z[1]]), np.array([[0.0, 1.0]])

        def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
            return z + step

        def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
            return two - one

    path = trace(Twice(), np.zeros(2), np.array([1.0, 0.0]), np.full(2, 0.1))
    assert path.end == "degenerate"
    assert path.points[-1][0] == pytest.approx(0.5, abs=1e-5)
    assert trace(Twice(), np.ones(2), np.array([1.0, 0.0]), np.full(2, 0.1)).end == "degenerate"
    assert not settle(Twice(), np.ones(2)).good


# -- Eclipse-II: S_a at the centre of the guide takes two inputs of the leg their effect -----------


def around(m: cc.Mechanism, width: float, *names: str) -> dict[str, np.ndarray]:
    home = dict(zip(m.inputs, m.input_values(m.home), strict=True))
    return {n: np.linspace(home[n] - width, home[n] + width, 17) for n in names}


@pytest.mark.slow
@pytest.mark.parametrize("names", [("th_a", "th_b"), ("th_b", "th_c")])
def test_two_inputs_of_a_leg_lose_their_effect(names: tuple[str, str]) -> None:
    m = cc.load("eclipse2")
    over = around(m, 1.2 if "th_a" in names else 1.0, *names)
    found = cc.singularity_set(m, "inverse", over)
    check_points(m, found, over)
    assert found.verdict == "curve"
    assert (found.missed, found.dropped) == (0, 0)
    assert set(found.ends) == {(EDGE, EDGE)}
    hinge = np.array([joint(m, q, "a_R") for q in found.q])
    double = np.array([lost.shape[1] == 2 for lost in found.lost_twists])
    assert double.sum() > 10
    assert np.abs(np.sin(0.5 * hinge[double])).max() < 1e-8
    assert np.abs(np.sin(0.5 * hinge[~double])).min(initial=1.0) > 1e-3


def test_no_inverse_singularity_near_home() -> None:
    m = cc.load("eclipse2")
    found = cc.singularity_set(m, "inverse", around(m, 0.05, "d_b", "d_c"))
    assert (found.verdict, len(found.q), found.missed) == ("none found", 0, 0)


# -- rus6 on its axis: three levers at once --------------------------------------------------------

AXIS = {"ry": np.radians(np.linspace(-105, 105, 22)), "y": np.linspace(-0.79, -0.35, 12)}


@pytest.mark.slow
@pytest.mark.parametrize(("variant", "lost"), [("coupled", 2), ("locked", 3)])
def test_three_levers_at_once(variant: str, lost: int) -> None:
    """Three of one kind; the seventh input moves one kind of lever, and keeps a rank of these."""
    m = cc.load("rus6") if variant == "coupled" else cc.load("rus6", variant=variant)
    at = {"beta": 0.0} if variant == "coupled" else None
    assert not cc.classify(m, m.home).kinds
    found = cc.singularity_set(m, "inverse", AXIS, at)
    check_points(m, found, AXIS)
    assert found.verdict == "curve"
    assert not found.everywhere
    assert not found.missed
    ranks = np.array([t.shape[1] for t in found.lost_twists])
    assert ranks.min() == lost
    assert set(ranks) <= {lost, 3, lost + 3}  # where two curves cross, six levers
    assert found.on_branch.sum() > 50


def test_everywhere_needs_singular_cells() -> None:
    none, every = np.zeros((3, 4), dtype=bool), np.ones((3, 4), dtype=bool)
    singular = {"inverse": none, "direct": every}
    assert not is_everywhere(SimpleNamespace(ok=every, singular=singular), "inverse")
    assert is_everywhere(SimpleNamespace(ok=every, singular=singular), "direct")
    assert not is_everywhere(SimpleNamespace(ok=none, singular=singular), "inverse")


# -- verdicts speak of the coordinates -------------------------------------------------------------


@pytest.mark.slow
def test_self_motion_above_a_point() -> None:
    """An S_j on the axis of Eclipse leaves the angle of its column free: points, not curves."""
    m, a = cc.load("eclipse"), np.linspace(-0.16, 0.16, 17)
    found = cc.singularity_set(m, "combined", {"x": a, "y": a})
    assert found.verdict == "isolated"
    assert "self-motion" in found.note
    angle = np.pi + 2.0 * np.pi / 3.0 * np.arange(3)
    expected = 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert len(found.coordinates) == 3
    for place in expected:
        assert np.abs(found.coordinates - place).max(axis=1).min() < 1e-9


# -- whole turns -----------------------------------------------------------------------------------


def test_postures_a_turn_apart_are_one() -> None:
    m = cc.load("rpa3t")
    system = Slice(chart_of(m, ("x", "y")))
    z = system.point(m.home)
    turned = z.copy()
    turned[m.model.idx_qs[m.model.getJointId("R12")]] += 2.0 * np.pi
    assert np.abs(system.difference(z, turned)).max() < 1e-12


@pytest.mark.slow
def test_curve_along_which_a_joint_turns_whole() -> None:
    m = cc.load("rpa3t")
    over = {"x": np.linspace(-0.5, 0.8, 14), "y": np.linspace(-0.058, 0.058, 11)}
    found = cc.singularity_set(m, "direct", over)
    check_points(m, found, over)
    assert found.missed == 0
    assert ("closed", "closed") in found.ends
    assert not any("limit of joint" in end for ends in found.ends for end in ends)
    (loop,) = (p for p, e in zip(found.pieces, found.ends, strict=True) if e[0] == "closed")
    index = m.model.idx_qs[m.model.getJointId("R12")]
    angle = np.unwrap([*found.q[loop, index], found.q[loop[0], index]])
    assert 5.5 < np.ptp(angle) < 2.0 * np.pi + 1e-9
    # each place of the loop once: copies a turn apart would repeat them
    places = np.round(found.coordinates[loop] / 1e-6).astype(int)
    assert len(np.unique(places, axis=0)) == len(loop)


class Wheel:
    """x = sin of an angle: a loop in (angle, x) up to whole turns, cut by limits of the angle."""

    size = 2

    def frame(self, z: np.ndarray) -> None:
        return None

    def evaluate(self, z: np.ndarray, frame: None) -> tuple[np.ndarray, np.ndarray]:
        return np.array([z[1] - np.sin(z[0])]), np.array([[-np.cos(z[0]), 1.0]])

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        return z + step

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        step = two - one
        step[0] -= 2.0 * np.pi * np.round(step[0] / (2.0 * np.pi))
        return step


@pytest.mark.parametrize(("limit", "closed"), [(4.0, True), (3.0, False), (10.0, True)])
def test_paths_that_meet_a_turn_apart_are_a_loop(limit: float, closed: bool) -> None:
    system, bounds = Wheel(), [Bound(0, 0, 1.0, -limit, limit, "limit")]
    start, steps = np.array([0.3, np.sin(0.3)]), np.full(2, 0.1)
    t = tangents(system, start)[:, 0]
    ahead, behind = (trace(system, start, s * t, steps, bounds) for s in (1.0, -1.0))
    found = joined(system, behind, ahead)
    assert (found.ends == ("closed", "closed")) == closed
    angles = np.array(found.points)[:, 0]
    assert np.ptp(angles) < 2.0 * np.pi + 1e-6


# -- codimension two: whatever the grid ------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("n", [13, 17])
def test_isolated_points_do_not_depend_on_the_grid(n: int) -> None:
    m, a = cc.load("rus6"), np.linspace(-0.26, 0.26, n)
    over = {"x": a, "z": a}
    found = cc.singularity_set(m, "inverse", over, {"y": -0.65, "beta": np.pi / 3.0})
    check_points(m, found, over)
    assert found.verdict == "isolated"
    assert "least values led to no singular posture" in found.note
    expected = [(-0.015317, -0.217399), (-0.180615, 0.121965), (0.195932, 0.095434)]
    assert len(found.coordinates) == len(expected)
    for place in expected:
        assert np.abs(found.coordinates - place).max(axis=1).min() < 1e-5
