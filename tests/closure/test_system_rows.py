"""Rows and Jacobians of many postures on the tape, against Pinocchio: robots, closure kinds."""

from __future__ import annotations

import math
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import get_args

import numpy as np
import pinocchio as pin
import pytest
from conftest import Tolerances, assert_close
from oracle.walks import anywhere
from small_linkages import build, joint, loop

import closedchain as cc
from closedchain.closure.solve.system import code_of
from closedchain.urdf.description import ClosureType

KINDS: tuple[ClosureType, ...] = tuple(k for k in get_args(ClosureType) if k != "distance")


def loose(kind: ClosureType) -> cc.Mechanism:
    """One closure of a kind between an arm of skew joints and a floating body; all of it closes."""
    second = "0.6 0.8 0" if kind == "prismatic" else "0 -0.6 0.8"
    parts = [
        joint("r1", "base", "a", "0.1 0.2 0.3", axis="0.6 0 -0.8", rpy="0.3 -0.7 1.9"),
        joint("p", "a", "b", "0 0.1 0.2", kind="prismatic", axis="-1 0 0", rpy="1 0.5 0"),
        joint("r2", "b", "c", "0.2 0 0", axis="0 1 0"),
        joint("weld", "c", "d", "0.1 0.1 0", kind="fixed", rpy="0.4 0.5 0.6"),
        joint("free", "base", "body", kind="floating"),
        joint("r3", "body", "e", "0 0 0.1", axis="0 0.6 0.8"),
        joint("r4", "base", "f", "0.3 0 0", axis="0 0 -1",
              more='<mimic joint="r1" multiplier="-1.7" offset="0.2"/>'),
        loop(kind, "d", "0.1 -0.2 0.3", "e", "0.2 0.1 0", "0.6 0.8 0", second),
    ]  # fmt: skip
    home = {"r1": 0.2, "p": 0.1, "r2": -0.4, "r3": 3.0 if kind == "prismatic" else 0.0}
    return build("base a b c d body e f", parts, home, "r1")


def evaluated(m: cc.Mechanism, postures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, rows) and K (n, rows, nv) [m, rad] of postures (n, nq)."""
    code = code_of(m, ())
    numbers = code.code.run(np.ascontiguousarray(postures.T)).T
    matrices = np.zeros((len(postures), m.rows, m.model.nv))
    matrices[:, code.places[0], code.places[1]] = numbers[:, m.rows :]
    return numbers[:, : m.rows], matrices * m.row_scale[:, None] / m.column_scale


def check(m: cc.Mechanism, postures: np.ndarray, tol: float) -> None:
    values, matrices = evaluated(m, postures)
    for q, value, matrix in zip(postures, values, matrices, strict=True):
        expected, jacobian = m.workspace.evaluate(q)
        if m.closures[0].kind == "fixed":
            expected, jacobian = expected.copy(), jacobian.copy()
            expected[:6], jacobian[:6] = weld(m, q)
        assert_close(value, expected, tol, m.name)
        assert_close(matrix, jacobian, tol, m.name)


def weld(m: cc.Mechanism, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a first closure that is fixed: displacement along frame 1, and Gibbs' vector.

    Pinocchio's log6, which ``workspace`` has, vanishes where they do, but mixes the two before.
    """
    m.workspace.evaluate(q)
    (_, anchor, data), *_ = m.workspace.frames
    gap = data.c1Mc2
    twist = gap.inverse().action @ anchor.jacobian(m.model, m.workspace.data, data)
    turn = pin.log3(gap.rotation)
    angle = np.linalg.norm(turn)
    gibbs = turn * (2.0 * math.tan(angle / 2.0) / angle if angle > 0.0 else 1.0)
    rate = np.eye(3) + pin.skew(gibbs) / 2.0 + np.outer(gibbs, gibbs) / 4.0
    rows = np.vstack([gap.rotation @ twist[:3], rate @ twist[3:]])
    return np.concatenate([gap.translation, gibbs]), rows


@pytest.mark.parametrize("robot", cc.robots("papers"))
def test_rows_of_the_robots(robot: str, tol: Tolerances) -> None:
    m = cc.load(robot)
    check(m, np.vstack([m.home[None], anywhere(m, 50)]), tol.closure)


@pytest.mark.parametrize("kind", KINDS)
def test_rows_of_every_closure_kind(kind: str, tol: Tolerances) -> None:
    m = loose(kind)
    postures = np.vstack([m.home[None], anywhere(m, 300)])
    if kind == "fixed":  # infinite at half a turn
        angles = np.array(
            [2.0 * math.atan(np.linalg.norm(weld(m, q)[0][3:]) / 2.0) for q in postures]
        )
        postures = postures[angles < 2.0]
        assert len(postures) > 50
    check(m, postures, tol.closure)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-6, 1e-3, 0.02, 0.09, 0.11, 0.3])
def test_rows_of_a_nearly_closed_weld(angle: float, tol: Tolerances) -> None:
    m = loose("fixed")
    q = pin.integrate(m.model, m.home, angle * np.ones(m.model.nv) / math.sqrt(m.model.nv))
    check(m, q[None], tol.closure)


def test_results_do_not_depend_on_threads_or_neighbours(d1: cc.Mechanism) -> None:
    postures = anywhere(d1, 400)
    whole = evaluated(d1, postures)[1]
    with ThreadPoolExecutor(4) as pool:
        parts = list(pool.map(lambda q: evaluated(d1, q)[1], np.array_split(postures, 40)))
    assert np.array_equal(np.concatenate(parts), whole)


def test_maps_are_light_to_import() -> None:
    code = (
        "import sys, closedchain.analysis.singularity.maps.mapping; "
        "assert not {'llvmlite', 'scipy.linalg', 'xarray'} & set(sys.modules), 'heavy import'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
