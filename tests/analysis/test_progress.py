"""The progress bar: on a terminal, with what is done, the rate and the time left."""

from __future__ import annotations

import re
import time

import pytest

from closedchain.analysis.progress import reporting


def test_bar_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setenv("COLUMNS", "160")
    with reporting(True) as report:
        assert report is not None
        report("compiling", 0, 0)
        for done in range(0, 5_000, 1_000):
            report("following the branch", done, 10_000)
            time.sleep(0.1)
    shown = capsys.readouterr().err
    assert "compiling" in shown
    assert re.search(r"4,000 of 10,000, [\d,]+/s", shown)
    assert "0:00:0" in shown  # elapsed and left


def test_nothing_elsewhere(capsys: pytest.CaptureFixture[str]) -> None:
    with reporting(True) as report:
        assert report is None  # pytest's captured stderr is no terminal
    with reporting(False) as report:
        assert report is None
    shown = capsys.readouterr()
    assert (shown.out, shown.err) == ("", "")


def test_callables_are_passed_on() -> None:
    calls: list[tuple[str, int, int]] = []

    def own(what: str, done: int, total: int) -> None:
        calls.append((what, done, total))

    with reporting(own) as report:
        assert report is not None
        report("this", 1, 2)
    assert calls == [("this", 1, 2)]
