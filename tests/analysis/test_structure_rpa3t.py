"""The topological claims of Shen et al. 2018, from screws: POC sets, loop ranks, decoupling."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.analysis.structure.loops import LoopGraph
from closedchain.analysis.structure.pair_screws import PairScrews, pair_screws
from closedchain.analysis.structure.postures import wander


@pytest.fixture(scope="module")
def robot() -> cc.Mechanism:
    return cc.load("rpa3t")


@pytest.fixture(scope="module")
def postures(robot: cc.Mechanism) -> list[PairScrews]:
    graph = cc.loops(robot)
    return [pair_screws(robot, graph, q) for q in wander(robot, 4)]


def motion(at: PairScrews, pairs: str, start: str, end: str) -> tuple[int, int]:
    """Translations and rotations of one body against another in a part of the mechanism."""
    graph: LoopGraph = at.graph
    index = {pair.name: p for p, pair in enumerate(graph.pairs)}
    bodies = {link: i for i, body in enumerate(graph.bodies) for link in body.links}
    return at.relative_motion(
        [index[name] for name in pairs.split()], bodies[start], bodies[end]
    ).dimensions


FOUR_S = "Ua Sc_closure Ub Sd_closure"
FOUR_R = "Re Rf Rg Rh"


def test_loop_ranks_and_coupling_degree(robot: cc.Mechanism) -> None:
    """Eqs. (3)-(5): xi = 6, 5; F = (8 + 6) - (6 + 5) = 3; both constraint degrees zero."""
    found = cc.structure(robot)
    assert found.ranks == (6, 5)
    assert [c.freedoms for c in found.open_chains] == [8, 6]
    assert [c.constraint_degree for c in found.open_chains] == [0, 0]
    assert (found.mobility, found.coupling_degree) == (3, 0)
    assert found.exhaustive
    assert [a.coupling_degree for a in found.assur_chains] == [0, 0]
    assert found.open_chains[0].inputs == ("theta1", "theta2")
    assert found.open_chains[0].mobility == 2
    # the sub-mechanism's POC set is t^2 r^0, eq. (4); with the second hybrid chain t^3 r^2
    assert found.open_chains[1].before == (2, 0)
    assert found.open_chains[1].union == (3, 2)
    assert min(c.rank_decision.gap for c in found.open_chains) > 1e9


def test_parallelograms_are_found(robot: cc.Mechanism) -> None:
    found = {c.bodies[1]: c for c in cc.structure(robot).composites}
    four_s, four_r = found["link3p"], found["R33_bar"]
    assert (four_s.freedoms, four_s.ranks, four_s.motion) == (4, (6,), (2, 2))
    assert (four_r.freedoms, four_r.ranks, four_r.motion) == (1, (3,), (1, 0))


def test_zero_coupling_rests_on_taking_parallelograms_as_pairs(robot: cc.Mechanism) -> None:
    every = cc.structure(robot, parallelograms=False)
    assert len(every.ranks) == 4
    assert sum(every.ranks) == 20
    assert every.exhaustive
    assert every.coupling_degree == 1


def test_poc_sets_of_the_branches(postures: list[PairScrews]) -> None:
    for at in postures:
        # branch I has five freedoms, t^3 r^2; eq. (4) prints t^2 r^2
        assert motion(at, f"R11 {FOUR_S}", "base", "link3p") == (3, 2)
        assert motion(at, "R21 R22 R23", "base", "link3p") == (2, 1)
        sub = f"R11 {FOUR_S} R21 R22 R23"
        assert motion(at, sub, "base", "link3p") == (2, 0)
        assert motion(at, f"{sub} R12 R13", "base", "platform") == (3, 1)
        assert motion(at, f"R31 R32 {FOUR_R} R33", "base", "platform") == (3, 1)


def test_poc_sets_of_the_platform_and_of_link_3p(robot: cc.Mechanism) -> None:
    platform = cc.poc(robot, "platform")
    assert platform.symbol == "t^3 r^0"
    assert platform.finite
    assert platform.travel[0] > 0.1
    assert platform.travel[1] < 1e-9
    middle = cc.poc(robot, "link3p")
    assert middle.symbol == "t^2 r^0"
    assert middle.finite
    assert_close(middle.slides[1], [0.0, 0.0], 1e-12, "in the plane xz")
    assert middle.stray[0] is not None
    assert middle.stray[0] < 1e-12


def test_decoupling_is_partial(robot: cc.Mechanism) -> None:
    """The paper's conclusion says complete decoupling; only z is free of theta3."""
    found = cc.dependence(robot)
    assert np.array_equal(found.matrix, [[1, 1, 1], [1, 1, 1], [1, 1, 0]])
    assert found.smallest_dependent > 1e-2
    assert found.largest_independent < 1e-10
    assert not found.decoupled
    middle = cc.dependence(robot, body="link3p")
    assert middle.matrix[[0, 2], :2].all()
    assert not middle.matrix[:, 2].any()
    assert not middle.matrix[[1, 3, 4, 5]].any()
