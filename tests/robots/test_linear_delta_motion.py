"""Second order of the linear Delta: the corrected Hessian and the source's numerical example."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import assert_close
from linear_delta_postures import SEED, G, random_positions, rods, translation

from closedchain.robots import linear_delta as ld
from closedchain.urdf.errors import ClosureError, DescriptionError

DIGITS = 2e-11  # the reference states 12 digits


@pytest.fixture(scope="module")
def ref(reference: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return reference("linear_delta")


@pytest.fixture(scope="module")
def generic(ref: dict[str, Any]) -> dict[str, Any]:
    return ref["generic"]


# --- acceleration ------------------------------------------------------------------------------


def test_layers_match_the_reference(generic: dict[str, Any]) -> None:
    bhat = rods(generic["p"], generic["sgn"])
    found = ld.layers(bhat, G)
    for i in range(3):
        assert_close(found[i, 0], generic[f"L_a{i + 1}"], DIGITS)
    assert_close(found[0, 4], generic["L_c1_limb1"], DIGITS)
    assert_close(found[0, 5], generic["L_c2_limb1"], DIGITS)
    assert_close(ld.hessian(bhat, G)[0], generic["H_layer0"], 1e-10)
    diagonal = ld.limb_hessians(bhat, G)[0, :, 2, 2]
    assert_close(diagonal, generic["H_limb1_layers_diag33"], DIGITS)


def test_layers_in_closed_form() -> None:
    """The only entries of L_a,i, L_c1,i and L_c2,i that do not vanish."""
    bhat = rods(random_positions(50)[:, None, :], ld.MODES)
    s, e = ld.parallelogram(bhat)
    s1, s2 = ld.AXIS, ld.TANGENT

    def dot(one: np.ndarray, two: np.ndarray) -> np.ndarray:
        return np.asarray((one * two).sum(axis=-1))

    expected = np.zeros((*bhat.shape[:-1], 6, 6, 6))
    actuation, c1, c2 = (expected[..., k, :, :] for k in (0, 4, 5))
    actuation[..., 0, 1] = actuation[..., 0, 3] = dot(bhat, np.cross(s1, s2))
    actuation[..., 1, 3] = G.b * (1.0 - dot(s2, bhat) ** 2)  # not b bhat.bhat
    actuation[..., 2, 2] = -1.0 / G.b  # missing in the source
    actuation[..., 0, 4] = dot(bhat, np.cross(s1, s))
    actuation[..., 2, 4] = dot(bhat, np.cross(e, s))
    c1[..., 1, 5] = c1[..., 3, 5] = dot(s, np.cross(s2, bhat))
    c2[..., 1, 4] = c2[..., 3, 4] = -1.0
    c2[..., 4, 5] = dot(np.cross(s, s2), np.cross(s, bhat))
    found = ld.layers(bhat, G)
    for k in (0, 4, 5):
        assert_close(found[..., k, :, :], expected[..., k, :, :], 1e-14, f"wrench {k}")
    assert_close(dot(bhat, np.cross(e, s)), np.ones(bhat.shape[:-1]), 1e-14)
    printed = ld.layers(bhat, G, printed=True)
    assert_close(printed[..., 0, 2, 2], np.zeros(bhat.shape[:-1]), 0.0)


def test_acceleration_matches_the_reference(generic: dict[str, Any]) -> None:
    bhat = rods(generic["p"], generic["sgn"])
    v, a = np.array(generic["v"]), np.array(generic["a"])
    true = ld.inverse_acceleration(bhat, G, translation(v), translation(a))
    assert_close(true[:3], generic["qddot_corrected"], DIGITS)
    assert_close(true[3:], np.zeros(6), 1e-14)
    assert_close(ld.slider_accelerations(bhat, v, a, G), generic["qddot_corrected"], DIGITS)
    printed = ld.inverse_acceleration(bhat, G, translation(v), translation(a), printed=True)
    assert_close(printed[:3], generic["qddot_paper_zero_diagonal"], DIGITS)


def test_printed_hessian_is_wrong_by_the_parallelograms_centripetal_term() -> None:
    """The claim that eqs (27)-(32) hold with a zero diagonal is refuted by differences of q."""
    rng = np.random.default_rng(SEED)
    p = random_positions(200)
    v, a = rng.normal(size=(2, 200, 3))
    bhat = rods(p)
    step = 1e-4
    ahead, here, behind = (
        ld.sliders(p + h * v + 0.5 * h**2 * a, G, np.ones(3)) for h in (step, 0.0, -step)
    )
    assert_close((ahead - behind) / (2 * step), ld.slider_rates(bhat, v), 1e-5)
    measured = (ahead - 2.0 * here + behind) / step**2
    true = ld.inverse_acceleration(bhat, G, translation(v), translation(a))[:, :3]
    printed = ld.inverse_acceleration(bhat, G, translation(v), translation(a), printed=True)[:, :3]
    assert_close(true, ld.slider_accelerations(bhat, v, a, G), 1e-9)
    assert_close(measured, true, 1e-3)
    assert np.abs(measured - printed).max() > 1.0
    rho3 = ld.limb_rates(bhat, G, translation(v))[..., 2]
    assert_close(true - printed, rho3**2 / (G.b * bhat[..., 2]), 1e-9)


def test_accelerations_of_singular_postures_are_refused() -> None:
    flat = rods([-0.3, 0.0, -0.6])
    for call in (
        lambda: ld.slider_rates(flat, np.ones(3)),
        lambda: ld.limb_rates(flat, G, np.ones(6)),
        lambda: ld.generalized_jacobian(flat, G).J,
    ):
        with pytest.raises(ClosureError, match="horizontal"):
            call()
    with pytest.raises(ClosureError, match="coplanar"):
        ld.hessian(rods(ld.opposed_rods(G, 0, 1), (1, -1, 1)), G)
    collapsed = np.array([ld.TANGENT[0], -ld.AXIS, -ld.AXIS])
    with pytest.raises(ClosureError, match="collapsed"):
        ld.limbs(collapsed, G)


# --- the numerical example ---------------------------------------------------------------------


def test_history_matches_the_reference(ref: dict[str, Any]) -> None:
    stored = ref["V1_T2_amax1_vz1"]
    times = np.array([float(t) for t in stored["samples"]])
    found = ld.history(ld.V1, times, G)
    for k, entry in enumerate(stored["samples"].values()):
        assert_close(ld.V1.position(times[k]), entry["p"], 1e-11)
        assert_close(found.q[k], entry["q"], 1e-11)
        assert_close(found.qdot[k], entry["qd"], 1e-11)
        assert_close(found.qddot[k], entry["qdd"], 1e-11)
        v, a = ld.V1.velocity(times[k]), ld.V1.acceleration(times[k])
        bhat = rods(entry["p"])
        printed = ld.inverse_acceleration(bhat, G, translation(v), translation(a), printed=True)
        assert_close(printed[:3], entry["qdd_paper"], 1e-10)
    assert abs(ld.V1.radius - stored["R"]) < 1e-11


def test_ranges_of_the_variants(ref: dict[str, Any]) -> None:
    stored = ref["V1_T2_amax1_vz1"]
    time = np.linspace(0.0, 2.0, 4001)
    found = ld.history(ld.V1, time, G)
    for values, name in ((found.q, "q"), (found.qdot, "qd"), (found.qddot, "qdd")):
        assert_close([values.min(), values.max()], stored[f"{name}_range"], 1e-6, name)
    twist, accelerator = translation(ld.V1.velocity(time)), translation(ld.V1.acceleration(time))
    bhat = ld.rods(ld.V1.position(time), found.q, G)
    printed = ld.inverse_acceleration(bhat, G, twist, accelerator, printed=True)
    error = np.abs(printed[:, :3] - found.qddot).max()
    assert abs(error - stored["max_paper_error"]) < 1e-6
    assert 0.50 < error / np.abs(found.qddot).max() < 0.51  # half of the peak
    slow = ld.history(ld.V2, np.linspace(0.0, 5.0, 4001), G)
    assert_close([slow.q.min(), slow.q.max()], [-0.251273, 0.119325], 1e-6)


@pytest.mark.parametrize("trajectory", [ld.V1, ld.V2])
def test_histories_are_derivatives_of_each_other(trajectory: ld.Trajectory) -> None:
    time = np.linspace(0.0, trajectory.T, 401)
    h = 1e-4
    ahead, here, behind = (ld.history(trajectory, time + k, G) for k in (h, 0.0, -h))
    assert_close((ahead.q - behind.q) / (2 * h), here.qdot, 1e-7)
    assert_close((ahead.qdot - behind.qdot) / (2 * h), here.qddot, 1e-7)


def test_z_is_cyclic_in_the_example() -> None:
    time = np.linspace(0.0, 2.0, 101)
    still = ld.history(ld.Trajectory(amax=1.0, T=2.0, vz=0.0), time, G)
    rising = ld.history(ld.V1, time, G)
    assert_close(rising.qdot, still.qdot + 1.0, 1e-13)
    assert_close(rising.qddot, still.qddot, 1e-12)


def test_printed_circle_is_infeasible_from_every_start() -> None:
    """Radius 0.633 m: no circle of that size fits into a reach 0.74 m across, wherever it lies."""
    assert abs(ld.PRINTED.radius - 0.633257) < 1e-6
    assert not ld.PRINTED.fits(G)
    assert ld.V1.fits(G)
    assert ld.V2.fits(G)
    assert 2.0 * ld.PRINTED.radius > 2.0 * 0.369042  # reach_is_three_discs
    with pytest.raises(ClosureError, match="out of reach"):
        ld.history(ld.PRINTED, np.linspace(0.0, 5.0, 11), G)
    assert ld.Trajectory(amax=0.4737, T=5.0, vz=1.0).fits(G)
    assert not ld.Trajectory(amax=0.4738, T=5.0, vz=1.0).fits(G)
    assert ld.Trajectory(amax=1.0, T=3.441, vz=1.0).fits(G)
    assert not ld.Trajectory(amax=1.0, T=3.442, vz=1.0).fits(G)
    with pytest.raises(DescriptionError, match="finite"):
        ld.Trajectory(amax=1.0, T=0.0, vz=0.0)


def frozen(side: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slider rates, accelerations and printed accelerations for figs 3-6, read literally.

    v = T amax/2 (sin, cos) and a = amax (cos, sin), the pose held at p_xy = 0.
    """
    angle = 2.0 * np.pi * np.linspace(0.0, 1.0, 2001)
    v = np.stack([2.5 * np.sin(angle), 2.5 * np.cos(angle), np.ones(2001)], axis=-1)
    a = np.stack([np.cos(angle), np.sin(angle), np.zeros(2001)], axis=-1)
    bhat = np.broadcast_to(rods(np.zeros(3), np.full(3, side)), (2001, 3, 3))
    printed = ld.inverse_acceleration(bhat, G, translation(v), translation(a), printed=True)
    return ld.slider_rates(bhat, v), ld.slider_accelerations(bhat, v, a, G), printed[:, :3]


def test_figure_5_is_a_frozen_pose_with_a_velocity_pi_times_too_large() -> None:
    """Its axis, -0.5 to 2.5, fits T amax/2, which is pi times the integral of figure 4."""
    rates = frozen(1.0)[0]
    assert_close([rates.min(), rates.max()], [-0.0911, 2.0911], 1e-4)
    consistent = ld.V1.velocity(np.array(0.5))[0]  # T amax / (2 pi)
    assert abs(ld.V1.amax * ld.V1.T / 2.0 - np.pi * consistent) < 1e-14
    # and v_y = + cos contradicts a_y = + sin: its integral has the opposite sign
    assert ld.V1.velocity(np.array(0.0))[1] < 0.0


def test_figure_6_cannot_be_reproduced() -> None:
    """Its axis spans -20 to 30; a right model keeps one sign on each branch there."""
    _, above, above_printed = frozen(1.0)
    _, below, below_printed = frozen(-1.0)
    assert_close([above.min(), above.max()], [-16.6187, -13.2022], 1e-3)
    assert_close([below.min(), below.max()], [13.2022, 16.6187], 1e-3)
    assert_close([above_printed.min(), above_printed.max()], [-16.6151, 0.4364], 1e-3)
    assert_close([below_printed.min(), below_printed.max()], [-0.4364, 16.6151], 1e-3)
