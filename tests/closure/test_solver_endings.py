"""How solvers end: one enumeration, events to rounding, and the keyboard."""

from __future__ import annotations

import os
import signal
import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import closedchain as cc
from closedchain.closure.solve.curve import trace
from closedchain.closure.solve.events import Event, along
from closedchain.closure.solve.outcome import Ending, Outcome
from closedchain.closure.solve.solution_set import Bound, settle


@dataclass(frozen=True)
class Circle:
    """x^2 + y^2 = 1; every evaluation takes ``pause`` seconds."""

    pause: float = 0.0
    size: int = 2

    def frame(self, z: np.ndarray) -> None:
        return None

    def evaluate(self, z: np.ndarray, frame: None) -> tuple[np.ndarray, np.ndarray]:
        time.sleep(self.pause)
        return np.array([z @ z - 1.0]), 2.0 * z[None]

    def move(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        return z + step

    def difference(self, one: np.ndarray, two: np.ndarray) -> np.ndarray:
        return two - one


def test_every_ending_has_a_word_a_code_and_a_sentence() -> None:
    assert len({e.word for e in Ending}) == len({e.sentence for e in Ending}) == len(Ending)
    for e in Ending:
        assert Ending.of(e.code) is Ending.named(e.word) is e
        assert len(e.sentence.split()) >= 3
    assert {e for e in Ending if e.good} == {Ending.ARRIVED, Ending.CLOSED}


def test_an_outcome_is_a_value_for_one_or_many() -> None:
    one = Outcome.one(np.zeros(3), 1e-13, None, Ending.ARRIVED)
    assert (len(one), one.good, one.ending) == (1, True, Ending.ARRIVED)
    codes = np.array([Ending.ARRIVED.code, Ending.FOLD.code])
    many = Outcome(np.zeros((2, 3)), np.zeros(2), np.ones(2, dtype=int), codes, np.ones(2))
    assert many.converged.tolist() == [True, False]
    assert many.endings == (Ending.ARRIVED, Ending.FOLD)
    assert not many.good
    with pytest.raises(ValueError, match="read-only"):
        many.q[0, 0] = 1.0
    with pytest.raises(ValueError, match="too many values"):
        _ = many.ending


def test_endings_of_a_trace() -> None:
    start, towards, steps = np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.full(2, 0.1)
    assert trace(Circle(), start, towards, steps).ending is Ending.CLOSED
    bound = Bound(1, 1, 1.0, -0.5, 0.5, "limit of a joint", Ending.LIMIT)
    found = trace(Circle(), start, towards, steps, [bound])
    assert (found.ending, found.end) == (Ending.LIMIT, "limit of a joint")
    assert trace(Circle(), start, towards, steps, most=5).ending is Ending.BUDGET
    assert settle(Circle(), np.zeros(2)).ending is Ending.OPEN


@dataclass(frozen=True)
class Away:
    """Signed distance from a place where something happens."""

    value: float
    signed: bool

    @property
    def size(self) -> float:
        return abs(self.value)

    @property
    def vanished(self) -> bool:
        return self.size < 1e-12

    def parted_from(self, other: Any) -> float:
        return float(np.sign(self.value * other.value)) if self.signed else 0.0


@pytest.mark.parametrize("signed", [True, False])
def test_events_are_located_to_rounding(signed: bool) -> None:
    """x = 0.3 on the circle, met twice: by a change of sign, and as a value that touches zero."""
    system = Circle()
    path = trace(system, np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.full(2, 0.1))

    def place(one: np.ndarray, two: np.ndarray, share: float) -> np.ndarray:
        return settle(system, one + share * (two - one)).posture

    event = Event(lambda z: Away(float(z[0]) - 0.3, signed), place)
    here, between = along(path.points, event, closed=True)
    assert here == []
    assert [np.sign(z[1]) for _, z in between] == [1.0, -1.0]
    for i, z in between:
        assert abs(z[0] - 0.3) < 1e-12
        assert (path.points[i][0] - 0.3) * (path.points[i + 1][0] - 0.3) < 0.0


def test_two_events_between_two_points() -> None:
    """They are told apart although both neighbours have the same sign."""
    system = Circle()
    angles = np.array([-0.5, -0.15, 0.15, 0.5])
    points = [np.array([np.cos(a), np.sin(a)]) for a in angles]

    def place(one: np.ndarray, two: np.ndarray, share: float) -> np.ndarray:
        return settle(system, one + share * (two - one)).posture

    event = Event(lambda z: Away(float(z[0]) - np.cos(0.05), signed=True), place)
    _, between = along(points, event, closed=False)
    # points are on the circle to 1e-12, which counts for twenty times as much along it
    found = sorted(float(np.arcsin(z[1])) for _, z in between)
    assert found == pytest.approx([-0.05, 0.05], abs=1e-10)


def interrupted(work: Any, begun: threading.Event | None = None, after: float = 0.3) -> float:
    """Seconds from Ctrl-C to its answer; fails where the work ends by itself first.

    Ctrl-C comes ``after`` seconds, and once ``begun``, if given, says that the work is under way.
    """
    sent = []

    def press() -> None:
        if begun is not None and not begun.wait(60.0):
            return
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after, press)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
        return time.perf_counter() - sent[0]
    finally:
        timer.cancel()


@pytest.mark.parametrize("what", ["trace", "track", "self_motion", "follow"])
def test_the_keyboard_stops_within_a_second(what: str) -> None:
    m = cc.load("d1")
    home = m.input_values(m.home)
    times = np.linspace(0.0, 60.0, 6001)
    begun = threading.Event()
    works = {
        "trace": lambda: trace(
            Circle(0.01), np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.full(2, 1e-3)
        ),
        "track": lambda: cc.track(m, home + 0.01 * np.sin(times)[:, None] * np.ones(len(home))),
        "self_motion": lambda: cc.self_motion(m, m.home, "x y z rx rz", step=1e-3, most=100_000),
        "follow": lambda: cc.follow(
            *(m, [m.pose(m.home)] * times.size),
            times=times,
            outputs="x y z rx rz",
            progress=lambda *_: begun.set(),
        ),
    }
    assert interrupted(works[what], begun if what == "follow" else None) < 1.0
