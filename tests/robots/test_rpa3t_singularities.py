"""Singularities of rpa3t: the generic definitions against the factors of det A and det B."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rpa3t_postures as postures
from conftest import assert_close
from rpa3t_postures import WIDE, G, Posture, configuration, sample

import closedchain as cc
from closedchain.analysis.singularity.maps.grid import NONE_FOUND, OK
from closedchain.robots import rpa3t

MM = np.array([1e-3, 1e-3, 1.0])
ROOT = 1e-6  # share of a singular value on a set that is known to the root of rounding


@pytest.fixture(scope="module")
def m() -> cc.Mechanism:
    return cc.load("rpa3t")


@pytest.fixture(scope="module")
def examples() -> dict[str, Any]:
    path = Path(__file__).parents[1] / "reference" / "rpa3t.json"
    found: dict[str, Any] = json.loads(path.read_text())["singular_examples"]
    return found


def posture(m: cc.Mechanism, example: dict[str, Any]) -> np.ndarray:
    return configuration(m, np.array(example["q"]) * MM, np.array(example["theta"]))


# --- examples ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("T1_cosb", {"inverse"}),
        ("T2_sinb", {"direct"}),
        ("T3_sinb_s1", {"direct", "inverse"}),
        ("paper_spurious_xC0", set()),
    ],
)
def test_reference_examples(
    m: cc.Mechanism, examples: dict[str, Any], name: str, kinds: set[str]
) -> None:
    q = posture(m, examples[name])
    assert np.abs(cc.residual(m, q)).max() < 1e-13
    found = cc.classify(m, q)
    assert found.kinds == kinds
    lost_rank = {
        "direct": 17 - examples[name]["rank_tree_passive_block"],
        "inverse": 20 - examples[name]["rank_tree_stack_Jc_JP"],
    }
    assert {kind for kind, lost in lost_rank.items() if lost} == kinds
    assert found.free_twists.shape[1] == lost_rank["direct"]
    assert found.lost_twists.shape[1] == lost_rank["inverse"]
    assert (cc.velocity(m, q).twist_map is None) == ("direct" in kinds)
    assert cc.redundancy(m, q).dimension == lost_rank["inverse"]


def test_beta_of_half_pi_is_no_direct_singularity(
    m: cc.Mechanism, examples: dict[str, Any]
) -> None:
    """The text before the case study: det A vanishes at beta = 0 and pi, not at +-pi/2."""
    at_half = examples["T1_cosb"]
    q, theta = np.array(at_half["q"]) * MM, np.array(at_half["theta"])
    assert abs(q[2]) == pytest.approx(np.pi / 2)
    assert abs(rpa3t.det_parallel(q, theta, G)) > 0.04
    found = cc.classify(m, posture(m, at_half))
    assert "direct" not in found.kinds
    assert_close(np.abs(found.lost_twists[:, 0]), [0.0, 1.0, 0.0], 1e-9, "lost: y")
    flat = cc.classify(m, posture(m, examples["T2_sinb"]))
    assert flat.kinds == {"direct"}
    twist = flat.free_twists[:, 0] / np.linalg.norm(flat.free_twists[:, 0])
    assert_close(np.abs(twist), [0, 1, 0, 0, 0, 0], 1e-9, "free: y")


def test_x_c1_zero_is_regular_in_the_whole_mechanism(m: cc.Mechanism) -> None:
    """Printed (16) has the factor x_C1."""
    rng = np.random.default_rng(0)
    regular = 0
    for _ in range(40):
        q = np.array([0.0, rng.uniform(-0.8, -0.4), rng.uniform(-1.2, -0.3)])
        theta, real = rpa3t.arm_angles(q, np.array([1.0, -1.0, 1.0]), G)
        if real.all():
            found = cc.classify(m, configuration(m, q, theta))
            assert found.kinds == frozenset()
            # of joint rates of size 1, all joints counted: 0.0154 at home
            assert found.sigma_direct > 5e-3
            regular += 1
    assert regular > 30


# --- the sets ---------------------------------------------------------------------------------

SETS: dict[str, tuple[Callable[[], list[Posture]], set[str]]] = {
    "sin_beta": (lambda: postures.on_sin_beta(25), {"direct"}),
    "M": (lambda: postures.on_parallel_rods(25), {"direct"}),
    "kappa": (lambda: postures.on_kappa(25), {"direct"}),
    "cos_beta": (lambda: postures.on_cos_beta(25), {"inverse"}),
    "s1": (lambda: postures.on_aligned(1, 25), {"inverse"}),
    "s2": (lambda: postures.on_aligned(2, 25), {"inverse"}),
    "s3": (lambda: postures.on_aligned(3, 25), {"inverse"}),
    # rank K drops: link 3' turns about y with the inputs locked, and no output is lost
    "drop": (lambda: postures.on_level_rods(25), {"constraint", "direct"}),
}


@pytest.mark.parametrize("factor", SETS)
def test_every_factor_gives_its_kind(m: cc.Mechanism, factor: str) -> None:
    draw, kinds = SETS[factor]
    for q, theta in draw():
        assert abs(float(getattr(rpa3t.factors(q, theta, G), factor))) < 1e-7
        x = configuration(m, q, theta)
        assert np.abs(cc.residual(m, x)).max() < 1e-12
        assert cc.classify(m, x, tolerance=ROOT).kinds == kinds


def test_without_a_vanishing_factor_postures_are_regular(m: cc.Mechanism) -> None:
    """The other direction, on all modes of random poses: the zero sets are equal."""
    found = rpa3t.inverse(sample(WIDE, 400, seed=1), G)
    f = rpa3t.factors(found.q, found.theta, G)
    direct = np.abs(f.sin_beta * f.kappa * f.M)
    inverse = np.abs(f.s1 * f.s2 * f.s3 * f.cos_beta)
    tested = 0
    for i, mode in np.argwhere(found.real)[::7]:
        c = cc.classify(m, configuration(m, found.q[i, mode], found.theta[i, mode]))
        # singular values and products of factors vanish together, at the same rate
        assert 0.1 < c.sigma_direct / direct[i, mode] < 1000.0
        assert 0.1 < c.sigma_inverse / inverse[i, mode] < 1e4
        assert c.sigma_constraint > 0.05
        assert c.kinds == frozenset()
        tested += 1
    assert tested > 500


def test_kappa_zero_is_a_finite_self_motion(m: cc.Mechanism) -> None:
    """Inputs locked, P runs around a whole circle of radius l7: direct all along."""
    theta3 = 0.2
    circle = rpa3t.self_motion(theta3, np.linspace(-np.pi, np.pi, 13), G)
    theta, real = rpa3t.arm_angles(circle[0], np.array([1.0, -1.0, 1.0]), G)
    assert real[:2].all()
    theta[2] = theta3
    seen = []
    for q in circle:
        x = configuration(m, q, theta)
        assert np.abs(cc.residual(m, x)).max() < 1e-13
        assert_close(m.input_values(x), theta, 1e-14)
        c = cc.classify(m, x)
        assert "direct" in c.kinds
        assert ("inverse" in c.kinds) == (abs(np.cos(q[2])) < 1e-9)
        seen.append(m.point(x, "P"))
    centre = np.array([circle[0, 0] + G.l2, 0.0, circle[0, 1] + 2 * G.l6])
    assert_close(np.linalg.norm(seen - centre, axis=1), np.full(13, G.l7), 1e-14)
    assert np.ptp(seen, axis=0)[1] > 1.9 * G.l7


def test_level_rods_are_seen_by_the_whole_model_only(m: cc.Mechanism) -> None:
    """The 3 x 3 determinants are regular there, yet link 3' may start to turn about y."""
    turns = 0
    for q, theta in postures.on_level_rods(10, seed=2):
        f = rpa3t.factors(q, theta, G)
        if min(abs(float(x)) for x in (f.sin_beta, f.kappa, f.M, f.s1, f.s2, f.s3)) < 0.02:
            continue
        x = configuration(m, q, theta)
        k = cc.constraint_jacobian(m, x)
        motions = np.linalg.svd(k)[2][11:].T
        assert motions.shape[1] == 4
        pin_jacobian = _angular_velocity(m, x, "link3p") @ motions
        assert np.abs(pin_jacobian[1]).max() > 0.01
        assert np.abs(pin_jacobian[[0, 2]]).max() < 1e-9
        turns += 1
    assert turns > 2


def _angular_velocity(m: cc.Mechanism, q: np.ndarray, link: str) -> np.ndarray:
    import pinocchio as pin

    data = m.model.createData()
    pin.computeJointJacobians(m.model, data, q)
    pin.updateFramePlacements(m.model, data)
    frame = m.model.getFrameId(link)
    return np.asarray(pin.getFrameJacobian(m.model, data, frame, pin.LOCAL_WORLD_ALIGNED)[3:])


# --- maps with redundant rows -----------------------------------------------------------------

OVER = {"theta1": np.linspace(-0.45, -0.25, 21), "theta3": np.linspace(-0.2, 0.4, 21)}


@pytest.fixture(scope="module")
def cells(m: cc.Mechanism) -> dict[str, np.ndarray]:
    found = cc.singularity_map(m, OVER, progress=False, keep_q=True)
    return {str(name): array.to_numpy() for name, array in found.data_vars.items()}


@pytest.mark.slow
def test_map_keeps_to_the_branch_of_home(m: cc.Mechanism, cells: dict[str, np.ndarray]) -> None:
    one, three = np.meshgrid(*OVER.values(), indexing="ij")
    theta = np.stack([one, np.full_like(one, m.input_values(m.home)[1]), three], axis=-1)
    exact = rpa3t.direct(theta, G)
    ok = cells["status"] == OK
    assert (ok == exact.real[..., 1]).all()  # y < 0, M > 0
    assert ok.sum() > 100
    for q, position in zip(cells["q"][ok], exact.position[ok, 1], strict=True):
        assert_close(m.point(q, "P"), position, 1e-10)
    determinant = cells["det_inverse"][ok]
    f = rpa3t.factors(exact.q[..., 1, :], theta, G)
    signs = np.sign(determinant * (f.cos_beta * f.s1 * f.s2 * f.s3)[ok])
    assert abs(signs.sum()) == signs.size


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "vanishes", "pieces"), [("direct", np.sin, 2), ("inverse", np.cos, 1)]
)
def test_singular_curves_are_those_of_the_factors(
    m: cc.Mechanism,
    kind: str,
    vanishes: Callable[[float], float],
    pieces: int,
) -> None:
    found = cc.singularity_set(m, kind, OVER, check=False).of_branch()
    assert found.dropped == 0
    assert len(found.pieces) == pieces
    assert len(found.q) > 30
    index = m.model.joints[m.model.getJointId("R12")].idx_q
    assert np.abs(vanishes(found.q[:, index])).max() < 1e-6


@pytest.mark.slow
def test_mirrored_joints_are_no_other_branch(cells: dict[str, np.ndarray]) -> None:
    """Beyond the branch of home the loops close only with R33 turned over, which is no posture."""
    assert set(np.unique(cells["status"])) == {OK, NONE_FOUND}
