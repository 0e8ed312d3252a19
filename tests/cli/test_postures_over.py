"""``closedchain postures --over``: which modes are joined, and which meet."""

import json

import pytest
from typer.testing import CliRunner

from closedchain.cli import app

FIVE_BAR = ["postures", "five_bar", "--no-count"]


def test_connections_are_said_below_the_table() -> None:
    words = ["--over", "q1=1.5:2.6:13", "--over", "q2=0.5:1.6:13"]
    done = CliRunner().invoke(app, [*FIVE_BAR, *words])
    assert done.exit_code == 0, done.stderr
    assert "q1 from 1.5 to 2.6 rad and q2 from 0.5 to 1.6 rad, all else held" in done.stdout
    assert "over 13 by 13 grid points" in done.stdout
    assert "home and +1 meet at a direct singularity" in done.stdout
    assert "joined by no way at all" in done.stdout


def test_json_has_them_too() -> None:
    done = CliRunner().invoke(app, [*FIVE_BAR, "--over", "q1", "--no-limits", "--json"])
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    connections = found["connections"]
    assert sorted(connections["groups"]) == [["+1"], ["home"]]
    assert connections["kind"] == "direct"
    assert connections["searched"]["limits"] is False
    assert connections["searched"]["shape"] == [400]
    for meeting in connections["meetings"]:
        assert set(meeting) == {"modes", "values", "distance", "q", "fold", "sigma"}
        assert meeting["sigma"] < 1e-9


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--over", "q9"], "unknown coordinate 'q9'"),
        (["--over", "x"], "unknown coordinate 'x'; known: q1, q2; only what the modes have held"),
        (["--over", "q1=3:4"], "must hold the value that the modes have"),
        (["--over", "q1=1:3:1"], "must have between 2 and 2000 cells, got 0"),
        ([w for n in ("q1", "q2", "x", "y") for w in ("--over", n)], "one to three coordinates"),
    ],
)
def test_refused(words: list[str], message: str) -> None:
    done = CliRunner().invoke(app, [*FIVE_BAR, *words])
    assert done.exit_code == 1
    assert message in done.stderr
