"""The closed-form position kinematics of D1 against stored numbers and against themselves."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from closedchain.robots import elimination
from closedchain.robots.d1.geometry import (
    NORMAL,
    RADIAL,
    TANGENT,
    VARIANTS,
    Geometry,
    Pose,
    geometry,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from closedchain.robots.d1.position import (
    MODE_PAIRS,
    Assembly,
    forward,
    inverse,
    leg_lengths,
    stage1,
    stage1_polynomial,
    stage2,
)
from closedchain.robots.d1.screws import j1, j2, planes1, planes2, scaled_screws
from closedchain.robots.d1.selfmotion import vertical_tool_quaternions
from closedchain.robots.elimination import three_points_on_circles
from closedchain.urdf.errors import DescriptionError

G = geometry()
REFERENCE = Path(__file__).parents[1] / "reference" / "d1.json"
SEED = 20100301


@pytest.fixture(scope="module")
def ref() -> dict[str, Any]:
    data: dict[str, Any] = json.loads(REFERENCE.read_text())
    return data


def pose(quaternion: Any, position: Any) -> Pose:
    return Pose(rotation_from_quaternion(np.array(quaternion)), np.array(position))


def state(entry: dict[str, Any]) -> tuple[Pose, Pose]:
    return pose(entry["quatB"], entry["pB"]), pose(entry["quatC"], entry["pC"])


def residuals(assembly: Assembly, g: Geometry = G) -> np.ndarray:
    """Left minus right sides of eqs (2), (3), (4), (7) as printed (m^2)."""
    s, s4 = assembly.coupler.points(g.s_B), assembly.platform.points(g.c_C)
    r, r4 = g.R, assembly.coupler.points(g.r_B)
    q = assembly.q
    rows = []
    for points, feet, ends, lengths, sides in (
        (s, r, r, q[:3], g.sides_S),
        (s4, r4, g.U, q[3:], g.sides_S4),
    ):
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            rows.append((points[i] - feet[i]) @ (feet[j] - feet[k]))
            rows.append((points[i] - ends[i]) @ (points[i] - ends[i]) - lengths[i] ** 2)
            rows.append((points[i] - points[j]) @ (points[i] - points[j]) - sides[i] ** 2)
    return np.array(rows)


HOME_Q = leg_lengths(G.home_coupler, G.home_platform, G)


# --- geometry ---------------------------------------------------------------------------------


def test_geometry_matches_the_reference(ref: dict[str, Any]) -> None:
    stored = ref["geometry"]
    for name, value in (
        ("R1_3", G.R),
        ("U1_3", G.U),
        ("s_B", G.s_B),
        ("r_B", G.r_B),
        ("c_C", G.c_C),
        ("tip_C", G.tip_C),
    ):
        np.testing.assert_allclose(value, stored[name], atol=1e-12)
    np.testing.assert_allclose(HOME_Q, ref["home"]["q"], atol=1e-12)


@pytest.mark.parametrize("name", ["printed_u", "circle_u"])
def test_variants(ref: dict[str, Any], name: str) -> None:
    g = geometry(name)
    np.testing.assert_allclose(g.U, ref["geometry"]["variants_U"][name], atol=1e-15)
    home = leg_lengths(g.home_coupler, g.home_platform, g)
    np.testing.assert_allclose(home, ref["geometry"]["variants_home_q"][name], atol=1e-12)
    assert set(VARIANTS) == {"corrected", "printed_u", "circle_u"}


def test_geometry_refuses_what_it_does_not_know() -> None:
    with pytest.raises(DescriptionError, match="did you mean 'printed_u'"):
        geometry("printed")
    with pytest.raises(DescriptionError, match="known: radius_R, radius_S"):
        geometry(radius_r=0.3)
    with pytest.raises(DescriptionError, match="positive"):
        geometry(radius_S=-0.1)
    with pytest.raises(DescriptionError, match="finite"):
        geometry(tip=float("nan"))
    assert geometry(tip=-0.3).tip == -0.3


def test_quaternions_round_trip() -> None:
    rng = np.random.default_rng(SEED)
    for q in (*rng.normal(size=(50, 4)), *np.eye(4)):
        unit = q / np.linalg.norm(q)
        rotation = rotation_from_quaternion(q)
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-14)
        assert abs(abs(quaternion_from_rotation(rotation) @ unit) - 1.0) < 1e-14


# --- the generic elimination -------------------------------------------------------------------


def test_elimination_finds_a_planted_solution_on_random_circles() -> None:
    rng = np.random.default_rng(SEED)
    for _ in range(60):
        centres, radii = rng.normal(size=(3, 3)), rng.uniform(0.5, 2.0, 3)
        frames = np.array([np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(3)])
        u, v, angles = frames[:, 0], frames[:, 1], rng.uniform(-np.pi, np.pi, 3)
        planted = centres + radii[:, None] * (
            np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v
        )
        sides = np.linalg.norm(planted - np.roll(planted, -1, axis=0), axis=1)
        found = three_points_on_circles(centres, u, v, radii, sides)
        assert (found.status, found.complex_count) == ("ok", 16)
        assert np.abs(found.points - planted).max(axis=(1, 2)).min() < 1e-11
        assert found.residual < 1e-13


def test_elimination_is_blind_to_the_choice_of_zero_angle() -> None:
    """A solution at b = pi (infinite half-angle tangent) is as good as any other."""
    up = np.tile(NORMAL, (3, 1))
    a = three_points_on_circles(G.R, RADIAL, up, HOME_Q[:3], G.sides_S)
    turn = a.angles[a.real][5].real + np.pi
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    b = three_points_on_circles(
        G.R, c * RADIAL + s * up, c * up - s * RADIAL, HOME_Q[:3], G.sides_S
    )
    assert np.abs(np.abs(b.angles[b.real].real) - np.pi).max(axis=1).min() < 1e-12
    assert len(a.points) == len(b.points) == 16
    for points in a.points:
        assert np.abs(b.points - points).max(axis=(1, 2)).min() < 1e-13


def test_elimination_says_when_it_cannot_count() -> None:
    up = np.tile(NORMAL, (3, 1))
    zero = three_points_on_circles(G.R, RADIAL, up, [0.0, 0.5, 0.5], G.sides_S)
    assert (zero.status, len(zero.points)) == ("degenerate", 0)
    flat = three_points_on_circles(G.R, RADIAL, up, [0.15] * 3, G.sides_S)
    assert flat.status == "multiple"  # one real solution of multiplicity 8
    np.testing.assert_allclose(flat.points, [0.1 * RADIAL], atol=1e-3)
    with pytest.raises(ValueError, match="expected"):
        three_points_on_circles(G.R, RADIAL, up, [0.5], G.sides_S)


# --- forward -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("case", "total"), [("home", 68), ("random", 70)])
def test_forward_finds_everything(ref: dict[str, Any], case: str, total: int) -> None:
    q = HOME_Q if case == "home" else np.array(ref["fk_random"][0]["q"])
    found = forward(q, G)
    assert found.stage1.complex_count == 16
    assert len(found.stage1.poses) == 16
    assert Counter(found.stage1.complex_modes) == {"ZT": 8, "HT": 8}
    for stage in found.stage2:
        assert stage.complex_count == 16
        assert Counter(stage.complex_modes) == {"ZT": 8, "HT": 8}
    assert sum(s.complex_count for s in found.stage2) == 256
    assert len(found.assemblies) == total
    worst = max(np.abs(residuals(a)).max() for a in found.assemblies)
    assert worst < 1e-12
    for a in found.assemblies:
        np.testing.assert_allclose(leg_lengths(a.coupler, a.platform, G), q, atol=1e-13)
    # pairwise distinct
    flat = np.array(
        [
            np.r_[a.coupler.points(G.s_B).ravel(), a.platform.points(G.c_C).ravel()]
            for a in found.assemblies
        ]
    )
    distance = np.abs(flat[:, None] - flat[None]).max(axis=-1) + np.eye(total)
    assert distance.min() > 1e-3


def test_forward_contains_home() -> None:
    found = forward(HOME_Q, G)
    distance = [
        np.abs(a.platform.position - G.home_platform.position).max()
        + np.abs(a.platform.rotation - np.eye(3)).max()
        + np.abs(a.coupler.rotation - np.eye(3)).max()
        for a in found.assemblies
    ]
    assert min(distance) < 1e-13
    assert found.assemblies[int(np.argmin(distance))].modes == ("ZT", "ZT")


def test_forward_matches_every_stored_assembly(ref: dict[str, Any]) -> None:
    names = {"zero-torsion": "ZT", "half-turn": "HT"}
    for entry in ref["fk_random"]:
        found = forward(entry["q"], G)
        assert len(found.stage1.poses) == entry["stage1_real"]
        for stored in entry["stage1"]:
            gaps = np.abs(found.stage1.points - stored["S1_3"]).max(axis=(1, 2))
            i = int(np.argmin(gaps))
            assert gaps[i] < 1e-11
            assert found.stage1.modes[i] == names[stored["mode"]]
            coupler = found.stage1.poses[i]
            np.testing.assert_allclose(coupler.position, stored["pB"], atol=1e-11)
            np.testing.assert_allclose(coupler.rotation @ NORMAL, stored["nB"], atol=1e-11)
            second = found.stage2[i]
            assert len(second.poses) == stored["stage2_real"] == len(stored["stage2"])
            for item in stored["stage2"]:
                gaps = np.abs(second.points - item["S4_6"]).max(axis=(1, 2))
                k = int(np.argmin(gaps))
                assert gaps[k] < 1e-11
                assert second.modes[k] == names[item["mode"]]
                tip = second.poses[k].points(G.tip_C[None])[0]
                np.testing.assert_allclose(tip, item["tip"], atol=1e-11)


def test_stage1_polynomial(ref: dict[str, Any]) -> None:
    stored = ref["stage1_t2_polynomial"]
    found = stage1_polynomial(stored["q"][:3], G)
    np.testing.assert_allclose(found, stored["monic_coefficients_descending"], rtol=1e-8)
    # its roots are the solver's own angles, each with its mirror image in the base plane
    solutions = stage1(stored["q"][:3], G).circles
    squares = np.sort(np.tan(solutions.angles[:, 0].real / 2.0) ** 2)
    roots = np.repeat([r[0] for r in stored["roots_t1_squared"]], 2)
    np.testing.assert_allclose(squares, roots, rtol=1e-11)
    scale = np.polyval(np.abs(found), squares)
    assert (np.abs(np.polyval(found, squares)) / scale).max() < 1e-11


def test_random_lengths_keep_sixteen() -> None:
    rng = np.random.default_rng(SEED)
    for _ in range(60):
        q = rng.uniform(0.3, 0.8, 3)
        found = stage1(q, G)
        assert (found.complex_count, found.circles.status) == (16, "ok")
        assert Counter(found.complex_modes) == {"ZT": 8, "HT": 8}
        assert len(found.poses) % 2 == 0


def test_stage2_out_of_reach_has_no_real_solution() -> None:
    coupler = pose([1.0, 0.3, 0.0, 0.1], [0.0, -0.5, 0.0])
    found = stage2(coupler, [0.05, 0.55, 0.55], G)
    assert found.circles.status == "unreachable"
    assert (found.poses, found.points.shape) == ((), (0, 3, 3))
    assert found.complex_count == 16
    assert np.all(np.isfinite(found.circles.complex_points))
    far = stage1([2.0, 0.5, 0.5], G)  # circles exist, the triangle does not close
    assert (far.poses, far.circles.status, far.complex_count) == ((), "ok", 16)


def test_lengths_are_checked() -> None:
    with pytest.raises(ValueError, match="6 finite"):
        forward([0.5] * 5, G)
    with pytest.raises(ValueError, match="3 finite"):
        stage1([0.5, 0.5, np.nan], G)


def test_leg_lengths_broadcast(ref: dict[str, Any]) -> None:
    states = [state(ref["home"]), state(ref["kinematics"][0])]
    coupler = Pose(
        *(np.stack(x) for x in zip(*((b.rotation, b.position) for b, _ in states), strict=True))
    )
    platform = Pose(
        *(np.stack(x) for x in zip(*((c.rotation, c.position) for _, c in states), strict=True))
    )
    q = leg_lengths(coupler, platform, G)
    np.testing.assert_allclose(q, [ref["home"]["q"], ref["kinematics"][0]["q"]], atol=1e-12)
    for both, single in zip(
        zip(*scaled_screws(coupler, platform, G), strict=True),
        (scaled_screws(b, c, G) for b, c in states),
        strict=True,
    ):
        np.testing.assert_allclose(both, single, atol=1e-15)


# --- inverse -----------------------------------------------------------------------------------


def test_inverse_finds_the_twelve_stored_solutions(ref: dict[str, Any]) -> None:
    entry = ref["ik"][0]
    target = Pose(np.array(entry["RC"]), np.array(entry["pC"]))
    found = inverse(target, G)
    assert (found.complex_count, found.self_motions, found.at_infinity) == (12, (), 0)
    counts = Counter("-".join(a.modes) for a in found.assemblies)
    assert counts == entry["n_real"]
    for stored in entry["real"]:
        (match,) = [
            a
            for a in found.assemblies
            if "-".join(a.modes) == stored["mode"]
            and np.abs(a.coupler.position - stored["pB"]).max() < 1e-9
        ]
        np.testing.assert_allclose(match.q, stored["q"], atol=1e-11)
        np.testing.assert_allclose(match.coupler.rotation @ NORMAL, stored["nB"], atol=1e-11)
        np.testing.assert_allclose(match.coupler.points(G.s_B), stored["S1_3"], atol=1e-11)
        np.testing.assert_allclose(match.coupler.points(G.r_B), stored["R4_6"], atol=1e-11)
    assert max(np.abs(residuals(a)).max() for a in found.assemblies) < 1e-12


@pytest.mark.slow
def test_forward_of_inverse_contains_the_pose() -> None:
    rng = np.random.default_rng(SEED)
    worst = 0.0
    for case in range(50):
        quaternion = np.r_[1.0, rng.uniform(-0.4, 0.4, 3)]
        position = np.array([0.0, -0.75, 0.0]) + rng.uniform(-0.1, 0.1, 3)
        target = pose(quaternion, position)
        found = inverse(target, G)
        assert found.complex_count == 12
        per_pair = Counter(a.modes for a in found.assemblies)
        assert set(per_pair) == set(MODE_PAIRS)
        assert set(per_pair.values()) <= {1, 3}
        for a in found.assemblies:  # m^2, relative to the square of the longest leg
            assert np.abs(residuals(a)).max() < 1e-12 * max(1.0, (a.q**2).max())
        # a coupler tens of metres away is a true solution too, but an ill-conditioned one
        near = [a for a in found.assemblies if a.q.max() < 3.0]
        chosen = near[case % len(near)]
        gaps = [
            np.abs(a.platform.position - target.position).max()
            + np.abs(a.platform.rotation - target.rotation).max()
            + np.abs(a.coupler.rotation - chosen.coupler.rotation).max()
            for a in forward(chosen.q, G).assemblies
        ]
        worst = max(worst, min(gaps))
    assert worst < 1e-9


def test_inverse_contains_every_forward_solution(ref: dict[str, Any]) -> None:
    q = np.array(ref["fk_random"][0]["q"])
    for a in forward(q, G).assemblies:
        found = inverse(a.platform, G)
        gaps = [
            np.abs(b.q - q).max() + np.abs(b.coupler.position - a.coupler.position).max()
            for b in found.assemblies
            if b.modes == a.modes
        ]
        assert min(gaps) < 1e-9


@pytest.mark.parametrize("position", [[0.0, -0.75, 0.0], [0.0, -0.75, 0.04], [-0.03, -0.78, 0.02]])
def test_vertical_tool_is_a_self_motion(position: list[float]) -> None:
    target = Pose(np.eye(3), np.array(position))
    found = inverse(target, G)
    (family,) = (f for f in found.self_motions if f.kind == "tool_vertical")
    assert ("ZT", "ZT") in family.modes
    lengths = []
    for height in (-0.52, -0.5, -0.47):
        members = family.members(height)
        assert members
        for a in members:
            assert a.modes == ("ZT", "ZT")
            assert abs(a.coupler.position[1] - height) < 1e-15
            assert np.abs(residuals(a)).max() < 1e-12
            lengths.append(a.q)
            # singular for the inverse kinematics, as it must be on a self-motion
            assert abs(np.linalg.det(scaled_screws(a.coupler, a.platform, G)[2])) < 1e-9
        assert min(np.arccos(a.coupler.rotation[1, 1]) for a in members) < np.deg2rad(20.0)
    assert np.ptp(np.array(lengths)[:, 3:], axis=0).max() < 1e-14
    assert np.ptp(np.array(lengths)[:, :3], axis=0).min() > 1e-2


def test_drill_waypoint_lies_in_the_self_motion(ref: dict[str, Any]) -> None:
    tip, q = ref["task_drill"]["waypoints"][1], ref["task_drill"]["q_at_waypoints"][1]
    target = Pose(np.eye(3), np.array(tip) - G.tip_C)
    family = inverse(target, G).self_motions[0]
    coupler = min(
        (a for a in forward(q, G).assemblies),
        key=lambda a: np.abs(a.platform.position - target.position).max(),
    ).coupler
    members = family.members(float(coupler.position[1]))
    assert min(np.abs(a.q - q).max() for a in members) < 1e-11


def test_self_motion_members_are_complete() -> None:
    """Members come in pairs, as real roots of an even eliminant do; so an odd count is a loss."""
    rng = np.random.default_rng(SEED)
    for _ in range(200):
        p = np.r_[rng.uniform(-0.1, 0.1), rng.uniform(-0.9, -0.6), rng.uniform(-0.1, 0.1)]
        found = vertical_tool_quaternions(p, rng.uniform(-0.9, -0.3), 0.1, 0.18)
        assert len(found) in (2, 4, 6)


def test_half_turn_about_the_normal_is_positive_dimensional_too() -> None:
    target = pose([0.0, 0.0, 1.0, 0.0], [0.01, -0.75, 0.02])
    found = inverse(target, G)
    (family,) = found.self_motions
    assert family.kind == "half_turn"
    assert set(family.modes) == {("ZT", "HT"), ("HT", "ZT")}
    assert family.members(-0.5) == ()
    assert all(np.abs(residuals(a)).max() < 1e-12 for a in found.assemblies)


def test_untilted_coupler_slides() -> None:
    """Only stage 2 tilted: the coupler slides along y while q4..q6 and the platform stay."""
    (a, *_) = (
        a
        for a in forward(np.r_[HOME_Q[:3], 0.55, 0.53, 0.57], G).assemblies
        if a.modes == ("ZT", "ZT") and np.abs(a.coupler.rotation - np.eye(3)).max() < 1e-12
    )
    found = inverse(a.platform, G)
    (family,) = (f for f in found.self_motions if ("ZT", "ZT") in f.modes)
    assert family.kind == "untilted_coupler"
    for height in (-0.55, -0.45):
        (member,) = family.members(height)
        np.testing.assert_allclose(member.q[3:], a.q[3:], atol=1e-12)
        assert np.abs(residuals(member)).max() < 1e-12


# --- screws ------------------------------------------------------------------------------------


def test_screw_matrices_match_the_reference(ref: dict[str, Any]) -> None:
    for entry in (ref["home"], ref["kinematics"][0]):
        b, c = state(entry)
        np.testing.assert_allclose(j1(b, G), entry["J1"], atol=1e-12)
        np.testing.assert_allclose(j2(b, c, G), entry["J2"], atol=1e-12)
    for entry in (ref["home"], *ref["kinematics"], *ref["singular"].values()):
        matrices = scaled_screws(*state(entry), G)
        for k, matrix in enumerate(matrices):
            assert abs(np.linalg.det(matrix) - entry["det_J1_J2_J3"][k]) < 1e-11
            values = np.linalg.svd(matrix, compute_uv=False)
            np.testing.assert_allclose(values, entry[f"sv_J{k + 1}"], atol=1e-12)


def test_screws_along_the_periodic_motion(ref: dict[str, Any]) -> None:
    for sample in ref["periodic"]["samples"]:
        b, c = (
            pose([sample[f"quat{x}_{k}"] for k in "wxyz"], [sample[f"p{x}_{k}"] for k in "xyz"])
            for x in "BC"
        )
        q = [sample[f"q{i}"] for i in range(1, 7)]
        np.testing.assert_allclose(leg_lengths(b, c, G), q, atol=1e-12)
        for k, matrix in enumerate(scaled_screws(b, c, G)):
            assert abs(np.linalg.det(matrix) - sample[f"detJ{k + 1}"]) < 1e-11
            smallest = np.linalg.svd(matrix, compute_uv=False)[-1]
            assert abs(smallest - sample[f"sminJ{k + 1}"]) < 1e-11


def test_four_planes_identity() -> None:
    """Holds with the normals t x leg; these have length 1 in stage 1 only."""
    rng = np.random.default_rng(SEED)
    for _ in range(20):
        chosen = forward(HOME_Q + rng.uniform(-0.02, 0.02, 6), G).assemblies
        for a in chosen[::7]:
            m1, m2, _ = scaled_screws(a.coupler, a.platform, G)
            first, second = planes1(a.coupler, G), planes2(a.coupler, a.platform, G)
            assert abs(np.linalg.det(m1) - 15 * np.sqrt(3) * np.linalg.det(first)) < 1e-12
            assert abs(np.linalg.det(m2) - np.linalg.det(second) / (0.04 * np.sqrt(3))) < 1e-12
            np.testing.assert_allclose(np.linalg.norm(first[:, :3], axis=1), 1.0, atol=1e-12)


def equation_10(x: np.ndarray, s4: np.ndarray, g: Geometry = G) -> np.ndarray:
    """Eq. (10) for x = (S1..S3, R4..R6) (18,) and given S4..S6, real or complex."""
    s, r = x[:9].reshape(3, 3), x[9:].reshape(3, 3)
    rows = []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rows.append((s4[i] - r[i]) @ (r[j] - r[k]))
        rows.append((s[i] - g.R[i]) @ (g.R[j] - g.R[k]))
        rows.append((s[i] - s[j]) @ (s[i] - s[j]) - g.sides_S[i] ** 2)
        rows.append((r[i] - r[j]) @ (r[i] - r[j]) - 3.0 * g.radius_R4**2)
        rows.append((s[i] - r[i]) @ (s[i] - r[i]) - (g.radius_R4 - g.radius_S) ** 2)
    return np.concatenate([rows, s.sum(axis=0) - r.sum(axis=0)])


def test_equation_10_is_degenerate(ref: dict[str, Any]) -> None:
    """Rank 15 of 18 at every solution."""
    entry = ref["ik"][0]
    target = Pose(np.array(entry["RC"]), np.array(entry["pC"]))
    s4 = target.points(G.c_C)
    for a in inverse(target, G).assemblies:
        x = np.r_[a.coupler.points(G.s_B).ravel(), a.coupler.points(G.r_B).ravel()]
        assert np.abs(equation_10(x, s4)).max() < 1e-12
        jacobian = np.empty((18, 18))
        for k in range(18):
            step = x.astype(complex)
            step[k] += 1e-30j
            jacobian[:, k] = equation_10(step, s4).imag / 1e-30
        values = np.linalg.svd(jacobian, compute_uv=False)
        assert values[15] < 1e-12 * values[0]
        assert values[14] > 1e-4 * values[0]


def followed(q: np.ndarray, near: Assembly) -> Assembly:
    """The assembly for q nearest to a given one."""
    return min(
        forward(q, G).assemblies,
        key=lambda a: (
            np.abs(a.coupler.rotation - near.coupler.rotation).max()
            + np.abs(a.platform.rotation - near.platform.rotation).max()
        ),
    )


def test_equation_29_rests_on_two_false_premises(ref: dict[str, Any]) -> None:
    """omega . n is not 0; omega . (y + n) is (finite differences of the closed forms)."""
    entry = ref["kinematics"][0]
    b, c = state(entry)
    q, qd = np.array(entry["q"]), np.array(entry["qd"])
    here = Assembly(b, c, ("ZT", "ZT"), q)
    h = 1e-4
    steps = {k: followed(q + k * h * qd, here) for k in (-2, -1, 1, 2)}

    def omega(name: str, rotation: np.ndarray) -> np.ndarray:
        r = {k: getattr(a, name).rotation for k, a in steps.items()}
        rate = (r[-2] - 8.0 * r[-1] + 8.0 * r[1] - r[2]) / (12.0 * h) @ rotation.T
        return np.array([rate[2, 1], rate[0, 2], rate[1, 0]])

    w_b, w_c = omega("coupler", b.rotation), omega("platform", c.rotation)
    np.testing.assert_allclose(w_b, entry["V_AB"][:3], atol=1e-9)
    np.testing.assert_allclose(w_c, entry["V_AC"][:3], atol=1e-9)
    n_b, n_c = b.rotation @ NORMAL, c.rotation @ NORMAL
    stored = entry["eq29"]
    assert abs(w_b @ n_b - stored["wAB_dot_nB"]) < 1e-9
    assert abs((w_c - w_b) @ n_c - stored["wBC_dot_nC"]) < 1e-9
    assert abs(w_b @ n_b) > 0.03
    assert abs((w_c - w_b) @ n_c) > 0.04
    assert abs(w_b @ (NORMAL + n_b)) < 1e-9
    assert abs((w_c - w_b) @ (n_b + n_c)) < 1e-9


def test_constants_are_read_only_and_consistent() -> None:
    assert elimination.BEZOUT == 16
    np.testing.assert_allclose(np.cross(NORMAL, RADIAL), TANGENT)
    np.testing.assert_allclose(TANGENT[0], [0.0, 0.0, -1.0])
    with pytest.raises(ValueError, match="read-only"):
        RADIAL[0, 0] = 2.0
