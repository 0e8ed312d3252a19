"""The command outside of its commands: help, streams that are closed or full, ``python -m``."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import closedchain as cc
from closedchain import cli

FULL = Path("/dev/full")


def test_the_list_of_commands_has_whole_sentences(monkeypatch: pytest.MonkeyPatch) -> None:
    """In 80 columns, where click would cut what is too long."""
    monkeypatch.setenv("COLUMNS", "80")
    shown = CliRunner().invoke(cli.app, ["--help"]).stdout
    rows = shown[shown.index("Commands:") :].strip().splitlines()[1:]
    assert len(rows) == len({row.split()[0] for row in rows}) > 15
    assert all(row.endswith(".") and not row.endswith("..") for row in rows)


def test_values_of_inputs_are_bracketed_once() -> None:
    shown = CliRunner().invoke(cli.app, ["direct", "--help"]).stdout
    assert " [INPUT=VALUE]..." in shown
    assert "[[" not in shown


def test_it_runs_as_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "closedchain", "--version"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == f"closedchain {cc.__version__}\n"


@pytest.mark.skipif(not FULL.exists(), reason="needs a device that is always full")
@pytest.mark.parametrize("words", [["--version"], ["--help"], ["list"]])
def test_a_full_disk_is_one_line(words: list[str]) -> None:
    with FULL.open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "closedchain", *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr == "closedchain: No space left on device\n"


def test_closed_output_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    monkeypatch.setattr(sys, "argv", ["closedchain", "list"])
    with pytest.raises(SystemExit, match=r"^closedchain: standard output is closed"):
        cli.main()
