"""Closed forms of rpa3t against stored numbers, against themselves and against what is printed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import assert_close
from rpa3t_postures import DEFAULT, WIDE, G, near, on_kappa, sample

from closedchain.robots import rpa3t
from closedchain.robots.rpa3t import printed
from closedchain.urdf.errors import ClosureError, DescriptionError

MM = np.array([1e-3, 1e-3, 1.0])  # (x_C1, z_C1, beta) of the reference to SI


@pytest.fixture(scope="module")
def ref() -> dict[str, Any]:
    path = Path(__file__).parents[1] / "reference" / "rpa3t.json"
    data: dict[str, Any] = json.loads(path.read_text())
    return data


# --- geometry ---------------------------------------------------------------------------------


def test_dimensions_are_the_case_study(ref: dict[str, Any]) -> None:
    for name in ("l1", "l2", "l3", "l4", "l5", "l6", "l7", "w4s", "w4r"):
        assert getattr(G, name) == pytest.approx(1e-3 * ref["params"][name], abs=1e-15)


def test_impossible_dimensions_are_refused_by_name() -> None:
    with pytest.raises(DescriptionError, match="'l4' must be positive"):
        rpa3t.geometry(l4=-0.8)
    with pytest.raises(DescriptionError, match=r"'l7'.*nan"):
        rpa3t.geometry(l7=float("nan"))
    with pytest.raises(DescriptionError, match="unknown rpa3t field 'l8'; known: l1, l2"):
        rpa3t.geometry(l8=0.1)
    assert rpa3t.geometry(l4=0.7).l4 == 0.7


def test_named_points(ref: dict[str, Any]) -> None:
    for pose in ref["poses"].values():
        mode = pose["ik"][pose["default_index"]]
        found = rpa3t.points(np.array(mode["q"]) * MM, np.array(mode["theta"]), G)
        assert set(found) == set(pose["points"])
        for name, xyz in pose["points"].items():
            assert_close(found[name], 1e-3 * np.array(xyz), 1e-13, name)


# --- inverse ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["home", "P2"])
def test_sixteen_working_modes_of_the_reference(ref: dict[str, Any], name: str) -> None:
    pose = ref["poses"][name]
    found = rpa3t.inverse(1e-3 * np.array(pose["P"]), G)
    assert found.real.all()
    assert pose["n_ik"] == len(found.theta) == 16
    for i, mode in enumerate(pose["ik"]):
        assert_close(found.modes[i], mode["wm"], 0.0, "label")
        assert_close(found.q[i], np.array(mode["q"]) * MM, 1e-13, "q")
        assert_close(near(found.theta[i], np.array(mode["theta"])), mode["theta"], 1e-13, "theta")


def test_jacobians_and_factors_of_the_reference(ref: dict[str, Any]) -> None:
    for pose in ref["poses"].values():
        for mode in pose["ik"]:
            q, theta = np.array(mode["q"]) * MM, np.array(mode["theta"])
            metres = np.array([1e-3, 1e-3, 1e-6])
            a, b = rpa3t.parallel_jacobian(q, theta, G), rpa3t.serial_jacobian(q, theta, G)
            assert_close(a, np.array(mode["A"]) * metres, 1e-12, "A")
            assert_close(b, 1e-6 * np.array(mode["B"]), 1e-12, "B")
            det_a, det_b = rpa3t.det_parallel(q, theta, G), rpa3t.det_serial(q, theta, G)
            assert det_a == pytest.approx(1e-12 * mode["detA"], rel=1e-11)
            assert det_b == pytest.approx(1e-18 * mode["detB"], rel=1e-11)
            twist = rpa3t.twist_map(q, theta, G)
            assert_close(twist, 1e-3 * np.array(mode["J"]), 1e-11, "J")
            assert np.linalg.det(twist) == pytest.approx(1e-9 * mode["detJ"], rel=1e-9)
            f, expected = rpa3t.factors(q, theta, G), mode["factors"]
            for found, key, unit in (
                (f.sin_beta, "sinb", 1.0),
                (f.cos_beta, "cosb", 1.0),
                (f.kappa, "kappa", 1e-3),
                (f.M, "M", 1e-6),
                (f.s1, "s1", 1e-3),
                (f.s2, "s2", 1e-3),
                (f.s3, "s3", 1e-3),
                (f.drop, "rz", 1e-3),
            ):
                assert float(found) == pytest.approx(unit * expected[key], abs=1e-13), key


def test_joint_values_of_the_reference(ref: dict[str, Any]) -> None:
    twins = {"Ua1": "U1", "Ub1": "U1", "Ua2": "U2", "Ub2": "U2"}
    for pose in ref["poses"].values():
        for mode in pose["ik"]:
            found = rpa3t.joint_values(np.array(mode["q"]) * MM, np.array(mode["theta"]), G)
            for name, value in found.items():
                expected = np.array(mode["joints"][twins.get(name, name)])
                assert_close(near(value, expected), expected, 1e-12, name)


def test_numbers_of_real_modes_and_their_labels() -> None:
    p = sample(WIDE, 3000, seed=0)
    found = rpa3t.inverse(p, G)
    assert found.theta.shape == (3000, 16, 3)
    numbers, times = np.unique(found.real.sum(axis=-1), return_counts=True)
    assert numbers.tolist() == [0, 8, 16]
    assert_close(times / 3000, [0.185, 0.013, 0.80], 0.02, "shares")
    here = found.real
    assert np.abs(rpa3t.residuals(found.q, found.theta, G))[here].max() < 1e-14
    reached = np.broadcast_to(p[:, None], found.q.shape)
    assert_close(rpa3t.tip(found.q, G), reached, 1e-15)
    signs = np.diagonal(rpa3t.serial_jacobian(found.q, found.theta, G), axis1=-2, axis2=-1)
    assert (np.sign(signs) == found.modes[:, 1:])[here].all()
    assert (np.sign(np.cos(found.q[..., 2])) == found.modes[:, 0])[here].all()
    assert np.isfinite(found.theta).all()
    assert np.isfinite(found.q).all()


def test_the_two_branches_of_beta_merge_on_the_planes_y_l7() -> None:
    found = rpa3t.inverse([0.1, G.l7, -0.6], G)
    assert found.real.all()
    assert_close(found.q[:8], found.q[8:], 1e-12)
    assert not rpa3t.inverse([0.1, 1.001 * G.l7, -0.6], G).real.any()


# --- direct -----------------------------------------------------------------------------------


def test_assembly_modes_of_the_reference(ref: dict[str, Any]) -> None:
    for case in ref["fk_cases"]:
        found = rpa3t.direct(np.array(case["theta"]), G)
        assert found.real.sum() == case["n"]
        for expected in case["solutions"]:
            i = found.modes.tolist().index(expected["mode"])
            assert found.real[i]
            assert_close(found.q[i], np.array(expected["q"]) * MM, 1e-11, "q")
            assert_close(found.position[i], 1e-3 * np.array(expected["P"]), 1e-11, "P")


def test_direct_inverts_inverse_in_all_modes() -> None:
    p = sample(WIDE, 1000, seed=1)
    found = rpa3t.inverse(p, G)
    theta = found.theta[found.real]
    wanted = np.broadcast_to(p[:, None], found.theta.shape)[found.real]
    back = rpa3t.direct(theta, G)
    off = np.abs(back.position - wanted[:, None]).max(axis=-1)
    off[~back.real] = np.inf
    assert off.min(axis=-1).max() < 1e-9  # sqrt(rounding) where two assembly modes merge
    assert np.median(off.min(axis=-1)) < 1e-14
    f = rpa3t.factors(back.q, theta[:, None, :], G)
    labels = np.stack([np.sign(f.M), np.sign(f.sin_beta)], axis=-1)
    apart = back.real & (np.abs(f.M) > 1e-9) & (np.abs(f.sin_beta) > 1e-9)
    assert (labels == back.modes)[apart].all()
    assert np.isfinite(back.q).all()


def test_numbers_of_assembly_modes_on_the_torus() -> None:
    theta = np.random.default_rng(2).uniform(-np.pi, np.pi, (20000, 3))
    numbers, times = np.unique(rpa3t.direct(theta, G).real.sum(axis=-1), return_counts=True)
    assert numbers.tolist() == [0, 2, 4]
    assert_close(times / 20000, [0.888, 0.103, 0.009], 0.006)


def test_inputs_do_not_know_the_sign_of_y() -> None:
    """Direct solutions come in pairs (x, +-y, z)."""
    theta = np.random.default_rng(3).uniform(-np.pi, np.pi, (5000, 3))
    found = rpa3t.direct(theta, G)
    assert (found.real[:, ::2] == found.real[:, 1::2]).all()
    mirrored = found.position[:, 1::2] * [1.0, -1.0, 1.0]
    assert_close(found.position[:, ::2], mirrored, 1e-15)


def test_self_motion_is_flagged_not_solved() -> None:
    for q, theta in on_kappa(10, seed=4):
        assert np.abs(rpa3t.residuals(q, theta, G)).max() < 1e-13
        found = rpa3t.direct(theta, G)
        assert found.self_motion.sum() == 2  # both labels of sin beta of one C1
        assert not (found.real & found.self_motion).any()


# --- derivatives ------------------------------------------------------------------------------


def test_jacobians_by_finite_differences() -> None:
    p = sample(WIDE, 40, seed=5)
    found = rpa3t.inverse(p, G)
    q, theta = found.q[found.real], found.theta[found.real]
    step = 1e-6
    for i in range(3):
        e = step * np.eye(3)[i]
        by_q = (rpa3t.residuals(q + e, theta, G) - rpa3t.residuals(q - e, theta, G)) / (2 * step)
        by_t = (rpa3t.residuals(q, theta + e, G) - rpa3t.residuals(q, theta - e, G)) / (2 * step)
        by_p = (rpa3t.tip(q + e, G) - rpa3t.tip(q - e, G)) / (2 * step)
        assert_close(rpa3t.parallel_jacobian(q, theta, G)[..., i], by_q, 1e-8, "A")
        assert_close(rpa3t.serial_jacobian(q, theta, G)[..., i], by_t, 1e-8, "B")
        assert_close(rpa3t.output_jacobian(q, G)[..., i], by_p, 1e-8, "D")


def test_determinants_factor() -> None:
    found = rpa3t.inverse(sample(WIDE, 200, seed=6), G)
    q, theta = found.q[found.real], found.theta[found.real]
    det_a = np.linalg.det(rpa3t.parallel_jacobian(q, theta, G))
    det_b = np.linalg.det(rpa3t.serial_jacobian(q, theta, G))
    det_d = np.linalg.det(rpa3t.output_jacobian(q, G))
    assert_close(rpa3t.det_parallel(q, theta, G), det_a, 1e-14)
    assert_close(rpa3t.det_serial(q, theta, G), det_b, 1e-14)
    assert_close(-G.l7 * rpa3t.factors(q, theta, G).cos_beta, det_d, 1e-15)
    ratio = -det_d * det_b / det_a  # det J = -det D det(A^-1 B), three rows
    far = np.abs(det_a) > 1e-4
    assert_close(
        np.linalg.det(rpa3t.twist_map(q[far], theta[far], G)) / ratio[far],
        1.0 + 0 * ratio[far],
        1e-9,
    )


def test_twist_map_refuses_direct_singularities() -> None:
    flat = rpa3t.inverse([0.1, 0.0, -0.6], G)
    with pytest.raises(ClosureError, match="direct singularity"):
        rpa3t.twist_map(flat.q[DEFAULT], flat.theta[DEFAULT], G)


def test_motion_is_decoupled_in_part_only() -> None:
    """z follows theta1 and theta2 only; x and y follow all three: no "complete" decoupling."""
    p = sample(WIDE, 200, seed=7)
    found = rpa3t.inverse(p, G)
    q, theta = (
        found.q[:, DEFAULT][found.real[:, DEFAULT]],
        found.theta[:, DEFAULT][found.real[:, DEFAULT]],
    )
    twist = rpa3t.twist_map(q, theta, G)
    assert_close(twist[:, 2, 2], 0.0 * twist[:, 2, 2], 1e-12, "dz/dtheta3")
    others = np.abs(np.delete(twist.reshape(-1, 9), 8, axis=1))
    assert np.median(others, axis=0).min() > 0.01


# --- what is printed --------------------------------------------------------------------------


def test_printed_inverse_formulas() -> None:
    """(13) for leg 1 returns pi - theta1, for leg 2 it is right; (15) misses the terms in x."""
    found = rpa3t.inverse([0.1, -0.03, -0.6], G)
    q = found.q[DEFAULT]
    sides = {i: np.unique(found.theta[:8, i - 1].round(12)) for i in (1, 2, 3)}  # cos beta > 0

    def solutions(leg: int) -> np.ndarray:
        values = [float(printed.arm_angle(leg, q, sign, G)) for sign in (1.0, -1.0)]
        return np.sort(values)

    assert_close(solutions(2), np.sort(sides[2]), 1e-11, "leg 2")
    supplement = np.arctan2(np.sin(np.pi - sides[1]), np.cos(np.pi - sides[1]))
    assert_close(solutions(1), np.sort(supplement), 1e-11, "leg 1")
    assert np.abs(solutions(1) - np.sort(sides[1])).min() > 0.1
    assert np.abs(solutions(3)[:, None] - sides[3]).min() > 0.05
    # with x_C3^2 - 2 x_C3 (l1 -+ l3) added to g3 and h3 the formula is right
    x3, y3, z3 = rpa3t.points(q, np.zeros(3), G)["C3"]
    rest = x3**2 + y3**2 + z3**2 - G.l4**2
    below = (G.l1 - G.l3) ** 2 - 2 * x3 * (G.l1 - G.l3) + rest
    above = (G.l1 + G.l3) ** 2 - 2 * x3 * (G.l1 + G.l3) + rest
    root = np.sqrt(4 * z3**2 * G.l3**2 - below * above)
    corrected = [2 * np.arctan((2 * G.l3 * z3 + sign * root) / below) for sign in (1, -1)]
    assert_close(np.sort(corrected), sides[3], 1e-11, "leg 3, corrected")


def test_printed_heights_contradict_the_inverse_text() -> None:
    q = np.array([-0.01, -0.62, -0.6])
    for name, z in printed.heights(q, G).items():
        assert rpa3t.points(q, np.zeros(3), G)[name][2] - z == pytest.approx(G.l6, abs=1e-15)
    found = rpa3t.points(q, np.zeros(3), G)
    assert_close(rpa3t.tip(q, G), 0.5 * (found["F1"] + found["D3"]), 1e-15, "(11)")
    assert rpa3t.tip(q, G)[2] == pytest.approx(-0.62 + 2 * 0.01, abs=1e-15)


def test_printed_parallel_factors_are_those_of_a_wrong_model() -> None:
    """(16) is det A with C2 held at x = -l5: factors x_C1 and 35 sin(theta2) - z_C1 are wrong."""
    found = rpa3t.inverse(sample(WIDE, 300, seed=8), G)
    q, theta = found.q[found.real], found.theta[found.real]
    f, p = rpa3t.factors(q, theta, G), printed.parallel_factors(q, theta)
    assert_close(p[:, 0], f.sin_beta, 1e-15)
    assert_close(p[:, 1], 100.0 * f.kappa, 1e-12)
    wrong = rpa3t.parallel_jacobian(q, theta, G)
    wrong[:, 1, 0] = 0.0  # C2 does not move along x
    in_cm = np.linalg.det(wrong) * 1e8
    assert_close(p.prod(axis=-1), in_cm / -40.0, 1e-9 * np.abs(in_cm).max(), "printed (16)")
    assert np.abs(p[:, 2] * p[:, 3] / 1e4 - f.M).max() > 0.1
    true = np.linalg.det(rpa3t.parallel_jacobian(q, theta, G))
    assert_close(rpa3t.det_parallel(q, theta, G), true, 1e-12 * np.abs(true).max(), "det A")


def test_x_c1_zero_is_not_singular(ref: dict[str, Any]) -> None:
    """The spurious example: printed (16) vanishes, det A does not."""
    example = ref["singular_examples"]["paper_spurious_xC0"]
    q, theta = np.array(example["q"]) * MM, np.array(example["theta"])
    assert np.abs(rpa3t.residuals(q, theta, G)).max() < 1e-12
    assert printed.parallel_factors(q, theta).prod() == 0.0
    assert rpa3t.det_parallel(q, theta, G) == pytest.approx(1e-12 * example["detA"], rel=1e-9)
    assert abs(rpa3t.det_parallel(q, theta, G)) > 0.02


def test_printed_serial_factors() -> None:
    """(17) in cm: factor 1 right, factor 2 has 20 for x_C1 + 10, factor 3 has z_C1 for z_C3."""
    found = rpa3t.inverse(sample(WIDE, 300, seed=9), G)
    q, theta = found.q[found.real], found.theta[found.real]
    f, p = rpa3t.factors(q, theta, G), printed.serial_factors(q, theta)
    scale = -2.0 * G.l3 * 1e4
    assert_close(p[:, 0], scale * f.s1, 1e-9, "factor 1")
    slip = 70.0 * (20.0 - (100.0 * q[:, 0] + 10.0)) * np.sin(theta[:, 1])
    assert_close(p[:, 1] - scale * f.s2, slip, 1e-9, "factor 2")
    assert np.abs(slip).max() > 100.0
    height = 70.0 * 100.0 * G.l6 * np.cos(theta[:, 2])
    assert_close(p[:, 2] - scale * f.s3, height, 1e-9, "factor 3")
    assert_close(p[:, 3], f.cos_beta, 1e-15)
    true = np.linalg.det(rpa3t.serial_jacobian(q, theta, G))
    assert_close(rpa3t.det_serial(q, theta, G), true, 1e-12 * np.abs(true).max(), "det B")


def test_y_b1_can_be_zero_and_a1_b1_can_vanish() -> None:
    """The text before (8) excludes both; with l3 > l1 both happen, the second without assembly."""
    theta1 = np.arccos(-G.l1 / G.l3)
    assert np.degrees(theta1) == pytest.approx(149.0, abs=0.05)
    assert abs(rpa3t.points(np.zeros(3), np.array([theta1, 0, 0]), G)["B1"][1]) < 1e-15
    theta2 = np.arccos((G.l1 - 2 * G.l5) / G.l3)
    for theta1 in (theta2, np.pi - theta2):
        theta = np.array([theta1, theta2, 0.1])
        b = rpa3t.points(np.zeros(3), theta, G)
        assert abs(b["B2"][0] + 2 * G.l5) < 1e-15  # a1 / 2
        assert abs(b["B2"][2] - b["B1"][2]) < 1e-15  # b1 / 2
        assert b["B1"][1] ** 2 > 1e-4  # -c1
        assert not rpa3t.direct(theta, G).real.any()


# --- surfaces ---------------------------------------------------------------------------------


def test_inverse_surfaces_are_the_squared_factors() -> None:
    p = sample(WIDE, 300, seed=10)
    found = rpa3t.inverse(p, G)
    f = rpa3t.factors(found.q, found.theta, G)
    squares = 4.0 * G.l3**2 * np.stack([f.s1, f.s2, f.s3], axis=-1) ** 2
    for i, mode in enumerate(found.modes):
        surfaces = rpa3t.inverse_surfaces(p, mode[0], G)
        here = found.real[:, i]
        assert_close(surfaces[here], squares[here, i], 1e-14)
        assert ((surfaces > 0.0).all(axis=-1) == here).all()
    assert_close(rpa3t.output_surface(p, G), G.l7**2 * (1 - (p[:, 1] / G.l7) ** 2), 1e-16)


def test_joint_space_surface_is_the_squared_factor() -> None:
    found = rpa3t.inverse(sample(WIDE, 200, seed=11), G)
    q, theta = found.q[found.real], found.theta[found.real]
    assert_close(rpa3t.parallel_rods(theta, G), 4.0 * rpa3t.factors(q, theta, G).M ** 2, 1e-13)


def test_kappa_surface_holds_the_self_motion() -> None:
    for q, theta in on_kappa(20, seed=12):
        assert abs(rpa3t.factors(q, theta, G).kappa) < 1e-15
        values = rpa3t.kappa_surface(rpa3t.tip(q, G), np.sign(np.cos(q[2])), G)
        assert np.abs(values).min() < 1e-14
        assert np.abs(values).max() > 1e-3
    with pytest.raises(ClosureError, match=r"l4=0\.04"):
        rpa3t.self_motion(0.0, 0.0, rpa3t.geometry(l4=0.04))
