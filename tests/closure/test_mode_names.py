"""Modes by name and number: stable under small changes, and taken wherever a mode may be given."""

from __future__ import annotations

import numpy as np
import pytest
from small_linkages import ROCKING, four_bar
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app


@pytest.mark.parametrize("robot", ["three_rpr", "five_bar", "double_butterfly"])
def test_names_and_order_are_stable_under_small_changes(robot: str) -> None:
    m = cc.load(robot)
    inputs = m.input_values(m.home)
    here = cc.postures(m, inputs=inputs, count=False)
    assert here.names[0] == "home"
    near = inputs + 3e-4 * np.where(m.translational[m.input_v], m.length, 1.0)
    far = inputs + 0.004 * np.where(m.translational[m.input_v], m.length, 1.0)
    for other in (near, far):  # at the second one home's mode has its name no more
        found = cc.postures(m, inputs=other, count=False)
        assert len(found) == len(here)
        for i, name in enumerate(here.names):
            moved = cc.direct(m, other, guess=here[i]).raise_if_failed()
            turns = (found[i].q - moved.q) / (2.0 * np.pi)
            assert np.abs(turns - np.round(turns)).max() < 1e-8, name
            assert found.names[i] == name or name == "home"
        assert len(set(found.names)) == len(found)


def test_direct_takes_a_mode_by_name_or_number() -> None:
    m = cc.load("five_bar")
    inputs = m.input_values(m.home)
    modes = cc.postures(m, inputs=inputs)
    near = inputs + 0.02
    for number, name in enumerate(modes.names):
        expected = cc.direct(m, near, guess=modes[number]).q
        for mode in (name, number, str(number)):
            assert np.array_equal(cc.direct(m, near, mode=mode).q, expected)
        many = cc.direct(m, np.array([near, inputs]), mode=name)
        assert np.array_equal(many.q[0], expected)
        sigma = cc.classify(m, modes[number].q).sigma_direct
        for mode in (name, number):
            assert abs(cc.classify(m, mode).sigma_direct - sigma) < 1e-12


def test_inverse_takes_working_modes() -> None:
    m = cc.load("linear_delta")
    pose = m.pose(m.home)
    expected = cc.inverse(m, pose, m.posture("++-"))
    assert np.array_equal(cc.inverse(m, pose, mode="++-").q, expected.q)
    with pytest.raises(cc.ClosureError, match="not both"):
        cc.inverse(m, pose, m.home, mode="++-")


def test_maps_and_sets_take_them() -> None:
    m = cc.load("five_bar")
    modes = cc.postures(m, inputs=m.input_values(m.home))
    other = modes.names[1]
    at = modes[1].q[m.input_q]
    over = {n: x + np.linspace(-0.05, 0.05, 3) for n, x in zip(m.inputs, at, strict=True)}
    expected = cc.singularity_map(m, over, at=modes[1].q)["det_direct"].values
    for mode in (other, 1):
        found = cc.singularity_map(m, over, mode=mode)
        assert np.allclose(found["det_direct"].values, expected, rtol=1e-12)
        assert cc.singularity_set(m, "direct", over, mode=mode).verdict == "none found"


def test_without_names_modes_have_signs() -> None:
    m = four_bar(ROCKING, 0.9)
    assert np.array_equal(cc.direct(m, [0.9], mode="home").q, cc.direct(m, [0.9]).q)
    other = cc.direct(m, [0.9], mode=1)
    assert np.abs(other.q - m.home).max() > 0.1
    assert np.array_equal(cc.direct(m, [0.9], mode="+1").q, other.q)


@pytest.mark.parametrize("mode", ["+7", 9, -1])
def test_unknown_ones_are_refused_with_those_there_are(mode: str | int) -> None:
    m = four_bar(ROCKING, 0.9)
    with pytest.raises(cc.ClosureError, match=r"no mode .* are home, \+1, by number 0 to 1"):
        cc.direct(m, [0.9], mode=mode)


def test_other_words_are_refused_without_a_search() -> None:
    m = four_bar(ROCKING, 0.9)
    for mode in ("elbow", True, "+", 1.5):
        with pytest.raises(cc.ClosureError, match=r"unknown mode .*; or a name or number"):
            cc.direct(m, [0.9], mode=mode)  # type: ignore[arg-type]
    assert ("modes.at_home", False) not in m.known
    with pytest.raises(cc.ClosureError, match="either a guess or a mode"):
        cc.direct(m, [0.9], m.home, mode="home")


def test_the_command_line_takes_them(tmp_path: object) -> None:
    def told(*words: str) -> str:
        done = CliRunner().invoke(app, [*words])
        assert done.exit_code == 0, done.stderr
        return done.stdout

    name, number = (
        told("direct", "five_bar", "--mode", "+1"),
        told("direct", "five_bar", "--mode", "1"),
    )
    assert name == number != told("direct", "five_bar")
    assert told("classify", "five_bar", "--mode", "+1") == told(
        "classify", "five_bar", "--mode", "1"
    )
    page = f"{tmp_path}/page.html"
    told("view", "five_bar", "--no-modes", "--mode", "+1", "--html", page)
