"""The batch kernel's residuals and Jacobians against Pinocchio, on every robot and closure kind."""

from __future__ import annotations

import math
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import get_args

import numpy as np
import pinocchio as pin
import pytest
from batch_cases import anywhere
from conftest import Tolerances, assert_close
from small_linkages import build, joint, loop

import closedchain as cc
from closedchain.closure.batch import Batch
from closedchain.urdf.description import ClosureType
from closedchain.urdf.errors import ClosureError

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


def check(m: cc.Mechanism, postures: np.ndarray, tol: float) -> None:
    batch = Batch(m)
    values, matrices = batch.residuals(postures), batch.jacobians(postures)
    for q, value, matrix in zip(postures, values, matrices, strict=True):
        expected, jacobian = m.workspace.evaluate(q)
        assert_close(value, expected, tol, m.name)
        assert_close(matrix, jacobian, tol, m.name)


@pytest.mark.parametrize("robot", cc.robots())
def test_rows_of_the_robots(robot: str, tol: Tolerances) -> None:
    m = cc.load(robot)
    check(m, np.vstack([m.home[None], anywhere(m, 50)]), tol.closure)


@pytest.mark.parametrize("kind", KINDS)
def test_rows_of_every_closure_kind(kind: str, tol: Tolerances) -> None:
    m = loose(kind)
    postures = np.vstack([m.home[None], anywhere(m, 100)])
    if kind == "fixed":  # log6 has no derivative at half a turn
        angles = np.array([np.linalg.norm(m.workspace.residual(q)[3:6]) for q in postures])
        postures = postures[angles < 3.0]
        assert len(postures) > 50
    check(m, postures, tol.closure)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-6, 1e-3, 0.02, 0.09, 0.11, 0.3])
def test_rows_of_a_nearly_closed_weld(angle: float, tol: Tolerances) -> None:
    """At small angles Pinocchio's log6 loses digits (1e-10 at 1e-3): its series is the judge."""
    m = loose("fixed")
    q = pin.integrate(m.model, m.home, angle * np.ones(m.model.nv) / math.sqrt(m.model.nv))
    batch = Batch(m)
    xi, found = batch.residuals(q[None])[0, :6], batch.jacobians(q[None])[0, :6]
    m.workspace.evaluate(q)
    (_, anchor, data), *_ = m.workspace.frames
    assert_close(pin.exp6(pin.Motion(xi)).homogeneous, data.c1Mc2.homogeneous, tol.closure)
    # inverse right Jacobian of exp6: x / (1 - e^-x) at x = ad xi, by Bernoulli's numbers
    ad = pin.Motion(xi).action
    series, power = np.eye(6) + ad / 2.0, np.eye(6)
    for number, factor in ((1 / 6, 2), (-1 / 30, 12), (1 / 42, 30), (-1 / 30, 56), (5 / 66, 90)):
        power = power @ ad @ ad / factor
        series = series + number * power
    if angle > 0.1:  # the series ends too early there, and Pinocchio's digits are good
        series = pin.Jlog6(data.c1Mc2)
    expected = (
        series @ data.c1Mc2.inverse().action @ anchor.jacobian(m.model, m.workspace.data, data)
    )
    assert_close(found, expected, tol.closure)


def test_results_do_not_depend_on_threads_or_neighbours(d1: cc.Mechanism) -> None:
    postures = anywhere(d1, 400)
    batch = Batch(d1)
    whole = batch.jacobians(postures)
    with ThreadPoolExecutor(4) as pool:
        parts = list(pool.map(batch.jacobians, np.array_split(postures, 40)))
    assert np.array_equal(np.concatenate(parts), whole)


def test_a_batch_pickles(d1: cc.Mechanism) -> None:
    batch = Batch(d1)
    postures = anywhere(d1, 3)
    expected = batch.residuals(postures)
    again = pickle.loads(pickle.dumps(batch))
    assert np.array_equal(again.residuals(postures), expected)


def test_arrays_that_do_not_fit_are_refused(d1: cc.Mechanism) -> None:
    batch = Batch(d1)
    with pytest.raises(ClosureError, match=r"postures must be \(n, 35\)"):
        batch.residuals(d1.home)
    with pytest.raises(ClosureError, match="finite"):
        batch.residuals(np.full((1, 35), np.nan))
    with pytest.raises(ClosureError, match="no chart"):
        batch.solve(d1.home[None], np.zeros((1, 6)))


@pytest.mark.slow
def test_compiled_tells_of_kernels_in_memory(d1: cc.Mechanism) -> None:
    batch = Batch(d1)
    batch.warm()
    assert batch.compiled()


def test_the_face_is_light() -> None:
    code = (
        "import sys, closedchain.closure.batch; assert not {'numba', 'scipy.linalg'} & "
        "set(sys.modules), 'heavy import'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
