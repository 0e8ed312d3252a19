"""Bordered measures and the equations of a slice: exact derivatives, zeros at rank losses."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import closedchain as cc
from closedchain.analysis.singularity.classify import row_combination
from closedchain.analysis.singularity.sets.bordered import Measure, corner
from closedchain.analysis.singularity.sets.postures_at import first_order_code
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure.charting import chart_of

ROBOTS = ("d1", "eclipse", "eclipse2", "rpa3t", "linear_delta", "rus6")
STEP = 1e-5


def nearby(m: cc.Mechanism, seed: int, spread: float = 0.1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    step = spread * rng.standard_normal(m.model.nv) * m.column_scale
    return cc.close(m, guess=pin.integrate(m.model, m.home, step)).raise_if_failed().q


@pytest.mark.parametrize("shape", [(4, 4), (3, 5), (1, 3)])
def test_corner_vanishes_where_the_rank_drops(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    a = rng.standard_normal(shape)
    u, s, vt = np.linalg.svd(a)
    borders = u[:, -1:], vt[shape[0] - 1 :].T
    s[-1] = 0.0
    dropped = (u[:, : s.size] * s) @ vt[: s.size]
    g, _, _ = corner(dropped, borders)
    assert g.shape == (1, shape[1] - shape[0] + 1)
    assert np.abs(g).max() < 1e-14
    assert np.abs(corner(a, borders)[0]).max() > 1e-3
    rows = rng.standard_normal(shape)
    values = [corner(dropped + t * rows, borders)[0] for t in (1e-4, -1e-4)]
    assert np.linalg.norm(values[0] + values[1]) < 1e-3 * np.linalg.norm(values[0])  # signed


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("kind", ["direct", "inverse", "constraint", "axis"])
def test_gradients_of_measures(robot: str, kind: str) -> None:
    """Against central differences of the corner, away from the posture of the borders."""
    m = cc.load(robot)
    outputs = m.outputs("x y z rx rz" if kind == "axis" and robot != "rpa3t" else None)
    measure = Measure(m, "inverse" if kind == "axis" else kind, outputs)
    code = first_order_code(m, outputs)
    at = code.at(nearby(m, 1))
    combine = row_combination(m, at.closures)
    borders = measure.borders(at, combine)
    rng = np.random.default_rng(2)
    q = pin.integrate(m.model, m.home, 0.05 * rng.standard_normal(m.model.nv) * m.column_scale)

    def value(x: np.ndarray) -> np.ndarray:
        return measure.evaluate(x, code.at(x), combine, borders)[0]

    g, gradient = measure.evaluate(q, code.at(q), combine, borders)
    assert g.size == measure.codimension == abs(np.subtract(*measure.shape)) + 1
    for i in range(0, m.model.nv, 2):
        e = np.zeros(m.model.nv)
        e[i] = STEP * m.column_scale[i]
        ahead, behind = (value(pin.integrate(m.model, q, s * e)) for s in (1.0, -1.0))
        slope = (ahead - behind) / (2.0 * STEP)
        assert np.abs(slope - gradient[:, i]).max() < 1e-6 * (1.0 + np.abs(gradient).max())


@pytest.mark.parametrize(
    ("robot", "names", "outputs"),
    [
        ("d1", ("q1", "q2"), None),
        ("d1", ("rx", "z"), "x y z rx rz"),
        ("eclipse", ("tilt", "azimuth", "x"), None),
        ("rus6", ("x", "ry"), None),
        ("linear_delta", ("x", "q2"), "x y"),
        ("rpa3t", ("x", "y"), None),
    ],
)
def test_jacobian_of_a_slice(robot: str, names: tuple[str, ...], outputs: str | None) -> None:
    m = cc.load(robot)
    q = nearby(m, 3, 0.03)
    chart = chart_of(m, names, q, outputs)
    kinds = ("direct", "inverse")
    system = Slice(chart, tuple(Measure(m, kind, m.outputs(outputs)) for kind in kinds))
    z = system.point(q)
    assert system.residual(z) < 1e-11
    frame = system.frame(z)
    rng = np.random.default_rng(4)
    z = system.move(z, 0.03 * rng.standard_normal(system.size))
    _, jacobian = system.evaluate(z, frame)
    for i in range(system.size):
        e = np.zeros(system.size)
        e[i] = STEP
        values = [system.evaluate(system.move(z, s * e), frame)[0] for s in (1.0, -1.0)]
        slope = (values[0] - values[1]) / (2.0 * STEP)
        assert np.abs(slope - jacobian[:, i]).max() < 1e-6
    step = 0.01 * rng.standard_normal(system.size)
    assert np.abs(system.difference(z, system.move(z, step)) - step).max() < 1e-12
