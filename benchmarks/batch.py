"""The batch kernel on D1, on one core, beside a Python loop over Pinocchio and LAPACK.

Two works, each timed for both in the same run: residual, Jacobian and both determinants of given
postures; and a solved and classified cell of a map (position by continuation from its neighbour,
three singular values, two determinants, condition of the twist map). The share of the flop bound
is the count of the kernel's own additions and multiplications over its time, against the rate of
a large matrix product on one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

import closedchain as cc
from benchmarks.timing import Row
from closedchain.analysis.first_order import first_order
from closedchain.analysis.singularity.classify import determinants
from closedchain.closure.batch import OK, UNSEEN, Batch
from closedchain.closure.chart import Chart
from closedchain.closure.charting import chart_of, straight
from closedchain.closure.continuation import follow
from closedchain.closure.equations import correct
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.task import task_jacobian

OURS = "closedchain"
LOOP = "Pinocchio + LAPACK loop"
DETERMINANTS = "residual, K, two determinants"
CELL = "solved, classified map cell"
HALF = 0.06  # m, of both axes


def rows(cells: int, repeats: int = 5) -> Iterator[Row]:
    """Rows of both works for D1's map q1 x q2 with ``cells`` along an axis."""
    m = cc.load("d1")
    chart = chart_of(m, ["q1", "q2"])
    batch = Batch(m, chart)
    batch.warm()
    home = chart.values(chart.start)
    axes = [np.linspace(h - HALF, h + HALF, cells) for h in home]
    values = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    status, q = spread(batch, values)
    postures = np.ascontiguousarray(q[status == OK])
    peak = peak_rate()

    ours = best(lambda: batch.determinants(postures), repeats) / len(postures)
    theirs = best(lambda: loop_determinants(m, postures), 1) / len(postures)
    residual = float(batch.determinants(postures)["residual"].max())
    note = _note(ours, determinant_flops(batch), peak)
    yield Row("d1", DETERMINANTS, OURS, ours, residual, note=note)
    yield Row("d1", DETERMINANTS, LOOP, theirs, residual)

    def cell() -> None:
        found, at = spread(batch, values)
        batch.measures(np.ascontiguousarray(at[found == OK]))

    ours = best(cell, repeats) / len(postures)
    note = f"{1e9 * ours:.0f} ns a cell, {len(postures)} of {status.size} cells reached"
    yield Row("d1", CELL, OURS, ours, residual, note=note)
    begin = time.process_time()
    reached, at = walk(chart, values)
    loop_measures(m, at[reached == OK])
    theirs = (time.process_time() - begin) / len(postures)
    if not np.array_equal(reached, status):
        raise AssertionError("the kernel and the Python loop reach different cells")
    yield Row("d1", CELL, LOOP, theirs, residual)


def best(work: Callable[[], object], repeats: int) -> float:
    """Least processor time of ``work()``."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def peak_rate(size: int = 800) -> float:
    """Flops a second of a large matrix product, one thread."""
    a = np.random.default_rng(0).standard_normal((size, size))
    return 2.0 * size**3 / best(lambda: a @ a, 5)


def spread(batch: Batch, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Status and postures of a block, reached by the kernel from its middle."""
    chart = batch.chart
    assert chart is not None
    shape = values.shape[:-1]
    status = np.full(shape, UNSEEN, dtype=np.int8)
    q = np.zeros((*shape, batch.mechanism.model.nq))
    middle = tuple(n // 2 for n in shape)
    q[middle] = correct(
        chart.equations(values[middle]), chart.pinned(chart.start, values[middle])
    ).q
    batch.spread(values, status, q, [int(np.ravel_multi_index(middle, shape))])
    return status, q


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
    """Status and postures of a block, reached by ``closure.continuation`` from its middle."""
    m, shape = chart.mechanism, values.shape[:-1]
    status = np.full(shape, UNSEEN, dtype=np.int8)
    q = np.zeros((*shape, m.model.nq))
    middle = tuple(n // 2 for n in shape)
    first = correct(chart.equations(values[middle]), chart.pinned(chart.start, values[middle]))
    status[middle], q[middle] = OK, first.q
    queue = [(middle, first)]
    for cell, here in queue:  # grows as it goes: breadth first
        for axis in range(len(shape)):
            for step in (-1, 1):
                key = (*cell[:axis], cell[axis] + step, *cell[axis + 1 :])
                if not 0 <= key[axis] < shape[axis] or status[key] != UNSEEN:
                    continue
                path = follow(straight(chart, values[cell], values[key]), here, 1e-4)
                if path.refusal is None and not beyond_limits(m, path.last.q):
                    status[key], q[key] = OK, path.last.q
                    queue.append((key, path.last))
    return status, q


# -- flops ----------------------------------------------------------------------------------------


def determinant_flops(batch: Batch) -> float:
    """Additions and multiplications of one posture's residual, K, J and determinants.

    A sine and its cosine count 40. Elimination counts every entry that can differ from zero in the
    pivot's column, over all columns to the right.
    """
    t, p = batch._tables, batch._problem
    kinds = t.joints[1:, 0]
    tree = 63.0 * kinds.size + 58.0 * np.sum(kinds == 0) + 75.0 * np.sum(kinds == 2)
    axes = np.where(t.joints[t.path[:, 0], 0] == 2, 3, 1).sum()
    closures = (2 * 63 + 18) * len(t.closures) + 42.0 * axes
    width = len(p.column)
    eliminated = sum(
        (end - begin - 1) * (2.0 * (width - col - 1) + 1)
        for steps in (p.steps, p.last_steps)
        for begin, _, end, col in steps
    )
    task = 63.0 + 45.0 * 3 * len(p.outputs)
    return float(tree + closures + task + eliminated)


def _note(seconds: float, flops: float, peak: float) -> str:
    share = flops / seconds / peak
    return (
        f"{1e9 * seconds:.0f} ns, {flops / 1e3:.1f} kflop: {share:.0%} of the bound at "
        f"{peak / 1e9:.0f} Gflop/s"
    )
