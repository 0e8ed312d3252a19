"""What the module of JavaScript says of a posture's kinds is what ``cc.classify`` says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from exported import NODE, run_js
from small_linkages import (
    PARALLELOGRAM,
    ROCKING,
    build,
    four_bar,
    four_bar_angles,
    joint,
    toggle,
)

import closedchain as cc

pytestmark = pytest.mark.skipif(NODE is None, reason="no node here")

Case = tuple[cc.Mechanism, list[np.ndarray]]
SHARES = [0.3, *(10.0**-k for k in range(2, 15)), 0.0]
"""How far from a singular posture, in its inputs."""


def toggled() -> Case:
    """A crank up to the angle at which rod and rocker are stretched: a fold."""
    m, end = four_bar(ROCKING, 1.0), toggle(ROCKING)
    return m, [np.array(four_bar_angles(ROCKING, end * (1.0 - share))) for share in SHARES]


def flat() -> Case:
    """A parallelogram as it lies down: its closures lose a rank, and branches meet."""
    m = four_bar(PARALLELOGRAM, 0.8, task='<task base="base" tip="rocker" outputs="rz"/>')
    return m, [np.array([share, -share, share]) for share in SHARES]


def stretched() -> Case:
    """Two links without a loop, as they become straight: the tip loses a direction."""
    parts = [joint("a", "base", "one"), joint("b", "one", "two", "1 0 0")]
    parts.append(joint("c", "two", "tip", "1 0 0", kind="fixed"))
    task = '<task base="base" tip="tip" outputs="x y"/>'
    m = build("base one two tip", parts, {"b": 0.5}, inputs="a b", task=task)
    return m, [np.array([0.4, share]) for share in SHARES]


def underdriven() -> Case:
    """Two links of which one is driven: direct everywhere."""
    parts = [joint("a", "base", "one"), joint("b", "one", "two", "1 0 0")]
    parts.append(joint("c", "two", "tip", "1 0 0", kind="fixed"))
    task = '<task base="base" tip="tip" outputs="x y"/>'
    m = build("base one two tip", parts, {"b": 0.5}, inputs="a", task=task)
    return m, [np.array([0.4, share]) for share in SHARES[::4]]


def d1() -> Case:
    """A floating platform beside its home, where many ranks are nearly lost, and elsewhere."""
    m = cc.load("d1")
    home, found = m.input_values(m.home), [m.home]
    rng = np.random.default_rng(1)
    for share in SHARES[::3]:
        answer = cc.direct(m, home + share * rng.standard_normal(6))
        if np.abs(cc.residual(m, answer.q)).max() < 1e-9:
            found.append(answer.q)
    assert len(found) > 4
    return m, found


def rus6() -> Case:
    """Redundant rows, and a spare input."""
    m = cc.load("rus6")
    found = [m.home, cc.direct(m, m.input_values(m.home) + 0.01).raise_if_failed().q]
    return m, found


@pytest.mark.parametrize("make", [toggled, flat, stretched, underdriven, d1, rus6])
def test_it_decides_as_python_does(make: Callable[[], Case], tmp_path: Path) -> None:
    m, postures = make()
    body = "return given.q.map((q) => robot.classify(q));"
    found = run_js(tmp_path, m, body, {"q": postures})
    seen = set()
    for q, told in zip(postures, found, strict=True):
        known = cc.classify(m, q)
        assert set(told["kinds"]) == known.kinds, q
        assert set(told["types"]) == known.types, q
        rounding = 1e-12 + 1e-15 / max(known.ranks["constraint"].above, 1e-9)
        assert abs(told["sigma"]["direct"] - known.sigma_direct) < rounding
        assert abs(told["sigma"]["inverse"] - known.sigma_inverse) < rounding
        distance = np.inf if told["distance"] is None else told["distance"]
        assert distance == pytest.approx(known.distance, rel=1e-2, abs=1e-12)
        assert told["accuracy"] == pytest.approx(known.accuracy, rel=0.5)
        seen.add(known.kinds)
    assert len(seen) > 1 or make in (underdriven, rus6)


def test_open_postures_are_not_classified(tmp_path: Path) -> None:
    m, postures = toggled()
    body = "return [robot.classify(given.open), robot.classify([NaN, 0, 0])];"
    assert run_js(tmp_path, m, body, {"open": postures[0] + 0.1}) == [None, None]
