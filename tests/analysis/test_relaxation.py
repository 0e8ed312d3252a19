"""Joints that have to give way for a mechanism not to be overconstrained."""

from __future__ import annotations

import dataclasses

import linkages
import numpy as np
import pytest
from rounded_files import rounded_urdf

import closedchain as cc
from closedchain.closure import mechanism_from_description


def with_closure(m: cc.Mechanism, name: str, kind: str) -> cc.Mechanism:
    """The mechanism with another kind of joint at a closure."""
    closures = tuple(
        dataclasses.replace(spec, type=kind) if spec.name == name else spec
        for spec in m.description.closures
    )
    return mechanism_from_description(
        dataclasses.replace(m.description, closures=closures, text="")
    )


def test_planar_four_bar_needs_a_ball_on_a_line() -> None:
    m = linkages.four_bar()
    found = cc.relaxation(m)
    assert found.redundant == cc.mobility(m).redundant_rows == 3
    assert {one.joint for one in found.single} == {"A", "B", "D", "C"}
    assert {(one.was, one.becomes, one.gained) for one in found.single} == {
        ("hinge", "ball on a line", 3)
    }
    # bought parts: a ball at one joint and a sliding hinge at another
    assert sorted(one.becomes for one in found.together) == ["ball", "cylindrical joint"]
    assert "a ball on a line instead of the hinge C" in found.text
    # said otherwise: with that joint the count is right, and it moves as before
    relaxed = with_closure(m, "C", "point_on_line")
    counted = cc.mobility(relaxed)
    assert (counted.mobility, counted.redundant_rows) == (1, 0)
    # less would not do, and the wrong freedoms neither
    for kind in ("spherical", "cylindrical"):
        assert cc.mobility(with_closure(m, "C", kind)).redundant_rows > 0


@pytest.mark.parametrize("decimals", [6, 5])
def test_a_relaxed_mechanism_closes_as_it_is_rounded(decimals: int) -> None:
    """What is not overconstrained does not mind: no number is read as another one."""
    m = with_closure(linkages.four_bar(), "C", "point_on_line")
    home = {name: (float(x),) for name, x in zip(list(m.model.names)[1:], m.home, strict=True)}
    text = rounded_urdf(m.description, decimals, np.random.default_rng(decimals), home)
    rounded = cc.load_urdf(text)
    assert rounded.rounding is None
    assert not rounded.home_open
    assert cc.mobility(rounded).mobility == 1


def test_spatial_loops() -> None:
    bennett = cc.relaxation(linkages.bennett())
    assert bennett.redundant == 3
    assert bennett.single or bennett.together
    # nothing is redundant in a spatial four-bar with a ball
    exact = cc.relaxation(linkages.spatial_four_bar(hooke=True))
    assert (exact.redundant, exact.single, exact.together) == (0, (), ())
    assert exact.text == "No closure row is redundant: nothing need be relaxed."


@pytest.mark.parametrize("name", ["rpa3t", "linear_delta"])
def test_robots_name_joints_that_take_all_redundancy(name: str) -> None:
    m = cc.load(name)
    found = cc.relaxation(m)
    assert found.redundant == cc.mobility(m).redundant_rows
    assert sum(one.gained for one in found.together) == found.redundant
    assert len({one.joint for one in found.together}) == len(found.together)
