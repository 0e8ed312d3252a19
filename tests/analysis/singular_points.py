"""Checks that every singular set has to pass, and readers of postures. No tests here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

import closedchain as cc
from closedchain.analysis.singularity.sets.bordered import Measure
from closedchain.analysis.singularity.sets.singular_set import wanted
from closedchain.analysis.singularity.sets.slices import Slice
from closedchain.closure import mechanism_from_description
from closedchain.closure.solve.solution_set import Bound, settle

RESIDUAL = 1e-10


def check_points(
    m: cc.Mechanism,
    found: cc.SingularitySet,
    over: Mapping[str, np.ndarray],
    outputs: str | None = None,
) -> None:
    """Closed, singular by ``classify``, measures zero, coordinates in range; pieces in order."""
    names = m.outputs(outputs)
    assert found.coordinates.shape == (len(found.q), len(over))
    assert found.over == tuple(over)
    for q, c, kinds, free, lost in zip(
        found.q, found.coordinates, found.kinds, found.free_twists, found.lost_twists, strict=True
    ):
        assert np.abs(cc.residual(m, q)).max(initial=0.0) < RESIDUAL
        again = cc.classify(m, q, names)
        assert again.kinds == kinds >= wanted(found.kind)
        assert free.shape[1] > 0 or "direct" not in kinds
        assert lost.shape[1] > 0 or "inverse" not in kinds or "constraint" in kinds
        tilted = {"tilt", "azimuth", "torsion"} & set(over)
        if not tilted:  # azimuth is known up to full turns
            assert np.abs(found.chart.values(q) - c).max() < 1e-9
    for kind in wanted(found.kind):
        column = ("direct", "inverse", "constraint").index(kind)
        assert found.sigmas[:, column].max(initial=0.0) < RESIDUAL
    for i, axis in enumerate(over.values()):
        assert found.coordinates[:, i].min(initial=axis[0]) >= axis[0] - 1e-9
        assert found.coordinates[:, i].max(initial=axis[-1]) <= axis[-1] + 1e-9
    used = np.unique(np.concatenate([p.ravel() for p in found.pieces])) if found.pieces else []
    if found.dimension < 2:
        assert len(used) == len(found.q)


def joint(m: cc.Mechanism, q: np.ndarray, name: str) -> np.ndarray:
    """Values (...) of a joint at postures (..., nq)."""
    return np.asarray(q[..., m.model.joints[m.model.getJointId(name)].idx_q])


def at_value(
    m: cc.Mechanism,
    found: cc.SingularitySet,
    name: str,
    value: float,
    near: np.ndarray | None = None,
    outputs: str | None = None,
) -> np.ndarray:
    """Coordinates (k,) of the set's point where one of them has a value: exact, not interpolated.

    Starts from the point of the set that is nearest, to ``near`` (k,) if given.
    """
    i = found.over.index(name)
    apart = np.abs(found.coordinates[:, i] - value)
    if near is not None:
        apart = np.linalg.norm(found.coordinates - near, axis=1)
    start = int(apart.argmin())
    chart = found.chart
    system = Slice(chart, (Measure(m, found.kind, m.outputs(outputs)),))
    column = m.model.nv + i
    index = m.model.nq + i
    bound = Bound(index, column, float(chart.scale[i]), value, value, name)
    z = settle(system, system.point(found.q[start], found.coordinates[start]), [(bound, value)])
    assert z.good
    return system.coordinates(z.posture)


def with_inputs(m: cc.Mechanism, *joints: str) -> cc.Mechanism:
    """The same mechanism with further joints driven."""
    one = m.description.inputs[0]
    more = tuple(replace(one, name=name, joint=name) for name in joints)
    return mechanism_from_description(replace(m.description, inputs=(*m.description.inputs, *more)))
