"""Mobility, velocity, singularities and redundancy of D1 against its reference numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc

AXIS_TASK = "x y z rx rz"  # position of the tip and direction of the tool axis y


def pose(position: list[float], wxyz: list[float]) -> pin.SE3:
    w, x, y, z = wxyz
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position))


def at_platform_centre(m: cc.Mechanism, q: np.ndarray, twists: np.ndarray) -> np.ndarray:
    """Tip twists (6, k) moved to the platform's centre, angular part times 0.18 m as the sheet."""
    arm = m.pose(q, "platform").translation - m.point(q, "T")
    linear = twists[:3] - pin.skew(arm) @ twists[3:]
    return np.vstack([linear, 0.18 * twists[3:]])


def working_postures(m: cc.Mechanism, n: int, seed: int) -> list[np.ndarray]:
    """Closed postures of random input steps of at most 0.04 m from home."""
    rng = np.random.default_rng(seed)
    home = m.input_values(m.home)
    found = []
    for _ in range(n):
        step = rng.standard_normal(6)
        step *= 0.04 * rng.random() ** (1 / 6) / np.linalg.norm(step)
        found.append(cc.direct(m, home + step).raise_if_failed().q)
    return found


# -- mobility ------------------------------------------------------------------------------------


def test_count_is_the_papers_and_its_verdict_is_refuted(d1: cc.Mechanism) -> None:
    found = cc.mobility(d1)
    assert (found.links, found.pairs, found.freedoms, found.gruebler) == (21, 27, 48, 6)
    assert found.pair_counts == {"R": 6, "P": 9, "U": 3, "S": 9}
    # the paper concludes five degrees of freedom; the loops leave six
    assert found.generic_rank == 27
    assert found.mobility == 6
    assert found.redundant_rows == 0
    assert found.rank.above > 0.1
    assert "six-dimensional" in found.text
    assert "five degrees of freedom" in found.text.replace("\n", " ")


# -- velocity ------------------------------------------------------------------------------------


def test_twist_map_has_the_reference_singular_values(
    d1: cc.Mechanism, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    for name, row in reference("d1")["rank_table"].items():
        q = cc.direct(d1, row["q"]).raise_if_failed().q
        twist_map = cc.velocity(d1, q).twist_map
        assert twist_map is not None
        values = np.linalg.svd(at_platform_centre(d1, q, twist_map), compute_uv=False)
        assert_close(values, row["sv_twist"], tol.reference, name)
        rank = np.count_nonzero(values > 1e-6)
        assert rank == row["rank6"], name


def test_twist_of_the_reference_motion(
    d1: cc.Mechanism, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    sample = reference("d1")["kinematics"][0]
    q = cc.direct(d1, sample["q"]).raise_if_failed().q
    twist_map = cc.velocity(d1, q).twist_map
    assert twist_map is not None
    assert_close(
        twist_map @ np.array(sample["qd"]), sample["v_tip"] + sample["omega"], tol.reference
    )


@pytest.mark.parametrize("outputs", ["x y z rx ry rz", AXIS_TASK, "x y z", "ry"])
def test_velocity_equation_holds_and_matches_finite_differences(
    d1: cc.Mechanism, outputs: str, tol: Tolerances
) -> None:
    step = 1e-5
    for q in working_postures(d1, 4, seed=1):
        v = cc.velocity(d1, q, outputs)
        assert v.twist_map is not None
        assert_close(v.Jx @ v.twist_map, v.Jq, tol.algebra, "Jx T = Jq")
        inputs = d1.input_values(q)
        names = outputs.split()
        for i in range(6):
            ahead, behind = (
                d1.pose(cc.direct(d1, inputs + s * step * np.eye(6)[i], q).raise_if_failed().q)
                for s in (1, -1)
            )
            linear = (ahead.translation - behind.translation) / (2 * step)
            spin = pin.log3(ahead.rotation @ behind.rotation.T) / (2 * step)
            if sum(n.startswith("r") for n in names) < 3:
                spin = d1.pose(q).rotation.T @ spin
            expected = dict(zip(["x", "y", "z", "rx", "ry", "rz"], [*linear, *spin], strict=True))
            assert_close(v.twist_map[:, i], [expected[n] for n in names], tol.finite_difference)


def test_no_twist_map_where_the_inputs_do_not_determine_the_motion(
    d1: cc.Mechanism, reference: Callable[[str], Any]
) -> None:
    example = reference("d1")["singular"]["S1_flat"]
    q = singular_posture(d1, example)
    v = cc.velocity(d1, q)
    assert v.twist_map is None
    assert v.rank.value == 24  # three freedoms of the coupler, all inputs locked
    assert v.rank.gap > 1e6


def test_idle_spin_of_a_rod_does_no_harm() -> None:
    """A slider pulled by a rod between two spherical joints: the rod spins, the tip obeys."""
    rod = """<robot name="pull"><link name="base"/><link name="crank"/><link name="rod"/>
      <link name="slide"/>
      <joint name="q" type="revolute"><parent link="base"/><child link="crank"/>
        <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
      <joint name="rod_pose" type="floating"><parent link="base"/><child link="rod"/></joint>
      <joint name="s" type="prismatic"><parent link="base"/><child link="slide"/>
        <axis xyz="1 0 0"/><limit lower="0" upper="9" effort="1" velocity="1"/></joint>
      <constraint name="A" type="spherical"><parent link="crank"/><parent_origin xyz="0.3 0 0"/>
        <child link="rod"/><child_origin xyz="0 0 0"/></constraint>
      <constraint name="B" type="spherical"><parent link="slide"/><parent_origin xyz="0 0 0"/>
        <child link="rod"/><child_origin xyz="1 0 0"/></constraint>
      <transmission name="q"><joint name="q"/></transmission>
      <task base="base" tip="slide" outputs="x"/>
      <group_state name="home"><joint name="q" value="0.5"/>
        <joint name="rod_pose" value="0.26327477 0.14382766 0 0 0 -0.07210187 0.9973973"/>
        <joint name="s" value="1.25287765"/></group_state></robot>"""
    m = cc.load_urdf(rod)
    assert cc.mobility(m).mobility == 2
    angle = float(m.input_values(m.home)[0])
    found = cc.velocity(m, m.home)
    assert found.rank.value == m.passive_v.size - 1  # the spin
    # s = r cos q + sqrt(l^2 - r^2 sin^2 q)
    root = np.sqrt(1.0 - (0.3 * np.sin(angle)) ** 2)
    slope = -0.3 * np.sin(angle) - 0.09 * np.sin(angle) * np.cos(angle) / root
    assert found.twist_map is not None
    assert_close(found.twist_map, [[slope]], 1e-10)
    assert_close(found.Jx @ found.twist_map, found.Jq, 1e-10)
    motion = cc.acceleration(m, m.home, [2.0], [0.0])
    h = 1e-4
    ahead, here, behind = (cc.direct(m, [angle + s * h]).q[-1] for s in (1, 0, -1))
    assert_close(motion.tip_acceleration[0], 4.0 * (ahead - 2 * here + behind) / h**2, 1e-6)


def test_open_posture_is_refused(d1: cc.Mechanism) -> None:
    q = np.array(d1.home)
    q[d1.input_q[0]] += 0.01
    with pytest.raises(cc.ClosureError, match=r"not closed: closure 'leg1_S'.*open by 0\.01"):
        cc.velocity(d1, q)


# -- singularities -------------------------------------------------------------------------------


def singular_posture(m: cc.Mechanism, example: dict[str, Any]) -> np.ndarray:
    placed = {
        "coupler": pose(example["pB"], example["quatB"]),
        "platform": pose(example["pC"], example["quatC"]),
    }
    return cc.close(m, place=placed).raise_if_failed().q


@pytest.mark.parametrize(
    ("name", "kinds", "freedoms"),
    [
        ("S1_flat", {"direct", "inverse"}, 3),
        ("S2_leg_in_plane_45deg", {"direct", "inverse"}, 1),
        ("T1_home", {"inverse"}, 0),
    ],
)
def test_reference_examples_get_their_kinds(
    d1: cc.Mechanism,
    reference: Callable[[str], Any],
    tol: Tolerances,
    name: str,
    kinds: set[str],
    freedoms: int,
) -> None:
    example = reference("d1")["singular"][name]
    q = singular_posture(d1, example)
    assert_close(d1.input_values(q), example["q"], tol.reference)
    found = cc.classify(d1, q)
    assert found.kinds == kinds
    assert found.combined == ({"direct", "inverse"} <= kinds)
    assert found.free_twists.shape == (6, freedoms)
    sigma = {"direct": found.sigma_direct, "inverse": found.sigma_inverse}
    for kind, value in sigma.items():
        # ten orders of magnitude lie between singular and regular
        assert value < 1e-12 if kind in kinds else value > 3e-4


def test_limb_singularities(d1: cc.Mechanism) -> None:
    """A leg of length zero leaves its universal joint, or its revolute joint, free to turn."""
    home = d1.input_values(d1.home)
    platform = d1.pose(d1.home, "platform")
    # S4 onto U1: with the coupler free, the stage above it can follow
    onto_u1 = pin.SE3(platform.rotation, d1.point(d1.home, "U1") - np.array([0.18, 0.0, 0.0]))
    found = cc.close(d1, place={"platform": onto_u1}, fixed={"q4": 0.0})
    assert found.converged, found.message
    kinds = cc.classify(d1, found.q).kinds
    assert "inverse" in kinds
    assert abs(d1.input_values(found.q)[3]) < 1e-12
    assert home[3] > 0.5


def test_home_loses_the_rotation_about_the_base_normal(d1: cc.Mechanism) -> None:
    found = cc.classify(d1, d1.home)
    assert found.lost_twists.shape == (6, 1)
    assert_close(np.abs(found.lost_twists[:, 0]), [0, 0, 0, 0, 1, 0], 1e-10)


def test_which_postures_lose_a_rotation(d1: cc.Mechanism) -> None:
    """Untilted coupler: always. One stage tilted along a symmetry direction: yes. Generic: no."""
    home = d1.input_values(d1.home)
    cases = {
        "second stage alone": ([0, 0, 0, 0.02, -0.01, 0.005], True),
        "first stage, symmetry direction": ([0.03, 0, 0, 0, 0, 0], True),
        "first stage, generic": ([0.03, -0.015, 0.0, 0, 0, 0], False),
        "both stages": ([0.02, -0.01, 0.0, 0.02, 0.01, -0.02], False),
    }
    for name, (step, singular) in cases.items():
        q = cc.direct(d1, home + np.array(step)).raise_if_failed().q
        found = cc.classify(d1, q)
        assert ("inverse" in found.kinds) is singular, f"{name}: sigma {found.sigma_inverse:.3g}"


def test_axis_task_is_regular_where_the_six_output_task_is_not(d1: cc.Mechanism) -> None:
    found = cc.classify(d1, d1.home, AXIS_TASK)
    assert found.kinds == frozenset()
    assert found.det_inverse is None  # 32 rows, 33 columns
    assert found.outputs == tuple(AXIS_TASK.split())
    assert "regular" in found.text


def test_determinants_are_smooth_and_keep_their_sign_on_a_branch(d1: cc.Mechanism) -> None:
    home = cc.classify(d1, d1.home)
    assert home.det_direct is not None
    for q in working_postures(d1, 20, seed=3):
        found = cc.classify(d1, q)
        assert found.det_direct is not None
        assert np.sign(found.det_direct) == np.sign(home.det_direct)


# -- redundancy ----------------------------------------------------------------------------------


@pytest.mark.parametrize("outputs", [None, AXIS_TASK])
def test_null_space_at_home_slides_the_coupler(d1: cc.Mechanism, outputs: str | None) -> None:
    found = cc.redundancy(d1, d1.home, outputs)
    assert found.dimension == 1
    assert_close(found.inputs[:, 0], np.array([1, 1, 1, 0, 0, 0]) / np.sqrt(3), 1e-10)
    assert found.rank.value == 32
    assert found.rank.gap > 1e10
    motion = found.joints[:, 0]
    assert_close(cc.constraint_jacobian(d1, d1.home) @ motion, np.zeros(27), 1e-12)
    # the coupler moves along the base normal, the platform not at all
    joint = d1.model.joints[d1.model.getJointId("coupler_pose")]
    coupler = motion[joint.idx_v : joint.idx_v + 6]
    assert_close(np.delete(coupler, 1), np.zeros(5), 1e-12)
    assert abs(coupler[1]) > 0.5


def test_reference_null_space(
    d1: cc.Mechanism, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    sample = reference("d1")["kinematics"][0]
    q = cc.direct(d1, sample["q"]).raise_if_failed().q
    found = cc.redundancy(d1, q, AXIS_TASK)
    assert_close(found.inputs[:, 0], sample["task_null_space"], tol.reference)
    assert cc.redundancy(d1, q).dimension == 0


@pytest.mark.slow
def test_axis_task_leaves_one_freedom_in_the_working_range(d1: cc.Mechanism) -> None:
    # more tests would find nothing new: the smallest task singular value stays above 0.27 there
    for q in working_postures(d1, 1000, seed=4):
        found = cc.redundancy(d1, q, AXIS_TASK)
        assert found.dimension == 1
        assert found.rank.above > 0.05


def test_finite_self_motion_at_a_vertical_tool(d1: cc.Mechanism) -> None:
    """The null vector is not only instantaneous: q1 = q2 = q3 may move with the tool at rest."""
    home = d1.input_values(d1.home)
    tip = d1.pose(d1.home)
    for slide in (-0.1, -0.03, 0.05, 0.1):
        coupler = d1.pose(d1.home, "coupler")
        placed = {
            "coupler": pin.SE3(coupler.rotation, coupler.translation + np.array([0, slide, 0])),
            "platform": d1.pose(d1.home, "platform"),
        }
        q = cc.close(d1, place=placed).raise_if_failed().q
        assert_close(d1.input_values(q)[3:], home[3:], 1e-12)
        assert_close(d1.pose(q).homogeneous, tip.homogeneous, 1e-12)
