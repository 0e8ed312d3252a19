"""The set of postures may have fewer dimensions than its tangent spaces: Wren and others."""

from __future__ import annotations

import math

import linkages
import numpy as np
import pytest

import closedchain as cc


@pytest.fixture(scope="module")
def wren() -> cc.Mechanism:
    """Two regular hexagons of radius 1, six equal rods of 2 between their corners."""
    return cc.load("wren")


def test_wren_moves_in_two_ways_and_in_one(wren: cc.Mechanism) -> None:
    """Rank says three everywhere: two for translations on a sphere, one for a screw-like motion."""
    found = cc.mobility(wren)
    assert found.mobility == 3
    assert found.finite == 2
    assert found.finite_at(wren.home) == (2, 1)
    aside = np.array(wren.home)
    aside[:3] = 2.0 * np.array([0.3, 0.2, math.sqrt(1.0 - 0.13)])
    turned, angle = np.array(wren.home), 0.8
    turned[2] = math.sqrt(4.0 - 4.0 * math.sin(angle / 2.0) ** 2)
    turned[5:7] = math.sin(angle / 2.0), math.cos(angle / 2.0)
    for q, dimensions in ((aside, (2,)), (turned, (1,))):
        assert np.abs(wren.workspace.residual(q)).max() < 1e-12
        assert found.finite_at(q) == dimensions


@pytest.mark.parametrize("robot", cc.robots("papers"))
def test_robots_move_as_their_rank_says(robot: str) -> None:
    found = cc.mobility(cc.load(robot))
    assert found.finite == found.mobility


def test_where_branches_part_each_has_its_own() -> None:
    """A parallelogram that lies flat: rank promises two, parallelogram and antiparallelogram."""
    m = linkages.flat_parallelogram()
    assert cc.mobility(m).finite_at(m.home) == (1,)


def test_open_postures_are_refused(wren: cc.Mechanism) -> None:
    q = np.array(wren.home)
    q[2] += 0.1
    with pytest.raises(cc.ClosureError, match="open there by"):
        cc.mobility(wren).finite_at(q)
