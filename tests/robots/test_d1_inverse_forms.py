"""Closed inverse problem of D1 and its self-motions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from d1_cases import HOME_Q, SEED, G, pose, residuals

from closedchain.robots.d1.geometry import (
    NORMAL,
    Pose,
)
from closedchain.robots.d1.position import (
    MODE_PAIRS,
    forward,
    inverse,
)
from closedchain.robots.d1.screws import scaled_screws
from closedchain.robots.d1.selfmotion import vertical_tool_quaternions


@pytest.fixture(scope="module")
def ref(reference: Callable[[str], dict[str, Any]]) -> dict[str, Any]:
    return reference("d1")


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
