"""What a map says of a cell after the ways that lead into it."""

from __future__ import annotations

import numpy as np
from oracle.reference_cells import ReferenceCells

import closedchain as cc
from closedchain.analysis.singularity.maps.grid import NONE_FOUND, NOT_CONVERGED, OK
from closedchain.analysis.singularity.maps.storage import in_memory
from closedchain.analysis.singularity.maps.tiles import Found, Tiles
from closedchain.closure.charting import chart_of
from closedchain.closure.solve.flood import ARRIVED, FOLD, STUCK, Block, flood


def test_ways_that_end_for_no_reason_are_not_converged() -> None:
    """In a cell none is found where a way in ended at a singularity, or none was tried."""
    store = in_memory(Tiles((6,), (6,)), (), 3, keep_q=False)
    one, none = np.array([0]), np.zeros(0, dtype=int)
    ok = np.array([OK], dtype=np.int8)
    store.add((0,), Found(one, ok, np.array([1, 2, 3]), np.array([STUCK, STUCK, FOLD])))
    store.add((0,), Found(none, ok[:0], np.array([1, 3, 4]), np.array([FOLD, STUCK, STUCK])))
    store.finish((0,))
    expected = [OK, NONE_FOUND, NOT_CONVERGED, NONE_FOUND, NOT_CONVERGED, NONE_FOUND]
    assert store.arrays["status"].tolist() == expected


def test_folds_are_told_from_regular_ways(delta: cc.Mechanism) -> None:
    """Of single ways, long ones too: of two cells the second is reached, or not for a fold."""
    chart = chart_of(delta, ("x", "y"))
    cells = ReferenceCells(chart)
    home = chart.values(delta.home)
    for outwards, end in (
        ([0.9, 0.0], FOLD),
        ([0.0, -0.9], FOLD),
        ([0.6, 0.7], FOLD),
        ([0.1, 0.1], ARRIVED),
    ):
        target = np.array(outwards)
        q = np.stack([delta.home, delta.home])
        targets = chart.targets(np.stack([home, target]))
        codes = flood(Block(chart.problem, targets, np.ones(2, dtype=bool), q), [0]).codes
        assert codes.tolist() == [ARRIVED, end]
        assert cells.ends_at_fold(delta.home, home, target) == (end == FOLD)
