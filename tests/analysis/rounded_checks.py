"""A mechanism with rounded numbers beside the exact one: it has to be read as that."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from conftest import Tolerances
from rounded_files import rounded_urdf

import closedchain as cc


def values(m: cc.Mechanism) -> dict[str, tuple[float, ...]]:
    """Values of all joints at home."""
    joints = list(zip(m.model.names, m.model.joints, strict=True))[1:]
    return {name: tuple(m.home[j.idx_q : j.idx_q + j.nq]) for name, j in joints}


def rounded(exact: cc.Mechanism, decimals: int, seed: int) -> cc.Mechanism:
    """The mechanism with every link's frame turned at random, and every number rounded."""
    rng = np.random.default_rng(seed)
    return cc.load_urdf(rounded_urdf(exact.description, decimals, rng, values(exact)), xacro=False)


def check(exact: cc.Mechanism, decimals: int, seed: int, tol: Tolerances) -> cc.Mechanism:
    """The rounded file is understood, closes, moves as much, and follows its inputs."""
    m = rounded(exact, decimals, seed)
    assert not m.home_open, m.notes
    unit = 10.0**-decimals
    assert m.rounding is not None
    assert 0.01 * unit < m.misfit < 100.0 * unit
    assert max(change.off for change in m.rounding.changed) < 11.0 * unit
    expected, found = cc.mobility(exact), cc.mobility(m)
    assert (found.mobility, found.redundant_rows) == (expected.mobility, expected.redundant_rows)
    assert found.finite_at(m.home) == expected.finite_at(exact.home)
    assert len(m.rounding.redundant) == expected.redundant_rows
    assert m.rounding.rank.gap > 50.0
    assert np.abs(cc.residual(m, m.home)).max() < tol.closure
    _solves(exact, m, 3e3 * unit)
    return m


def _solves(exact: cc.Mechanism, m: cc.Mechanism, apart: float) -> None:
    """Follows its inputs as the exact one does; without any, closes from beside home."""
    if not m.inputs:
        aside = 0.05 * np.random.default_rng(0).standard_normal(m.model.nv) * m.column_scale
        cc.close(m, pin.integrate(m.model, m.home, aside)).raise_if_failed()
        return
    step = 0.05 * m.column_scale[m.input_v]
    s = cc.direct(m, m.input_values(m.home) + step).raise_if_failed()
    as_exact = cc.direct(exact, exact.input_values(exact.home) + step).raise_if_failed()
    # joint values mean the same in both; rounding is amplified by the mechanism, not without bound
    assert np.abs(_joint_values(m, s.q) - _joint_values(exact, as_exact.q)).max() < apart


def _joint_values(m: cc.Mechanism, q: np.ndarray) -> np.ndarray:
    return np.array([q[j.idx_q] for j in list(m.model.joints)[1:] if j.nq == 1])
