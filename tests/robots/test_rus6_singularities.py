"""Singularities of rus6: the paper's factors against the generic ranks, and its false claims.

With beta as an input there are seven inputs for six outputs. Jq,i = 0 in a leg of M1 is then no
inverse singularity as long as beta can drive that leg (J'q,i not 0); with beta locked it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from conftest import Tolerances
from rus6_postures import (
    ALIGNED,
    INWARD_M1,
    G,
    at,
    configuration,
    on_axis,
    one,
    random_poses,
    stored,
)
from scipy.optimize import fsolve

import closedchain as cc
from closedchain.robots.rus6 import (
    Legs,
    Pose,
    det_jx,
    geometry,
    idle_beta_tip,
    inverse,
    j_beta,
    j_inputs,
    j_q,
    j_x,
    pencil_margin,
    platform_rates,
    pose_with_tip,
    posture,
    roots,
    rotation_ypr,
    stage_sigma,
    stretched_heights,
    stretched_tip,
)

BOTH, DIRECT, INVERSE, REGULAR = {"direct", "inverse"}, {"direct"}, {"inverse"}, set()
CLEAR = 1e-4  # share of the largest singular value that a regular posture keeps


@pytest.fixture(scope="module")
def ref(reference: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return reference("rus6")


@pytest.fixture(scope="module")
def coupled() -> cc.Mechanism:
    return cc.load("rus6")


@pytest.fixture(scope="module")
def locked() -> cc.Mechanism:
    return cc.load("rus6", variant="locked")


@pytest.fixture(scope="module")
def free() -> cc.Mechanism:
    return cc.load("rus6", variant="free")


def sigma(matrix: np.ndarray) -> float:
    """Smallest singular value over the largest."""
    values = np.linalg.svd(matrix, compute_uv=False)
    return float(values[-1] / values[0])


# --- the reference's singular examples ---------------------------------------------------------


def test_stored_examples_have_the_right_kinds(
    ref: dict[str, Any], coupled: cc.Mechanism, locked: cc.Mechanism
) -> None:
    """P is stored to 12 digits, of which the edge of a leg's reach leaves half."""
    expected = {
        "type1_Jq_M2_extended(LA,LB not collinear in 3D)": INVERSE,
        "counterexample_Jqprime0_Jq_nonzero_beta=0": REGULAR,
        "type2_default_yaw+": DIRECT,
        "type3_Jq0_and_Jx0_default": BOTH,
    }
    for name, kinds in expected.items():
        pose, beta, mode = stored(ref["singularities"][name])
        assert beta == 0.0
        for m in (coupled, locked):
            q, _ = at(m, pose, beta, mode)
            assert cc.classify(m, q, tolerance=1e-6).kinds == kinds, (name, m.inputs)
    for name in ref["home"]:
        pose, beta, mode = stored(ref["home"][name])
        q, _ = at(coupled, pose, beta, mode)
        assert cc.classify(coupled, q).kinds == REGULAR


def test_type_1_in_all_legs_of_a_stage(coupled: cc.Mechanism, free: cc.Mechanism) -> None:
    """One beta cannot stand in for three arms: M1 stretched is singular with and without it."""
    for leg, beta in ((3, 0.0), (0, np.pi / 3)):
        pose = on_axis(stretched_heights(G, leg, beta)[0])
        q, legs = at(coupled, pose, beta)
        stage = slice(0, 3) if leg == 0 else slice(3, 6)
        assert np.abs(j_q(legs)[stage]).max() < 1e-7
        assert np.abs(np.delete(j_q(legs), range(6)[stage])).min() > 0.04
        found = cc.classify(coupled, q, tolerance=1e-7)
        assert found.kinds == INVERSE
        assert found.lost_twists.shape[1] == (2 if leg == 0 else 3)
        # three betas can stand in for three arms
        q, _ = at(free, pose, beta)
        assert cc.classify(free, q, tolerance=1e-7).kinds == (REGULAR if leg == 0 else INVERSE)


def test_one_beta_cannot_stand_in_for_two_arms(coupled: cc.Mechanism, free: cc.Mechanism) -> None:
    """Legs 1 and 2 of M1 stretched, found by height and pitch; beta 60 degrees."""

    def reach(x: np.ndarray) -> np.ndarray:
        return inverse(on_axis(x[0], pitch=x[1], roll=0.05), np.pi / 3, G).reach[:2]

    height, pitch = fsolve(reach, [-0.7, 0.0], xtol=1e-12)
    pose = on_axis(height, pitch=pitch, roll=0.05)
    q, legs = at(coupled, pose, np.pi / 3)
    assert np.abs(j_q(legs)[:2]).max() < 1e-6
    assert np.abs(j_q(legs)[2:]).min() > 0.01
    assert np.abs(j_beta(legs)).min() > 0.01
    found = cc.classify(coupled, q, tolerance=1e-6)
    assert found.kinds == INVERSE
    assert found.lost_twists.shape[1] == 1
    q, _ = at(free, pose, np.pi / 3)
    assert cc.classify(free, q, tolerance=1e-6).kinds == REGULAR


def test_type_3_on_the_axis(coupled: cc.Mechanism) -> None:
    """M2 stretched while yaw makes the rods dependent: case (i) of the paper."""

    def height(yaw: float) -> float:
        # where M2 is stretched at this yaw, which is that of a platform drawn at psi4 - yaw
        return float(stretched_heights(geometry(psi4=-yaw), 3)[0])

    def determinant(t: np.ndarray) -> np.ndarray:
        return np.array([det_jx(inverse(on_axis(height(x), x), 0.0, G)) for x in t])

    (yaw,) = roots(determinant, np.radians([60.0, 65.0]))
    assert np.degrees(yaw) == pytest.approx(62.8244608349, abs=1e-5)
    assert height(yaw) == pytest.approx(-0.690679575271, abs=1e-7)
    q, legs = at(coupled, on_axis(height(yaw), yaw))
    assert np.abs(j_q(legs)[3:]).max() < 1e-7
    found = cc.classify(coupled, q, tolerance=1e-7)
    assert found.kinds == BOTH
    assert found.combined
    assert np.linalg.matrix_rank(j_x(legs), tol=1e-6) == 5


def test_figure_5_pencil() -> None:
    """Rods of M1 level and meeting on the axis: LB + r < LA + R lets that happen."""
    sizes = {"LA": 0.25, "LB": 0.25, "r": 0.12, "H": 0.05}
    g = geometry(**sizes)
    assert pencil_margin(g, 0.0)[0] == pytest.approx(-0.16)
    # rods level and radial: B at the height of C, at radius r + LB
    arm = np.arccos((g.r + g.LB - g.Rf - g.Rr) / g.LA)
    pose = on_axis(-g.LA * np.sin(arm) - g.h, yaw=np.pi / 6)
    assert pose.position[1] == pytest.approx(-0.333238075794, abs=1e-11)
    m = cc.load("rus6", variant="figure5")
    q, legs = at(m, pose, 0.0, g=g)
    np.testing.assert_allclose(legs.w[:3], -g.radial[:3], atol=1e-12)
    assert stage_sigma(legs)[0] < 1e-12
    assert np.abs(j_q(legs)).min() > 0.05
    assert cc.classify(m, q).kinds == DIRECT


def test_figure_6_all_links_vertical() -> None:
    """Case (ii): Jq = 0, J'q = 0 and det Jx = 0 at once; the loops are dependent there too."""
    # as drawn the arms are stretched and the robot is taut
    g = geometry(Rf=0.2, R2=0.2, r=0.2, H=1.58, **ALIGNED)
    legs = inverse(on_axis(-0.88), -np.pi / 2, g)
    assert np.abs(legs.reach).max() < 1e-12
    for zero in (j_q(legs), j_beta(legs)):
        assert np.abs(zero).max() < 1e-7
    assert np.linalg.matrix_rank(j_x(legs), tol=1e-6) == 3
    # legs exactly stretched, 0.7 = 0.2 + 0.5 m, reach, though rounding may say 2e-16 too far
    assert legs.closed
    assert (legs.reach < 0.0).any()
    sizes = {"Rf": 0.2, "R2": 0.2, "r": 0.2, "H": 1.58, "height": -0.88, **ALIGNED}
    taut = cc.load("rus6", beta=-np.pi / 2, **sizes)
    assert np.abs(cc.residual(taut, taut.home)).max() < 1e-12
    assert np.abs(taut.pose(taut.home).translation - [0.0, -0.88, 0.0]).max() < 1e-12
    found = cc.classify(taut, taut.home)
    assert found.kinds == {"direct", "inverse", "constraint"}
    assert max(found.sigma_direct, found.sigma_inverse, found.sigma_constraint) < 1e-12
    with pytest.raises(cc.DescriptionError, match=r"0\.7001 m from the foot.*out of reach"):
        cc.load("rus6", beta=-np.pi / 2, **sizes | {"H": 1.5801})
    # with the arms folded back the robot can leave the posture, so that its ranks mean something
    sizes = {"Rf": 0.2, "R2": 0.2, "r": 0.2, "H": 0.78, "height": -0.45, **ALIGNED}
    m = cc.load("rus6", **sizes)
    q, legs = at(m, on_axis(-0.48), -np.pi / 2, g=geometry(**sizes))
    for zero in (j_q(legs), j_beta(legs)):
        assert np.abs(zero).max() < 1e-7
    found = cc.classify(m, q, tolerance=1e-7)
    assert found.kinds == {"direct", "inverse", "constraint"}
    assert found.free_twists.shape[1] == found.lost_twists.shape[1] == 3


# --- zero sets: the factors against the generic definitions -------------------------------------


def postures_with_tip(
    leg: int, tip: Callable[[np.random.Generator], tuple[float, np.ndarray, float]], n: int
) -> Iterator[tuple[Pose, float, Legs]]:
    """Random postures whose leg ``leg`` stands as ``tip`` says (beta, C, arm); others regular."""
    rng = np.random.default_rng(leg)
    found = 0
    while found < n:
        beta, point, arm = tip(rng)
        pose = pose_with_tip(G, leg, point, rotation_ypr(*rng.uniform(-0.3, 0.3, 3)))
        legs = inverse(pose, beta, G)
        rest = np.delete(legs.reach, leg)
        if (rest < 0.03).any() or abs(det_jx(legs)) < 1e-3:
            continue
        alpha = np.array(legs.alpha)
        alpha[leg] = arm - G.carried(beta)[leg]  # exact, where the arc cosine is not
        found += 1
        yield pose, beta, posture(pose, alpha, beta, G)


@pytest.mark.parametrize("leg", range(6))
def test_stretched_leg(
    leg: int, coupled: cc.Mechanism, locked: cc.Mechanism, free: cc.Mechanism, tol: Tolerances
) -> None:
    """Jq,i = 0 alone: inverse with beta locked; with beta an input only in M2."""

    def tip(rng: np.random.Generator) -> tuple[float, np.ndarray, float]:
        arm, swing = rng.uniform(-2.2, -1.0), rng.uniform(-0.5, 0.5)
        return 0.0, stretched_tip(G, leg, 0.0, arm, swing, 1.0), arm

    for pose, beta, legs in postures_with_tip(leg, tip, 12):
        assert abs(j_q(legs)[leg]) < 1e-15
        assert np.abs(np.delete(j_q(legs), leg)).min() > 1e-3
        for m in (coupled, locked, free):
            found = cc.classify(m, configuration(m, pose, legs))
            singular = leg >= 3 or m is locked
            assert found.kinds == (INVERSE if singular else REGULAR)
            assert found.sigma_direct > CLEAR
            assert (found.sigma_inverse < tol.singular) == singular
        assert (sigma(j_inputs(legs)) < 1e-12) == (leg >= 3)
        assert beta == 0.0


@pytest.mark.parametrize("leg", range(3))
def test_idle_beta_in_one_leg_is_no_singularity(
    leg: int, coupled: cc.Mechanism, locked: cc.Mechanism, free: cc.Mechanism
) -> None:
    """J'q,i = 0 alone: beta does not reach that leg, and nothing is lost."""

    def tip(rng: np.random.Generator) -> tuple[float, np.ndarray, float]:
        line, swing = rng.uniform(-2.4, -1.2), rng.uniform(-0.3, 0.3)
        point = idle_beta_tip(G, leg, 0.0, line, swing, (-1, 1))
        offset = G.Rr * np.sin(line)
        reach = G.Rr * np.cos(line) - np.sqrt(G.LA**2 - offset**2)
        arm = np.arctan2(reach * np.sin(line), reach * np.cos(line) - G.Rr)
        return 0.0, point, arm

    for pose, _, legs in postures_with_tip(leg, tip, 12):
        assert abs(j_beta(legs)[leg]) < 1e-15
        assert abs(j_q(legs)[leg]) > 1e-3
        alone = j_q(legs)[leg] * np.eye(7)[leg]  # of all inputs the leg's own moves it
        assert np.abs(j_inputs(legs)[leg] - alone).max() < 1e-15
        for m in (coupled, locked, free):
            assert cc.classify(m, configuration(m, pose, legs)).kinds == REGULAR
        rest = cc.redundancy(coupled, configuration(coupled, pose, legs)).inputs[:, 0]
        assert abs(rest[leg]) < 1e-12  # the arm stands still while beta turns
        assert abs(rest[6]) > 0.1


@pytest.mark.parametrize("leg", range(3))
def test_link_arm_and_rod_in_line(leg: int, coupled: cc.Mechanism, free: cc.Mechanism) -> None:
    """J'q,i = Jq,i = 0: inverse whatever beta is; the paper's cases of Rr, LA, LB in line."""

    def tip(rng: np.random.Generator) -> tuple[float, np.ndarray, float]:
        beta, swing = rng.uniform(-1.9, -1.3), rng.uniform(-0.2, 0.2)
        arm = beta + np.pi  # folded back over the link, the rod back over the arm
        return beta, stretched_tip(G, leg, beta, arm, swing, -1.0), arm

    for pose, _, legs in postures_with_tip(leg, tip, 12):
        assert abs(j_q(legs)[leg]) < 1e-15
        assert abs(j_beta(legs)[leg]) < 1e-15
        for m in (coupled, free):
            assert cc.classify(m, configuration(m, pose, legs)).kinds == INVERSE


def test_dependent_rods(coupled: cc.Mechanism, locked: cc.Mechanism, tol: Tolerances) -> None:
    """det Jx = 0 on yaw roots from random postures: direct, with the twist that Jx lets free."""
    poses, beta = random_poses(30, share=0.6)
    for i in range(30):
        base = one(poses, i)

        def turned(t: np.ndarray, base: Pose = base) -> Pose:
            p = np.broadcast_to(base.position, (*t.shape, 3))
            return Pose(rotation_ypr(t) @ base.rotation, p)

        angle = beta[i] if i % 2 else 0.0

        def determinant(t: np.ndarray, angle: float = angle) -> np.ndarray:
            return det_jx(inverse(turned(t), angle, G))

        t = np.radians(np.arange(-100.0, 100.5, 5.0))
        true = np.linalg.det(j_x(inverse(turned(t), angle, G)))
        np.testing.assert_allclose(determinant(t), true, atol=1e-12)
        found = roots(determinant, t)
        assert found.size == 2
        for x in found:
            pose = turned(np.array(x))
            for m in (coupled, locked) if angle == 0.0 else (coupled,):
                q, legs = at(m, pose, angle)
                assert legs.closed
                c = cc.classify(m, q)
                assert c.kinds == DIRECT
                assert c.sigma_direct < tol.singular
                assert cc.velocity(m, q).twist_map is None
                v, omega = c.free_twists[:3, 0], c.free_twists[3:, 0]
                state = np.r_[omega, v - np.cross(omega, pose.position)]
                assert np.abs(platform_rates(legs) @ state).max() < 1e-9


def test_regular_where_no_factor_vanishes(coupled: cc.Mechanism) -> None:
    poses, beta = random_poses(60, seed=11)
    for i in range(60):
        mode = INWARD_M1 if i % 2 else (1.0,) * 6
        q, legs = at(coupled, one(poses, i), beta[i], mode)
        if min(abs(det_jx(legs)) * 10, sigma(j_inputs(legs))) < 1e-3:
            continue
        c = cc.classify(coupled, q)
        assert c.kinds == REGULAR
        assert min(c.sigma_direct, c.sigma_inverse, c.sigma_constraint) > CLEAR
