"""The benchmarks run, close every loop that they time, and write what they measured."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # benchmarks/ is not installed

from benchmarks import run
from benchmarks.cases import CASES, OURS, PEERS

KEYS = {"robot", "work", "tool", "seconds", "residual", "tip_error", "note", "ratio"}

pytestmark = pytest.mark.slow


def test_report_of_a_short_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "rows.json"
    monkeypatch.setattr(sys, "argv", ["run", "--repeats", "10", "--cells", "4", "--json", str(out)])
    run.main()
    found = json.loads(out.read_text())
    assert {"python", "closedchain", "pin", "numpy", "scipy", "mujoco"} <= set(found["versions"])
    rows = found["rows"]
    assert all(set(row) == KEYS for row in rows)
    for case in CASES:
        works = {row["work"] for row in rows if row["robot"] == case.robot}
        assert {
            "direct, warm",
            "residual + Jacobian",
            "velocity equation",
            "acceleration",
            "track with rates, a sample",
        } <= works
        tools = {
            row["tool"]
            for row in rows
            if (row["robot"], row["work"]) == (case.robot, "direct, warm")
        }
        assert tools == {OURS, *(peer.tool for peer in PEERS)}
    for row in rows:
        if row["seconds"] is None:
            assert row["note"]  # not installed, or not closed
            continue
        assert row["seconds"] > 0.0
        if row["residual"] is not None:
            assert row["residual"] < 1e-12, row
        if row["tip_error"] is not None:
            assert row["tip_error"] < 1e-10, row
        assert (row["ratio"] is None) == (row["tool"] == OURS)


def test_a_solver_that_leaves_the_loops_open_gets_no_time() -> None:
    """SLSQP refuses redundant rows, of which the parallelograms have many."""
    rows = run.report(run.measure(5, 0))["rows"]
    (row,) = (r for r in rows if r["robot"] == "linear_delta" and "SLSQP" in r["tool"])
    assert row["seconds"] is None
    assert "More equality constraints" in row["note"]
    assert row["residual"] > 1e-3
