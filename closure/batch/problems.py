"""Tables of what is asked of a mechanism: its measures, and the equations of a chart."""

from __future__ import annotations

import numpy as np

from closedchain.closure.batch.measures import Problem
from closedchain.closure.batch.newton import Equations
from closedchain.closure.batch.system import dense, eliminated, parity, plain
from closedchain.closure.batch.tables import ancestors, touched
from closedchain.closure.chart import Chart
from closedchain.closure.generic import dimensionless_jacobian
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import OUTPUTS


def problem(mechanism: Mechanism, rank: int, outputs: tuple[str, ...]) -> Problem:
    """Tables of the measures; ``rank`` is the generic rank of K."""
    m, d = mechanism, len(outputs)
    passive, rows = m.passive_v, m.rows
    closures = touched(m) if rank == rows else np.ones((rank, m.model.nv), dtype=bool)
    task = _tip_pattern(m, d) if d else np.zeros((0, m.model.nv), dtype=bool)
    order = [int(v) for v in (*passive, *m.input_v)]
    square = rank == passive.size
    s = plain(order, m.model.nv)
    if square and rank:
        s = eliminated(np.vstack([closures, task]), order[:rank], order[rank:], cleared=d)
    used = s.unknown[: passive.size]
    last = m.model.nv - passive.size if square and rank + d == m.model.nv else 0
    everything = rank + d if rank + d == m.model.nv else 0
    home = np.zeros((0, rows))
    if rank < rows and not square:
        u, _, _ = np.linalg.svd(dimensionless_jacobian(m, m.home)[None])
        home = np.ascontiguousarray(u[0, :, :rank].T)
    last_steps, last_slots = dense(last, rank, passive.size)
    all_steps, all_slots = dense(everything)
    return Problem(
        rank=rank,
        passive=int(passive.size),
        outputs=_indices(outputs),
        sign_rows=s.row_sign,
        sign_passive=float(parity(np.argsort(np.argsort(used)))),
        sign_all=float(parity(s.unknown)),
        column=s.column,
        steps=s.steps,
        slots=s.slots,
        last_steps=last_steps,
        last_slots=last_slots,
        all_steps=all_steps,
        all_slots=all_slots,
        home=home,
    )


def equations(chart: Chart) -> Equations:
    """Tables of the equations of a chart."""
    m, outputs = chart.mechanism, chart.outputs
    free = [int(v) for v in chart.free]
    pattern = touched(m)
    if outputs:
        pattern = np.vstack([pattern, _tip_pattern(m, len(outputs))])
    square = len(pattern) == len(free)
    s = eliminated(pattern, free) if square else plain(free, m.model.nv)
    used = np.argsort(np.argsort(s.unknown))
    return Equations(
        pins=np.array(chart.pinned_q, dtype=np.int64),
        pin_units=np.array(m.column_scale[chart.pinned_v], dtype=float),
        outputs=_indices(outputs),
        goal_units=np.array([m.length if n in "xyz" else 1.0 for n in outputs], dtype=float),
        square=square,
        column=s.column,
        steps=s.steps,
        slots=s.slots,
        sign=s.row_sign * parity(used),
        unknowns=len(free),
    )


def no_equations() -> Equations:
    """Equations of nothing, to compile for."""
    none, numbers = np.zeros(0, dtype=np.int64), np.zeros(0)
    s = plain([], 0)
    return Equations(none, numbers, none, numbers, True, none, s.steps, none, 1.0, 0)


def _indices(outputs: tuple[str, ...]) -> np.ndarray:
    return np.array([OUTPUTS.index(n) for n in outputs], dtype=np.int64)


def _tip_pattern(m: Mechanism, rows: int) -> np.ndarray:
    """Which unknowns move the tip, (rows, nv) of bool."""
    model = m.model
    pattern = np.zeros((rows, model.nv), dtype=bool)
    frame = model.frames[m.frame_id(m.required_task().tip)]
    for j in ancestors(m, frame.parentJoint):
        pattern[:, model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = True
    return pattern
