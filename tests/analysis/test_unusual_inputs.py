"""Too few inputs, too many, none, inputs with unlucky names; balls that are written as hinges."""

from __future__ import annotations

from pathlib import Path

import linkage_text
import linkages
import numpy as np
import pytest
from linkage_text import Cut, J
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app


def five_bar(inputs: dict[str, str]) -> cc.Mechanism:
    """Five-bar whose output is the turn of a rod, which both cranks move."""
    return linkage_text.load(
        "five_bar",
        [
            J("A", "base", "left"),
            J("B", "left", "left_rod", "0.2 0 0"),
            J("E", "base", "right", "0.3 0 0"),
            J("D", "right", "right_rod", "0.2 0 0"),
        ],
        [Cut("C", "left_rod", "right_rod", "0.3 0 0", "0.3 0 0")],
        inputs=inputs,
        home={"A": 2.2, "B": -1.3, "E": 0.9, "D": 1.3},
        tip="left_rod",
        outputs="x rz",
    )


def test_a_freedom_that_no_input_drives_is_said_everywhere() -> None:
    m = five_bar({"q1": "A"})
    s = cc.direct(m, {"q1": 2.15}).raise_if_failed()
    assert s.message.endswith(
        "; 1 freedom is not driven: the posture is one of many with these inputs"
    )
    assert "Under-driven: 1 freedom of 2 is not driven by its 1 input" in cc.mobility(m).text
    found = cc.classify(m, s.q)
    assert "direct" in found.kinds
    assert "Under-driven" in found.text


def test_inputs_that_contradict_each_other_say_what_would_fit() -> None:
    m = five_bar({"q1": "A", "q2": "E", "q3": "B"})
    q1, q2, q3 = m.input_values(m.home)
    s = cc.direct(m, [q1, q2, q3 + 0.1])
    assert not s.converged
    assert f"q3 would have to be {q3:.6g} with q1={q1:.6g}, q2={q2:.6g} as given" in s.message


def test_without_inputs_there_is_one_sentence(tmp_path: Path) -> None:
    m = linkage_text.load(
        "loose",
        [J("A", "base", "crank"), J("B", "crank", "coupler", "0.15 0 0"),
         J("D", "base", "rocker", "0.4 0 0")],
        [Cut("C", "coupler", "rocker", "0.4 0 0", "0.15 0 0")],
        home={"A": 1.0, "B": -1.0, "D": 1.0},
        tip="coupler",
        outputs="x",
    )  # fmt: skip
    with pytest.raises(cc.ClosureError, match="'loose' has no inputs: add <transmission"):
        cc.redundancy(m, m.home)
    file = tmp_path / "loose.urdf"
    file.write_text(m.description.text)
    done = CliRunner().invoke(app, ["singularities", str(file), "--out", str(tmp_path / "out")])
    assert done.exit_code == 1
    assert "has no inputs" in done.stderr
    assert not list((tmp_path / "out").glob("*"))


@pytest.mark.parametrize("name", ["q", "status", "residual", "condition", "sigma_direct", "x"])
def test_an_input_may_be_called_like_a_variable_of_maps(name: str) -> None:
    m = linkages.four_bar({name: "A"})
    value = float(m.input_values(m.home)[0])
    assert cc.direct(m, {name: value + 0.01}).converged
    axis = value + np.linspace(-0.1, 0.1, 3)
    found = cc.singularity_map(m, {name: axis}, keep_q=True)
    assert found[name].values.tolist() == axis.tolist()
    ordinary = cc.singularity_map(linkages.four_bar({"q1": "A"}), {"q1": axis}, keep_q=True)
    for variable in ordinary.data_vars:
        label = f"{variable}_" if variable == name else str(variable)
        assert np.array_equal(found[label].values, ordinary[str(variable)].values)


@pytest.mark.slow
def test_a_survey_over_an_input_called_q(tmp_path: Path) -> None:
    file = tmp_path / "bar.urdf"
    file.write_text(linkages.four_bar({"q": "A"}).description.text)
    out = tmp_path / "out"
    words = ["singularities", str(file), "--out", str(out), "--resolution", "21"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert (out / "map.png").exists()


# -- balls written as three hinges -----------------------------------------------------------------


def rod_between_balls() -> cc.Mechanism:
    """A crank that swings a rocker by a rod between two balls: one of them is three hinges."""
    length = float(np.hypot(0.4, 0.1))
    return linkage_text.load(
        "rod",
        [
            J("crank", "base", "arm"),
            J("rocker", "base", "lever", "0.4 0 0"),
            J("b1", "arm", "x1", "0 0.2 0", axis="1 0 0"),
            J("b2", "x1", "x2", axis="0 1 0"),
            J("b3", "x2", "rod", axis="0 0 1"),
        ],
        [Cut("S", "rod", "lever", f"{length!r} 0 0", "0 0.3 0", type="spherical")],
        inputs={"q1": "crank"},
        home={"b3": float(np.arctan2(0.1, 0.4))},
        tip="lever",
        outputs="rz",
    )


def test_three_hinges_through_a_point_are_a_ball() -> None:
    m = rod_between_balls()
    counted = cc.mobility(m)
    assert dict(counted.pair_counts) == {"R": 2, "S": 2}
    assert (counted.links, counted.freedoms, counted.gruebler) == (4, 8, 2)
    assert (counted.mobility, counted.idle, counted.undriven) == (2, 1, 0)
    graph = cc.loops(m)
    assert [(pair.name, pair.symbol, pair.freedoms) for pair in graph.pairs] == [
        ("crank", "R", 1),
        ("rocker", "R", 1),
        ("b", "S", 3),
        ("S", "S", 3),
    ]
    assert "+b(S)" in graph.text or "-b(S)" in graph.text


def test_what_does_not_depend_on_an_idle_spin_works_beside_it() -> None:
    m = rod_between_balls()
    found = cc.classify(m, m.home)
    assert found.kinds == frozenset()
    assert "idle" in found.text
    assert cc.direct(m, [0.2]).raise_if_failed().converged
    # velocity of the lever from the network of all pairs, and from Pinocchio's Jacobians
    network = cc.network(m, m.home)
    assert network.rank.value == 6
    assert "rank" in cc.structure(m).text
    rate = cc.velocity(m, m.home, "rz").twist_map
    assert rate.shape == (1, 1)


def test_a_driven_hinge_before_two_others_is_no_ball() -> None:
    """A motor whose axis goes through a universal joint: one drive, and a joint beyond it."""
    m = linkage_text.load(
        "motor",
        [
            J("motor", "base", "hub", axis="0 1 0"),
            J("u1", "hub", "cross", axis="1 0 0"),
            J("u2", "cross", "arm", axis="0 1 0"),
        ],
        inputs={"q1": "motor"},
        tip="arm",
    )
    assert dict(cc.mobility(m).pair_counts) == {"R": 1, "U": 1}


def test_maps_hold_the_idle_spin() -> None:
    m = rod_between_balls()
    axis = np.linspace(-0.3, 0.3, 7)
    found = cc.singularity_map(m, {"q1": axis})
    assert (found["status"] == 0).all()
    for value, sigma in zip(axis, found["sigma_direct"].values, strict=True):
        q = cc.direct(m, [value]).raise_if_failed().q
        # as at the posture itself: an idle spin counts in no measure
        assert cc.classify(m, q).sigma_direct == pytest.approx(sigma, rel=1e-9)
