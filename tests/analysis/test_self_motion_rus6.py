"""Self-motion of rus6: for every pose a family of (alpha, beta), by tracing and in closed form."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close

import closedchain as cc
from closedchain.analysis.motion.self_motion.motion import SelfMotion, self_motion
from closedchain.robots.rus6 import Pose, geometry, inverse, mode_of, posture, rotation_ypr

G = geometry()
LEGS_OF_M2 = slice(3, 6)


@pytest.fixture(scope="module")
def rus6() -> cc.Mechanism:
    return cc.load("rus6")


def pose_at(height: float) -> Pose:
    return Pose(rotation_ypr(0.05, 0.04, -0.06), np.array([0.02, height, -0.03]))


def start(m: cc.Mechanism, pose: Pose, beta: float | None = None) -> np.ndarray:
    target = pin.SE3(pose.rotation, pose.position)
    q = cc.inverse(m, target).raise_if_failed().q
    if beta is None:
        return q
    for value in np.linspace(q[m.input_q[6]], beta, 30)[1:]:
        found = cc.close(m, q, fixed={"beta": value}, place={"P": target})
        assert found.converged, found.message
        q = found.q
    return q


def follows_closed_form(s: SelfMotion, pose: Pose) -> np.ndarray:
    """Every alpha is that of the inverse problem for its beta; returns the working modes (n, 6)."""
    modes = []
    for row in s.inputs:
        mode = mode_of(posture(pose, row[:6], row[6], G))
        legs = inverse(pose, row[6], G, mode)
        assert legs.closed
        off = (legs.alpha - row[:6] + np.pi) % (2.0 * np.pi) - np.pi
        assert_close(off, np.zeros(6), 1e-10)
        modes.append(mode)
    return np.array(modes)


@pytest.mark.parametrize("height", [-0.55, -0.68])
def test_beta_turns_fully_and_the_loop_is_closed(
    rus6: cc.Mechanism, height: float, tol: Tolerances
) -> None:
    """From the lower pose both ways meet a limit: together they are the loop, once."""
    pose = pose_at(height)
    s = self_motion(rus6, start(rus6, pose))
    assert s.closed
    assert abs(s.turns["beta"]) == 1
    assert {s.turns[f"alpha{i}"] for i in (1, 2, 3)} == {-s.turns["beta"]}
    assert not s.singular
    assert s.residual.max() < tol.closure
    assert s.task_error.max() < tol.closure
    assert (follows_closed_form(s, pose) == 1.0).all()
    beta = s.inputs[:, 6]
    assert 2.0 * np.pi - 0.2 < np.ptp(beta) < 2.0 * np.pi
    assert (np.diff(beta) < 0.0).all()
    assert np.abs(s.inputs[:, LEGS_OF_M2] - s.inputs[0, LEGS_OF_M2]).max() < 1e-12
    lower, upper = rus6.limits
    assert (s.q >= lower - 1e-9).all()
    assert (s.q <= upper + 1e-9).all()


@pytest.mark.parametrize("beta", [-0.5, 0.6, 1.5])
def test_loop_does_not_depend_on_where_it_is_begun(rus6: cc.Mechanism, beta: float) -> None:
    """Begun elsewhere, another limit is met before the turn is full, or none."""
    pose = pose_at(-0.55)
    s = self_motion(rus6, start(rus6, pose, beta))
    assert s.closed
    assert abs(s.turns["beta"]) == 1
    assert s.length == pytest.approx(self_motion(rus6, start(rus6, pose)).length, rel=2e-3)
    follows_closed_form(s, pose)


def test_low_platform_takes_an_elbow_to_its_other_side(rus6: cc.Mechanism, tol: Tolerances) -> None:
    """Beta cannot turn fully: where leg 3 is stretched, the loop goes on in another mode."""
    pose = pose_at(-0.72)
    s = self_motion(rus6, start(rus6, pose))
    modes = follows_closed_form(s, pose)
    assert s.closed
    assert not s.turns
    assert s.residual.max() < tol.closure
    assert (modes[:, [0, 1, 3, 4, 5]] == 1.0).all()
    third = modes[:, 2]
    assert {-1.0, 1.0} == set(third)
    changes = np.flatnonzero(third != np.roll(third, 1))
    assert len(changes) == 2
    # beta turns round there: with leg 3 stretched it has no first-order say in the posture
    at = s.inputs[changes, 6]
    assert_close(np.sort(at), [s.inputs[:, 6].min(), s.inputs[:, 6].max()], 0.05)
    beyond = [inverse(pose, b, G).reach[2] for b in (at.min() - 0.05, at.max() + 0.05)]
    assert max(beyond) < 0.0  # out of reach: no other beta holds the pose


def test_home_by_symmetry(rus6: cc.Mechanism) -> None:
    s = self_motion(rus6, rus6.home)
    assert s.closed
    assert np.abs(np.diff(s.inputs[:, :3], axis=1)).max() < 1e-12  # legs of M1 move alike
    follows_closed_form(s, Pose(np.eye(3), G.height * np.array([0.0, 1.0, 0.0])))


def test_three_free_links_leave_three_freedoms() -> None:
    m = cc.load("rus6", reconfiguration="free")
    with pytest.raises(
        cc.ClosureError, match=r"3 freedoms remain.*lock 2 of .*beta1, beta2, beta3"
    ):
        self_motion(m, m.home)
    s = self_motion(m, m.home, lock="beta2 beta3")
    assert s.closed
    assert s.turns == {"beta1": -1, "alpha1": 1}
    assert np.abs(s.inputs[:, 1:6] - s.inputs[0, 1:6]).max() < 1e-12  # leg 1 moves alone


def test_without_reconfiguration_there_is_none() -> None:
    m = cc.load("rus6", reconfiguration="locked")
    with pytest.raises(cc.ClosureError, match="nothing can move"):
        self_motion(m, m.home)
