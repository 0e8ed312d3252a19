"""All postures of platforms: shapes, the forty of Dietmaier, idle spins, an independent proof."""

from __future__ import annotations

import json

import linkages
import numpy as np
import pytest
from oracle.krawczyk import proves
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app
from closedchain.closure.modes.blocks import blocks_of
from closedchain.closure.modes.complex_equations import equations_of
from closedchain.closure.modes.monodromy import generic_solutions
from closedchain.closure.modes.shapes import Shapes, groups, shapes_of
from closedchain.closure.position import driven

LEGS = (1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071)
"""Dietmaier, The Stewart-Gough platform of general geometry can have 40 real postures, 1998."""


@pytest.fixture(scope="module")
def platform() -> cc.Mechanism:
    return cc.load("gough_stewart", home="0.03 -0.02 0.5 0.05 -0.1 0.08 1")


def test_other_spellings_are_no_other_shapes(platform: cc.Mechanism) -> None:
    """The universal joint's second spelling, and the leg turned with its slide reversed."""
    q = np.array(platform.home)
    at = {
        name: platform.model.joints[platform.model.getJointId(name)].idx_q
        for name in ("leg1_U1", "leg1_U2", "leg1_P")
    }
    second, turned, other = q.copy(), q.copy(), q.copy()
    second[at["leg1_U1"]] += np.pi
    second[at["leg1_U2"]] = np.pi - q[at["leg1_U2"]]
    turned[at["leg1_U1"]] += np.pi
    turned[at["leg1_U2"]] *= -1.0
    turned[at["leg1_P"]] *= -1.0
    other[at["leg1_U2"]] += 1e-3
    for posture in (second, turned):
        assert np.abs(platform.workspace.residual(posture)).max() < 1e-12
    shapes = Shapes(platform).of(np.array([q, second, turned, other]))
    assert groups(shapes).tolist() == [0, 0, 0, 1]
    found = cc.postures(platform, inputs=platform.input_values(platform.home), count=False)
    assert np.abs(found["home"].q - q).max() < 1e-9  # the spelling within limits, next to home


@pytest.mark.slow
def test_all_forty_of_dietmaier_are_counted_and_proved() -> None:
    m = cc.load("gough_stewart", variant="dietmaier")
    found = cc.postures(m, inputs=LEGS)
    assert (found.complete, found.complex_count, len(found)) == ("counted", 40, 40)
    assert found.certified.all()
    shapes = Shapes(m).of(found.q)
    apart = np.abs(shapes[:, None] - shapes[None]).max(axis=2) + np.eye(40)
    assert apart.min() > 1e-2
    assert np.abs(m.input_values(found.q[7]) - LEGS).max() < 1e-12


def test_idle_spins_do_not_multiply_modes() -> None:
    """A rod between two balls spins about itself: one family for each of two postures."""
    m = linkages.spatial_four_bar(hooke=False)
    found = cc.postures(m, inputs=m.input_values(m.home))
    assert len(found) == 2
    assert [f.dimension for f in found.families] == [1, 1]
    without = linkages.spatial_four_bar(hooke=True)
    assert len(cc.postures(without, inputs=without.input_values(without.home), count=False)) == 2


@pytest.mark.slow
def test_an_independent_checker_agrees() -> None:
    """Eclipse: own kinematics in mpmath's intervals. A posture that is moved is not proved."""
    m = cc.load("eclipse")
    found = cc.postures(m, inputs=m.input_values(m.home), count=False)
    certificate = found.certificate(m)
    assert len(certificate["postures"]) == 8
    for i in range(8):
        assert proves(m.description, certificate, i, 1.0)
    moved = json.loads(json.dumps(certificate))
    next(x for x in reversed(moved["postures"][0]["joints"].values()) if len(x) == 1)[0] += 1e-7
    assert not proves(m.description, moved, 0, 1.0)


def test_the_command(tmp_path: object) -> None:
    runner, file = CliRunner(), f"{tmp_path}/proof.json"
    words = ["postures", "linear_delta", "--xyz", "0", "0", "-0.6", "--no-count"]
    shown = runner.invoke(app, [*words, "--certificate", file], catch_exceptions=False)
    assert shown.exit_code == 0
    assert shown.stdout.startswith("8 postures with the tip's x y z held.")
    assert "home" in shown.stdout
    with open(file) as text:
        proof = json.load(text)
    assert len(proof["postures"]) == 8
    assert proof["postures"][0]["radius"] == 1e-10
    data = json.loads(runner.invoke(app, [*words, "--json"], catch_exceptions=False).stdout)
    assert (data["count"], data["complete"], data["complex_count"]) == (8, "searched", None)
    assert all(data["certified"])
    for wrong, why in (
        (["postures", "linear_delta", "nowhere=1"], "unknown input 'nowhere'"),
        (["postures", "linear_delta", "--fixed", "nowhere=1"], "unknown joint"),
        (["postures", "linear_delta", "q1=0", "--fixed", "leg1_P=1"], "one of these"),
        (["postures", "linear_delta", "--seconds", "-1"], "not above zero"),
    ):
        refused = runner.invoke(app, wrong, catch_exceptions=False)
        assert refused.exit_code == 1
        assert why in refused.stderr


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 10, 57])
def test_platforms_of_random_sizes_have_forty(seed: int) -> None:
    """Of the first two, loops that are small beside the platform reach 36 and 39.

    The third has a solution that is a thousand times as large as the others; without it, sums over
    119 points of a slice are straight to seven digits, unless the slice moves far.
    """
    rng = np.random.default_rng(seed)
    feet, tops = (" ".join(map(str, 0.5 * rng.standard_normal(18))) for _ in range(2))
    home = "0.03 -0.02 0.5 0.0572 -0.0956 0.0793 0.9896"
    m = cc.load("gough_stewart", feet=feet, tops=tops, home=home, leg_max=5)
    (block,) = blocks_of(equations_of(driven(m)))
    found = generic_solutions(block, shapes_of(m))
    assert (len(found.q), found.points, found.known) == (40, 120, True)
