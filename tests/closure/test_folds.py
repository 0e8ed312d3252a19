"""Folds on ways, located; the parabola beside them."""

from __future__ import annotations

import math

import numpy as np
from conftest import Tolerances
from small_linkages import ROCKING, four_bar, toggle

from closedchain.closure.position import driven
from closedchain.closure.solve.folds import folds_near, moved
from closedchain.closure.solve.path import follower_of


def test_a_four_bar_folds_where_it_is_stretched(tol: Tolerances) -> None:
    m = four_bar(ROCKING, 0.9)
    problem, follower = driven(m), follower_of(driven(m))
    begin, end = np.array([[0.9]]), np.array([[1.9]])
    way = follower.run(m.home[None], begin, end)
    assert way.reached[0] < 1.0
    for share in (way.reached, way.reached - 0.01):  # from the end of the way, and a little before
        q = follower.run(m.home[None], begin, begin + share[:, None]).q
        found = folds_near(problem, q, begin, end, share)
        assert found.found[0]
        assert found.lost[0] == 1
        assert abs(0.9 + found.share[0] - toggle(ROCKING)) < tol.algebra
        assert abs(math.sin(found.q[0, 0] + found.q[0, 1] - found.q[0, 2])) < 1e-9
        assert found.bend[0] < 0.0
    # postures beside it: the parabola is their first term, and they are on both sides
    sides = []
    for left in (1e-4, 1e-6):
        share = found.share - left
        aside = found.aside(share)
        for side in (1.0, -1.0):
            start = moved(problem, found.q, side * aside[:, None] * found.along)
            target = begin + share[:, None]
            beside = follower.run(start, target, target)
            assert beside.started[0]
            gone = (beside.q - found.q)[0, 1:] / m.column_scale[1:]
            assert abs(abs(gone @ found.along[0]) / aside[0] - 1.0) < 10.0 * math.sqrt(left)
            sides.append((side, np.sign(beside.det[0])))
    assert len(set(sides)) == 2


def test_where_nothing_folds_nothing_is_found() -> None:
    m = four_bar(ROCKING, 0.9)
    begin, end = np.array([[0.9]]), np.array([[0.91]])
    found = folds_near(driven(m), m.home[None], begin, end, np.array([0.5]))
    assert not found.found[0] or abs(found.share[0]) > 1.0
    assert np.isnan(found.aside(np.array([3.0]))[0])
    none = folds_near(driven(m), m.home[None][:0], begin[:0], end[:0], np.zeros(0))
    assert none.found.shape == (0,)
