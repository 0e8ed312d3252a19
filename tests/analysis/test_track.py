"""Following paths of inputs and of poses: accuracy, motion, stops, going on, refusals."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from linkages import flat_parallelogram, four_bar

import closedchain as cc
from closedchain.closure.task import task_jacobian
from closedchain.robots.d1 import geometry
from closedchain.robots.d1.tasks import periodic

load = cache(cc.load)
CLOSED = 1e-12
Motion = Callable[[float], np.ndarray]


def wave(m: cc.Mechanism) -> tuple[Motion, Motion, Motion]:
    """Inputs that swing about home once a second, with their derivatives."""
    rng = np.random.default_rng(1)
    n = len(m.inputs)
    share = 0.015 if m.name == "rpa3t" else 0.15  # rpa3t's home is close to a singularity
    size = share * m.column_scale[m.input_v] * rng.uniform(0.5, 1.0, n)
    phase, w = rng.uniform(0.0, 6.0, n), 2.0 * np.pi
    home = m.input_values(m.home)
    return (
        lambda t: home + size * (np.sin(w * t + phase) - np.sin(phase)),
        lambda t: w * size * np.cos(w * t + phase),
        lambda t: -w * w * size * np.sin(w * t + phase),
    )


def differences(m: cc.Mechanism, q: Any, ahead: Any, behind: Any, h: float) -> tuple[Any, Any]:
    """Central differences of postures: velocity and acceleration (nv,)."""
    forth, back = pin.difference(m.model, q, ahead), pin.difference(m.model, q, behind)
    return (forth - back) / (2.0 * h), (forth + back) / h**2


@pytest.mark.parametrize("name", ["d1", "eclipse", "eclipse2", "rpa3t", "linear_delta", "rus6"])
def test_inputs_of_every_robot(name: str) -> None:
    m = load(name)
    inputs, rates, second = wave(m)
    times = np.linspace(0.0, 1.0, 21)
    found = cc.track(m, inputs, times=times, velocities=rates, accelerations=second)
    assert found.stop is None
    assert found.complete
    assert found.residual.max() < CLOSED
    assert found.q.shape == (21, m.model.nq)
    assert max(np.abs(cc.residual(m, q)).max() for q in found.q) < CLOSED
    assert_close(found.q[:, m.input_q], [inputs(t) for t in times], 0.0)
    q, before = found.q[-1], m.home  # the path ends where it began, at home
    assert_close(pin.difference(m.model, before, q), np.zeros(m.model.nv), 1e-9)
    half = cc.direct(m, inputs(0.5)).raise_if_failed().q
    assert_close(pin.difference(m.model, half, found.q[10]), np.zeros(m.model.nv), 1e-9)

    i, h = 7, 1e-4
    ahead, behind = (
        cc.track(m, [inputs(times[i]), inputs(times[i] + s * h)], start=found.q[i]).q[1]
        for s in (1, -1)
    )
    velocity, acceleration = differences(m, found.q[i], ahead, behind, h)
    assert_close(found.qdot[i], velocity, 1e-5 * np.abs(velocity).max())
    assert_close(found.qddot[i], acceleration, 1e-4 * np.abs(acceleration).max())
    exact = cc.acceleration(m, found.q[i], rates(times[i]), second(times[i]))
    assert_close(found.qdot[i], exact.qdot, 1e-10 * np.abs(exact.qdot).max())
    assert_close(found.qddot[i], exact.qddot, 1e-9 * np.abs(exact.qddot).max())


@pytest.mark.parametrize("name", ["eclipse", "eclipse2", "rpa3t", "linear_delta", "rus6"])
def test_poses_of_every_robot(name: str) -> None:
    """Poses read off a motion lead through them again; D1's home is an inverse singularity."""
    m = load(name)
    inputs, _, _ = wave(m)
    times = np.linspace(0.0, 1.0, 21)
    motion = cc.track(m, inputs, times=times)
    poses = [m.pose(q) for q in motion.q]
    found = cc.track(m, poses, times=times, start=motion.q[0])
    assert found.complete
    assert found.residual.max() < CLOSED
    for q, pose in zip(found.q, poses, strict=True):
        here = m.pose(q)
        assert_close(here.translation, pose.translation, CLOSED)
        if len(m.task.outputs) == 6:
            assert_close(here.rotation, pose.rotation, 1e-11)
    if name != "rus6":  # seven freedoms: another posture of the same pose
        gaps = [pin.difference(m.model, a, b) for a, b in zip(found.q, motion.q, strict=True)]
        assert_close(gaps, np.zeros((21, m.model.nv)), 1e-9)


def tip_motion(m: cc.Mechanism) -> tuple[Callable[[float], pin.SE3], Motion, Motion]:
    """A pose that moves on a curve and turns about a fixed axis, with twist and its rate."""
    home = m.pose(m.home)
    way, turn = 0.1 * m.length * np.array([1.0, -0.5, 0.7]), np.array([0.1, 0.15, -0.1])

    def pose(t: float) -> pin.SE3:
        shift = way * np.sin(2.0 * t)
        return pin.SE3(pin.exp3(np.sin(t) * turn) @ home.rotation, home.translation + shift)

    return (
        pose,
        lambda t: np.concatenate([2.0 * np.cos(2.0 * t) * way, np.cos(t) * turn]),
        lambda t: np.concatenate([-4.0 * np.sin(2.0 * t) * way, -np.sin(t) * turn]),
    )


@pytest.mark.parametrize(
    ("name", "outputs"),
    [
        ("d1", "x y z rx rz"),
        ("d1", "x y z"),
        ("eclipse", "x y z rx ry rz"),
        ("eclipse", "x y z ry"),
        ("eclipse2", "x y rx rz"),
        ("rus6", "x y z rx ry rz"),
        ("rus6", "z rx"),
        ("linear_delta", "x y z"),
    ],
)
def test_motion_along_poses(name: str, outputs: str) -> None:
    """Velocities and accelerations, also those of the shortest motion where freedoms are left."""
    m = load(name)
    pose, twist, rate = tip_motion(m)
    times = np.linspace(0.0, 0.6, 7)
    found = cc.track(
        m, pose, times=times, velocities=twist, accelerations=rate, outputs=outputs
    ).raise_if_stopped()
    i, h = 4, 3e-4
    ahead, behind = (
        cc.track(m, [pose(times[i]), pose(times[i] + s * h)], start=found.q[i], outputs=outputs).q[
            1
        ]
        for s in (1, -1)
    )
    velocity, acceleration = differences(m, found.q[i], ahead, behind, h)
    assert_close(found.qdot[i], velocity, 1e-5 * np.abs(velocity).max())
    assert_close(found.qddot[i], acceleration, 2e-4 * np.abs(acceleration).max())
    if len(outputs.split()) in (3, 6):
        rates = task_jacobian(m, found.q[i], outputs) @ found.qdot[i]
        where = [k for k, n in enumerate(("x", "y", "z", "rx", "ry", "rz")) if n in outputs]
        assert_close(rates, twist(times[i])[where], 1e-10)


def test_periodic_motion_of_d1(d1: cc.Mechanism, reference: Callable[[str], Any]) -> None:
    """Tip velocities of the reference; without derivatives given, those of the spline are near."""
    samples = reference("d1")["periodic"]["samples"]
    times = np.linspace(0.0, samples[-1]["t"], 8 * len(samples) + 1)
    given = periodic(times, geometry())
    plain = cc.track(d1, given.inputs, times=times)
    found = cc.track(
        d1, given.inputs, times=times, velocities=given.rates, accelerations=given.accelerations
    )
    assert found.residual.max() < CLOSED
    assert found.branch == plain.branch == cc.direct(d1, given.inputs[0]).branch
    for n, s in enumerate(samples):
        i = 8 * (n + 1)
        tip = task_jacobian(d1, found.q[i], "x y z rx ry rz") @ found.qdot[i]
        wanted = [s[f"{v}_{x}"] for v in ("vtip", "omega") for x in "xyz"]
        assert_close(tip, wanted, 1e-8)
        assert_close(d1.point(found.q[i], "T"), [s[f"tip_{x}"] for x in "xyz"], 1e-9)
    inner = slice(4, -4)
    assert_close(plain.q, found.q, 1e-9)
    assert_close(plain.qdot[inner], found.qdot[inner], 1e-4)
    assert_close(plain.qddot[inner], found.qddot[inner], 1e-2)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_stop_at_a_direct_singularity(d1: cc.Mechanism, seed: int) -> None:
    """Inputs that run straight into a fold: the last good posture, and within 1e-6 the place."""
    way = np.random.default_rng(seed).normal(size=6)
    way *= 0.6 / np.abs(way).max()
    home = d1.input_values(d1.home)
    found = cc.track(d1, np.array([home, home + way]))
    assert found.reached == 1
    assert not found.complete
    assert found.stop is not None
    stop = found.stop
    assert stop.kinds == {"direct"}
    assert "direct singularity at sample" in stop.message
    assert 0.0 <= stop.where - stop.parameter < 1e-6
    assert np.abs(cc.residual(d1, stop.q)).max() < CLOSED
    assert_close(stop.q[d1.input_q], home + stop.parameter * way, 1e-12)
    # cc.direct bisects for itself: still solvable just before, no more just after
    assert cc.direct(d1, home + (stop.where - 1e-6) * way).converged
    assert not cc.direct(d1, home + (stop.where + 1e-6) * way).converged
    with pytest.raises(cc.ClosureError, match="direct singularity"):
        found.raise_if_stopped()
    assert found.resume().stop.where == pytest.approx(stop.where, abs=1e-9)


def test_stop_at_an_inverse_singularity() -> None:
    """Tilted about y, Eclipse's S_a comes onto the central axis at 90 degrees (T1a)."""
    m = load("eclipse")
    centre = np.array([0.0, 0.0, 0.1])
    angles = np.linspace(0.0, 1.8, 19)
    poses = [pin.SE3(pin.utils.rotate("y", a), centre) for a in angles]
    found = cc.track(m, poses, times=angles)
    assert found.stop is not None
    assert "inverse" in found.stop.kinds
    assert found.stop.where == pytest.approx(np.pi / 2, abs=1e-6)
    assert found.reached == 16


def test_stop_where_a_linkage_branches() -> None:
    """A parallelogram laid flat can go on as an anti-parallelogram."""
    found = cc.track(flat_parallelogram(1.0), np.array([1.0, 0.5, -0.5])[:, None])
    assert found.reached == 2
    assert found.stop is not None
    assert {"direct", "constraint"} <= found.stop.kinds
    assert found.stop.where == pytest.approx(1.5, abs=1e-6)


def test_inputs_that_contradict_each_other() -> None:
    """A four-bar with both cranks driven moves only where they agree."""
    one = four_bar()
    both = four_bar({"q1": "A", "q2": "D"})
    angles = np.linspace(0.0, 0.3, 4)[:, None] + one.input_values(one.home)
    follower = both.input_q[1]
    agreed = np.column_stack([angles, cc.track(one, angles).q[:, follower]])
    assert cc.track(both, agreed).complete
    found = cc.track(both, agreed + np.outer([0.0, 0.0, 1e-3, 0.0], [0.0, 1.0]))
    assert found.reached == 2
    assert found.stop is not None
    assert found.stop.kinds == frozenset()
    assert "contradicts the loops" in found.stop.message


def test_samples_may_be_far_apart() -> None:
    """Steps are as short as they must be: many samples lead where few do, or stop where they do."""
    m = load("rus6")
    home = m.input_values(m.home)
    rng = np.random.default_rng(5)
    stops = 0
    for _ in range(8):
        way = 0.4 * rng.normal(size=7)
        few = cc.track(m, np.array([home, home + way]))
        many = cc.track(m, home + np.linspace(0.0, 1.0, 21)[:, None] * way)
        assert few.complete == many.complete
        if few.stop is None or many.stop is None:
            assert_close(few.q[-1], many.q[-1], 1e-9)
            continue
        stops += 1
        assert few.stop.where == pytest.approx(many.stop.where / 20.0, abs=1e-7)
        assert few.stop.kinds == many.stop.kinds == {"direct"}
    assert 0 < stops < 8


def test_start_that_is_singular_or_out_of_reach(d1: cc.Mechanism) -> None:
    home = d1.pose(d1.home)
    found = cc.track(d1, [home, home], times=[0.0, 1.0])
    assert (found.reached, found.q.shape, found.qdot.shape) == (0, (0, 35), (0, 33))
    assert found.stop is not None
    assert found.stop.kinds == {"inverse"}
    long = np.array(d1.input_values(d1.home))
    long[0] += 5.0
    far = cc.track(d1, [long, long])
    assert far.reached == 0
    assert far.stop is not None
    assert "sample 0 is not reached from the start" in far.stop.message


def test_going_on() -> None:
    m = load("linear_delta")
    inputs, _, _ = wave(m)
    times = np.linspace(0.0, 1.0, 11)
    seen: list[tuple[str, int, int]] = []
    whole = cc.track(m, inputs, times=times, progress=lambda *a: seen.append(a))
    assert seen[0] == ("track", 1, 11)
    assert seen[-1] == ("track", 11, 11)
    part = cc.track(m, inputs, times=times, until=0.45)
    assert (part.reached, part.stop, part.complete) == (5, None, False)
    more = part.resume(until=0.75).resume()
    assert more.complete
    assert more.resume() is more
    for a, b in [(more.q, whole.q), (more.qdot, whole.qdot), (more.qddot, whole.qddot)]:
        assert_close(a, b, 1e-9)
    assert_close(more.times, times, 0.0)
    assert more.residual.shape == (11,)
    after = cc.track(m, [inputs(0.4), inputs(0.5)], start=part)
    assert_close(after.q[0], part.q[-1], 1e-11)
    guessed = part.resume(guess=whole.q[5])
    assert guessed.complete
    assert_close(guessed.q, whole.q, 1e-9)
    with pytest.raises(ValueError, match="read-only"):
        whole.q[0, 0] = 1.0


def test_paths_in_other_words() -> None:
    m = load("linear_delta")
    inputs, _, _ = wave(m)
    times = np.linspace(0.0, 0.3, 4)
    table = np.array([inputs(t) for t in times])
    plain = cc.track(m, table)
    assert plain.times is None
    assert plain.qdot is None
    assert plain.beyond_limits == ()
    by_name = dict(zip(reversed(m.inputs), reversed(table.T), strict=True))
    assert_close(cc.track(m, by_name).q, plain.q, 0.0)
    timed = cc.track(m, by_name, times=times)

    def named(t: float) -> dict[str, float]:
        return dict(zip(m.inputs, inputs(t), strict=True))

    assert_close(cc.track(m, named, times=times).q, timed.q, 0.0)
    assert_close(timed.q, plain.q, 1e-11)
    single = cc.track(m, table[:1], times=[0.0])
    assert single.complete
    assert_close(single.qdot, np.zeros((1, m.model.nv)), 0.0)


@pytest.mark.parametrize(
    ("path", "options", "message"),
    [
        ([[0.0, 0.0]], {}, r"path must have shape \(n, 3\)"),
        ([[0.0, 0.0, np.nan]], {}, "not finite"),
        ([["a", "b", "c"]], {}, "table"),
        ([], {}, r"path must have shape \(n, 3\)"),
        ({"q1": [0.0], "q2": [0.0]}, {}, "no values for input q3"),
        ({"q1": [0.0], "q2": [0.0], "q4": [0.0]}, {}, "unknown input 'q4'"),
        ({"q1": [0.0], "q2": [0.0], "q3": [0.0, 1.0]}, {}, "as many samples"),
        (np.zeros((3, 3)), {"times": [0.0, 1.0]}, "times: 2 given for 3 samples"),
        (np.zeros((3, 3)), {"times": [0.0, 1.0, 1.0]}, r"times must rise: times\[2\]"),
        (np.zeros((1, 3)), {"times": [np.inf]}, "not finite"),
        (lambda t: np.zeros(3), {}, "needs times="),
        (np.zeros((2, 3)), {"velocities": np.zeros((2, 3))}, "timed path"),
        (np.zeros((2, 3)), {"times": [0, 1], "velocities": np.zeros((1, 3))}, "1 rows given for 2"),
        (np.zeros((2, 3)), {"outputs": "x"}, "outputs belong to a path of poses"),
        (np.zeros((2, 3)), {"method": "euler"}, "unknown method 'euler'"),
        (np.zeros((2, 3)), {"gain": 1.0}, 'belong to method="davies"'),
        (np.zeros((2, 3)), {"method": "davies", "gain": -1.0}, "must not be negative"),
        ([pin.SE3.Identity(), 3.0], {}, r"path\[1\] must be a pin.SE3"),
        (pin.SE3.Identity(), {}, "a list of poses"),
    ],
)
def test_wrong_questions(path: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        cc.track(load("linear_delta"), path, **options)
