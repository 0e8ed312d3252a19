"""The closed forms of rus6 against stored numbers, finite differences and themselves."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import Tolerances, assert_close
from rus6_postures import INWARD_M1, G, on_axis, one, random_poses, stored

from closedchain.robots.rus6 import (
    MODES,
    UP,
    Pose,
    det_jx,
    gaps,
    geometry,
    input_rates,
    inverse,
    j_beta,
    j_inputs,
    j_q,
    j_x,
    klein,
    leg_screws,
    mode_of,
    pencil_margin,
    platform_rates,
    posture,
    roots,
    rotation_ypr,
    state_at_origin,
    stretched_heights,
    wrapped,
)
from closedchain.urdf.errors import ClosureError, DescriptionError


@pytest.fixture(scope="module")
def ref(reference: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return reference("rus6")


def entries(ref: dict[str, Any]) -> dict[str, dict[str, Any]]:
    singular = {k: v for k, v in ref["singularities"].items() if isinstance(v, dict)}
    return {**ref["home"], "generic": ref["generic"]["state"], **singular}


# --- geometry ---------------------------------------------------------------------------------


def test_geometry_matches_the_reference(ref: dict[str, Any], tol: Tolerances) -> None:
    for name, value in ref["geometry"].items():
        assert_close(getattr(G, name), value, 1e-11, name)
    generic = ref["generic"]
    pose, beta, mode = stored(generic["state"])
    legs = inverse(pose, beta, G, mode)
    assert_close(G.F, generic["F"], tol.reference, "F")
    for name in "ABCw":
        assert_close(getattr(legs, name), generic[name], tol.reference, name)
    assert_close(rotation_ypr(0.15, -0.1, 0.08), generic["state"]["R"], 1e-11)


def test_axes_are_as_the_paper_draws_them() -> None:
    """u_i is tangent, and a positive turn about it raises the outward arm."""
    np.testing.assert_allclose((G.tangent * G.radial).sum(-1), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.cross(G.tangent, G.radial), np.tile(UP, (6, 1)), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(G.A(0.4)[:3] - G.F, axis=-1), G.Rr, atol=1e-15)
    # beta moves the radius R1 and the height of M1's feet, those of M2 stand still
    radii, heights = (G.A(0.4) * G.radial).sum(-1), G.A(0.4)[:, 1]
    np.testing.assert_allclose(radii, [0.2 + 0.08 * np.cos(0.4)] * 3 + [0.3] * 3, atol=1e-15)
    np.testing.assert_allclose(heights, [0.08 * np.sin(0.4)] * 3 + [-0.1] * 3, atol=1e-15)


def test_geometry_refuses_what_it_does_not_know() -> None:
    with pytest.raises(DescriptionError, match="unknown rus6 field 'theta'"):
        geometry(theta=0.1)
    with pytest.raises(DescriptionError, match="'LA' must be positive"):
        geometry(LA=0.0)
    with pytest.raises(DescriptionError, match="'beta'"):
        geometry(beta=0.0)
    with pytest.raises(DescriptionError, match="'H' must be a finite number"):
        geometry(H=float("nan"))
    assert geometry(H=-0.1).H == -0.1


# --- positions --------------------------------------------------------------------------------


def test_inverse_matches_the_reference(ref: dict[str, Any]) -> None:
    generic = ref["generic"]
    pose, beta, mode = stored(generic["state"])
    legs = inverse(pose, beta, G, mode)
    assert_close(legs.alpha, generic["alpha_kappa_plus"], 1e-11)
    assert_close(inverse(pose, beta, G, [-1] * 6).alpha, generic["alpha_kappa_minus"], 1e-11)
    assert_close(legs.bend, generic["U1_relative"], 1e-10)
    assert_close(legs.swing, -np.array(generic["delta_LB_outofplane"]), 1e-11)
    absolute = G.absolute(legs.alpha, beta)
    assert_close(wrapped(legs.bend + absolute), generic["phi_LB_inplane"], 1e-10)
    assert_close(legs.v, [s[:3] for s in leg_screws(legs).joints[2]], 0.0)
    for name in ("beta=-30 deg", "beta=+0 deg", "beta=+30 deg"):
        pose, beta, mode = stored(ref["home"][name])
        assert_close(inverse(pose, beta, G, mode).alpha, ref["home"][name]["alpha"], 1e-11)


def test_all_64_modes_close_and_are_labelled() -> None:
    poses, beta = random_poses(200)
    legs = inverse(poses, beta, G, MODES[:, None])
    assert legs.alpha.shape == (64, 200, 6)
    assert legs.closed.all()
    assert np.abs(gaps(poses, legs.alpha, beta, G)).max() < 1e-15
    assert np.array_equal(mode_of(legs), np.broadcast_to(MODES[:, None], legs.alpha.shape))
    for i in range(6):  # twelve angles make all modes
        assert len(np.unique(legs.alpha[:, 0, i].round(9))) == 2
    assert len(np.unique(legs.alpha[:, 0].round(9), axis=0)) == 64
    assert np.array_equal(MODES[0], np.ones(6))


def test_the_batch_agrees_with_single_poses() -> None:
    poses, beta = random_poses(5)
    batch = inverse(poses, beta, G)
    for i in range(5):
        alone = inverse(one(poses, i), beta[i], G)
        for name in ("alpha", "B", "w", "v", "bend", "swing"):
            np.testing.assert_array_equal(getattr(alone, name), getattr(batch, name)[i])


def test_out_of_reach_is_said_and_finite() -> None:
    far = inverse(on_axis(-0.9), 0.0, G)
    assert not far.closed
    assert (far.reach < 0.0).all()
    assert all(np.isfinite(getattr(far, n)).all() for n in ("alpha", "B", "w", "v", "bend"))
    assert (gaps(on_axis(-0.9), far.alpha, 0.0, G) > 0.02).all()  # the rods are too short
    assert inverse(on_axis(-0.55), 0.0, G).closed
    # the point C straight on the axis of A, where rho = 0
    bad = geometry(r=0.3, psi1=-np.pi / 6, psi4=np.pi / 6, H=0.0)
    assert np.isfinite(inverse(on_axis(0.0), 0.0, bad).alpha).all()


def test_posture_is_the_inverse_of_inverse() -> None:
    poses, beta = random_poses(50)
    for mode in ((1,) * 6, INWARD_M1):
        legs = inverse(poses, beta, G, mode)
        again = posture(poses, legs.alpha, beta, G)
        for name in ("B", "w", "bend", "swing"):
            np.testing.assert_allclose(getattr(again, name), getattr(legs, name), atol=1e-12)


def test_stored_assemblies_solve_the_direct_problem(ref: dict[str, Any]) -> None:
    fk = ref["fk"][0]
    assert (fk["n_complex_finite"], len(fk["real"])) == (40, 8)
    signs = []
    for found in fk["real"]:
        w, *v = found["quat_wxyz"]
        pose = Pose(_rotation(w, np.array(v)), np.array(found["P"]))
        assert np.abs(gaps(pose, fk["alpha"], fk["beta"], G)).max() < 1e-10
        determinant = det_jx(posture(pose, fk["alpha"], fk["beta"], G))
        assert determinant == pytest.approx(found["det_Jx"], abs=1e-9)
        signs.append(np.sign(determinant))
    assert signs[0] == -1.0  # the assembly of home, and four or so of the other sign
    assert {-1.0, 1.0} == set(signs)


def _rotation(w: float, v: np.ndarray) -> np.ndarray:
    x, y, z = v
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


# --- velocities: equations (1) to (5) -----------------------------------------------------------


def test_jacobians_match_the_reference(ref: dict[str, Any]) -> None:
    for name, entry in entries(ref).items():
        pose, beta, mode = stored(entry)
        legs = inverse(pose, beta, G, mode)
        # Jq grows like the root of the distance from its zero, and P is stored to 12 digits
        exact = 1e-9 if np.abs(entry["Jq"]).min() > 1e-3 else 1e-6
        assert_close(j_q(legs), entry["Jq"], exact, name)
        assert_close(j_beta(legs), entry["Jq_prime"][:3], exact, name)
        both = np.column_stack([np.diag(entry["Jq"]), [*entry["Jq_prime"][:3], 0.0, 0.0, 0.0]])
        assert_close(j_inputs(legs), both, exact, name)
        assert_close(det_jx(legs), entry["det_Jx"], exact, name)
        sigma = np.linalg.svd(j_x(legs), compute_uv=False)
        assert_close(sigma, entry["sv_Jx"], exact, name)
    pose, beta, mode = stored(ref["generic"]["state"])
    assert_close(j_x(inverse(pose, beta, G, mode)), ref["generic"]["Jx"], 1e-11)


def test_screws_match_the_reference(ref: dict[str, Any]) -> None:
    pose, beta, mode = stored(ref["generic"]["state"])
    screws = leg_screws(inverse(pose, beta, G, mode))
    for leg, name in ((0, "screws_leg1"), (3, "screws_leg4")):
        for n in range(6):
            assert_close(screws.joints[n, leg], ref["generic"][name][str(n + 1)], 1e-11)
    assert_close(screws.links[0], ref["generic"]["screws_leg1"]["r"], 1e-11)
    assert_close(screws.virtual[0], ref["generic"]["screws_leg4"]["f"], 1e-11)


def test_rod_screw_is_reciprocal_to_the_passive_joints() -> None:
    """Equations (3) and (4): only $1, $r and the virtual $f work against $6."""
    poses, beta = random_poses(100)
    legs = inverse(poses, beta, G, MODES[17])
    screws = leg_screws(legs)
    rods = screws.joints[5]
    for n in (2, 3, 4, 5, 6):
        assert np.abs(klein(screws.joints[n - 1], rods)).max() < 1e-15
    np.testing.assert_allclose(klein(screws.joints[0], rods), j_q(legs), atol=1e-15)
    np.testing.assert_allclose(klein(screws.links, rods[:, :3]), j_beta(legs), atol=1e-15)
    np.testing.assert_allclose(klein(screws.virtual, rods[:, 3:]), 1.0, atol=1e-15)


def motion(t: np.ndarray) -> tuple[Pose, np.ndarray]:
    """Motion of the platform and of beta in time (n,): all seven freedoms at once."""
    p = np.stack([0.03 * np.sin(t), -0.55 + 0.02 * np.cos(2 * t), 0.02 * np.sin(3 * t)], axis=-1)
    return Pose(rotation_ypr(0.1 * np.sin(t), 0.08 * t, 0.1 * np.cos(t)), p), 0.3 * np.sin(2 * t)


@pytest.mark.parametrize("mode", [(1,) * 6, INWARD_M1, (1, -1, 1, -1, -1, 1)])
def test_velocity_equation_is_the_derivative_of_the_inverse(mode: Any, tol: Tolerances) -> None:
    """Equation (5): alpha of M1 must count from the reconfiguration link."""
    t, e = np.linspace(0.0, 1.0, 40), 1e-3
    weights = ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12))  # fourth order
    steps = [(w / e, *motion(t + k * e)) for k, w in weights]
    alpha_rate = sum(w * inverse(pose, beta, G, mode).alpha for w, pose, beta in steps)
    beta_rate = sum(w * beta for w, _, beta in steps)
    v_P = sum(w * pose.position for w, pose, _ in steps)
    turning = sum(w * pose.rotation for w, pose, _ in steps)
    pose, beta = motion(t)
    spin = turning @ np.swapaxes(pose.rotation, -1, -2)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
    legs = inverse(pose, beta, G, mode)
    state = state_at_origin(omega, v_P, pose.position)
    found = input_rates(legs, state, beta_rate)
    assert np.abs(found - alpha_rate).max() < tol.finite_difference * np.abs(alpha_rate).max()
    # the usual slip: the velocity of P in place of that of the point at O
    slip = input_rates(legs, np.concatenate([omega, v_P], axis=-1), beta_rate)
    assert np.abs(slip - alpha_rate).max() > 1e-2
    # with absolute angles of M1, J'q would have to be J'q - Jq
    absolute = alpha_rate[:, :3] + beta_rate[:, None]
    assert np.abs(found[:, :3] - absolute).max() > 1e-2
    left = (platform_rates(legs) @ state[..., None])[:, :3, 0]
    corrected = j_beta(legs) - j_q(legs)[:, :3]
    rows = left - corrected * beta_rate[:, None] - j_q(legs)[:, :3] * absolute
    assert np.abs(rows).max() < 1e-8


def test_rates_match_the_reference(ref: dict[str, Any]) -> None:
    generic = ref["generic"]
    pose, beta, mode = stored(generic["state"])
    legs = inverse(pose, beta, G, mode)
    state = state_at_origin(generic["omega"], generic["vP"], pose.position)
    rates = input_rates(legs, state, generic["betadot"])
    assert_close(rates, generic["alphadot"], 1e-10)
    slope = -j_beta(legs) / j_q(legs)[:3]
    assert_close(slope, generic["dalpha_dbeta_fixed_pose"], 1e-10)
    free = j_inputs(legs) @ np.r_[slope, 0.0, 0.0, 0.0, 1.0]  # beta moves, the platform rests
    assert np.abs(free).max() < 1e-15


def test_rates_refuse_a_stretched_leg() -> None:
    pose = on_axis(stretched_heights(G, 3)[0])
    legs = inverse(pose, 0.0, G)
    assert np.abs(j_q(legs)[3:]).max() < 1e-7
    with pytest.raises(ClosureError, match="alpha4, alpha5, alpha6"):
        input_rates(legs, np.ones(6), 0.0)


# --- roots --------------------------------------------------------------------------------------


def test_roots_of_det_jx_in_the_home_mode(ref: dict[str, Any]) -> None:
    """Direct singularities by pure yaw, pitch or roll at the home position, all elbows outward."""

    def along(turn: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        return lambda t: det_jx(inverse(Pose(turn(t), G.home.position), 0.0, G))

    t = np.radians(np.arange(-90.0, 90.5, 1.0))
    yaw = np.degrees(roots(along(rotation_ypr), t))
    assert_close(yaw, [-84.853552183, 87.5923188294], 1e-8)
    angle = ref["singularities"]["type2_default_yaw+"]["angle_deg"]
    assert yaw[1] == pytest.approx(angle, abs=1e-9)
    small = np.radians(np.arange(-50.0, 50.5, 1.0))
    pitch = roots(along(lambda a: rotation_ypr(0.0, a)), small)
    roll = roots(along(lambda a: rotation_ypr(0.0, 0.0, a)), small)
    assert_close(np.degrees(pitch), [40.5006836262], 1e-8)
    assert_close(np.degrees(roll), [42.695811785], 1e-8)


def test_stretched_heights_match_the_sheet(ref: dict[str, Any]) -> None:
    assert_close(stretched_heights(G, 3)[0], -0.776656534474, 1e-11)
    assert_close(stretched_heights(G, 0, np.pi / 3)[0], -0.717418715421, 1e-11)
    assert stretched_heights(geometry(r=1.5), 0).size == 0
    for leg, beta in itertools.product(range(6), (0.0, 0.7)):
        for height in stretched_heights(G, leg, beta):
            legs = inverse(on_axis(height), beta, G)
            assert abs(legs.reach[leg]) < 1e-12
            assert abs(j_q(legs)[leg]) < 1e-6


def test_safe_box_is_free_of_singularities(ref: dict[str, Any]) -> None:
    box = ref["safe_box"]
    poses, beta = random_poses(6000)
    legs = inverse(poses, beta, G)
    assert legs.closed.all()
    assert (det_jx(legs) < 0.0).all()
    assert np.abs(det_jx(legs)).min() > 0.9 * box["min_abs_detJx"]
    assert np.abs(j_q(legs)).min() > 0.9 * box["min_abs_Jq"]
    sigma = np.linalg.svd(j_x(legs), compute_uv=False)[:, -1]
    assert sigma.min() > 0.9 * box["min_sigma_Jx"]


def test_pencil_margin() -> None:
    assert_close(pencil_margin(G, 0.0), [0.20, 0.18], 1e-15)
    assert pencil_margin(G, np.linspace(-1.5, 1.5, 7)).shape == (7, 2)
    worst = pencil_margin(G, np.linspace(-1.5, 1.5, 301))[:, 0]
    assert worst.argmin() == 150  # beta = 0: R = Rf + Rr
