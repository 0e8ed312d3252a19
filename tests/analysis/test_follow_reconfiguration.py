"""Following with other robots: rus6 reconfigures, three spare freedoms, an overdriven Eclipse."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from overdriven import overdriven_eclipse

import closedchain as cc
from closedchain.analysis.motion.follow import compare, follow
from closedchain.robots import rus6

load = cache(cc.load)
TIMES = np.linspace(0.0, 4.0, 41)
BETA = {"beta": (-1.5, 1.5)}


def turned(angles: tuple[float, float, float], home: np.ndarray) -> list[pin.SE3]:
    """There and back: yaw, pitch and roll up to the angles, at home's place."""
    share = np.sin(np.linspace(0.0, np.pi, TIMES.size)) ** 2
    return [pin.SE3(rus6.rotation_ypr(*(s * np.array(angles))), home) for s in share]


def rus6_path(angles: tuple[float, float, float]) -> list[pin.SE3]:
    m = load("rus6")
    return turned(angles, m.pose(m.home).translation)


@pytest.mark.parametrize(
    ("angles", "clear"),
    [((1.6, 0.0, 0.0), 0.05), ((0.0, 0.0, 0.8), 0.045), ((-1.5, 0.0, 0.0), 0.024)],
)
def test_rus6_keeps_clear_by_reconfiguring(
    angles: tuple[float, float, float], clear: float
) -> None:
    """Beyond yaw 87.6 and -84.9 and roll 42.7 degrees, where det Jx = 0 with beta = 0."""
    m, poses = load("rus6"), rus6_path(angles)
    locked = follow(m, poses, times=TIMES, lock="beta")
    assert not locked.converged
    assert "direct singularity" in locked.message
    assert_close(locked.inputs[:, 6], np.zeros(locked.reached), 0.0)
    free = follow(m, poses, times=TIMES, limits=BETA, method="path").raise_if_failed()
    assert free.smallest > clear
    assert free.residual.max() < 1e-12
    assert free.task_error.max() < 1e-12
    beta = free.inputs[:, 6]
    assert np.abs(beta).max() <= 1.5 + 1e-6
    assert np.ptp(beta) > 0.3
    # it is the reconfiguration that does it: the same poses in closed form
    form = [
        rus6.inverse(rus6.Pose(p.rotation, p.translation), b, rus6.geometry())
        for p, b in zip(poses, beta, strict=True)
    ]
    assert_close(free.inputs[:, :6], [legs.alpha for legs in form], 1e-9)
    dets = np.array([rus6.det_jx(legs) for legs in form])
    assert (dets < 0.0).all()  # as at home
    still = [
        rus6.det_jx(rus6.inverse(rus6.Pose(p.rotation, p.translation), 0.0, rus6.geometry()))
        for p in poses
    ]
    assert max(still) > 0.0


def test_the_start_may_be_held() -> None:
    m, poses = load("rus6"), rus6_path((1.6, 0.0, 0.0))
    options = {"times": TIMES, "limits": BETA, "method": "path"}
    held = follow(m, poses, hold_start=True, **options).raise_if_failed()
    free = follow(m, poses, **options).raise_if_failed()
    assert_close(held.q[0], m.home, 1e-9)
    assert abs(free.inputs[0, 6]) > 0.1
    assert free.smallest >= held.smallest - 1e-4


def test_gradient_needs_gain_where_the_measure_is_flat() -> None:
    """It sees only the next step: even with a large gain it passes nearer than the whole path."""
    m, poses = load("rus6"), rus6_path((1.6, 0.0, 0.0))
    found = follow(m, poses, times=TIMES, limits=BETA)
    assert not found.converged
    assert "direct singularity between" in found.message
    assert np.abs(found.inputs[:, 6]).max() < 0.15  # of the 1.5 that it may use
    eager = follow(m, poses, times=TIMES, limits=BETA, gain=2000.0).raise_if_failed()
    whole = follow(m, poses, times=TIMES, limits=BETA, method="path")
    assert 0.04 < eager.smallest < 0.06
    # beta ends at its limit of 1.5 rad, where the hardest sample is as clear as it can be
    assert whole.smallest > 1.1 * eager.smallest


def test_what_is_returned_of_a_blocked_path_keeps_the_limits() -> None:
    """Whole-path search begins without limits; where it fails, they hold for what is reached."""
    m = load("rus6")
    rise = 0.2 * np.sin(np.linspace(0.0, np.pi, TIMES.size)) ** 2
    home = m.pose(m.home)
    poses = [pin.SE3(home.rotation, home.translation + np.array([0.0, s, 0.0])) for s in rise]
    for objective in ("singularity", "range"):
        found = follow(m, poses, times=TIMES, method="path", objective=objective, speed_limits=0.5)
        assert not found.converged
        assert 1 < found.reached < 30
        rates = np.abs(np.diff(found.inputs, axis=0)) / np.diff(found.times)[:, None]
        assert rates.max() <= 0.5 * (1.0 + 1e-5)
        free = follow(m, poses, times=TIMES, method="path", objective=objective)
        assert not free.converged  # out of reach without speed limits as well
        assert np.abs(np.diff(free.inputs, axis=0)).max() / 0.1 > 0.5
        assert found.reached <= free.reached


@pytest.mark.slow
def test_three_spare_freedoms() -> None:
    m = load("rus6", variant="free")
    poses = rus6_path((1.6, 0.0, 0.0))
    limits = {f"beta{i}": (-1.5, 1.5) for i in (1, 2, 3)}
    found = follow(m, poses, times=TIMES, limits=limits, method="path").raise_if_failed()
    coupled = follow(load("rus6"), poses, times=TIMES, limits=BETA, method="path")
    assert found.smallest > coupled.smallest
    # by the rates of all joints there is little to be gained from moving the three unlike
    assert np.ptp(found.inputs[:, 6:], axis=1).max() > 1e-3
    part = follow(m, poses, times=TIMES, limits=limits, lock="beta1")
    assert part.problem.freedoms == 2
    # of three freedoms, two are kept within speed limits too
    slow = follow(
        m, poses[:15], times=TIMES[:15], limits=limits, speed_limits={"beta1": 0.05, "beta2": 0.05}
    )
    free = follow(m, poses[:15], times=TIMES[:15], limits=limits)
    rates = np.abs(np.diff(slow.inputs[:, 6:8], axis=0)) / np.diff(TIMES[:15])[:, None]
    assert slow.converged
    assert rates.max() <= 0.05 * (1.0 + 1e-5)
    assert np.abs(free.input_speeds[:, 6:8]).max() > 0.055


def test_rus6_table() -> None:
    m = load("rus6")
    poses = turned((0.0, 0.3, 0.0), m.pose(m.home).translation)[::2]
    table = compare(m, poses, times=TIMES[::2], limits=BETA)
    assert [r.name for r in table.rows[-3:]] == ["beta locked", "gradient", "path"]
    assert not any(table.row(f"alpha{i} locked").converged for i in (4, 5, 6))
    assert table.row("beta locked").converged
    assert table.best_free > table.best_locked
    more = compare(m, poses, times=TIMES[::2], methods=(), lock_values={"beta": [0.2, -0.2]})
    assert [r.name for r in more.rows[-2:]] == ["beta = 0.2", "beta = -0.2"]
    assert more.best_free == 0.0


def test_redundant_actuation_is_followed_but_not_optimised() -> None:
    """Eclipse with its revolute joints driven too passes where six inputs meet a singularity."""
    six, nine = load("eclipse"), overdriven_eclipse()
    share = np.sin(np.linspace(0.0, np.pi, 41)) ** 2
    place = six.pose(six.home).translation
    poses = [pin.SE3(pin.exp3(np.array([0.0, 1.25 * s, 0.0])), place) for s in share]
    stopped = follow(six, poses, times=TIMES)
    assert not stopped.converged
    assert "direct singularity" in stopped.message
    found = follow(nine, poses, times=TIMES).raise_if_failed()
    # with all three driven the platform is held everywhere: S_a, S_b and S_c are given
    assert found.sigma_direct.min() > 0.5 * found.sigma_direct.max()
    assert_close(found.inputs[: stopped.reached, :6], stopped.inputs, 1e-9)
    assert "9 inputs for 6 freedoms are redundancy of actuation" in found.message
    whole = follow(nine, poses, times=TIMES, method="path").raise_if_failed()
    assert_close(whole.q, found.q, 0.0)
    with pytest.raises(cc.ClosureError, match="leave no freedoms"):
        follow(nine, poses, times=TIMES, lock="r_a")
    with pytest.raises(cc.ClosureError, match="redundant as actuators, not as motions"):
        compare(nine, poses, times=TIMES)


@pytest.mark.parametrize("name", ["rpa3t", "linear_delta"])
def test_redundant_closure_rows(name: str) -> None:
    """One output of three: two freedoms to spare, with closure rows that depend on each other."""
    m = load(name)
    start = m.pose(m.home)
    share = 0.02 * np.sin(np.linspace(0.0, np.pi, 11)) ** 2
    up = np.array([0.0, 0.0, 1.0])
    poses = [pin.SE3(start.rotation, start.translation + s * up) for s in share]
    times = np.linspace(0.0, 1.0, 11)
    rest = follow(m, poses, times=times, outputs="z", gain=0.0).raise_if_failed()
    for method in ("gradient", "path"):
        found = follow(m, poses, times=times, outputs="z", method=method).raise_if_failed()
        assert found.residual.max() < 1e-12
        assert found.task_error.max() < 1e-12
        assert found.problem.freedoms == 2
        assert found.smallest >= rest.smallest - 1e-12
