"""Where the kept rows alone would take another branch, all rows are followed."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import Tolerances

import closedchain as cc
from closedchain.closure.solve.path import follower_of
from closedchain.closure.solve.problem import problem_of
from closedchain.closure.solve.samples import closed_samples

STARTS = ((7, (-0.251982973902671, 0.09875203559142733, -0.2595014604884375)),
          (0, (-0.3490293903904309, -0.3414988496738671, 0.027217253956143217)))  # fmt: skip


@pytest.mark.parametrize(("start", "goal"), STARTS)
@pytest.mark.parametrize("pieces", [16, 64, 256])
def test_short_steps_arrive_where_a_long_one_does(
    start: int, goal: tuple[float, ...], pieces: int, tol: Tolerances
) -> None:
    """linear_delta: beside some regular postures rows of its parallelograms change their part."""
    m = cc.load("linear_delta")
    q = closed_samples(m)[start]
    begin, end = m.input_values(q), np.array(goal)
    once = cc.direct(m, end, guess=q).raise_if_failed()
    for k in range(1, pieces + 1):
        q = cc.direct(m, begin + k / pieces * (end - begin), guess=q).raise_if_failed().q
    assert np.abs(q - once.q).max() < tol.algebra


def test_many_at_once_do_so_too() -> None:
    m = cc.load("linear_delta")
    rng = np.random.default_rng(7)
    starts = closed_samples(m)
    q = starts[rng.integers(0, len(starts), 400)]
    begin = q[:, m.input_q]
    goals = begin + 0.25 * m.length * rng.uniform(-1.0, 1.0, begin.shape)
    whole = cc.direct(m, goals, guess=q)
    for k in range(1, 33):
        step = cc.direct(m, begin + k / 32 * (goals - begin), guess=q)
        assert step.converged[whole.converged].all()
        q = step.q
    assert np.abs(q - whole.q)[whole.converged].max() < 1e-10


def test_rows_that_follow_to_the_first_order_only_do_not_stop_the_machine(tol: Tolerances) -> None:
    """Wren's platform: three rows kept hold the others to the square of a step."""
    m = cc.load("wren")
    problem = problem_of(m)
    assert len(problem.kept) == 3 < m.rows
    way = follower_of(problem).run(m.home[None], *2 * [problem.targets_at(m.home[None])])
    assert way.reached[0] == 1.0
    assert np.abs(m.workspace.residual(way.q[0])).max() < tol.closure
