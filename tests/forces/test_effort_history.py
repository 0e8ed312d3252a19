"""Efforts over a timed path: against inverse dynamics, energy, and a spline's derivatives."""

from pathlib import Path

import numpy as np
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.analysis.figures.efforts import draw_efforts

TIMES = np.linspace(0.0, 1.0, 41)


@pytest.fixture(scope="module")
def delta() -> cc.Mechanism:
    return cc.with_inertias(cc.load("linear_delta"))


@pytest.fixture(scope="module")
def track(delta: cc.Mechanism) -> cc.Track:
    way = 0.05 * (1 - np.cos(2 * np.pi * TIMES))[:, None] * [1.0, -0.5, 0.3]
    return cc.track(delta, delta.input_values(delta.home) + way, times=TIMES)


@pytest.fixture(scope="module")
def efforts(delta: cc.Mechanism, track: cc.Track) -> cc.EffortHistory:
    return cc.efforts_along(delta, track.times, track.q, track.qdot, track.qddot)


def test_each_sample_is_the_inverse_dynamics(
    delta: cc.Mechanism, track: cc.Track, efforts: cc.EffortHistory
) -> None:
    k, v = 17, delta.input_v
    one = cc.inverse_dynamics(delta, track.q[k], track.qdot[k, v], track.qddot[k, v])
    assert_close(efforts.inputs[k], one.inputs, 0.0)
    assert_close(efforts.joints["leg1_B"][k], one.forces.joints["leg1_B"], 0.0)
    assert "leg1_B" in efforts.undetermined


def test_the_work_over_a_closed_path_is_nothing(efforts: cc.EffortHistory) -> None:
    """It ends where it began, at rest, and nothing rubs: Simpson's rule over the powers."""
    power = efforts.powers.sum(axis=1)
    weights = np.ones(41)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    assert abs(weights @ power) / 120 < 1e-5 * np.abs(power).max()


def test_without_rates_a_spline_gives_them(
    delta: cc.Mechanism, track: cc.Track, efforts: cc.EffortHistory
) -> None:
    by_spline = cc.efforts_along(delta, track.times, track.q)
    middle = slice(5, -5)
    scale = np.abs(efforts.inputs).max()
    assert_close(by_spline.inputs[middle], efforts.inputs[middle], 5e-3 * scale)


def test_dataset_and_figure(efforts: cc.EffortHistory, tmp_path: Path) -> None:
    found = efforts.to_dataset()
    assert found["wrench"].dims == ("time", "joint", "component")
    assert_close(found["effort"].values, efforts.inputs, 0.0)
    assert list(found["effort_units"].values) == ["N", "N", "N"]
    image = tmp_path / "efforts.png"
    draw_efforts(efforts, image, ["leg1_B", "leg1_C"])
    assert image.stat().st_size > 10_000
    with pytest.raises(cc.ClosureError, match="nobody"):
        draw_efforts(efforts, image, ["nobody"])


def test_wrong_paths_are_refused(delta: cc.Mechanism, track: cc.Track) -> None:
    q = track.q[:6]
    for times, words, match in (
        (TIMES[:5], {}, "6 rising numbers"),
        (TIMES[5::-1], {}, "rising"),
        (TIMES[:6], {"v": track.qdot[:6]}, "or neither"),
        (TIMES[:6], {"v": track.qdot[:5], "a": track.qddot[:6]}, "must be"),
        (TIMES[:6], {"payload": {"nobody": 1.0}}, "nobody"),
    ):
        with pytest.raises(cc.ClosureError, match=match):
            cc.efforts_along(delta, times, q, **words)
    with pytest.raises(cc.ClosureError, match="4 samples"):
        cc.efforts_along(delta, TIMES[:3], q[:3])
    bad = q.copy()
    bad[2] += 0.01
    with pytest.raises(cc.ClosureError, match=r"at 0\.05 s: the posture is not closed"):
        cc.efforts_along(delta, TIMES[:6], bad)
