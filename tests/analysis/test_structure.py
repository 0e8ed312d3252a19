"""Loops, loop ranks, coupling degree, POC sets, decoupling: linkages with known answers."""

from __future__ import annotations

from collections.abc import Callable

import linkage_text
import linkages
import numpy as np
import pytest
from conftest import assert_close

import closedchain as cc
from closedchain.analysis.structure import ordering
from closedchain.analysis.structure.graph import short_cycles, simple_cycles
from closedchain.analysis.structure.loops import loops
from closedchain.analysis.structure.pair_screws import pair_screws
from closedchain.analysis.structure.postures import wander

# name: mechanism, pairs, loops, ranks, mobility, coupling degree
KNOWN: dict[str, tuple[Callable[[], cc.Mechanism], int, int, tuple[int, ...], int, int | None]] = {
    "planar four-bar": (linkages.four_bar, 4, 1, (3,), 1, 0),
    "planar parallelogram": (linkages.parallelogram, 4, 1, (3,), 1, 0),
    "five-bar": (linkages.five_bar, 5, 1, (3,), 2, 0),
    "five-bar, coupled cranks": (lambda: linkages.five_bar(coupled=True), 5, 1, (4,), 1, 0),
    "Bennett": (linkages.bennett, 4, 1, (3,), 1, 0),
    "wedges": (linkages.wedges, 3, 1, (2,), 1, 0),
    "RSSR, whose rod spins": (lambda: linkages.spatial_four_bar(False), 4, 1, (6,), 2, None),
    "RUSR": (lambda: linkages.spatial_four_bar(True), 4, 1, (6,), 1, 0),
    "Stephenson, four-bar driven": (lambda: linkages.six_bar("A"), 7, 2, (3, 3), 1, 0),
    "Stephenson, dyad driven": (lambda: linkages.six_bar("G"), 7, 2, (3, 3), 1, 1),
    "planar 3-RRR": (linkages.three_rrr, 9, 2, (3, 3), 3, 1),
    "two U-S rods": (linkages.rods, 4, 1, (6,), 4, None),
    "three U-S rods": (lambda: linkages.rods(3), 6, 2, (6, 6), 3, None),
    "arm with a parallelogram": (linkages.arm_with_parallelogram, 6, 1, (3,), 3, 0),
    "arm": (linkages.lone_arm, 2, 0, (), 2, 0),
    "truss": (linkages.truss, 3, 1, (3,), 0, 0),
}


@pytest.fixture(scope="module")
def built() -> Callable[[str], cc.Mechanism]:
    made: dict[str, cc.Mechanism] = {}

    def get(name: str) -> cc.Mechanism:
        if name not in made:
            made[name] = KNOWN[name][0]()
        return made[name]

    return get


# -- the loop graph ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN)
def test_loops_are_closed_walks_as_many_as_euler_says(
    name: str, built: Callable[[str], cc.Mechanism]
) -> None:
    graph = cc.loops(built(name))
    _, pairs, count, *_ = KNOWN[name]
    assert (len(graph.pairs), len(graph.loops)) == (pairs, count)
    assert count == len(graph.pairs) - len(graph.bodies) + graph.components
    for loop in graph.loops:
        for k, (p, sign) in enumerate(zip(loop.pairs, loop.signs, strict=True)):
            here = graph.pairs[p]
            ends = (here.parent, here.child)[::sign]
            assert ends == (loop.bodies[k], loop.bodies[(k + 1) % len(loop.bodies)])


@pytest.mark.parametrize("name", KNOWN)
def test_loop_conditions_leave_what_the_constraint_jacobian_leaves(
    name: str, built: Callable[[str], cc.Mechanism]
) -> None:
    """Two independent ways to the mobility: screws of pairs around loops, and rank of K."""
    m = built(name)
    graph = loops(m)
    for q in wander(m, 3):
        at = pair_screws(m, graph, q)
        everything = range(len(graph.pairs))
        left = graph.freedoms - at.rank(everything).value + 6 * (graph.components - 1)
        assert left == KNOWN[name][4] == cc.mobility(m).mobility


def test_welds_floating_joints_and_cross_links_are_no_pairs() -> None:
    bennett = cc.loops(linkages.bennett())
    assert bennett.bodies[0].links == ("base", "link4", "tip")
    rods = cc.loops(linkages.rods())
    assert [(p.name, p.symbol, p.freedoms) for p in rods.pairs] == [
        ("u1", "U", 2),
        ("u2", "U", 2),
        ("s1", "S", 3),
        ("s2", "S", 3),
    ]
    assert rods.text.startswith("rods: 4 bodies, 4 pairs with 10 freedoms, 1 independent loop")


def test_short_loops_are_preferred() -> None:
    # a square 0 1 2 3 with both diagonals: three triangles, not the square
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)]
    assert [len(walk) for walk in short_cycles(4, edges)] == [3, 3, 3]
    assert len(simple_cycles(4, edges, range(6))) == 7  # four triangles, three squares
    # two joints between the same two bodies, and a joint from a body to itself
    assert short_cycles(2, [(0, 1), (0, 1), (1, 1)]) == (((2, 1),), ((0, 1), (1, -1)))


def test_loops_of_d1(d1: cc.Mechanism) -> None:
    graph = cc.loops(d1)
    found = cc.mobility(d1)
    assert (len(graph.bodies), len(graph.pairs)) == (found.links, found.pairs) == (21, 27)
    assert len(graph.loops) == 7
    assert max(len(loop.pairs) for loop in graph.loops) == 9  # one loop through both stages


# -- loop ranks and coupling degree --------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN)
def test_ranks_and_coupling_degree(name: str, built: Callable[[str], cc.Mechanism]) -> None:
    _, _, _, ranks, mobility, coupling = KNOWN[name]
    found = cc.structure(built(name))
    assert found.ranks == ranks
    assert found.mobility == mobility == found.freedoms - sum(found.ranks)
    assert found.coupling_degree == coupling
    assert found.exhaustive
    for chain in found.open_chains:
        assert chain.rank_decision.gap > 1e6
        assert chain.constraint_degree == chain.freedoms - len(chain.inputs) - chain.rank
        if name != "five-bar, coupled cranks":  # there the coupling is one more equation
            assert chain.rank == chain.rank_decision.value == sum(chain.union)


def test_idle_freedoms_leave_no_coupling_degree() -> None:
    found = cc.structure(linkages.spatial_four_bar(False))
    assert found.assur_chains == ()
    assert "add up to +1" in found.text.replace("\n ", "")


def test_assur_chains_are_solved_one_after_the_other() -> None:
    apart = cc.structure(linkages.six_bar("A"))
    assert [(a.loops, a.coupling_degree) for a in apart.assur_chains] == [((0,), 0), ((1,), 0)]
    together = cc.structure(linkages.six_bar("G"))
    assert [(a.loops, a.coupling_degree) for a in together.assur_chains] == [((0, 1), 1)]
    assert [c.constraint_degree for c in together.open_chains] == [1, -1]


def test_structure_of_d1(d1: cc.Mechanism) -> None:
    found = cc.structure(d1)
    assert found.ranks == (6,) * 7
    assert (found.freedoms, found.mobility) == (48, 6)
    # the driven 3-RPS stage by itself, then everything else at once
    assert [a.coupling_degree for a in found.assur_chains] == [2, 4]
    assert found.assur_chains[0].loops == (0, 1)
    assert found.open_chains[1].inputs == ("q3",)
    assert found.coupling_degree == 4
    assert found.exhaustive
    assert not found.composites


def test_greedy_search_says_so_and_is_an_upper_bound(
    d1: cc.Mechanism, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = cc.structure(d1)
    monkeypatch.setattr(ordering, "MOST_BRANCHES", 0)
    found = cc.structure(d1)
    assert not found.exhaustive
    assert "upper bound" in found.text
    assert sum(found.ranks) == sum(best.ranks)
    total = sum(abs(c.constraint_degree) for c in best.open_chains)
    assert sum(abs(c.constraint_degree) for c in found.open_chains) >= total


@pytest.mark.parametrize("name", cc.robots("papers"))
def test_every_robot_adds_up(name: str) -> None:
    m = cc.load(name)
    for parallelograms in (True, False):
        found = cc.structure(m, parallelograms=parallelograms)
        assert found.mobility == cc.mobility(m).mobility
        assert found.mobility == found.freedoms - sum(found.ranks)
        inside = sum(sum(c.ranks) for c in found.composites)
        assert sum(found.ranks) + inside == cc.loops(m).freedoms - found.mobility


# -- POC sets ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "body", "symbol", "slides", "spins", "dependent"),
    [
        ("planar four-bar", "coupler", "t^0 r^1", 0, 1, 1),
        ("planar four-bar", "crank", "t^0 r^1", 0, 1, 0),
        ("planar parallelogram", "bar", "t^1 r^0", 0, 0, 0),  # along a circle
        ("five-bar", "left_rod", "t^1 r^1", 0, 1, 0),
        ("wedges", "plunger", "t^1 r^0", 1, 0, 0),
        ("planar 3-RRR", "platform", "t^2 r^1", 2, 1, 0),
        ("arm", "lower", "t^0 r^2", 0, 1, 1),  # the second axis is carried round by the first
        ("RUSR", "rocker", "t^0 r^1", 0, 1, 0),
        ("Bennett", "link2", "t^0 r^1", 0, 0, 1),
        ("truss", "bar", "t^0 r^0", 0, 0, 0),
    ],
)
def test_poc_sets(
    name: str,
    body: str,
    symbol: str,
    slides: int,
    spins: int,
    dependent: int,
    built: Callable[[str], cc.Mechanism],
) -> None:
    m = linkages.wedges() if name == "wedges" else built(name)
    found = cc.poc(m, body)
    assert found.symbol == symbol
    assert (found.slides.shape[1], found.spins.shape[1]) == (slides, spins)
    assert found.dependent == dependent
    assert found.finite
    assert found.rank.gap > 1e6
    for decision in found.steady:
        assert decision.above == 0.0 or decision.above > 1e-3  # directions really change
        assert decision.below < 1e-9


def test_poc_directions() -> None:
    assert_close(np.abs(cc.poc(linkages.wedges()).slides.T), [[0, 1, 0]], 1e-12)
    assert_close(np.abs(cc.poc(linkages.three_rrr()).spins.T), [[0, 0, 1]], 1e-12)
    plane = cc.poc(linkages.three_rrr()).slides
    assert_close(plane[2], [0, 0], 1e-12)
    assert "plane normal to z" in cc.poc(linkages.three_rrr()).text
    arm = cc.poc(linkages.arm_with_parallelogram())
    assert arm.symbol == "t^2 r^1"
    assert_close(np.abs(arm.slides.T), [[0, 0, 1]], 1e-12)  # the other one goes round a circle
    assert_close(np.abs(arm.spins.T), [[1, 0, 0]], 1e-12)


def test_finite_motion_of_a_parallelogram_keeps_the_orientation() -> None:
    found = cc.poc(linkages.parallelogram())
    assert found.travel[0] > 0.1
    assert found.stray[1] is not None
    assert found.stray[1] < 1e-10
    assert found.travel[1] < 1e-10


def test_instantaneous_translations_of_a_rod_parallelogram_are_not_finite() -> None:
    """Two U-S rods let a plate translate in two directions where they are parallel, only there."""
    m = linkages.rods()
    start = pair_screws(m, loops(m), m.home).relative_motion(range(4), 0, cc_body(m, "plate"))
    assert start.dimensions == (2, 2)
    found = cc.poc(m)
    assert found.symbol == "t^1 r^3"


def cc_body(m: cc.Mechanism, link: str) -> int:
    return next(i for i, body in enumerate(loops(m).bodies) if link in body.links)


def test_poc_of_d1(d1: cc.Mechanism) -> None:
    platform = cc.poc(d1)
    assert (platform.symbol, platform.body) == ("t^3 r^3", "T")
    coupler = cc.poc(d1, "coupler")
    assert coupler.symbol == "t^1 r^2"
    assert_close(np.abs(coupler.slides.T), [[0, 1, 0]], 1e-9)
    assert coupler.spins.shape == (3, 0)  # zero torsion: the axes change with the tilt
    assert coupler.dependent == 2
    assert cc.poc(d1, "base").dimension == 0


def test_poc_agrees_with_screws_around_the_loops(d1: cc.Mechanism) -> None:
    """The Jacobian of the spanning tree and the loops of pairs are two ways to the same space."""
    graph = loops(d1)
    for body in ("coupler", "platform"):
        found = cc.poc(d1, body)
        at = pair_screws(d1, graph, found.postures[0])
        pairs = range(len(graph.pairs))
        assert at.relative_motion(pairs, 0, cc_body(d1, body)).dimensions == (
            found.translations,
            found.rotations,
        )


def test_bad_questions_are_refused(d1: cc.Mechanism) -> None:
    with pytest.raises(cc.ClosureError, match="frame"):
        cc.poc(d1, "nothing")
    with pytest.raises(cc.ClosureError, match="has no task"):
        cc.poc(linkage_text.load("bare", [linkage_text.J("A", "base", "arm")]))
    with pytest.raises(cc.ClosureError, match="nq"):
        cc.structure(d1, [1.0, 2.0])
    q = np.array(d1.home)
    q[d1.input_q[0]] += 0.01
    with pytest.raises(cc.ClosureError, match="not closed"):
        cc.dependence(d1, q)


# -- dependence ----------------------------------------------------------------------------------


def test_gantry_is_decoupled_and_five_bar_is_not() -> None:
    gantry = cc.dependence(linkages.gantry())
    assert gantry.decoupled
    assert np.array_equal(gantry.matrix, np.eye(3, dtype=bool))
    elbow = cc.dependence(linkages.five_bar())
    assert not elbow.decoupled
    assert np.array_equal(elbow.matrix, [[True, False], [True, False]])  # the elbow, on q1 alone
    tip = cc.dependence(linkages.five_bar(), body="right_rod", outputs="x y rz")
    assert np.array_equal(tip.matrix, [[False, True], [False, True], [True, True]])


def test_dependence_reports_its_evidence() -> None:
    found = cc.dependence(linkages.arm_with_parallelogram())
    assert np.array_equal(
        found.matrix, np.array([[0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]])
    )
    assert found.smallest_dependent > 1e-3
    assert found.largest_independent < 1e-12
    assert len(found.postures) > 5
    assert "z depends on q1" in found.text


def test_idle_spins_do_not_hide_the_dependence() -> None:
    found = cc.dependence(linkages.spatial_four_bar(False))  # the rod spins as it likes
    assert found.matrix.ravel().tolist() == [False, False, False, True, False, False]


def test_undetermined_outputs_are_refused() -> None:
    with pytest.raises(cc.ClosureError, match="do not determine the motion"):
        cc.dependence(linkages.five_bar(inputs={"q1": "A"}), outputs="rz")
    with pytest.raises(cc.ClosureError, match="has no inputs"):
        cc.dependence(linkages.rods())
    with pytest.raises(cc.ClosureError, match="cannot move independently"):
        cc.dependence(linkages.four_bar({"q1": "A", "q2": "D"}))


def test_dependence_of_d1_and_its_coupler(d1: cc.Mechanism) -> None:
    assert cc.dependence(d1).matrix.all()
    coupler = cc.dependence(d1, body="coupler").matrix
    assert coupler[:, :3].all()
    assert not coupler[:, 3:].any()
