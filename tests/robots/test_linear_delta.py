"""The linear Delta as a mechanism, against its closed forms; redundant rows in every analysis."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from linear_delta_postures import SEED, G, configuration, random_positions, rods_at

import closedchain as cc
from closedchain.robots import linear_delta as ld
from closedchain.robots import robot


def dimensionless(mechanism: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    """K (rows, nv) without units."""
    k = cc.constraint_jacobian(mechanism, q)
    return k * mechanism.column_scale / mechanism.row_scale[:, None]


# --- description -------------------------------------------------------------------------------


def test_home_and_named_points(delta: cc.Mechanism, tol: Tolerances) -> None:
    q = delta.home
    assert delta.inputs == ("q1", "q2", "q3")
    assert delta.task == delta.required_task()
    assert (delta.required_task().tip, delta.required_task().outputs) == ("P", ("x", "y", "z"))
    assert np.abs(cc.residual(delta, q)).max() < tol.closure
    p = np.array([0.0, 0.0, -0.6])
    height = p[2] + np.sqrt(G.b**2 - G.d**2)
    assert_close(delta.input_values(q), np.full(3, height), 1e-14)
    expected = {"P": p, "platform": p}
    for i, (a, c, s2) in enumerate(zip(G.A, G.C, ld.TANGENT, strict=True), start=1):
        b = a + height * ld.AXIS
        expected |= {f"A{i}": a, f"B{i}": b, f"C{i}": p + c}
        expected |= {f"D{i}": b + G.t * s2, f"E{i}": b - G.t * s2}
        expected |= {f"G{i}": p + c + G.t * s2, f"F{i}": p + c - G.t * s2}
    for name, place in expected.items():
        assert_close(delta.point(q, name), place, 1e-13, name)
    assert_close(delta.pose(q, "platform").rotation, np.eye(3), 1e-14)
    stated = delta.description.home
    assert_close(q, np.concatenate([stated[n] for n in list(delta.model.names)[1:]]), 1e-9)


def test_inputs_are_slider_heights_on_rails(delta: cc.Mechanism) -> None:
    lower, upper = delta.limits
    assert_close(lower[delta.input_q], np.full(3, -1.2), 0.0)
    assert_close(upper[delta.input_q], np.full(3, 0.4), 0.0)
    every = ld.inverse([0.0, 0.0, -0.6], G)
    assert every.min() > -1.2
    assert every.max() < 0.4


def test_variants_begin_their_trajectories_at_home() -> None:
    assert tuple(robot("linear_delta").variants) == ("default", "V1", "V2")
    for name, trajectory in (("V1", ld.V1), ("V2", ld.V2)):
        m = cc.load("linear_delta", variant=name)
        assert_close(m.point(m.home, "P"), trajectory.position(np.array(0.0)), 1e-14)
        heights = ld.history(trajectory, np.linspace(0.0, trajectory.T, 201), G).q
        lower, upper = m.limits
        assert (heights > lower[m.input_q]).all()
        assert (heights < upper[m.input_q]).all()


def test_home_in_any_working_mode(tol: Tolerances) -> None:
    for sides in ld.MODES:
        m = cc.load("linear_delta", home="0.08 -0.05 -0.6", sides=" ".join(map(str, sides)))
        assert np.abs(cc.residual(m, m.home)).max() < tol.closure
        assert_close(m.input_values(m.home), ld.sliders([0.08, -0.05, -0.6], G, sides), 1e-13)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"b": -0.5}, "'b' is -0.5; it must be greater than zero"),
        ({"t": 0}, "'t' is 0; it must be greater than zero"),
        ({"b": 0.1}, "parameter home: leg1 would need rods b of at least 0.2 m"),
        ({"home": "0.5 0 -0.6"}, "parameter home: leg2 would need rods b of at least 0.6245 m"),
        ({"home": "0 0 3"}, "leg1_P.*outside the limits"),
        ({"home": "0 0"}, "parameter 'home' must be 3 numbers"),
        ({"sides": "1 2 1"}, "parameter 'sides' must be three of 1 and -1"),
        ({"rail_lower": 1.0}, "'rail_lower' must be less than 'rail_upper'"),
        ({"rod": 0.5}, "unknown parameter 'rod'.*known: a, b, c, t"),
    ],
)
def test_bad_parameters_are_named(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(cc.DescriptionError, match=message):
        cc.load("linear_delta", **parameters)


# --- positions ---------------------------------------------------------------------------------


def test_closed_forms_close_the_mechanism_in_all_modes(
    delta: cc.Mechanism, tol: Tolerances
) -> None:
    """1,000 poses, 8 working modes in turn."""
    for k, p in enumerate(random_positions(1000)):
        q = configuration(delta, p, ld.MODES[k % 8])
        assert np.abs(cc.residual(delta, q)).max() < tol.closure
        assert_close(delta.point(q, "P"), p, 1e-12)
        if k < 50:
            assert_close(rods_at(delta, q), ld.rods(p, delta.input_values(q), G), 1e-12)


@pytest.mark.slow
def test_direct_agrees_with_the_closed_form(delta: cc.Mechanism) -> None:
    """1,000 poses from nearby guesses, the first 100 of them also from home.

    From home on the platform stays below the plane of the sliders.
    """
    rng = np.random.default_rng(SEED)
    p = random_positions(1000, seed=1)
    for k, (target, heights) in enumerate(zip(p, ld.inverse(p, G)[:, 0], strict=True)):
        near = configuration(delta, 0.9 * target + 0.02 * rng.uniform(-1.0, 1.0, 3), ld.MODES[0])
        found = cc.direct(delta, heights, guess=None if k < 100 else near)
        assert found.converged, found.message
        assert found.rank == 13
        assert_close(delta.point(found.q, "P"), target, 1e-10)
        assert_close(delta.pose(found.q).rotation, np.eye(3), 1e-10)


def test_both_assemblies_are_reached_from_guesses_on_them(delta: cc.Mechanism) -> None:
    for p in random_positions(20, seed=2):
        heights = ld.inverse(p, G)[0]
        solutions = ld.direct(heights, G)
        for centre, sides in zip(solutions.p, solutions.sides, strict=True):
            guess = configuration(delta, centre + 0.02 * ld.AXIS, sides)
            found = cc.direct(delta, heights, guess=guess).raise_if_failed()
            assert_close(delta.point(found.q, "P"), centre, 1e-10)


@pytest.mark.parametrize("sides", ld.MODES)
def test_inverse_stays_in_its_working_mode(delta: cc.Mechanism, sides: np.ndarray) -> None:
    guess = configuration(delta, [0.0, 0.0, -0.6], sides)
    for p in random_positions(8, seed=3, radius=0.2):
        found = cc.inverse(delta, pin.SE3(np.eye(3), p), guess=guess).raise_if_failed()
        assert_close(delta.input_values(found.q), ld.sliders(p, G, sides), 1e-10)


def test_close_places_the_platform_from_an_open_guess(delta: cc.Mechanism) -> None:
    """Redundant rows do not keep the search from converging to the last digit."""
    rng = np.random.default_rng(SEED)
    for p in random_positions(20, seed=4, radius=0.15):
        guess = pin.integrate(delta.model, delta.home, 0.1 * rng.normal(size=16))
        pose = pin.SE3(np.eye(3), p)
        found = cc.close(delta, guess, place={"platform": pose}).raise_if_failed()
        assert_close(delta.input_values(found.q), ld.inverse(p, G)[0], 1e-10)


def test_poses_out_of_reach_fail_with_a_reason(delta: cc.Mechanism) -> None:
    far = cc.inverse(delta, pin.SE3(np.eye(3), np.array([-0.35, 0.0, -0.6])))
    assert not far.converged
    assert "out of reach" in far.message
    apart = cc.direct(delta, [0.3, -0.9, 0.3])
    assert not apart.converged
    with pytest.raises(cc.ClosureError, match="no platform position"):
        ld.direct([0.3, -0.9, 0.3], G)


# --- mobility ----------------------------------------------------------------------------------


def test_mobility(delta: cc.Mechanism, reference: Callable[[str], dict[str, Any]]) -> None:
    stored = reference("linear_delta")["mobility"]
    found = cc.mobility(delta)
    assert found.links == stored["bodies"] == 17
    assert found.pairs == stored["joints"] == 21
    assert found.gruebler == stored["CGK"] == -9
    assert found.mobility == stored["true_mobility"] == 3
    assert found.redundant_rows == stored["redundant"] == 12
    # the tree carries the platform on leg 1: 5 rows for each of 5 cut pins, less 12
    assert (delta.rows, found.generic_rank) == (25, 13)
    assert found.rank.gap > 1e10


def test_redundant_rows_by_loop(
    delta: cc.Mechanism, reference: Callable[[str], dict[str, Any]]
) -> None:
    """Three in each parallelogram, three more in the platform's couples, in every mode."""
    stored = reference("linear_delta")["mobility"]
    where = dict(zip([c.name for c in delta.closures], delta.row_slices, strict=True))
    for p, sides in zip(random_positions(24, seed=5), itertools.cycle(ld.MODES), strict=False):
        k = dimensionless(delta, configuration(delta, p, sides))
        pins = [np.linalg.matrix_rank(k[where[f"leg{i}_F"]], tol=1e-9) for i in (1, 2, 3)]
        assert pins == [2, 2, 2]
        assert 5 - pins[0] == stored["redundant_per_parallelogram"]
        total = int(np.linalg.matrix_rank(k, tol=1e-9))
        assert total == 13
        assert (25 - total) - 9 == stored["redundant_after_parallelograms"]


def test_platform_only_translates(delta: cc.Mechanism) -> None:
    assert cc.mobility(delta).mobility == 3
    for sides in ld.MODES:
        q = configuration(delta, [0.08, -0.05, -0.6], sides)
        free = cc.redundancy(delta, q, "rx ry rz")
        assert free.dimension == 3  # every motion leaves the attitude at rest
        assert cc.redundancy(delta, q).dimension == 0


# --- first and second order --------------------------------------------------------------------


def test_velocity_equation_is_that_of_the_rods(delta: cc.Mechanism) -> None:
    """Jx v = Jq qdot spans the rows bhat.v = bhat.z qdot; the twist map is their quotient."""
    for p, sides in zip(random_positions(24, seed=6), itertools.cycle(ld.MODES), strict=False):
        q = configuration(delta, p, sides)
        bhat = ld.rods(p, delta.input_values(q), G)
        found = cc.velocity(delta, q)
        assert found.Jx.shape == found.Jq.shape == (3, 3)
        rows = np.hstack([bhat, -np.diag(bhat[:, 2])])
        ours = np.hstack([found.Jx, -found.Jq])
        assert np.linalg.matrix_rank(np.vstack([rows, ours]), tol=1e-9) == 3
        if abs(ld.direct_factor(bhat)) > 0.01:
            assert found.twist_map is not None
            v = found.twist_map @ np.array([0.3, -0.2, 0.1])
            assert_close(ld.slider_rates(bhat, v), [0.3, -0.2, 0.1], 1e-10)


@pytest.mark.parametrize(("name", "trajectory"), [("V1", ld.V1), ("V2", ld.V2)])
def test_histories_of_the_variants(name: str, trajectory: ld.Trajectory, tol: Tolerances) -> None:
    """The mechanism follows the sliders: pose, velocity and acceleration of o', in closed loop."""
    m = cc.load("linear_delta", variant=name)
    time = np.linspace(0.0, trajectory.T, 41)
    sliders = ld.history(trajectory, time, G)
    q = m.home
    for k, t in enumerate(time):
        q = cc.direct(m, sliders.q[k], guess=q).raise_if_failed().q
        assert_close(m.point(q, "P"), trajectory.position(t), 1e-10)
        moving = cc.acceleration(m, q, sliders.qdot[k], sliders.qddot[k])
        zero = np.zeros(3)
        v, a = trajectory.velocity(t), trajectory.acceleration(t)
        assert_close(moving.tip_twist, np.concatenate([v, zero]), tol.reference)
        assert_close(moving.tip_acceleration, np.concatenate([a, zero]), tol.reference)


def test_printed_accelerations_do_not_move_the_mechanism_as_claimed() -> None:
    """Sliders driven by the zero-diagonal Hessian miss the platform's acceleration by a quarter."""
    m = cc.load("linear_delta", variant="V1")
    v, a = ld.V1.velocity(np.array(0.0)), ld.V1.acceleration(np.array(0.0))
    bhat = ld.rods(ld.V1.position(np.array(0.0)), m.input_values(m.home), G)
    zero = np.zeros(3)
    printed = ld.inverse_acceleration(
        bhat, G, np.concatenate([v, zero]), np.concatenate([a, zero]), printed=True
    )[:3]
    moving = cc.acceleration(m, m.home, ld.slider_rates(bhat, v), printed)
    assert np.linalg.norm(moving.tip_acceleration[:3] - a) > 0.25
