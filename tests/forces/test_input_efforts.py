"""Input efforts by machine code: those of statics, at one posture, many, and singular ones."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import assert_close
from heavy import weighed

import closedchain as cc

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkage_text import J, load
from linkages import four_bar, spinning_rod

PUSH = np.array([3.0, -2.0, 5.0, 0.4, -0.3, 0.2])


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_they_are_those_of_statics(name: str) -> None:
    m = weighed(cc.load(name))
    q = cc.resets(m, 20, seed=2).q
    fall = np.array([1.0, -9.0, -2.0])
    other = m.description.links[-1].name
    for words in (
        {"wrench": PUSH, "gravity": fall},
        {"wrench": {other: PUSH}, "gravity": False, "payload": {other: 2.0}},
        {"payload": {m.task.tip: 1.5}},
    ):
        found = cc.input_efforts(m, q, **words)
        expected = np.array([cc.statics(m, one, **words).inputs for one in q])
        scale = np.abs(expected).max()
        assert_close(found, expected, 1e-8 * scale)
        assert_close(cc.input_efforts(m, q[3], **words), found[3], 1e-12 * scale)


def test_open_chains() -> None:
    """A double pendulum's weights by hand."""
    m = weighed(load("two", [J("A", "base", "a", axis="0 1 0"), J("B", "a", "b", "0 0 -1",
                             axis="0 1 0")], inputs={"q1": "A", "q2": "B"}, tip="b"))  # fmt: skip
    q = np.random.default_rng(1).uniform(-1, 1, (10, 2))
    found = cc.input_efforts(m, q)
    expected = [cc.statics(m, one).inputs for one in q]
    assert_close(found, expected, 1e-10)


def test_spare_inputs_and_idle_parts_go_another_way() -> None:
    m = four_bar({"q1": "A", "q2": "D"})
    assert_close(cc.input_efforts(m, m.home, PUSH), cc.statics(m, m.home, PUSH).inputs, 0.0)
    rod = spinning_rod()
    many = cc.input_efforts(rod, np.tile(rod.home, (3, 1)), PUSH)
    assert_close(many, np.tile(cc.statics(rod, rod.home, PUSH).inputs, (3, 1)), 1e-12)


def test_singular_postures() -> None:
    m = four_bar({"q1": "D"})
    d = np.pi - np.arccos((0.4**2 + 0.3**2 - 0.5**2) / (2 * 0.4 * 0.3))
    a = np.arctan2(0.3 * np.sin(d), 0.4 + 0.3 * np.cos(d))
    q = np.array([m.home, [a, 0.0, d]])
    with pytest.raises(cc.ClosureError, match="not carried"):
        cc.input_efforts(m, q, {"crank": [0, 0, 0, 0, 0, 1.0]})
    pull = {"coupler": [np.cos(a), np.sin(a), 0, 0, 0, 0]}
    assert np.isfinite(cc.input_efforts(m, q, pull)).all()


def test_wrong_questions_are_refused() -> None:
    m = four_bar()
    with pytest.raises(cc.ClosureError, match="posture 1 is not closed"):
        cc.input_efforts(m, [m.home, m.home + 0.1])
    with pytest.raises(cc.ClosureError, match="nobody"):
        cc.input_efforts(m, m.home, {"nobody": PUSH})
    with pytest.raises(cc.ClosureError, match="below zero"):
        cc.input_efforts(m, m.home, payload={"coupler": -1.0})
