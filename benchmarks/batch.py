"""Many postures at once on one core, for D1 beside a Python loop over Pinocchio and LAPACK.

Works: residual and determinants of given postures; solves from 2 mm away; requests for inputs or
poses, many at once; solved and classified cells of a map (position by continuation from its
neighbour, singular values, determinants, condition of the twist map).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import closedchain as cc
from benchmarks.cases import CASES, STEP, Case
from benchmarks.timing import OURS, Row, least
from closedchain.analysis.first_order import first_order
from closedchain.analysis.singularity.bulk.measuring import bulk_measures
from closedchain.analysis.singularity.classify import determinants
from closedchain.closure.chart import Chart
from closedchain.closure.charting import chart_of, straight
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.position import driven
from closedchain.closure.solve.continuation import follow
from closedchain.closure.solve.flood import ARRIVED, Block, flood
from closedchain.closure.solve.newton import correct
from closedchain.closure.solve.path import follower_of
from closedchain.closure.task import task_jacobian

LOOP = "Pinocchio + LAPACK loop"
DETERMINANTS = "residual, two determinants"
CELL = "solved, classified map cell"
PUBLIC = "singularity_map, a cell"
SOLVE = "solve from 2 mm away, in bulk"
MANY = {"direct": "direct, many at once", "inverse": "inverse, many at once"}


@dataclass(frozen=True)
class Field:
    """A map that is timed: coordinates, and half its width [m or rad] about the start."""

    robot: str
    names: tuple[str, ...]
    half: float

    def axes(self, chart: Chart, cells: int) -> dict[str, np.ndarray]:
        """Values of each coordinate, ``cells`` ** 2 in all."""
        each = max(3, round(cells ** (2.0 / len(self.names))))
        home = chart.values(chart.start)
        return {
            n: np.linspace(h - self.half, h + self.half, each)
            for n, h in zip(self.names, home, strict=True)
        }


FIELDS = (
    Field("d1", ("q1", "q2"), 0.06),
    Field("linear_delta", ("x", "y", "z"), 0.06),
    Field("rpa3t", ("x", "z"), 0.05),
)


def rows(cells: int, repeats: int = 5) -> Iterator[Row]:
    """Rows of all works, ``cells`` ** 2 postures at once in each."""
    yield from _determinants(cells, repeats)
    yield from _solve(cells, repeats)
    for case in CASES:
        yield from _many(case, cells, repeats)
    for field in FIELDS:
        yield from _cells(field, cells, repeats)


def _determinants(cells: int, repeats: int) -> Iterator[Row]:
    chart, values = grid(FIELDS[0], cells)
    bulk = bulk_measures(chart.mechanism)
    reached, q = filled(chart, values)
    postures = np.ascontiguousarray(q[reached])
    residual = float(bulk.determinants(postures)["residual"].max())
    ours = least(lambda: bulk.determinants(postures), repeats) / len(postures)
    yield Row("d1", DETERMINANTS, OURS, ours, residual)
    theirs = least(lambda: loop_determinants(chart.mechanism, postures), 1) / len(postures)
    yield Row("d1", DETERMINANTS, LOOP, theirs, residual)


def _solve(cells: int, repeats: int) -> Iterator[Row]:
    """Newton's method alone: postures and targets as the follower takes them."""
    m, q = CASES[1].start()
    n, start = cells**2, m.input_values(q)
    targets = np.tile(start + STEP, (n, 1))
    follower = follower_of(driven(m))
    given = np.tile(q, (n, 1)), np.tile(start, (n, 1)), targets
    way = follower.run(*given)
    residual = float(follower.check.run(np.concatenate([way.q.T, targets.T]))[0].max())
    seconds = least(lambda: follower.run(*given), repeats) / n
    note = f"{way.evaluations.mean():.1f} evaluations"
    yield Row("d1", SOLVE, OURS, seconds, residual, note=note)


def _many(case: Case, cells: int, repeats: int) -> Iterator[Row]:
    """Requests around one posture, a step of up to 2 mm away."""
    m, q = case.start()
    rng, n = np.random.default_rng(0), cells**2
    inputs = m.input_values(q) + STEP * rng.uniform(-1.0, 1.0, (n, len(m.inputs)))
    found = cc.direct(m, inputs, q)
    poses = np.array([pin.SE3ToXYZQUAT(m.pose(one)) for one in found.q])
    back = cc.inverse(m, poses, q)
    if not (found.good and back.good):
        raise AssertionError(f"{m.name}: requests were not met")
    calls = {"direct": lambda: cc.direct(m, inputs, q), "inverse": lambda: cc.inverse(m, poses, q)}
    residuals = {"direct": found.residual, "inverse": back.residual}
    for name, call in calls.items():
        seconds = least(call, repeats) / n
        yield Row(case.robot, MANY[name], OURS, seconds, float(residuals[name].max()))


def _cells(field: Field, cells: int, repeats: int) -> Iterator[Row]:
    chart, values = grid(field, cells)
    m, bulk = chart.mechanism, bulk_measures(chart.mechanism)
    reached, q = filled(chart, values)
    count = int(reached.sum())
    residual = float(bulk.measures(q[reached])["residual"].max())

    def cell() -> None:
        found, at = filled(chart, values)
        bulk.measures(np.ascontiguousarray(at[found]))

    ours = least(cell, repeats) / count
    about = f"{' x '.join(field.names)}, {count} of {reached.size} cells"
    yield Row(field.robot, CELL, OURS, ours, residual, note=about)
    axes = field.axes(chart, cells)

    def whole() -> None:
        cc.singularity_map(m, axes, progress=False, workers=1)

    whole()
    yield Row(field.robot, PUBLIC, OURS, least(whole, repeats) / count, note="labelled arrays")
    if field is FIELDS[0]:
        walked, at = walk(chart, values)
        theirs = least(lambda: loop_measures(m, walk(chart, values)[1][walked]), 1) / count
        if not np.array_equal(walked, reached) or at.shape != q.shape:
            raise AssertionError("the machine code and the Python loop reach different cells")
        yield Row(field.robot, CELL, LOOP, theirs, residual)


def grid(field: Field, cells: int) -> tuple[Chart, np.ndarray]:
    """Chart of a map, and the values of its cells (*shape, k)."""
    chart = chart_of(cc.load(field.robot), list(field.names))
    axes = field.axes(chart, cells).values()
    return chart, np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def filled(chart: Chart, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which cells of a block are reached from its middle, and their postures."""
    shape = values.shape[:-1]
    targets = chart.targets(values.reshape(-1, values.shape[-1])).reshape(*shape, -1)
    q = np.zeros((*shape, chart.mechanism.model.nq))
    middle = tuple(n // 2 for n in shape)
    q[middle] = at_middle(chart, values[middle])
    block = Block(chart.problem, targets, np.ones(shape, dtype=bool), q)
    codes = flood(block, [int(np.ravel_multi_index(middle, shape))]).codes
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
    """The same as ``filled`` by ``closure.solve.continuation``."""
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
