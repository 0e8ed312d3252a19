"""The batch kernel's position solver, spreading and search against the single-posture solvers."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from batch_cases import JOINT_LIMIT, OK, UNSEEN, cells, closed, walk
from conftest import Tolerances, assert_close
from small_linkages import ROCKING, build, four_bar, joint, loop, toggle

import closedchain as cc
from closedchain.closure.batch import CLOSED, FOLD, OPEN, UNDECIDED, UNTRIED, Batch
from closedchain.closure.chart import Chart
from closedchain.closure.charting import chart_of, straight
from closedchain.closure.constraints import flipped_axes
from closedchain.closure.continuation import follow
from closedchain.closure.equations import correct
from closedchain.urdf.errors import ClosureError

TIP = {
    "d1": ("x", "y"),
    "eclipse": ("tilt", "azimuth"),
    "eclipse2": ("x", "ry"),
    "rpa3t": ("x", "z"),
    "linear_delta": ("x", "z"),
    "rus6": ("x", "rz"),
}
REACH = {"rpa3t": 0.02}  # dimensionless, about the start
OFF_HOME = (0.03, -0.015, 0.0, 0.02, 0.01, -0.02)  # m, of D1's inputs: its home is singular


def away(m: cc.Mechanism) -> np.ndarray:
    """A closed posture off home, which may be special."""
    if m.name == "d1":
        return cc.direct(m, m.input_values(m.home) + np.array(OFF_HOME)).raise_if_failed().q
    return closed(m, 1, 3, 0.05)[0]


@pytest.mark.parametrize("robot", cc.robots())
@pytest.mark.parametrize("tip", [False, True], ids=["inputs", "tip"])
def test_solve_follows_the_branch(robot: str, tip: bool, tol: Tolerances) -> None:
    m = cc.load(robot)
    chart = chart_of(m, TIP[robot] if tip else m.inputs[:2], at=away(m))
    begin = chart.values(chart.start)
    reach = REACH.get(robot, 0.3) * chart.scale
    values = begin + reach * np.random.default_rng(1).uniform(-1, 1, (12, 2))
    found, status = Batch(m, chart).solve(np.repeat(chart.start[None], 12, axis=0), values)
    here = correct(chart.equations(begin), chart.start)
    for target, q, code in zip(values, found, status, strict=True):
        path = follow(straight(chart, begin, target), here)
        assert (path.refusal is None) == (code == 0)
        if code == 0:
            assert np.abs(m.workspace.residual(q)).max() < tol.closure
            assert_close(q, path.last.q, tol.algebra)
    assert (status == 0).sum() >= 4


def spread(chart: Chart, values: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, ...]:
    """Block reached from its middle: status, postures, ends."""
    shape = values.shape[:-1]
    status = np.full(shape, UNSEEN, dtype=np.int8)
    q = np.zeros((*shape, chart.mechanism.model.nq))
    middle = tuple(n // 2 for n in shape)
    q[middle] = first
    seed = np.ravel_multi_index(middle, shape)
    ends = Batch(chart.mechanism, chart).spread(values, status, q, [seed])
    return status, q, ends


@pytest.mark.slow
@pytest.mark.parametrize("robot", cc.robots())
@pytest.mark.parametrize("tip", [False, True], ids=["inputs", "tip"])
def test_spread_reaches_what_a_walk_reaches(robot: str, tip: bool, tol: Tolerances) -> None:
    m = cc.load(robot)
    chart = chart_of(m, TIP[robot] if tip else m.inputs[:2], at=away(m))
    values = cells(chart, 0.6, 9)
    expected, postures = walk(chart, values)
    status, q, ends = spread(chart, values, postures[4, 4])
    assert np.array_equal(status, expected)
    reached = status == OK
    assert_close(q[reached], postures[reached], tol.algebra)
    assert (ends[status != UNSEEN] == UNTRIED).all()


@pytest.mark.parametrize("axes", [1, 3])
def test_spread_over_one_and_three_axes(axes: int, tol: Tolerances) -> None:
    m = cc.load("linear_delta")
    chart = chart_of(m, m.inputs[:axes])
    values = cells(chart, 0.3, 5)
    expected, postures = walk(chart, values)
    status, q, _ = spread(chart, values, postures[(2,) * axes])
    assert np.array_equal(status, expected)
    assert_close(q[status == OK], postures[status == OK], tol.algebra)


def test_spread_stops_at_a_fold_and_says_so() -> None:
    m = four_bar(ROCKING, 0.9)
    chart = chart_of(m, ["crank_joint"])
    end = toggle(ROCKING)
    values = np.linspace(0.9, end + 0.5, 41)[:, None]
    status = np.full(41, UNSEEN, dtype=np.int8)
    q = np.zeros((41, 3))
    q[0] = m.home
    ends = Batch(m, chart).spread(values, status, q, [0])
    reached = values[:, 0] < end
    assert np.array_equal(status == OK, reached)
    assert ends[np.flatnonzero(~reached)[0]] == FOLD
    assert (ends[np.flatnonzero(~reached)[1:]] == UNTRIED).all()


def test_seeds_from_outside_lead_on_and_other_cells_stay() -> None:
    """A block beside another one: its first column is given, one cell is a wall."""
    m = cc.load("linear_delta")
    chart = chart_of(m, m.inputs[:2])
    values = cells(chart, 0.2, 7)
    whole, postures = walk(chart, values)
    assert (whole == OK).all()
    status = np.full((7, 7), UNSEEN, dtype=np.int8)
    status[0] = 2
    status[3, 3] = 1
    q = np.zeros_like(postures)
    q[0] = postures[0]
    done = np.zeros(1, dtype=np.int64)
    Batch(m, chart).spread(values, status, q, np.arange(7), label=2, done=done)
    assert status[3, 3] == 1
    assert (q[3, 3] == 0.0).all()
    assert np.count_nonzero(status == 2) == 48
    assert done[0] == 41
    rest = status == 2
    assert_close(q[rest], postures[rest], 1e-10)


def test_limits_are_walls() -> None:
    text = '<limit lower="-0.5" upper="0.5" effort="1" velocity="1"/>'
    parts = [
        joint("a", "base", "wedge", axis="1 0 0", kind="prismatic"),
        joint("b", "base", "plunger", axis="0 1 0", kind="prismatic").replace(
            '<limit lower="-30" upper="30" effort="1" velocity="1"/>', text
        ),
        loop("prismatic", "wedge", "0 0 0", "plunger", "0 0 0", "0.6 0.8 0", "0.6 0.8 0"),
    ]
    task = '<task base="base" tip="plunger" outputs="y"/>'
    m = build("base wedge plunger", parts, {}, "a", task)
    chart = chart_of(m, ["a"])
    values = np.linspace(-0.9, 0.9, 19)[:, None]
    status = np.full(19, UNSEEN, dtype=np.int8)
    q = np.zeros((19, m.model.nq))
    Batch(m, chart).spread(values, status, q, [9])
    # the plunger moves 4/3 of the wedge: 0.375 is its last place
    inside = np.abs(values[:, 0]) < 0.375
    assert np.array_equal(status == OK, inside)
    walls = np.flatnonzero(status == JOINT_LIMIT)
    assert np.array_equal(walls, [5, 13])


def test_spread_is_the_same_in_every_thread(d1: cc.Mechanism) -> None:
    chart = chart_of(d1, ["q1", "q2"])
    values = cells(chart, 0.3, 9)

    def once(_: int) -> tuple[np.ndarray, ...]:
        return spread(chart, values, chart.start)

    alone = once(0)
    with ThreadPoolExecutor(4) as pool:
        for found in pool.map(once, range(8)):
            assert all(np.array_equal(a, b) for a, b in zip(found, alone, strict=True))


def test_search_tells_closed_from_open(tol: Tolerances) -> None:
    m = four_bar(ROCKING, 0.9)
    batch = Batch(m, chart_of(m, ["crank_joint"]))
    end = toggle(ROCKING)
    values = np.concatenate([np.linspace(0.3, end - 1e-3, 6), np.linspace(end + 0.02, 3.0, 5)])
    found, verdicts = batch.search(values[:, None], batch.random_starts(6))
    assert np.array_equal(verdicts == CLOSED, values < end)
    assert np.isin(verdicts[values > end], (OPEN, UNDECIDED)).all()
    for value, q in zip(values[:6], found[:6], strict=True):
        assert np.abs(m.workspace.residual(q)).max() < tol.closure
        assert not flipped_axes(m, q)
        assert q[0] == value


@pytest.mark.parametrize("robot", ["d1", "rus6", "rpa3t", "eclipse"])
def test_search_finds_home_again(robot: str, tol: Tolerances) -> None:
    m = cc.load(robot)
    chart = chart_of(m, m.inputs[:2])
    batch = Batch(m, chart)
    value = chart.values(chart.start)[None]
    found, verdict = batch.search(value, batch.random_starts(60, 1))
    assert verdict[0] == CLOSED
    assert np.abs(m.workspace.residual(found[0])).max() < tol.closure
    assert_close(chart.values(found[0]), value[0], tol.closure)


def test_blocks_that_do_not_fit_are_refused(d1: cc.Mechanism) -> None:
    batch = Batch(d1, chart_of(d1, ["q1", "q2"]))
    values, q = np.zeros((3, 3, 2)), np.zeros((3, 3, 35))
    with pytest.raises(ClosureError, match="needs values"):
        batch.spread(values, np.zeros((3, 2), dtype=np.int8), q, [0])
    with pytest.raises(ClosureError, match="status must be a writeable"):
        batch.spread(values, np.zeros((3, 3)), q, [0])
    with pytest.raises(ClosureError, match="seeds must be flat indices"):
        batch.spread(values, np.zeros((3, 3), dtype=np.int8), q, [9])
    with pytest.raises(ClosureError, match=r"coordinates must be \(n, 2\)"):
        batch.solve(d1.home[None], np.zeros((1, 3)))
    with pytest.raises(ClosureError, match="1 postures and 2 rows"):
        batch.solve(d1.home[None], np.zeros((2, 2)))
