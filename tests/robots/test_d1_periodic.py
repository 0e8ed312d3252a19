"""D1's periodic motion of section 6 as one track: poses, twists, accelerations, torsion.

The torsion that the platform shows refutes the paper's claim of five degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.robots.d1 import Pose, geometry, periodic, tasks
from closedchain.robots.d1.geometry import rotation_from_quaternion

G = geometry()
PERIOD = 2.0 * np.pi
TIMES = np.linspace(0.0, PERIOD, 201)
UP = np.array([0.0, 1.0, 0.0])
BODIES = {"B": "coupler", "C": "platform"}


@pytest.fixture(scope="module")
def track(d1: cc.Mechanism) -> cc.Track:
    at = periodic(TIMES, G)
    found = cc.track(
        d1, at.inputs, times=TIMES, velocities=at.rates, accelerations=at.accelerations
    )
    return found.raise_if_stopped()


def body(m: cc.Mechanism, track: cc.Track, k: int, name: str) -> tuple[pin.SE3, pin.Motion, Any]:
    """Pose of a body at sample k, its twist and spatial acceleration about the base's origin."""
    assert track.qdot is not None
    assert track.qddot is not None
    data, frame = m.model.createData(), m.frame_id(name)
    pin.forwardKinematics(m.model, data, track.q[k], track.qdot[k], track.qddot[k])
    pin.updateFramePlacements(m.model, data)
    return (
        data.oMf[frame].copy(),
        pin.getFrameVelocity(m.model, data, frame, pin.WORLD),
        pin.getFrameAcceleration(m.model, data, frame, pin.WORLD),
    )


def series(m: cc.Mechanism, track: cc.Track, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and angular velocities (n, 3) of a body in the base frame."""
    found = [body(m, track, k, name) for k in range(track.reached)]
    return np.array([f[0].rotation for f in found]), np.array([f[1].angular for f in found])


def spectral(values: np.ndarray) -> np.ndarray:
    """Time derivative (n, k) of one period of a smooth function, the last sample repeated."""
    modes = np.fft.fftfreq(len(values) - 1, 1.0 / (len(values) - 1))
    found = np.fft.ifft(1j * modes[:, None] * np.fft.fft(values[:-1], axis=0), axis=0).real
    return np.vstack([found, found[:1]])


def torsion(rotations: np.ndarray) -> np.ndarray:
    """Twist about the base normal of rotations (n, 3, 3) [deg]."""
    return np.degrees(tasks.torsion(Pose(rotations, np.zeros((len(rotations), 3)))))


# -- poses, twists, accelerations ----------------------------------------------------------------


def test_one_track_leads_all_the_way_round(d1: cc.Mechanism, track: cc.Track) -> None:
    assert track.complete
    assert track.residual.max() < 1e-12
    assert not track.beyond_limits
    assert_close(pin.difference(d1.model, track.q[0], track.q[-1]), np.zeros(33), 1e-9)
    assert_close(pin.difference(d1.model, track.q[100], d1.home), np.zeros(33), 1e-9)  # t = pi
    for q in track.q[::10]:
        assert "direct" not in cc.classify(d1, q).kinds


def test_track_is_the_reference(
    d1: cc.Mechanism, track: cc.Track, reference: Callable[[str], Any], tol: Tolerances
) -> None:
    """Both bodies: pose, twist (omega, v_O) and accelerator, which is the twist's rate at O."""
    for sample in reference("d1")["periodic"]["samples"]:
        k = round(sample["t"] * 100 / np.pi)
        for letter, name in BODIES.items():
            pose, twist, rate = body(d1, track, k, name)
            quaternion = np.array([sample[f"quat{letter}_{c}"] for c in "wxyz"])
            assert_close(pose.rotation, rotation_from_quaternion(quaternion), tol.reference)
            position = [sample[f"p{letter}_{c}"] for c in "xyz"]
            assert_close(pose.translation, position, tol.reference)
            for found, stored in ((twist, "V"), (rate, "A")):
                mine = np.concatenate([found.angular, found.linear])
                expected = [sample[f"{stored}{letter}_{i}"] for i in range(6)]
                assert_close(mine, expected, tol.reference, f"{stored}{letter} at sample {k}")


def test_acceleration_at_every_sample_is_that_of_the_track(
    d1: cc.Mechanism, track: cc.Track
) -> None:
    at = periodic(TIMES, G)
    assert track.qdot is not None
    assert track.qddot is not None
    for k in range(0, 201, 8):
        found = cc.acceleration(d1, track.q[k], at.rates[k], at.accelerations[k])
        assert_close(found.qdot, track.qdot[k], 1e-9)
        assert_close(found.qddot, track.qddot[k], 1e-8)
        twist = cc.velocity(d1, track.q[k], "x y z rx ry rz").twist_map @ at.rates[k]
        assert_close(found.tip_twist, twist, 1e-9)


def test_twists_and_accelerations_are_time_derivatives(d1: cc.Mechanism, track: cc.Track) -> None:
    """Against the Fourier series of the tip's path, which knows of no Jacobian."""
    at = periodic(TIMES, G)
    tips = np.array([d1.point(q, "T") for q in track.q])
    rates = spectral(tips)
    found = [
        cc.acceleration(d1, q, v, a)
        for q, v, a in zip(track.q, at.rates, at.accelerations, strict=True)
    ]
    assert_close([f.tip_twist[:3] for f in found], rates, 1e-10)
    assert_close([f.tip_acceleration[:3] for f in found], spectral(rates), 1e-8)
    turns, omega = series(d1, track, "platform")
    rotation_rates = spectral(turns.reshape(201, 9)).reshape(201, 3, 3)
    spins = np.array([pin.unSkew(d @ r.T) for d, r in zip(rotation_rates, turns, strict=True)])
    assert_close(spins, omega, 1e-10)
    assert_close([f.tip_acceleration[3:] for f in found], spectral(omega), 1e-8)


# -- torsion: six degrees of freedom -------------------------------------------------------------


def test_torsion_of_the_tool(
    d1: cc.Mechanism, track: cc.Track, reference: Callable[[str], Any]
) -> None:
    degrees = torsion(series(d1, track, "platform")[0])
    assert degrees.min() == pytest.approx(-2.561, abs=5e-4)
    assert degrees.max() == pytest.approx(1.843, abs=5e-4)
    assert_close([degrees.min(), degrees.max()], reference("d1")["periodic"]["torsion_deg"], 2e-6)
    # at home, in the middle and at the end of the period, there is none
    assert np.abs(degrees[[0, 100, 200]]).max() < 1e-9


def test_torsion_comes_from_two_stages_without_torsion(d1: cc.Mechanism, track: cc.Track) -> None:
    """Each stage is a half-turn about a bisector after another; their product has torsion."""
    b, omega_b = series(d1, track, "coupler")
    c, omega_c = series(d1, track, "platform")
    relative = b.swapaxes(1, 2) @ c
    assert np.abs(torsion(b)).max() < 1e-9
    assert np.abs(torsion(relative)).max() < 1e-9
    n_b, n_c = b[:, :, 1], c[:, :, 1]

    def half_turns(m: np.ndarray) -> np.ndarray:
        m = m / np.linalg.norm(m, axis=1, keepdims=True)
        return 2.0 * m[:, :, None] * m[:, None, :] - np.eye(3)

    assert_close(half_turns(n_b + n_c) @ half_turns(UP + n_b), c, 1e-10)
    # the twist condition of a stage is about the bisector, not about its normal
    across = omega_c - omega_b
    assert np.abs((omega_b * (UP + n_b)).sum(axis=1)).max() < 1e-10
    assert np.abs((across * (n_b + n_c)).sum(axis=1)).max() < 1e-10
    assert np.abs((omega_b * n_b).sum(axis=1)).max() > 1e-3
    assert np.abs((across * n_c).sum(axis=1)).max() > 1e-2


def test_a_platform_of_five_freedoms_would_not_move_so(d1: cc.Mechanism, track: cc.Track) -> None:
    """Without torsion the tool's direction alone would give its orientation: off by degrees."""
    turns, omega = series(d1, track, "platform")
    untwisted = [pin.Quaternion.FromTwoVectors(UP, r[:, 1]).toRotationMatrix() for r in turns]
    off = [np.linalg.norm(pin.log3(r.T @ u)) for r, u in zip(turns, untwisted, strict=True)]
    assert np.degrees(max(off)) == pytest.approx(2.561, abs=1e-3)
    # all six output rates are independent almost everywhere: the twist map has rank 6
    sigmas = np.array([cc.classify(d1, q).sigma_inverse for q in track.q])
    assert np.count_nonzero(sigmas > 1e-6) >= 190
    assert sigmas[[0, 100, 200]].max() < 1e-8  # at home, where the map has rank 5
    assert np.abs((omega * turns[:, :, 1]).sum(axis=1)).max() > 0.01


def test_determinant_of_the_inverse_problem_changes_sign_twice(
    d1: cc.Mechanism, track: cc.Track, reference: Callable[[str], Any]
) -> None:
    """Harmless for the direct problem, which stays regular throughout."""
    found = [cc.classify(d1, q) for q in track.q]
    inverse = np.array([f.det_inverse for f in found])
    direct = np.array([f.det_direct for f in found])
    assert (direct * direct[0] > 0.0).all()
    away = np.abs(inverse) > 1e-9 * np.abs(inverse).max()
    kept = np.flatnonzero(away)
    changes = [
        0.5 * (TIMES[i] + TIMES[j]) for i, j in pairwise(kept) if inverse[i] * inverse[j] < 0.0
    ]
    assert len(changes) == reference("d1")["periodic"]["detJ3_sign_changes"]
    assert_close(changes, [0.64, 3.88], 0.02)
    assert np.abs(inverse[[0, 100, 200]]).max() < 1e-9 * np.abs(inverse).max()  # home: touched
