"""Claims of the paper on rus6 that are false, each with its counterexample."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from rus6_postures import ALIGNED, INWARD_M1, G, at, on_axis

import closedchain as cc
from closedchain.robots.rus6 import (
    Legs,
    Pose,
    det_jx,
    geometry,
    inverse,
    j_beta,
    j_q,
    j_x,
    pencil_margin,
    roots,
    rotation_ypr,
    stage_sigma,
    stretched_heights,
)

DIRECT, INVERSE, REGULAR = {"direct"}, {"inverse"}, set()


@pytest.fixture(scope="module")
def coupled() -> cc.Mechanism:
    return cc.load("rus6")


def angle_between_arm_and_rod(legs: Legs, leg: int) -> float:
    """Degrees."""
    arm = (legs.B - legs.A)[leg] / legs.geometry.LA
    return float(np.degrees(np.arccos(np.clip(abs(arm @ legs.w[leg]), 0.0, 1.0))))


@pytest.mark.parametrize(
    ("height", "beta", "lever"),
    [(-0.392926348539, 0.0, 0.0778158), (-0.744039741858, np.radians(20.0), 0.0719354)],
)
def test_idle_beta_does_not_imply_stretched_arms(
    height: float, beta: float, lever: float, coupled: cc.Mechanism
) -> None:
    """Claim: det J'q = 0 implies det Jq = 0. Here J'q = 0 in all of M1 and the rest is regular."""
    q, legs = at(coupled, on_axis(height), beta, INWARD_M1)
    assert np.abs(j_beta(legs)).max() < 1e-11
    np.testing.assert_allclose(np.abs(j_q(legs)[:3]), lever, atol=1e-6)
    assert angle_between_arm_and_rod(legs, 0) > 20.0
    assert cc.classify(coupled, q).kinds == REGULAR
    # what it means: beta turns alone, the arms and the platform stand still
    rest = cc.redundancy(coupled, q)
    np.testing.assert_allclose(np.abs(rest.inputs[:, 0]), [0, 0, 0, 0, 0, 0, 1], atol=1e-9)
    # in the leg's plane F, B and C' are in line, A is not
    back = (legs.B[:3] - G.F) @ np.eye(3)
    rods = legs.w[:3]
    moments = (np.cross(back, rods) * legs.u[:3]).sum(-1)
    assert np.abs(moments).max() < 1e-11
    link = legs.A[:3] - G.F
    assert np.abs((np.cross(link, rods) * legs.u[:3]).sum(-1)).min() > 0.02


def test_stretched_arms_do_not_imply_idle_beta() -> None:
    """The converse fails as well: Jq = 0 in M1 while J'q is not."""
    legs = inverse(on_axis(stretched_heights(G, 0, np.pi / 3)[0]), np.pi / 3, G)
    assert np.abs(j_q(legs)[:3]).max() < 1e-7
    np.testing.assert_allclose(j_beta(legs), -0.0308, atol=5e-5)


def test_type_1_does_not_need_arm_and_rod_in_line(coupled: cc.Mechanism) -> None:
    """Claim: Jq,i = 0 means LA and LB collinear. They are so in the leg's plane only."""
    q, legs = at(coupled, on_axis(stretched_heights(G, 3)[0]))
    assert cc.classify(coupled, q, tolerance=1e-7).kinds == INVERSE
    angle = angle_between_arm_and_rod(legs, 3)
    assert angle == pytest.approx(10.37, abs=0.01)
    assert np.sin(np.radians(angle)) == pytest.approx(abs(legs.w[3] @ legs.u[3]), abs=1e-7)


PENCILS = [
    # stage, mode, P, rotation vector
    (0, INWARD_M1, [0.2988272756164, -0.44274403650703, -0.17805317464728],
     [-0.28611033855412, 0.51989004826211, -0.63665240395837]),
    (0, (1,) * 6, [0.32042081687498, 0.24172954412475, -0.1716434435947],
     [0.23596754249132, 0.48760953884902, 0.88297102273892]),
    (1, (1,) * 6, [0.35629958993439, 0.23616664854165, 0.22554007052078],
     [-0.24199884296632, -0.51444742730398, 0.59476186110738]),
]  # fmt: skip


@pytest.mark.parametrize(("stage", "mode", "P", "turn"), PENCILS)
def test_the_margin_does_not_rule_out_pencils(
    stage: int, mode: Any, P: list[float], turn: list[float], coupled: cc.Mechanism
) -> None:
    """Claim: LB + r > LA + R keeps a stage's rods independent."""
    np.testing.assert_allclose(pencil_margin(G, 0.0), [0.20, 0.18], atol=1e-15)
    q, legs = at(coupled, Pose(pin.exp3(np.array(turn)), np.array(P)), 0.0, mode)
    assert legs.closed
    assert stage_sigma(legs)[stage] < 1e-10
    assert stage_sigma(legs)[1 - stage] > 0.2
    assert cc.classify(coupled, q).kinds == DIRECT
    # coplanar, and the three lines meet in one point
    w, c = legs.w[3 * stage : 3 * stage + 3], legs.C[3 * stage : 3 * stage + 3]
    normal = np.linalg.svd(w)[2][2]
    assert np.abs(w @ normal).max() < 1e-10
    assert np.abs((c - c[0]) @ normal).max() < 1e-10
    across = np.eye(3) - w[:, :, None] * w[:, None, :]
    apex = np.linalg.solve(across.sum(axis=0), (across @ c[..., None]).sum(axis=0))[:, 0]
    assert np.linalg.norm(np.cross(apex - c, w), axis=-1).max() < 1e-10
    assert np.linalg.norm(np.cross(w, np.roll(w, 1, axis=0)), axis=-1).min() > 0.02


def test_the_margin_does_not_rule_out_direct_singularities(coupled: cc.Mechanism) -> None:
    """Claim: sizes can avoid them all. Home mode, positive margins, both stages independent."""
    turns = {"yaw": (87.5923188294, -84.853552183), "pitch": (40.5006836262,)}
    for axis, (name, degrees) in enumerate({**turns, "roll": (42.695811785,)}.items()):

        def determinant(t: np.ndarray, axis: int = axis) -> np.ndarray:
            turn = rotation_ypr(*(t if i == axis else 0.0 * t for i in range(3)))
            place = np.broadcast_to([0.0, -0.55, 0.0], (len(t), 3))
            return det_jx(inverse(Pose(turn, place), 0.0, G))

        found = np.degrees(roots(determinant, np.radians(np.arange(-100.0, 101.0, 5.0))))
        for angle in degrees:
            assert np.abs(found - angle).min() < 1e-8
            q, legs = at(coupled, on_axis(-0.55, **{name: np.radians(angle)}))
            assert (pencil_margin(G, 0.0) > 0.17).all()
            assert (stage_sigma(legs) > 0.85).all()
            assert np.linalg.matrix_rank(j_x(legs), tol=1e-9) == 5
            assert cc.classify(coupled, q).kinds == DIRECT


def rods_moment_about_y(legs: Legs) -> np.ndarray:
    return np.asarray(j_x(legs)[..., 4, :])


def test_aligned_stages_need_not_coincide() -> None:
    """Claim: the special case needs coinciding triangles. Aligned azimuths are enough."""
    g = geometry(**ALIGNED)
    m = cc.load("rus6", **ALIGNED)
    assert len({g.Rf, g.R2, g.r}) == 3
    for height in (-0.6, -0.55, -0.45):
        q, legs = at(m, on_axis(height), 0.1, g=g)
        assert np.abs(rods_moment_about_y(legs)).max() < 1e-15
        found = cc.classify(m, q)
        assert found.kinds == DIRECT
        spin = found.free_twists[:, 0]
        np.testing.assert_allclose(spin / spin[4], [0, 0, 0, 0, 1, 0], atol=1e-9)


def test_offset_stages_avoid_it_for_a_prism_only() -> None:
    """theta_i other than theta_(i+3) helps where psi_i = psi_(i+3)."""
    legs = inverse(on_axis(-0.55), 0.0, G)
    assert abs(det_jx(legs)) > 1e-2
    follows = geometry(psi1=G.theta1, psi4=G.theta4)
    assert abs(det_jx(inverse(on_axis(-0.55), 0.0, follows))) < 1e-16


def test_idle_beta_and_dependent_rods_can_meet() -> None:
    """Claim: det J'q = det Jx = 0 with Jq regular cannot exist."""
    g = geometry(**ALIGNED)
    m = cc.load("rus6", **ALIGNED)

    def lever(height: np.ndarray) -> np.ndarray:
        position = np.stack([0 * height, height, 0 * height], axis=-1)
        return j_beta(inverse(Pose(np.eye(3), position), 0.0, g, INWARD_M1))[..., 0]

    (height,) = roots(lever, np.linspace(-0.45, -0.38, 8))
    assert height == pytest.approx(-0.410845645745, abs=1e-11)
    q, legs = at(m, on_axis(height), 0.0, INWARD_M1, g)
    assert np.abs(j_beta(legs)).max() < 1e-14
    assert np.abs(j_q(legs)).min() > 0.07
    assert np.linalg.matrix_rank(j_x(legs), tol=1e-9) == 5
    found = cc.classify(m, q)
    assert found.kinds == DIRECT  # no output is lost: J'q = 0 by itself is no singularity
