"""Kinds and Zlatanov's six types: an example of each, and what is wrong in every posture."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import linkage_text
import linkages
import numpy as np
import pytest
from linkage_text import Cut, J

import closedchain as cc
from closedchain.analysis.figures.palette import COLOURS, KIND_LABELS
from closedchain.analysis.singularity.kinds import COMBINED, KINDS, TYPES, kinds_of, title, types_of
from closedchain.analysis.singularity.rank_loss import Ranks
from closedchain.closure.generic import GenericRanks, generic_ranks
from closedchain.closure.loading import mechanism_from_description
from closedchain.closure.ranks import Rank
from closedchain.closure.solve.samples import closed_samples
from closedchain.robots.overlays import PALETTE


def posture(m: cc.Mechanism, **values: float) -> np.ndarray:
    """Posture with these joints of one freedom at these values, the others at home."""
    q = np.array(m.home)
    for name, value in values.items():
        q[m.model.joints[m.model.getJointId(name)].idx_q] = value
    return q


def toggled(tip: str, outputs: str) -> tuple[cc.Mechanism, np.ndarray]:
    """A four-bar driven at its rocker, crank and coupler in line."""
    m = linkage_text.load(
        "rocker_driven",
        [
            J("A", "base", "crank"),
            J("B", "crank", "coupler", "0.15 0 0"),
            J("D", "base", "rocker", "0.4 0 0"),
        ],
        [Cut("C", "coupler", "rocker", "0.35 0 0", "0.3 0 0")],
        inputs={"q1": "D"},
        home={"A": 1.1, "B": -0.8, "D": 1.7},
        tip=tip,
        outputs=outputs,
    )
    return m, cc.close(m, fixed={"B": 0.0}).raise_if_failed().q


def folded(tip: str, outputs: str, **inputs: str) -> tuple[cc.Mechanism, np.ndarray]:
    """A parallelogram that lies flat at home."""
    m = linkage_text.load(
        "flat_parallelogram",
        [
            J("A", "base", "crank"),
            J("B", "crank", "bar", "0.1 0 0"),
            J("D", "base", "rocker", "0.4 0 0"),
        ],
        [Cut("C", "bar", "rocker", "0.4 0 0", "0.1 0 0")],
        inputs=inputs,
        tip=tip,
        outputs=outputs,
    )
    return m, m.home


def at_home(m: cc.Mechanism) -> tuple[cc.Mechanism, np.ndarray]:
    return m, m.home


Case = tuple[Callable[[], tuple[cc.Mechanism, np.ndarray]], set[str], set[str]]
CASES: dict[str, Case] = {
    "D1 at home": (lambda: at_home(cc.load("d1")), {"inverse"}, {"RI", "IO"}),
    "linear Delta, a rod level": (
        lambda: at_home(cc.load("linear_delta", home="-0.3 0 -0.6")),
        {"inverse"},
        {"RI", "IO"},
    ),
    "linear Delta, two rods opposed": (
        lambda: at_home(
            cc.load("linear_delta", home="0.05 0.08660254037844387 -0.6", sides="1 -1 1")
        ),
        {"direct"},
        {"RO", "II"},
    ),
    "rocker at its end, coupler asked for": (
        lambda: toggled("coupler", "x y rz"),
        {"direct"},
        {"RO", "II"},
    ),
    "rocker at its end, rocker asked for": (
        lambda: toggled("rocker", "rz"),
        {"direct", "inverse"},
        {"II", "IO", "RPM"},
    ),
    "flat parallelogram, crank asked for": (
        lambda: folded("crank", "rz", q1="A"),
        {"direct", "constraint"},
        {"IIM", "RPM"},
    ),
    "flat parallelogram, bar asked for": (
        lambda: folded("bar", "x y rz", q1="A"),
        {"direct", "constraint"},
        {"IIM", "RO"},
    ),
    "flat parallelogram, driven twice": (
        lambda: folded("crank", "rz", q1="A", q2="D"),
        {"constraint"},
        {"IIM", "RI"},
    ),
    "regular four-bar": (lambda: at_home(linkages.four_bar()), set(), set()),
    "regular Stewart platform": (lambda: at_home(cc.load("gough_stewart")), set(), set()),
}


@pytest.mark.parametrize("name", CASES)
def test_examples_have_their_kinds_and_types(name: str) -> None:
    make, kinds, types = CASES[name]
    m, q = make()
    found = cc.classify(m, q)
    assert found.kinds == kinds, found.text
    assert found.types == types, found.text
    for kind in KINDS:
        assert (getattr(found, f"sigma_{kind}") < 1e-8) == (kind in kinds)
    assert (found.free_twists.shape[1] > 0) == ("direct" in kinds)
    assert (found.lost_twists.shape[1] > 0) == ("inverse" in kinds)
    for one in types:
        assert TYPES[one].title in found.text
    assert ("vanishes" in found.text) == bool(kinds)


def test_the_examples_show_all_types_and_kinds() -> None:
    assert {t for _, _, types in CASES.values() for t in types} == set(TYPES)
    assert {k for _, kinds, _ in CASES.values() for k in kinds} == set(KINDS)


def test_each_type_is_what_it_says() -> None:
    """Motions that show the type, found from the Jacobians alone."""
    m, q = toggled("coupler", "x y rz")
    free = cc.classify(m, q).free_twists
    assert np.linalg.norm(free) > 0.1  # RO: the coupler moves
    m, q = toggled("rocker", "rz")
    assert np.linalg.norm(cc.classify(m, q).free_twists) < 1e-12  # RPM: it does not
    d1 = cc.load("d1")
    still = cc.redundancy(d1, d1.home)
    assert np.linalg.norm(still.inputs) > 0.9  # RI: inputs move, the tip does not
    m, q = folded("crank", "rz", q1="A")
    null = np.linalg.svd(cc.constraint_jacobian(m, q), compute_uv=False)
    assert m.model.nv - np.count_nonzero(null > 1e-9) == cc.mobility(m).mobility + 1  # IIM


def test_ranks_come_with_their_gaps() -> None:
    m, q = folded("crank", "rz", q1="A")
    ranks = cc.classify(m, q).ranks
    assert set(ranks) == set(KINDS)
    assert ranks["constraint"].value == cc.mobility(m).generic_rank - 1
    assert ranks["constraint"].gap > 1e8
    assert ranks["direct"].value == ranks["inverse"].value == 1
    d1 = cc.load("d1")
    home = cc.classify(d1, d1.home).ranks["inverse"]
    assert home.value == 5
    assert home.above > 0.1 > 1e-12 > home.below


def test_kinds_follow_from_the_types() -> None:
    """Constraint is IIM, inverse IO, direct RO or RPM; and how II and RI come along."""
    n, a, d, b, inputs = 4, 2, 2, 3, 3
    rank = {k: Rank(k, 1.0, 0.0) for k in range(6)}
    for a in (2, 3):
        generic = GenericRanks(n, rank[a], rank[d], rank[b], inputs, 1.0, 9)
        seen = 0
        for m, alpha, delta, beta in product(range(n, n + 3), range(4), range(4), range(6)):
            # what can be: kernels of a posture are no smaller than generic ones
            possible = max(alpha, delta) <= beta <= min(m, alpha + delta) and m - beta >= n - b
            if not possible or m - delta < n - d or (m == n and alpha > a):
                continue
            seen += 1
            ranks = Ranks(rank[0], rank[alpha], rank[delta], beta, m)
            kinds, types = kinds_of(ranks, generic), types_of(ranks, generic)
            assert ("constraint" in kinds) == ("IIM" in types)
            assert ("inverse" in kinds) == ("IO" in types)
            assert ("direct" in kinds) == bool({"RO", "RPM"} & types)
            if generic.undriven:
                assert "direct" in kinds
            elif m == n:
                assert ("II" in types) == ("direct" in kinds)
            if m == n and "IO" in types:
                assert {"RI", "RPM"} & types
        assert seen > 20


# -- in every posture ----------------------------------------------------------------------------


def half_driven(outputs: tuple[str, ...]) -> cc.Mechanism:
    """A five-bar with one input; its tip stands on the driven crank and turns with a rod."""
    d = linkages.five_bar(inputs={"q1": "A"}).description
    return mechanism_from_description(replace(d, task=replace(d.task, outputs=outputs)))


def test_too_few_inputs_are_said() -> None:
    m = half_driven(("x", "y", "rz"))
    found = cc.mobility(m)
    assert (found.mobility, found.undriven, found.idle) == (2, 1, 0)
    sentence = "1 freedom of 2 is not driven by its 1 input"
    assert sentence in found.text
    for q in closed_samples(m)[:4]:
        at = cc.classify(m, q)
        assert at.kinds == {"direct"}
        assert at.types == {"RO"}
        assert at.sigma_direct == 0.0
        assert sentence in at.text
    assert sentence in cc.redundancy(m, m.home).text


def test_an_idle_freedom_that_moves_the_tip_is_told() -> None:
    m = half_driven(("x", "y"))
    assert (cc.mobility(m).undriven, cc.mobility(m).idle) == (0, 1)
    assert "moves the tip, in ways that are no outputs" in " ".join(cc.mobility(m).text.split())
    assert cc.classify(m, m.home).kinds == frozenset()


def test_architecturally_singular_platforms() -> None:
    """Joints on two regular hexagons: six inputs, rank 5 in every posture (Ma and Angeles 1991)."""
    m = cc.load("gough_stewart", variant="hexagons", home="0.03 -0.02 0.5 0.05 -0.1 0.08 1")
    generic = generic_ranks(m, m.outputs())
    assert generic.architecturally_singular
    assert (generic.motions, generic.inputs.value, generic.together.value) == (6, 5, 6)
    assert generic.inputs.gap > 1e8
    assert "Architecturally singular: its 6 inputs drive only 5 of the 6" in cc.mobility(m).text
    for q in closed_samples(m)[:4]:
        found = cc.classify(m, q)
        assert found.kinds == {"direct"}
        assert "Architecturally singular" in found.text
    well = cc.load("gough_stewart")
    assert not generic_ranks(well, well.outputs()).architecturally_singular
    assert cc.mobility(well).undriven == 0


def test_idle_freedoms_are_named_and_singular_nowhere() -> None:
    m = linkages.spatial_four_bar(hooke=False)
    assert (cc.mobility(m).idle, cc.mobility(m).undriven) == (1, 0)
    assert "1 freedom of 2 is idle" in " ".join(cc.mobility(m).text.split())
    for q in closed_samples(m)[1:4]:
        assert cc.classify(m, q).kinds == frozenset()


def test_without_a_task_nothing_is_claimed() -> None:
    m = linkage_text.load(
        "lone", [J("A", "base", "arm"), J("B", "arm", "hand")], inputs={"q1": "A"}
    )
    found = cc.mobility(m)
    assert (found.undriven, found.idle) == (None, None)
    assert "without a task" in found.text.replace("\n", " ")


def test_more_outputs_than_freedoms_are_no_singularity() -> None:
    """A four-bar cannot move its coupler in six ways; that is no inverse singularity."""
    m = linkages.four_bar()
    assert len(m.outputs()) == 6
    found = cc.classify(m, m.home)
    assert found.kinds == frozenset()
    assert "Of its 6 outputs only 1 can change independently" in found.text


# -- the table -----------------------------------------------------------------------------------


def test_everything_that_is_coloured_takes_the_tables_colours() -> None:
    every = {**KINDS, "combined": COMBINED}
    assert {name: kind.colour for name, kind in every.items()} == dict(PALETTE) == COLOURS
    assert {name: kind.label for name, kind in every.items()} == KIND_LABELS


def test_names_for_people() -> None:
    assert title(frozenset()) == "regular"
    assert title(frozenset({"direct"})) == "direct singularity (type 2)"
    both = title(frozenset({"direct", "inverse", "constraint"}))
    assert both == "combined singularity (direct and inverse, type 3), and constraint"
    assert title(frozenset({"constraint"})) == "constraint singularity"


def test_the_docs_have_the_table() -> None:
    page = (Path(__file__).parents[2] / "docs" / "singularities.md").read_text()
    for kind in KINDS.values():
        assert re.search(rf"\| {re.escape(kind.condition)} \| {re.escape(kind.meaning)} \|", page)
    for one in TYPES.values():
        assert f"| {one.name}, {one.title} | {one.condition} |" in page
