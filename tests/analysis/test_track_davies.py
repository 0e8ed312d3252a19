"""Davies' method on any mechanism: the error table of the Eclipse paper, and its bound."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from eclipse_circuits import circuits, leading, secondary

import closedchain as cc
from closedchain.robots.eclipse import ECLIPSE, trajectory
from closedchain.robots.eclipse.davies import exact_joints, integrate

load = cache(circuits)


def run(gain: float, inner: int = 0) -> tuple[cc.Track, np.ndarray, float]:
    """Track, joints of the legs and the largest error of the driven joints, cm."""
    values, rates = leading()
    found = cc.track(
        load(),
        values,
        times=trajectory.TIMES,
        velocities=rates,
        method="davies",
        gain=gain,
        inner=inner,
    )
    joints = secondary(load(), found.q)
    error = np.abs(joints - exact_joints(ECLIPSE)[: found.reached])[:, :, :2] * [20.0, 100.0]
    return found, joints, float(error.max())


def test_without_feedback_the_paper_s_integration_to_rounding() -> None:
    """Any constant gap keeps the same rates: how an error is written does not matter yet."""
    found, joints, error = run(0.0)
    assert found.complete
    assert error == pytest.approx(0.967, abs=5e-4)
    assert_close(joints, integrate(ECLIPSE).joints, 1e-12)
    assert found.residual.max() > 0.03  # it drifts


@pytest.mark.parametrize(("gain", "cm"), [(10.0, 0.314), (50.0, 0.0799), (100.0, 0.0401)])
def test_error_table(gain: float, cm: float) -> None:
    """With feedback the error's coordinates matter: log6 here, XYZ angles there; 0.05 % of it."""
    _, _, error = run(gain)
    assert error == pytest.approx(cm, rel=2e-3)
    reference = np.abs(integrate(ECLIPSE, gain=gain).joints - exact_joints(ECLIPSE))[:, :, :2]
    assert error == pytest.approx((reference * [20.0, 100.0]).max(), rel=5e-4)


def test_inner_iterations_close_the_loops() -> None:
    found, _, error = run(100.0, inner=3)
    assert error < 1e-11
    assert found.residual.max() < 1e-11


def test_gain_must_stay_below_two_steps() -> None:
    """Stable for K_e < 2 / dt = 200."""
    bounded, grows, lost = run(198.0), run(202.0), run(210.0)
    assert bounded[2] < 0.03 < 0.1 < grows[2]
    assert lost[0].stop is not None
    assert not lost[0].complete
    assert "errors grow" in lost[0].stop.message


def test_on_the_mechanism_itself() -> None:
    """Six driven joints lead, nine loop rows are fed back; poses lead likewise."""
    m = cc.load("eclipse")
    t = trajectory.TIMES
    poses = [pin.SE3(trajectory.rotation(), trajectory.position(x)) for x in t]
    exact = cc.track(m, poses, times=t)
    assert exact.complete
    inputs = exact.q[:, m.input_q]
    twists = np.concatenate([trajectory.velocity(t), np.zeros((t.size, 3))], axis=-1)
    for gain, cm in ((0.0, 0.9667), (100.0, 0.0405)):
        found = cc.track(
            m, poses, times=t, velocities=twists, method="davies", gain=gain, start=exact.q[0]
        )
        driven = np.abs(found.q[:, m.input_q] - inputs) * np.repeat([20.0, 100.0], 3)
        assert driven.max() == pytest.approx(cm, rel=1e-3)
    errors = []
    for path in (inputs, poses):
        for gain, inner in ((0.0, 0), (100.0, 0), (100.0, 2)):
            found = cc.track(
                m, path, times=t, method="davies", gain=gain, inner=inner, start=exact.q[0]
            )
            assert found.complete
            reached = [m.point(q, "platform") for q in found.q]
            errors.append(np.abs(reached - trajectory.position(t)).max())
    assert errors[0] > 1e-3 > errors[1] > 1e-5 > 1e-11 > errors[2]
    assert errors[3] > 1e-3 > errors[4] > 1e-5 > 1e-11 > errors[5]
