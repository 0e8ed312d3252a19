"""The benchmarks run, close every loop that they time, and write what they measured."""

import json
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # benchmarks/ is not installed

import closedchain as cc
from benchmarks import batch, cases, cold, exported, forces, modes, msolve_peer, run, sets, stacks
from benchmarks.following import DIRECT, INVERSE
from benchmarks.placo_peer import TOOL as PLACO
from benchmarks.timing import OURS, Row

KEYS = {"robot", "work", "tool", "seconds", "residual", "tip_error", "note", "ratio"}

pytestmark = pytest.mark.slow


def sound(rows: Iterable[Row]) -> list[dict[str, object]]:
    """Rows of the report; what is timed is closed, and what is not says why."""
    found = run.report(list(rows))["rows"]
    assert isinstance(found, list)
    for row in found:
        assert set(row) == KEYS
        if row["seconds"] is None:
            assert row["note"]
            continue
        assert row["seconds"] > 0.0, row
        assert row["residual"] is None or row["residual"] < 1e-12, row
        assert row["tip_error"] is None or row["tip_error"] < 1e-9, row
        assert (row["ratio"] is None) == (row["tool"] == OURS)
    return found


@pytest.mark.parametrize("case", cases.CASES, ids=[case.robot for case in cases.CASES])
def test_single_calls_beside_peers(case: cases.Case) -> None:
    rows = sound(cases.rows(case, 20))
    tools = {OURS, PLACO, *(peer.tool for peer in cases.PEERS)}
    for work in (DIRECT, INVERSE):
        assert {row["tool"] for row in rows if row["work"] == work} == tools
    works = {row["work"] for row in rows if row["tool"] == OURS}
    assert {cases.RESIDUAL_JACOBIAN, "velocity equation", "acceleration", "classify"} <= works


def test_a_solver_that_leaves_the_loops_open_gets_no_time() -> None:
    """SLSQP refuses redundant rows, of which the parallelograms have many."""
    rows = sound(cases.rows(cases.CASES[2], 20))
    (row,) = (r for r in rows if r["work"] == DIRECT and "SLSQP" in str(r["tool"]))
    assert row["seconds"] is None
    assert "More equality constraints" in str(row["note"])
    assert float(str(row["residual"])) > 1e-3


def test_forces_beside_pinocchio() -> None:
    case = next(case for case in cases.CASES if case.robot == "d1")
    rows = sound(forces.rows(case, 20))
    works = {row["work"] for row in rows if row["tool"] == OURS}
    assert works == {forces.ONE, forces.BULK, forces.STATES, forces.FORWARD, forces.STEP}
    m, q = case.start()
    assert abs(forces.by_lapack(m, q) - cc.input_efforts(m, q, forces.PUSH)).max() < 1e-9


def test_exported_to_c() -> None:
    rows = sound(exported.rows(cases.CASES[0], 20))
    assert {row["work"] for row in rows} == {f"{w}, exported to C" for w in (DIRECT, INVERSE)}
    for row in rows:
        assert row["seconds"] is not None or row["note"] == "no gcc here"


def test_many_at_once() -> None:
    rows = sound(batch.rows(4, 1))
    works = {row["work"] for row in rows}
    assert works == {
        *(batch.DETERMINANTS, batch.SOLVE, batch.CELL, batch.PUBLIC),
        *batch.MANY.values(),
    }
    assert {row["robot"] for row in rows if row["work"] == batch.CELL} == {
        field.robot for field in batch.FIELDS
    }


@pytest.mark.parametrize(
    ("make", "works"),
    [
        (lambda: sets.point(9), 2),
        (lambda: [sets.modes(9)], 1),
        (lambda: sets.surveyed("rpa3t"), 2),
        (lambda: cold.rows((), 1), 1),
        (lambda: cold.rows(("rpa3t",), 1), 3),
    ],
    ids=["point", "modes", "survey", "import", "first map"],
)
def test_rows_of_one_work(make: Callable[[], Iterable[Row]], works: int) -> None:
    assert len({row["work"] for row in sound(make())}) == works


def test_growth_of_stacks() -> None:
    rows = sound(stacks.rows((1, 2), 4, 20))
    notes = [str(row["note"]) for row in rows if "growth" in str(row["work"])]
    assert len(notes) == len(stacks.WORKS)
    assert all(note.startswith("N^") for note in notes)


def test_report_and_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "rows.json"
    options = ["--sections", "batch", "--cells", "4", "--json", str(out)]
    monkeypatch.setattr(sys, "argv", ["run", *options])
    run.main()
    found = json.loads(out.read_text())
    known = {"processor", "python", "closedchain", "pin", "numpy", "scipy", "mujoco", "placo"}
    assert known <= set(found["versions"])
    printed = capsys.readouterr().out
    for row in found["rows"]:
        assert str(row["robot"]) in printed
        if row["seconds"] is not None:
            assert run.duration(row["seconds"]) in printed


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(1.234e-7, "123. ns"), (9.9999e-7, "1.00 us"), (0.0125, "12.5 ms"), (75.0, "75.0 s")],
)
def test_durations(seconds: float, text: str) -> None:
    assert run.duration(seconds) == text


def test_all_postures() -> None:
    found = sound(modes.rows(("linear_delta",), first=False))
    assert [row["work"] for row in found] == [modes.SEARCHED, modes.KEPT, modes.PROVED]
    assert found[0]["note"] == "2 real"
    assert found[1]["note"] == "2 real of 2"
    assert found[2]["note"] == "2 of 2"


@pytest.mark.parametrize(("name", "real"), [("three_rps", 8), ("gough_stewart dietmaier", 40)])
def test_platforms_as_polynomials(
    name: str, real: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """All real postures meet the equations that msolve gets, to the digits that they have."""
    robot, _, variant = name.partition(" ")
    m = cc.load(robot, variant=variant or None)
    found = cc.postures(m, inputs=m.input_values(m.home))
    assert len(found) == real
    polynomials = msolve_peer.equations(m)
    assert len(polynomials) == len(msolve_peer.VARIABLES)
    for q in found.q:
        (x, y, z, w), p = q[3:7], q[:3]
        v = np.array([x, y, z])
        # (e, f): the dual quaternion of the pose, f = (0, p) e / 2
        e, f = np.array([w, *v]), 0.5 * np.array([-p @ v, *(w * p + np.cross(p, v))])
        if abs(w) < 1e-3:  # a half turn is at infinity there
            continue
        at = np.concatenate([[w * w], e[1:] / w, f / w])
        for polynomial in polynomials:
            terms = [float(c) * np.prod(at ** np.array(k)) for k, c in polynomial.items()]
            assert abs(sum(terms)) < 1e-4 * (1.0 + sum(map(abs, terms)))
    # an answer as it is written, and a program that is not there
    assert msolve_peer.count("[0, [1,\n[[[-7 / 2^3, 1 / 2^2]], [[1 / 2^1, 3 / 2^2]]]\n]]:\n") == 2
    monkeypatch.delenv("MSOLVE", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert msolve_peer.solve_with_msolve(name, "work", m).note == "not installed"
