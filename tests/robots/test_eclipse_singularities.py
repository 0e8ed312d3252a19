"""Eclipse and Eclipse-II: velocity equation, singular sets, and what the paper claims of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import Reference
from eclipse_cases import CASES, Case, load, of_mode, posture, random_poses
from numpy.testing import assert_allclose
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import closedchain as cc
from closedchain.robots.eclipse import (
    ECLIPSE,
    ECLIPSE2,
    Geometry,
    actuator_jacobian,
    direct,
    direct_determinant,
    first_direct_tilt,
    four_planes,
    inverse,
    platform_jacobian,
    reciprocal_lines,
    tilted,
)

ROBOTS = pytest.mark.parametrize(("name", "g"), [("eclipse", ECLIPSE), ("eclipse2", ECLIPSE2)])
BLOCKS = np.r_[3:6, 0:3]  # (linear, angular) <-> (angular, linear)


# --- velocity equation --------------------------------------------------------------------------


def test_jacobians_of_the_reference(reference: Reference) -> None:
    """Twists there are angular first, which turns the sign of the determinant."""
    for entry in reference("eclipse")["poses"] + reference("eclipse")["singularities"]:
        second = entry["variant"] == "II"
        g = Geometry(*(entry[n] / 100 for n in ("r_g", "r", "a")), z_c=0.0 if second else None)
        found = inverse(np.array(entry["P"]) / 100, entry["R"], g)
        signs = tuple(entry.get("branch", {}).get("s_q", (1, 1, 1)))
        k = next(k for k, mode in enumerate(found.modes) if mode.q == signs)
        x, q = found.inputs[k], found.q_r[k]
        jx = platform_jacobian(x, q, g, about=np.zeros(3), length=0.01)  # moments in cm
        assert_allclose(jx[:, BLOCKS], entry["Jx"], atol=2e-11)
        assert_allclose(-direct_determinant(x, q, g), entry["det_Jx_norm"], atol=1e-12)
        rates = actuator_jacobian(x, q, g)
        rates[: 4 if second else 3] /= g.r_g  # per arc length
        assert_allclose(rates, entry["Jq_diag_arclength"], atol=1e-11)
        planes = np.linalg.det(four_planes(x, q, g))
        assert_allclose(100 * planes, entry["det_planes4"], atol=1e-10)


@ROBOTS
def test_velocity_equation_agrees_with_the_generic_one(name: str, g: Geometry) -> None:
    m = load(name)
    position, rotation = random_poses(30, seed=11)
    found = inverse(position, rotation, g)
    for i in range(30):
        k = i % len(found.modes)
        x, q_r = found.inputs[i, k], found.q_r[i, k]
        q = posture(m, position[i], rotation[i], x, q_r)
        closed = np.linalg.solve(
            platform_jacobian(x, q_r, g), np.diag(actuator_jacobian(x, q_r, g))
        )
        generic = cc.velocity(m, q).twist_map
        assert generic is not None
        assert_allclose(generic, closed, atol=1e-9 * np.abs(closed).max())


@ROBOTS
def test_determinants_are_the_generic_ones(name: str, g: Geometry) -> None:
    """K with the inputs' columns left out has the determinant -(r/a)^3 det Jx; [K; J] that of Jq.

    Constants everywhere, in every mode: so the zero sets are the same.
    """
    m = load(name)
    position, rotation = random_poses(60, seed=12)
    found = inverse(position, rotation, g)
    per_direct, per_inverse, plane_ratio = [], [], []
    for i in range(60):
        k = i % len(found.modes)
        x, q_r = found.inputs[i, k], found.q_r[i, k]
        at = cc.classify(m, posture(m, position[i], rotation[i], x, q_r))
        determinant = direct_determinant(x, q_r, g)
        per_direct.append(at.det_direct / determinant)
        per_inverse.append(at.det_inverse / actuator_jacobian(x, q_r, g).prod())
        area = np.sqrt(3) / 4 * g.side**2
        plane_ratio.append(
            determinant * g.a**3 / (2 * area * np.linalg.det(four_planes(x, q_r, g)))
        )
    assert_allclose(per_direct, -((g.r / g.a) ** 3), rtol=1e-10)
    assert_allclose(per_inverse, per_inverse[0], rtol=1e-10)
    assert_allclose(plane_ratio, -1.0, rtol=1e-10)


@ROBOTS
def test_zero_set_of_the_four_planes(name: str, g: Geometry) -> None:
    """Random tilts through the type 2 surface: where the closed form changes sign, and only there.

    On the surface the four planes share a point, and inputs locked leave one motion.
    """
    m = load(name)
    rng = np.random.default_rng(13)
    met = 0
    for _ in range(25):
        p = np.array([*rng.uniform(-0.02, 0.02, 2), rng.uniform(0.09, 0.13)])
        axis = rng.normal(size=3) * [1, 1, 0.2]
        axis /= np.linalg.norm(axis)

        def turned(angle: float, axis: np.ndarray = axis) -> np.ndarray:
            return Rotation.from_rotvec(angle * axis).as_matrix()

        def determinant(angle: float, p: np.ndarray = p, turned: Any = turned) -> float:
            return float(direct_determinant(*of_mode(inverse(p, turned(angle), g)), g))

        grid = np.linspace(0.0, 1.3, 40)
        values = np.array([determinant(x) for x in grid])
        if not inverse(p, turned(1.3), g).exists[0] or (values > 0).all():
            continue
        k = int(np.flatnonzero(values < 0)[0])
        root = brentq(determinant, grid[k - 1], grid[k], xtol=1e-15)
        for angle, kinds in ((root, {"direct"}), (root - 0.02, set()), (root + 0.02, set())):
            inputs, q_r = of_mode(inverse(p, turned(angle), g))
            q = posture(m, p, turned(angle), inputs, q_r)
            at = cc.classify(m, q)
            assert at.kinds == kinds
            sigma = np.linalg.svd(four_planes(inputs, q_r, g) / [1, 1, 1, g.a], compute_uv=False)
            assert (sigma[-1] < 1e-10) == bool(kinds)
        met += 1
        inputs, q_r = of_mode(inverse(p, turned(root), g))
        at = cc.classify(m, posture(m, p, turned(root), inputs, q_r))
        free = at.free_twists[:, 0]
        jx = platform_jacobian(inputs, q_r, g, length=g.a)
        assert np.abs(jx @ (free * [1, 1, 1, g.a, g.a, g.a])).max() < 1e-9
    assert met >= 8


@ROBOTS
def test_zero_set_of_type_1(name: str, g: Geometry) -> None:
    """Poses driven through rho = 0 and sin q_r = 0, one leg at a time."""
    rng = np.random.default_rng(14)
    for leg in range(3):
        for sizes, distance in (({"r": 0.25}, 0.0), ({"r": 0.15}, 0.05), ({"r": 0.15}, 0.35)):
            size = Geometry(**sizes, z_c=g.z_c)
            m = load(name, **sizes)
            rotation = Rotation.from_rotvec(rng.uniform(-0.2, 0.2, 3)).as_matrix()
            azimuth = rng.uniform(-np.pi, np.pi) if distance == 0.0 else 2 * np.pi / 3 * leg
            s = np.array([distance * np.cos(azimuth), distance * np.sin(azimuth), 0.12])
            if size.arc[leg] and distance:  # as far from, or as near to the guide's centre
                s[2] = size.z_c
            position = s - rotation @ size.plate[leg]
            found = inverse(position, rotation, size)
            inputs, q_r = of_mode(found)
            assert found.exists[0]
            straight = np.where(np.abs(np.sin(q_r)) < 1e-6, np.round(q_r / np.pi) * np.pi, q_r)
            guess = posture(m, position, rotation, inputs, straight)
            q = cc.close(m, guess).raise_if_failed().q
            factors = np.abs(actuator_jacobian(m.input_values(q), straight, size))
            assert (factors < 1e-8).sum() == 1
            assert cc.classify(m, q).kinds == {"inverse"}


# --- examples ------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_singular_examples(case: Case) -> None:
    m, q = case.load()
    at = cc.classify(m, q)
    assert at.kinds == case.kinds
    rank = np.linalg.matrix_rank(at.free_twists, tol=1e-6)
    assert rank == (1 if "direct" in case.kinds else 0)


def test_examples_are_those_of_the_reference(reference: Reference) -> None:
    by_name = {case.name: case for case in CASES}
    for entry in reference("eclipse")["singularities"]:
        case = by_name[entry["note"].split()[0]]
        m, q = case.load()
        pose = m.pose(q)
        assert_allclose(pose.translation, np.array(entry["P"]) / 100, atol=1e-9)
        assert_allclose(pose.rotation, entry["R"], atol=1e-9)
        at = cc.classify(m, q)
        assert ("direct" in at.kinds) == (entry["type"] in (2, 3))
        assert ("inverse" in at.kinds) == (entry["type"] in (1, 3))
        inputs = m.input_values(q)
        jx = platform_jacobian(inputs, [leg[2] for leg in entry["q"]], case.geometry, length=0.1)
        sigma = np.linalg.svd(jx, compute_uv=False)
        assert_allclose(sigma, entry["sv_Jx_norm"], atol=1e-9)


def test_the_free_motion_at_T2a(reference: Reference) -> None:
    """The plate turns about the line S_b S_c although all six inputs are locked."""
    (case,) = (case for case in CASES if case.name == "T2a")
    entry = reference("eclipse")["singularities"][1]
    m, q = case.load()
    twist = cc.classify(m, q).free_twists[:, 0]
    stated = np.array(entry["null_twist_omega_vP"])
    stated[3:] /= 100  # cm/s
    omega, v = twist[3:], twist[:3]
    assert_allclose(np.cross(omega, [0, 1, 0]), 0.0, atol=1e-9)
    for point in ("Sb", "Sc"):
        arm = m.point(q, point) - m.point(q, "P")
        assert np.abs(v + np.cross(omega, arm)).max() < 1e-9 * np.abs(omega).max()
    scale = omega[1] / stated[1]
    assert_allclose(v, scale * stated[3:], atol=1e-9 * abs(scale))


def test_assembly_modes_merge_at_T2a() -> None:
    """The direct problem has a double solution there."""
    (case,) = (case for case in CASES if case.name == "T2a")
    inputs, _ = of_mode(inverse(case.position, case.rotation, ECLIPSE))
    found = direct(inputs, ECLIPSE)
    assert found.circles.status == "multiple"
    assert any(np.abs(one.rotation - case.rotation).max() < 1e-6 for one in found.assemblies)
    near = tilted(0.0, -np.arccos(2 / 3) + 1e-3)
    inputs, _ = of_mode(inverse(case.position, near, ECLIPSE))
    close = [
        one
        for one in direct(inputs, ECLIPSE).assemblies
        if np.abs(one.rotation - near).max() < 0.02
    ]
    assert len(close) == 2


# --- tilts on the axis ---------------------------------------------------------------------------


def test_tilts_at_which_eclipse_is_singular() -> None:
    """Before 90 degrees for every azimuth; kinds by the generic definition."""
    m = load("eclipse")
    expected = {0: 69.9786165, 30: 54.0070066, 60: 48.1896851, 90: 54.0070066, 180: 48.1896851}
    for azimuth, degrees in expected.items():
        psi = np.radians(azimuth)
        tilt = first_direct_tilt(psi, ECLIPSE)
        assert tilt is not None
        assert_allclose(np.degrees(tilt), degrees, atol=6e-8)
        for angle, kinds in ((tilt, {"direct"}), (0.99 * tilt, set()), (1.01 * tilt, set())):
            found = of_mode(inverse([0, 0, 0.1], tilted(psi, angle), ECLIPSE))
            q = posture(m, [0, 0, 0.1], tilted(psi, angle), *found)
            assert cc.classify(m, q).kinds == kinds
    for psi in np.linspace(0, 2 * np.pi, 73):
        assert 48.18 < np.degrees(first_direct_tilt(psi, ECLIPSE) or 90.0) < 69.98
        upright = of_mode(inverse([0, 0, 0.1], tilted(psi, np.pi / 2), ECLIPSE))
        level = of_mode(inverse([0, 0, 0.1], tilted(psi, 0.0), ECLIPSE))
        assert direct_determinant(*upright, ECLIPSE) < 0 < direct_determinant(*level, ECLIPSE)


@pytest.mark.parametrize("g", [ECLIPSE, Geometry(0.25, 0.22, 0.08), Geometry(0.2, 0.2, 0.09)])
def test_tilts_in_closed_form(g: Geometry) -> None:
    """S_a up: its link lies in the plate. S_a down: it lies in the planes of legs b and c."""
    up = first_direct_tilt(np.pi, g)
    assert up is not None
    assert_allclose(np.cos(up), g.r_g / (g.r + g.a), atol=1e-9)
    down = first_direct_tilt(0.0, g)
    assert down is not None
    c, s = np.cos(down), np.sin(down)
    rho = g.a * np.sqrt(c * c / 4 + 3 / 4)
    q_b = np.arccos((g.r_g - rho) / g.r)
    assert_allclose(np.tan(q_b), 2 * s * rho / (g.a * (1 + c * c)), atol=1e-9)


def test_a_large_plate_can_stand_upright() -> None:
    """With S_a down type 2 comes before 90 degrees only if 2 (r_g - a sqrt(3)/2) > r."""
    limit = 0.2 / np.sqrt(3)
    assert first_direct_tilt(0.0, Geometry(a=0.99 * limit)) is not None
    assert first_direct_tilt(0.0, Geometry(a=1.01 * limit)) is None
    assert first_direct_tilt(np.pi, Geometry(a=1.01 * limit)) is not None


def test_tilts_of_eclipse_2_depend_on_the_height() -> None:
    for azimuth in range(90, 271, 30):
        assert first_direct_tilt(np.radians(azimuth), ECLIPSE2) is None
    for azimuth, degrees in ((0, 69.98), (30, 44.92), (-30, 44.92), (60, 48.19), (-60, 48.19)):
        tilt = first_direct_tilt(np.radians(azimuth), ECLIPSE2)
        assert tilt is not None
        assert_allclose(np.degrees(tilt), degrees, atol=6e-3)
    higher = first_direct_tilt(0.0, ECLIPSE2, height=0.15)
    assert higher is not None
    assert_allclose(np.degrees(higher), 14.48, atol=6e-3)
    assert first_direct_tilt(0.0, ECLIPSE, height=0.15) == pytest.approx(
        first_direct_tilt(0.0, ECLIPSE), abs=1e-10
    )


def test_driven_hinges_remove_type_2() -> None:
    """With the three R joints driven as well, sigma_min is constant: sqrt(3/2)."""
    position, rotation = random_poses(50, seed=15)
    inputs, q_r = of_mode(inverse(position, rotation, ECLIPSE))
    s, _, link = reciprocal_lines(inputs, q_r, ECLIPSE)
    jx = platform_jacobian(inputs, q_r, ECLIPSE, length=ECLIPSE.a)
    t = jx[:, :3, :3]
    third = np.cross(t, link)
    arm = (s - position[:, None]) / ECLIPSE.a
    rows = np.concatenate([third, np.cross(arm, third)], axis=-1)
    sigma = np.linalg.svd(np.concatenate([jx, rows], axis=1), compute_uv=False)
    assert_allclose(sigma[:, -1], np.sqrt(1.5), atol=1e-12)
