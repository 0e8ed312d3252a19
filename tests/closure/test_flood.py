"""Grids filled by fronts, ways and searches in bulk, against the single-posture solvers."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from oracle.walks import JOINT_LIMIT, OK, cells, closed, walk
from small_linkages import ROCKING, four_bar, toggle, wedge_and_plunger

import closedchain as cc
from closedchain.closure.chart import Chart
from closedchain.closure.charting import chart_of, straight
from closedchain.closure.constraints import flipped_axes
from closedchain.closure.solve.continuation import follow
from closedchain.closure.solve.flood import ARRIVED, FOLD, LIMIT, UNTRIED, Block, flood
from closedchain.closure.solve.newton import correct
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import follower_of
from closedchain.closure.solve.search import search
from closedchain.closure.solve.ways import follow as ways

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


@pytest.mark.parametrize("robot", cc.robots("papers"))
@pytest.mark.parametrize("tip", [False, True], ids=["inputs", "tip"])
def test_solve_follows_the_branch(robot: str, tip: bool, tol: Tolerances) -> None:
    m = cc.load(robot)
    chart = chart_of(m, TIP[robot] if tip else m.inputs[:2], at=away(m))
    begin = chart.values(chart.start)
    reach = REACH.get(robot, 0.3) * chart.scale
    values = begin + reach * np.random.default_rng(1).uniform(-1, 1, (12, 2))
    q = np.repeat(chart.start[None], 12, axis=0)
    way = ways(
        chart.problem, q, chart.targets(np.repeat(begin[None], 12, axis=0)), chart.targets(values)
    )
    found, status = way.q, way.codes
    here = correct(chart.equations(begin), chart.start)
    for target, q, code in zip(values, found, status, strict=True):
        path = follow(straight(chart, begin, target), here)
        assert (path.refusal is None) == (code == 0)
        if code == 0:
            assert np.abs(m.workspace.residual(q)).max() < tol.closure
            assert_close(q, path.last.q, tol.algebra)
    assert (status == 0).sum() >= 4


def block(chart: Chart, values: np.ndarray) -> Block:
    """All cells open, no posture known."""
    shape = values.shape[:-1]
    targets = chart.targets(values.reshape(-1, values.shape[-1])).reshape(*shape, -1)
    q = np.zeros((*shape, chart.mechanism.model.nq))
    return Block(chart.problem, targets, np.ones(shape, dtype=bool), q)


def spread(chart: Chart, values: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Block reached from its middle: codes and postures."""
    cells_ = block(chart, values)
    middle = tuple(n // 2 for n in cells_.open.shape)
    cells_.q[middle] = first
    return flood(cells_, [np.ravel_multi_index(middle, cells_.open.shape)]).codes, cells_.q


def status_of(codes: np.ndarray) -> np.ndarray:
    """As ``walk`` has it."""
    return np.select([codes == ARRIVED, codes == LIMIT], [OK, JOINT_LIMIT], -1)


@pytest.mark.slow
@pytest.mark.parametrize("robot", cc.robots("papers"))
@pytest.mark.parametrize("tip", [False, True], ids=["inputs", "tip"])
def test_spread_reaches_what_a_walk_reaches(robot: str, tip: bool, tol: Tolerances) -> None:
    m = cc.load(robot)
    chart = chart_of(m, TIP[robot] if tip else m.inputs[:2], at=away(m))
    values = cells(chart, 0.6, 9)
    expected, postures = walk(chart, values)
    codes, q = spread(chart, values, postures[4, 4])
    assert np.array_equal(status_of(codes), expected)
    reached = codes == ARRIVED
    assert_close(q[reached], postures[reached], tol.algebra)


@pytest.mark.parametrize("axes", [1, 3])
def test_spread_over_one_and_three_axes(axes: int, tol: Tolerances) -> None:
    m = cc.load("linear_delta")
    chart = chart_of(m, m.inputs[:axes])
    values = cells(chart, 0.3, 5)
    expected, postures = walk(chart, values)
    codes, q = spread(chart, values, postures[(2,) * axes])
    assert np.array_equal(status_of(codes), expected)
    assert_close(q[codes == ARRIVED], postures[codes == ARRIVED], tol.algebra)


def test_spread_stops_at_a_fold_and_says_so() -> None:
    m = four_bar(ROCKING, 0.9)
    chart = chart_of(m, ["crank_joint"])
    end = toggle(ROCKING)
    values = np.linspace(0.9, end + 0.5, 41)[:, None]
    cells_ = block(chart, values)
    cells_.q[0] = m.home
    codes = flood(cells_, [0]).codes
    reached = values[:, 0] < end
    assert np.array_equal(codes == ARRIVED, reached)
    assert codes[np.flatnonzero(~reached)[0]] == FOLD
    assert (codes[np.flatnonzero(~reached)[1:]] == UNTRIED).all()


def test_seeds_from_outside_lead_on_and_other_cells_stay() -> None:
    """A block beside another one: its first column is given, one cell is a wall."""
    m = cc.load("linear_delta")
    chart = chart_of(m, m.inputs[:2])
    values = cells(chart, 0.2, 7)
    whole, postures = walk(chart, values)
    assert (whole == OK).all()
    cells_ = block(chart, values)
    cells_.open[0] = False
    cells_.open[3, 3] = False
    cells_.q[0] = postures[0]
    done: list[int] = []
    codes = flood(cells_, np.arange(7), done.append).codes
    assert codes[3, 3] == UNTRIED
    assert (cells_.q[3, 3] == 0.0).all()
    assert np.count_nonzero(codes == ARRIVED) == 48
    assert sum(done) == 41
    rest = codes == ARRIVED
    assert_close(cells_.q[rest], postures[rest], 1e-10)


def test_limits_are_walls() -> None:
    chart = chart_of(wedge_and_plunger(), ["a"])
    values = np.linspace(-0.9, 0.9, 19)[:, None]
    codes = flood(block(chart, values), [9]).codes
    # the plunger moves 4/3 of the wedge: 0.375 is its last place
    inside = np.abs(values[:, 0]) < 0.375
    assert np.array_equal(codes == ARRIVED, inside)
    walls = np.flatnonzero(codes == LIMIT)
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


def random_starts(m: cc.Mechanism, count: int, seed: int = 0) -> np.ndarray:
    """Postures (count, nq) far around home: any angle, lengths within about ``length``."""
    rng = np.random.default_rng(seed)
    v = rng.uniform(-np.pi, np.pi, (count, m.model.nv))
    slides = m.translational
    v[:, slides] = m.column_scale[slides] * rng.standard_normal((count, int(slides.sum())))
    return np.array([pin.integrate(m.model, m.home, one) for one in v])


def test_search_tells_closed_from_open(tol: Tolerances) -> None:
    m = four_bar(ROCKING, 0.9)
    chart = chart_of(m, ["crank_joint"])
    end = toggle(ROCKING)
    values = np.concatenate([np.linspace(0.3, end - 1e-3, 6), np.linspace(end + 0.02, 3.0, 5)])
    found = search(chart.problem, chart.targets(values[:, None]), random_starts(m, 6))
    assert np.array_equal(found.found, values < end)
    assert set(found.codes[values > end]) <= {Ending.OPEN.code, Ending.SLOW.code}
    for value, q in zip(values[:6], found.q[:6], strict=True):
        assert np.abs(m.workspace.residual(q)).max() < tol.closure
        assert not flipped_axes(m, q)
        assert q[0] == value


@pytest.mark.parametrize("robot", ["d1", "rus6", "rpa3t", "eclipse"])
def test_search_finds_home_again(robot: str, tol: Tolerances) -> None:
    m = cc.load(robot)
    chart = chart_of(m, m.inputs[:2])
    value = chart.values(chart.start)[None]
    found = search(chart.problem, chart.targets(value), random_starts(m, 60, 1))
    assert found.found.all()
    assert np.abs(m.workspace.residual(found.q[0])).max() < tol.closure
    assert_close(chart.values(found.q[0]), value[0], tol.closure)


@pytest.mark.parametrize("robot", ["d1", "rus6"])
def test_search_does_not_depend_on_what_is_searched_beside(robot: str) -> None:
    m = cc.load(robot)
    chart = chart_of(m, m.inputs[:2])
    values = cells(chart, 0.5, 4).reshape(-1, 2)
    starts = np.stack([random_starts(m, 5, i) for i in range(len(values))])
    whole = search(chart.problem, chart.targets(values), starts)
    for i in range(0, len(values), 5):
        one = search(chart.problem, chart.targets(values[i : i + 1]), starts[i : i + 1])
        assert one.codes[0] == whole.codes[i]
        assert np.array_equal(one.q[0], whole.q[i])


def test_kept_rows_lead_wherever_all_rows_do(tol: Tolerances) -> None:
    """The parallelograms of the linear delta make rows redundant; along their own axes some do."""
    m = cc.load("linear_delta")
    chart = chart_of(m, ["q1", "q2"])
    assert chart.problem.redundant
    values = np.stack(np.meshgrid(*2 * [np.linspace(-0.64, 0.35, 34)], indexing="ij"), axis=-1)
    first = chart.pinned(chart.start, values[17, 17])
    middle = correct(chart.equations(values[17, 17]), first)
    assert middle.refusal is None
    expected, postures = walk(chart, values)
    codes, q = spread(chart, values, postures[17, 17])
    assert np.array_equal(status_of(codes), expected)
    assert (expected == OK).mean() > 0.9
    alone = follower_of(chart.problem).run
    lost = 0
    for i, j in np.argwhere((codes == ARRIVED)[1:, 1:] & (codes == ARRIVED)[:-1, 1:]):
        ends = chart.targets(values[i : i + 2, j + 1])
        way = alone(q[i : i + 1, j + 1], ends[:1], ends[1:], 1e-4)
        lost += int(way.codes[0] != ARRIVED)
    assert lost == 0
    assert_close(q[codes == ARRIVED], postures[codes == ARRIVED], 1e-9)
