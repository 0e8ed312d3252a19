"""Section 5 of the D1 paper: velocity and acceleration by screws, as printed and as mended."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.robots.d1 import Pose, geometry, j1, j2, limb_rates, limb_screws, motion, rates
from closedchain.robots.d1.geometry import rotation_from_quaternion
from closedchain.robots.d1.rates import klein, lie

G = geometry()


@pytest.fixture(scope="module")
def sample(reference: Callable[[str], Any]) -> dict[str, Any]:
    stored: dict[str, Any] = reference("d1")["kinematics"][0]
    return stored


@pytest.fixture(scope="module")
def poses(sample: dict[str, Any]) -> tuple[Pose, Pose]:
    coupler, platform = (
        Pose(rotation_from_quaternion(np.array(sample[f"quat{n}"])), np.array(sample[f"p{n}"]))
        for n in "BC"
    )
    return coupler, platform


@pytest.fixture(scope="module")
def found(sample: dict[str, Any], poses: tuple[Pose, Pose]) -> rates.Motion:
    return motion(*poses, G, sample["qd"], sample["qdd"])


def working_motions(m: cc.Mechanism, n: int, seed: int) -> list[tuple[np.ndarray, ...]]:
    """Closed postures within 0.03 m of home with random rates and accelerations of the legs."""
    rng = np.random.default_rng(seed)
    home = m.input_values(m.home)
    steps = rng.uniform(-1.0, 1.0, (n, 6)) * 0.012
    found = [cc.direct(m, home + step).raise_if_failed().q for step in steps]
    return [(q, *rng.uniform(-0.1, 0.1, (2, 6))) for q in found]


def posed(m: cc.Mechanism, q: np.ndarray) -> tuple[Pose, Pose]:
    placed = [m.pose(q, name) for name in ("coupler", "platform")]
    return Pose(placed[0].rotation, placed[0].translation), Pose(
        placed[1].rotation, placed[1].translation
    )


def test_twists_and_accelerators_are_the_reference(
    found: rates.Motion, sample: dict[str, Any], tol: Tolerances
) -> None:
    for name in ("V_AB", "V_AC", "A_AB", "A_AC"):
        assert_close(getattr(found, name), sample[name], tol.reference, name)
    assert bool(found.regular)


def test_limb_rates_are_the_reference(
    found: rates.Motion, poses: tuple[Pose, Pose], sample: dict[str, Any], tol: Tolerances
) -> None:
    stored = sample["limb_rates"]
    twists = (found.V_AB, found.V_AC - found.V_AB, found.V_AC)
    names = ("RPS_active_t_R_P_S3", "RPS_passive", "UPS")
    for screws, twist, name in zip(limb_screws(*poses, G), twists, names, strict=True):
        values = limb_rates(screws, twist)
        back = (values[..., None] * screws).sum(axis=-2)
        assert_close(back, np.tile(twist, (3, 1)), 1e-12, f"eq. (19), {name}")
        assert_close(values, stored[name], tol.reference, name)


def test_auxiliary_joints_rest_in_rps_limbs_and_not_in_ups_limbs(
    found: rates.Motion, poses: tuple[Pose, Pose]
) -> None:
    """The paper marks the first screw of the UPS limbs, too, as one of rate zero."""
    ab, bc, ac = limb_screws(*poses, G)
    assert np.abs(limb_rates(ab, found.V_AB)[:, 0]).max() < 1e-12
    assert np.abs(limb_rates(bc, found.V_AC - found.V_AB)[:, 0]).max() < 1e-12
    assert np.abs(limb_rates(ac, found.V_AC)[:, 0]).max() > 0.1


def test_velocity_equations_hold_on_the_mechanism(d1: cc.Mechanism) -> None:
    """Eqs (22) to (28) with the twists of the loops, not of the equations themselves."""
    delta = np.block([[np.zeros((3, 3)), np.eye(3)], [np.eye(3), np.zeros((3, 3))]])
    for q, qd, qdd in working_motions(d1, 5, seed=1):
        coupler, platform = posed(d1, q)
        v_ab, v_ac = (body_twist(d1, q, qd, qdd, name) for name in ("coupler", "platform"))
        right = np.zeros(6)
        right[1::2] = qd[:3]
        assert_close(j1(coupler, G).T @ delta @ v_ab, right, 1e-12, "(22)")
        second = j2(coupler, platform, G)
        passive = second.T[3:]
        assert_close(klein(second.T[:3], v_ac), qd[3:], 1e-12, "(25)")
        assert_close(klein(passive, v_ac), klein(passive, v_ab), 1e-12, "(26)")
        right = np.concatenate([qd[3:], klein(passive, v_ab)])
        assert_close(second.T @ delta @ v_ac, right, 1e-12, "(27)")
        by_screws = motion(coupler, platform, G, qd, qdd)
        assert_close(by_screws.V_AB, v_ab, 1e-11, "(22) solved")
        assert_close(by_screws.V_AC, v_ac, 1e-11, "(27) solved")


def body_twist(
    m: cc.Mechanism, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, name: str
) -> np.ndarray:
    """(omega; v_O) of a body on a floating joint of the base."""
    joint = m.model.joints[m.model.getJointId(f"{name}_pose")]
    local = cc.acceleration(m, q, qd, qdd).qdot[joint.idx_v : joint.idx_v + 6]
    pose = m.pose(q, name)
    v, w = pose.rotation @ local[:3], pose.rotation @ local[3:]
    return np.concatenate([w, v + np.cross(pose.translation, w)])


def test_accelerations_by_screws_are_those_of_the_mechanism(d1: cc.Mechanism) -> None:
    for q, qd, qdd in working_motions(d1, 20, seed=2):
        by_screws = motion(*posed(d1, q), G, qd, qdd)
        by_loops = cc.acceleration(d1, q, qd, qdd)
        tip = d1.point(q, "T")
        w, v_o = np.split(by_screws.V_AC, 2)
        v = v_o + np.cross(w, tip)
        assert_close(by_loops.tip_twist, np.concatenate([v, w]), 1e-11)
        alpha, dual = np.split(by_screws.A_AC, 2)  # (15): a_O = dual + omega x v_O
        a = dual + np.cross(w, v_o) + np.cross(alpha, tip) + np.cross(w, np.cross(w, tip))
        assert_close(by_loops.tip_acceleration, np.concatenate([a, alpha]), 1e-11)


def test_a_batch_is_its_rows(d1: cc.Mechanism) -> None:
    rows = working_motions(d1, 4, seed=3)
    pairs = [posed(d1, q) for q, _, _ in rows]
    batch = [
        Pose(np.array([p[k].rotation for p in pairs]), np.array([p[k].position for p in pairs]))
        for k in (0, 1)
    ]
    qd, qdd = np.array([r[1] for r in rows]), np.array([r[2] for r in rows])
    together = motion(*batch, G, qd, qdd)
    for k, pair in enumerate(pairs):
        alone = motion(*pair, G, qd[k], qdd[k])
        for name in ("V_AB", "V_AC", "A_AB", "A_AC"):
            assert_close(getattr(together, name)[k], getattr(alone, name), 1e-12, name)
    assert together.regular.tolist() == [True] * 4


def test_printed_indices_of_34_and_35_are_wrong(
    found: rates.Motion, poses: tuple[Pose, Pose], sample: dict[str, Any]
) -> None:
    """Rows that the paper gives the reciprocal screw of limb 1 do not hold with it."""
    first, second = j1(poses[0], G).T, j2(*poses, G).T
    v_bc = found.V_AC - found.V_AB
    limbs = limb_screws(*poses, G)
    lie_ab, lie_bc, lie_ac = (
        lie_screws(screws, twist)
        for screws, twist in zip(limbs, (found.V_AB, v_bc, found.V_AC), strict=True)
    )
    qdd = np.array(sample["qdd"])
    # (34), row 4: leg of limb 2; printed leg of limb 1
    left = klein(first[3], found.A_AB)
    assert abs(left - (qdd[1] + klein(first[3], lie_ab[1]))) < 1e-9
    assert abs(left - (qdd[1] + klein(first[1], lie_ab[1]))) > 0.01
    # (35), rows 2 and 3: limbs 2 and 3; printed 1, with the Lie screw of limb 2 in both
    for row, printed_lie in ((1, 1), (2, 1)):
        left = klein(second[row], found.A_AC)
        assert abs(left - (qdd[3 + row] + klein(second[row], lie_ac[row]))) < 1e-9
        assert abs(left - (qdd[3 + row] + klein(second[0], lie_ac[printed_lie]))) > 1e-3
    # (35), row 5: passive limb 2; printed 1
    carried = found.A_AB + lie(found.V_AB, v_bc)
    left = klein(second[4], found.A_AC)
    assert abs(left - klein(second[4], carried + lie_bc[1])) < 1e-9
    assert abs(left - klein(second[3], carried + lie_bc[1])) > 0.1


def lie_screws(screws: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """Eq. (33) term by term."""
    total = np.zeros((3, 6))
    for i, values in enumerate(limb_rates(screws, twist)):
        for j in range(5):
            behind = sum(values[k] * screws[i, k] for k in range(j + 1, 6))
            total[i] += lie(values[j] * screws[i, j], behind)
    return total


def test_limb_accelerations_exist_for_the_accelerators(
    found: rates.Motion, poses: tuple[Pose, Pose]
) -> None:
    """Eq. (32) for every limb, and by it the rate of the auxiliary joint keeps still."""
    v_bc = found.V_AC - found.V_AB
    a_bc = found.A_AC - found.A_AB - lie(found.V_AB, v_bc)  # (31)
    for screws, twist, a, auxiliary in zip(
        limb_screws(*poses, G),
        (found.V_AB, v_bc, found.V_AC),
        (found.A_AB, a_bc, found.A_AC),
        (True, True, False),
        strict=True,
    ):
        lies = lie_screws(screws, twist)
        second = np.array([limb_rates(screws, a - part)[i] for i, part in enumerate(lies)])
        back = (second[..., None] * screws).sum(axis=-2) + lies
        assert_close(back, np.tile(a, (3, 1)), 1e-11)
        assert bool(np.abs(second[:, 0]).max() < 1e-11) is auxiliary


def test_singular_postures_are_said_to_be(reference: Callable[[str], Any]) -> None:
    for name, regular in (("S1_flat", False), ("S2_leg_in_plane_45deg", False), ("T1_home", True)):
        stored = reference("d1")["singular"][name]
        coupler, platform = (
            Pose(rotation_from_quaternion(np.array(stored[f"quat{n}"])), np.array(stored[f"p{n}"]))
            for n in "BC"
        )
        at = motion(coupler, platform, G, np.full(6, 0.1), np.zeros(6))
        assert bool(at.regular) is regular, name
        assert np.isfinite(at.A_AC).all()


def test_the_twists_of_the_platform_span_six_dimensions(d1: cc.Mechanism) -> None:
    """Eq. (30) writes the platform's twist with five components."""
    q = working_motions(d1, 1, seed=4)[0][0]
    pair = posed(d1, q)
    twists = np.array([motion(*pair, G, unit, np.zeros(6)).V_AC for unit in np.eye(6)])
    assert np.linalg.svd(twists, compute_uv=False)[-1] > 1e-5
    # of five outputs one freedom is left over, and it moves the platform about the sixth
    left = cc.redundancy(d1, q, "x y z rx rz")
    assert left.dimension == 1
    assert_close(np.linalg.norm(left.inputs[:, 0]), 1.0, 1e-12)
    joint = d1.model.joints[d1.model.getJointId("platform_pose")]
    rates = left.joints[joint.idx_v : joint.idx_v + 6, 0]
    turn, twist = d1.pose(q, "platform").rotation, left.inputs[:, 0] @ twists
    assert_close(turn @ rates[3:], twist[:3], 1e-10)
    assert_close((turn.T @ twist[:3])[[0, 2]], np.zeros(2), 1e-10)
    assert abs((turn.T @ twist[:3])[1]) > 1e-3
