"""Closed forms of D1: geometry, elimination and the direct problem."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from d1_cases import HOME_Q, SEED, G, pose, residuals, state

from closedchain.robots.d1.geometry import (
    NORMAL,
    RADIAL,
    VARIANTS,
    Pose,
    geometry,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from closedchain.robots.d1.position import (
    forward,
    leg_lengths,
    stage1,
    stage1_polynomial,
    stage2,
)
from closedchain.robots.d1.screws import scaled_screws
from closedchain.robots.elimination import three_points_on_circles
from closedchain.urdf.errors import DescriptionError


@pytest.fixture(scope="module")
def ref(reference: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return reference("d1")


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
