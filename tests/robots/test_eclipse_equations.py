"""Eclipse and Eclipse-II: the paper's equations (16) to (19), and what they say and do not say."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import Reference
from eclipse_cases import CASES, load, of_mode, posture, random_poses
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import closedchain as cc
from closedchain.robots.eclipse import (
    ECLIPSE,
    ECLIPSE2,
    Geometry,
    actuator_jacobian,
    determinant_arc,
    determinant_column,
    determinant_virtual,
    inverse,
    leg_pose,
    leg_screws,
    network,
    reciprocal_lines,
    trajectory,
    virtual_screws,
    wrist_angles,
)
from closedchain.robots.eclipse.davies import exact_joints


def random_legs(n: int, seed: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Inputs (6,), q_r (3,) and wrist angles (3, 3) at random: the loops need not close."""
    rng = np.random.default_rng(seed)
    return [
        (
            np.concatenate([rng.uniform(-3, 3, 3), rng.uniform(-0.3, 0.5, 3)]),
            rng.uniform(-3, 3, 3),
            rng.uniform(-1.5, 1.5, (3, 3)),
        )
        for _ in range(n)
    ]


def test_leg_of_the_reference(reference: Reference) -> None:
    (entry,) = reference("eclipse")["leg_samples"]
    theta, d, q, *wrist = entry["q"]
    inputs = [theta] * 3 + [d / 100] * 3
    position, rotation = leg_pose(inputs, [q] * 3, [wrist] * 3, ECLIPSE)
    end = np.array(entry["T_platform"])
    assert_allclose(rotation[0], end[:3, :3], atol=1e-12)
    assert_allclose(position[0], end[:3, 3] / 100, atol=1e-12)
    stored = np.array(entry["M"])
    stored[3:, [0, 2, 3, 4, 5]] /= 100  # moments of hinges in m; the column slides in m per m
    screws = leg_screws(inputs, [q] * 3, [wrist] * 3, ECLIPSE)
    assert_allclose(screws[0], stored, atol=1e-12)
    assert_allclose(np.linalg.det(screws[0]) * 1e4, entry["det"], atol=1e-9)


def test_equation_17() -> None:
    """Right, its sign included, per radian; an arc length as coordinate divides it by r_g."""
    for inputs, q_r, wrist in random_legs(50, seed=16):
        expected = determinant_column(q_r, wrist[:, 1], ECLIPSE)
        screws = leg_screws(inputs, q_r, wrist, ECLIPSE)
        assert_allclose(np.linalg.det(screws), expected, atol=1e-13)
        screws[:, :, 0] /= ECLIPSE.r_g
        assert_allclose(np.linalg.det(screws), expected / ECLIPSE.r_g, atol=1e-13)


def test_equation_18() -> None:
    """Right for every height of the guide's centre; columns per radian, although it has L_a."""
    for z_c in (0.0, 0.17):
        g = Geometry(r=0.17, z_c=z_c)
        for inputs, q_r, wrist in random_legs(50, seed=17):
            expected = determinant_arc(inputs[3], q_r[0], wrist[0, 1], g)
            screws = leg_screws(inputs, q_r, wrist, g)[0]
            assert_allclose(np.linalg.det(screws), expected, atol=1e-14)
            screws[:, :2] /= g.r_g
            assert_allclose(np.linalg.det(screws), expected / g.r_g**2, atol=1e-12)


def test_equation_19_and_the_virtual_chain() -> None:
    """Right as a determinant; the three M_1j are one matrix, as a phase turns no screw."""
    rng = np.random.default_rng(18)
    for _ in range(20):
        position, angles = rng.normal(size=3), rng.uniform(-3, 3, 3)
        screws = virtual_screws(position, angles)
        assert_allclose(np.linalg.det(screws), determinant_virtual(angles[1]), atol=1e-12)
        phased = virtual_screws(position, angles + np.array([0, 0, 2 * np.pi / 3]))
        assert_allclose(phased, screws, atol=1e-15)


def test_equation_16_is_no_block_diagonal() -> None:
    """One platform twist leads the three legs: N_p is 18 x 6, and only with a minus sign."""
    position, rotation = random_poses(5, seed=19)
    inputs, q_r = of_mode(inverse(position, rotation, ECLIPSE))
    for k in range(5):
        wrist = wrist_angles(inputs[k], q_r[k], rotation[k], ECLIPSE)
        legs = leg_screws(inputs[k], q_r[k], wrist, ECLIPSE)
        angles = Rotation.from_matrix(rotation[k]).as_euler("XYZ")
        lead = virtual_screws(position[k], angles)
        rates = np.linalg.solve(legs, lead)  # (3, 6, 6): joints of each leg per virtual joint
        h = 1e-6
        for virtual in range(6):
            ends = []
            for sign in (-1, 1):
                p, a = position[k].copy(), angles.copy()
                (p if virtual < 3 else a)[virtual % 3] += sign * h
                rot = Rotation.from_euler("XYZ", a).as_matrix()
                x, q = of_mode(inverse(p, rot, ECLIPSE))
                first = np.stack([x[:3], x[3:], q], axis=-1)
                ends.append(np.concatenate([first, wrist_angles(x, q, rot, ECLIPSE)], axis=-1))
            slope = (ends[1] - ends[0]) / (2 * h)
            assert_allclose(rates[:, :, virtual], slope, atol=1e-6 * max(1, np.abs(slope).max()))


def test_circulation_law() -> None:
    """N qdot = 0 (eqs 3 to 5) for the joint rates along eq. (20), by differences."""
    step = float(trajectory.TIMES[1])
    for g in (ECLIPSE, ECLIPSE2):
        joints = exact_joints(g)
        for k in (10, 40, 70):
            near = joints[[k - 2, k - 1, k + 1, k + 2]]
            rates = np.tensordot([1, -8, 8, -1], near, axes=1) / (12 * step)
            here = joints[k]
            legs = leg_screws([*here[:, 0], *here[:, 1]], here[:, 2], here[:, 3:], g)
            assert np.abs(network(legs) @ rates.ravel()).max() < 2e-5 * np.abs(rates).max()


def test_network_matrix_has_full_rank_in_all_examples(reference: Reference) -> None:
    """Rank 12 at every example of type 1, 2, 3: the mechanism gains no mobility."""
    for case in CASES:
        found = inverse(case.position, case.rotation, case.geometry)
        x, q_r = of_mode(found)
        wrist = wrist_angles(x, q_r, case.rotation, case.geometry)
        legs = leg_screws(x, q_r, wrist, case.geometry)
        legs[:, 3:] /= 0.1
        assert np.linalg.matrix_rank(network(legs)) == 12
        m, q = case.load()
        assert "constraint" not in cc.classify(m, q).kinds


def test_the_wrist_factor_is_no_property_of_the_robot() -> None:
    """prod D(M_j) = r^3 prod cos(q_y) det Jq: only rho and sin q_r are physical."""
    position, rotation = random_poses(40, seed=20)
    for g, sign in ((ECLIPSE, 1.0), (ECLIPSE2, 1.0)):
        inputs, q_r = of_mode(inverse(position, rotation, g))
        wrist = wrist_angles(inputs, q_r, rotation, g)
        jq = actuator_jacobian(inputs, q_r, g).prod(axis=-1)
        expected = sign * g.r**3 * np.cos(wrist[..., 1]).prod(axis=-1) * jq
        for k in range(40):
            product = np.linalg.det(leg_screws(inputs[k], q_r[k], wrist[k], g)).prod()
            assert_allclose(product, expected[k], rtol=1e-10)


def gimbal_lock() -> tuple[np.ndarray, np.ndarray]:
    """A pose at which leg a's hinges x and z are parallel: the plate square to its link."""
    position, rotation = np.array([0.01, 0.0, 0.12]), np.eye(3)
    for _ in range(40):  # turn the plate's z axis onto the link, which moves with the plate
        inputs, q_r = of_mode(inverse(position, rotation, ECLIPSE))
        link = -reciprocal_lines(inputs, q_r, ECLIPSE)[2][0]
        axis = np.cross(rotation[:, 2], link)
        angle = np.arctan2(np.linalg.norm(axis), rotation[:, 2] @ link)
        if angle < 1e-15:
            break
        rotation = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix() @ rotation
    return position, rotation


def test_refuted_q_y_is_no_inverse_singularity() -> None:
    """q_y = pi/2 makes D(M_a) = 0 (eq. 17), yet every platform velocity can be produced."""
    position, rotation = gimbal_lock()
    inputs, q_r = of_mode(inverse(position, rotation, ECLIPSE))
    wrist = wrist_angles(inputs, q_r, rotation, ECLIPSE)
    assert_allclose(wrist[0, 1], np.pi / 2, atol=1e-6)
    assert abs(determinant_column(q_r[0], wrist[0, 1], ECLIPSE)) < 1e-8
    assert np.abs(actuator_jacobian(inputs, q_r, ECLIPSE)).min() > 0.01
    m = load("eclipse")
    q = posture(m, position, rotation, inputs, q_r)
    assert cc.classify(m, q).kinds == frozenset()


def test_refuted_equation_19_is_no_direct_singularity() -> None:
    """phi_y = pi/2 at a regular posture; and a direct singularity with phi_y far from it."""
    m = load("eclipse")
    rotation = Rotation.from_euler("XYZ", [0.3, np.pi / 2, 0.1]).as_matrix()
    position = np.array([0.03, 0.02, 0.12])
    assert abs(determinant_virtual(np.pi / 2)) < 1e-15
    for phi in (-1.2, 0.4, np.pi / 2, 2.0):  # it is the determinant of M_1j all the same
        block = virtual_screws(position, np.array([0.3, phi, 0.1]))
        assert determinant_virtual(phi) == pytest.approx(np.linalg.det(block), abs=1e-12)
    found = inverse(position, rotation, ECLIPSE)
    assert found.exists.all()
    for k in range(8):
        q = posture(m, position, rotation, found.inputs[k], found.q_r[k])
        at = cc.classify(m, q)
        assert at.kinds == frozenset()
        assert at.sigma_direct > 1e-2
    (case,) = (case for case in CASES if case.name == "T2a")
    m, q = case.load()
    phi_y = Rotation.from_matrix(case.rotation).as_euler("XYZ")[1]
    assert abs(determinant_virtual(phi_y)) > 0.6
    assert cc.classify(m, q).kinds == {"direct"}


def test_conditions_that_the_lists_omit() -> None:
    """q_r = pi is singular too; with r = r_g the listed q_r = 0 and r cos q_r = r_g are one."""
    (stretched,) = (case for case in CASES if case.name == "T1d")
    m, q = stretched.load()
    assert cc.classify(m, q).kinds == {"inverse"}
    assert determinant_column(np.pi, 0.3, ECLIPSE) == pytest.approx(0.0, abs=1e-17)
    small = 1e-3
    triple = determinant_column(small, 0.0, ECLIPSE)
    assert triple == pytest.approx(-0.04 * small**3 / 2, rel=1e-6)
    beta = 0.4  # leg a with r = r_g: the third condition is q_r = 0 or q_r = -2 beta
    assert determinant_arc(beta, -2 * beta, 0.0, ECLIPSE2) == pytest.approx(0.0, abs=1e-17)
