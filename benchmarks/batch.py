"""Many postures of D1 on one core, beside a Python loop over Pinocchio and LAPACK.

Two works, each timed for both in the same run: residual and both determinants of given postures;
and a solved and classified cell of a map (position by continuation from its neighbour, three
singular values, two determinants, condition of the twist map).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

import closedchain as cc
from benchmarks.timing import Row
from closedchain.analysis.first_order import first_order
from closedchain.analysis.singularity.bulk.measuring import bulk_measures
from closedchain.analysis.singularity.classify import determinants
from closedchain.closure.chart import Chart
from closedchain.closure.charting import chart_of, straight
from closedchain.closure.continuation import follow
from closedchain.closure.equations import correct
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.solve.flood import ARRIVED, Block, flood
from closedchain.closure.task import task_jacobian

OURS = "closedchain"
LOOP = "Pinocchio + LAPACK loop"
DETERMINANTS = "residual, two determinants"
CELL = "solved, classified map cell"
HALF = 0.06  # m, of both axes


def rows(cells: int, repeats: int = 5) -> Iterator[Row]:
    """Rows of both works for D1's map q1 x q2 with ``cells`` along an axis."""
    m = cc.load("d1")
    chart = chart_of(m, ["q1", "q2"])
    bulk = bulk_measures(m)
    home = chart.values(chart.start)
    axes = [np.linspace(h - HALF, h + HALF, cells) for h in home]
    values = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    reached, q = filled(chart, values)
    postures = np.ascontiguousarray(q[reached])
    bulk.measures(postures)  # compiles

    ours = best(lambda: bulk.determinants(postures), repeats) / len(postures)
    theirs = best(lambda: loop_determinants(m, postures), 1) / len(postures)
    residual = float(bulk.determinants(postures)["residual"].max())
    yield Row("d1", DETERMINANTS, OURS, ours, residual, note=f"{1e9 * ours:.0f} ns")
    yield Row("d1", DETERMINANTS, LOOP, theirs, residual)

    def cell() -> None:
        found, at = filled(chart, values)
        bulk.measures(np.ascontiguousarray(at[found]))

    ours = best(cell, repeats) / len(postures)
    note = f"{1e9 * ours:.0f} ns a cell, {len(postures)} of {reached.size} cells reached"
    yield Row("d1", CELL, OURS, ours, residual, note=note)
    begin = time.process_time()
    walked, at = walk(chart, values)
    loop_measures(m, at[walked])
    theirs = (time.process_time() - begin) / len(postures)
    if not np.array_equal(walked, reached):
        raise AssertionError("the machine code and the Python loop reach different cells")
    yield Row("d1", CELL, LOOP, theirs, residual)


def best(work: Callable[[], object], repeats: int) -> float:
    """Least processor time of ``work()``."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def filled(chart: Chart, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which cells of a block are reached from its middle, and their postures."""
    shape = values.shape[:-1]
    targets = chart.targets(values.reshape(-1, values.shape[-1])).reshape(*shape, -1)
    q = np.zeros((*shape, chart.mechanism.model.nq))
    middle = tuple(n // 2 for n in shape)
    q[middle] = at_middle(chart, values[middle])
    block = Block(chart.problem, targets, np.ones(shape, dtype=bool), q)
    codes = flood(block, [int(np.ravel_multi_index(middle, shape))])
    return codes == ARRIVED, q


def at_middle(chart: Chart, values: np.ndarray) -> np.ndarray:
    """Posture (nq,) near the start at coordinates (k,)."""
    return correct(chart.equations(values), chart.pinned(chart.start, values)).q


# -- the Python loop ------------------------------------------------------------------------------


def matrices(m: cc.Mechanism, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residual and dimensionless [K; J] of one posture."""
    values, jacobian = m.workspace.evaluate(q)
    units = np.array([m.length if n in "xyz" else 1.0 for n in m.outputs()])
    stacked = np.vstack([jacobian / m.row_scale[:, None], task_jacobian(m, q) / units[:, None]])
    return values, stacked * m.column_scale


def loop_determinants(m: cc.Mechanism, postures: np.ndarray) -> None:
    """Residual and both determinants, LAPACK called on all postures at once."""
    stacked = np.array([matrices(m, q)[1] for q in postures])
    np.linalg.det(stacked[:, : m.rows, m.passive_v])
    np.linalg.det(stacked)


def loop_measures(m: cc.Mechanism, postures: np.ndarray) -> None:
    """What ``classify`` evaluates, with LAPACK called on all postures at once."""
    stacked = np.array([first_order(m, q).stacked for q in postures])
    closures, task = stacked[:, : m.rows], stacked[:, m.rows :]
    for matrix in (closures[:, :, m.passive_v], stacked, closures):
        np.linalg.svd(matrix, compute_uv=False)
    determinants(m, closures, task)
    kp, ka = closures[:, :, m.passive_v], closures[:, :, m.input_v]
    twist_map = task[:, :, m.input_v] - task[:, :, m.passive_v] @ np.linalg.solve(kp, ka)
    np.linalg.svd(twist_map, compute_uv=False)
    for q in postures:
        np.abs(m.workspace.residual(q)).max()


def walk(chart: Chart, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same as ``filled`` by ``closure.continuation``."""
    m, shape = chart.mechanism, values.shape[:-1]
    seen = np.zeros(shape, dtype=bool)
    reached, q = seen.copy(), np.zeros((*shape, m.model.nq))
    middle = tuple(n // 2 for n in shape)
    first = correct(chart.equations(values[middle]), chart.pinned(chart.start, values[middle]))
    reached[middle] = seen[middle] = True
    q[middle] = first.q
    queue = [(middle, first)]
    for cell, here in queue:  # grows as it goes: breadth first
        for axis in range(len(shape)):
            for step in (-1, 1):
                key = (*cell[:axis], cell[axis] + step, *cell[axis + 1 :])
                if not 0 <= key[axis] < shape[axis] or seen[key]:
                    continue
                path = follow(straight(chart, values[cell], values[key]), here, 1e-4)
                if path.refusal is None:
                    seen[key] = True
                    if not beyond_limits(m, path.last.q):
                        reached[key], q[key] = True, path.last.q
                        queue.append((key, path.last))
    return reached, q
