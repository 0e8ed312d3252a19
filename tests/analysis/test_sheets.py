"""Maps know which neighbours the branch joins, through isthmuses; so do sets."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import Tolerances

import closedchain as cc
from closedchain.analysis.singularity.maps.grid import OK

ECLIPSE = np.linspace(0.0, 0.44, 45)
"""Of Eclipse's d_b and d_c [m]: from mode -+- the branch lies over them in two sheets."""

NARROW = {"alpha4": -0.3796720427738639, "alpha3": -0.1804926421648046}
"""Of rus6 with beta locked: the branch is narrow near here."""


@pytest.fixture(scope="module")
def eclipse() -> cc.Mechanism:
    return cc.load("eclipse")


def along(found: object, axis: int) -> np.ndarray:
    """Whether cells are joined to the next ones along an axis, with the last ones left out."""
    bits = found["joined"].to_numpy() >> axis & 1  # type: ignore[index]
    return np.asarray(np.moveaxis(bits, axis, 0)[:-1] > 0)


def test_joined_neighbours_lead_to_each_other(eclipse: cc.Mechanism, tol: Tolerances) -> None:
    """Sign changes lie between joined cells, or none does: sheets on top of each other."""
    start = eclipse.posture("-+-")
    over = {"d_b": ECLIPSE, "d_c": ECLIPSE}
    found = cc.singularity_map(eclipse, over, start, keep_q=True, progress=False)
    status, det, q = (found[n].to_numpy() for n in ("status", "det_inverse", "q"))
    columns = [eclipse.inputs.index(name) for name in over]
    begin = eclipse.input_values(start)
    changes = {True: 0, False: 0}
    for axis in (0, 1):
        ok, d, postures = (np.moveaxis(a, axis, 0) for a in (status == OK, det, q))
        joined = along(found, axis)
        both = ok[:-1] & ok[1:]
        assert not (joined & ~both).any()
        with np.errstate(invalid="ignore"):
            changing = both & (d[:-1] * d[1:] < 0.0)
        for i, j in np.argwhere(changing | (both & ~joined)):
            goal = begin.copy()
            cell = (i + 1, j) if axis == 0 else (j, i + 1)
            goal[columns] = ECLIPSE[list(cell)]
            way = cc.direct(eclipse, goal, guess=postures[i, j])
            same = way.converged and np.abs(way.q - postures[i + 1, j]).max() < 1e-6
            assert same == joined[i, j]
            if changing[i, j]:
                changes[bool(same)] += 1
    assert changes[True] > 40
    assert changes[False] > 5


def test_sheets_are_not_taken_for_zeros(eclipse: cc.Mechanism) -> None:
    axis = np.linspace(0.0, 0.44, 30)
    found = cc.singularity_set(
        eclipse, "inverse", {"d_b": axis, "d_c": axis}, eclipse.posture("-+-")
    )
    assert found.verdict == "curve"
    assert (found.missed, found.dropped) == (0, 0)


@pytest.mark.parametrize("chunk", [4, 7])
def test_tiles_join_what_one_tile_joins(chunk: int) -> None:
    m = cc.load("linear_delta")
    axis = np.linspace(-0.4, 0.4, 15)
    over = {"x": axis, "y": axis}
    one = cc.singularity_map(m, over, {"z": -0.6}, progress=False)
    many = cc.singularity_map(m, over, {"z": -0.6}, chunk=chunk, progress=False)
    assert np.array_equal(one["status"], many["status"])
    assert np.array_equal(one["joined"], many["joined"])
    ok = one["status"].to_numpy() == OK
    for axis_ in (0, 1):
        inside = np.moveaxis(ok, axis_, 0)
        assert np.array_equal(along(many, axis_), inside[:-1] & inside[1:])


@pytest.fixture(scope="module")
def locked() -> tuple[cc.Mechanism, np.ndarray]:
    m = cc.load("rus6", variant="locked")
    inputs = [
        -0.37969292418554024, -0.35494050212550876, -0.1804926421648046,
        -0.3796720427738639, -0.7901805109566212, -0.6921511266819435,
    ]  # fmt: skip
    return m, cc.direct(m, np.array(inputs)).raise_if_failed().q


@pytest.mark.slow
@pytest.mark.parametrize("cells", [17, 25, 33, 65])
def test_isthmuses_are_crossed(locked: tuple[cc.Mechanism, np.ndarray], cells: int) -> None:
    """At 17 and 25 cells no grid line passes where the branch goes on; the share stays 31 %."""
    m, start = locked
    over = {name: np.linspace(v - 1.5, v + 1.5, cells) for name, v in NARROW.items()}
    found = cc.singularity_map(m, over, start, progress=False)
    assert float((found["status"] == OK).mean()) == pytest.approx(0.312, abs=0.005)
    det = found["det_inverse"]
    share = float((det < 0.0).sum() / (det > 0.0).sum())
    assert share == pytest.approx(0.053, abs=0.008)


@pytest.mark.slow
def test_a_set_does_not_contradict_its_map(locked: tuple[cc.Mechanism, np.ndarray]) -> None:
    m, start = locked
    for cells in (17, 25, 49):
        over = {name: np.linspace(v - 1.5, v + 1.5, cells) for name, v in NARROW.items()}
        found = cc.singularity_set(m, "inverse", over, start)
        assert found.verdict == "curve"
        assert found.on_branch.sum() > 10
        assert found.missed == 0
