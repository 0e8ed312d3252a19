"""``index.html`` of a folder of results leads through everything in it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from browser import Browser
from typer.testing import CliRunner

import closedchain as cc
from closedchain._index_page import write_index
from closedchain.cli import app


def test_a_simulation_is_looked_at_in_a_browser(tmp_path: Path) -> None:
    words = ["simulate", "linear_delta", "--until", "0.05", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    folder = tmp_path / "out"
    index = (folder / "index.html").read_text()
    assert str(folder / "index.html") in done.stdout
    named = set(re.findall(r'(?:href|src)="([^"]*)"', index))
    assert named == {path.name for path in folder.iterdir()} - {"index.html"}
    assert named == {"motion.nc", "linear_delta.html"}
    with Browser(tmp_path) as browser:
        browser.open((folder / "index.html").as_uri(), ready="document.querySelector('iframe')")
        browser.click("a[href='linear_delta.html']")
        browser.open((folder / "linear_delta.html").as_uri())
        browser.script("document.getElementById('play').click();")
        shown = browser.run(
            "[...document.querySelectorAll('#readouts b')].map((b) => b.textContent)"
        )
        assert browser.errors == []
    assert shown == [*cc.load("linear_delta").inputs, "energy"]


def test_words_and_names_stay_text(tmp_path: Path) -> None:
    evil = "<script>document.title = 'taken'</script>"
    figure, page = tmp_path / "map.png", tmp_path / "a & b.html"
    figure.write_bytes(b"")
    page.write_text("")
    (tmp_path / "map.alt.txt").write_text(f"Two curves\nthat {evil}")
    index = write_index(evil, {"1": figure, "2": page}, [evil, ""], [{evil: 0.1234567, "b": evil}])
    text = index.read_text()
    assert "<script" not in text
    assert "script-src 'none'" in text
    assert 'alt="Two curves that &lt;script&gt;' in text
    assert '<iframe src="a &amp; b.html"' in text
    assert "<td>0.123457</td>" in text
    assert text.count("<p></p>") == 0


@pytest.mark.slow
def test_a_survey_leads_to_its_page_and_figure(tmp_path: Path) -> None:
    words = ["singularities", "five_bar", "--over", "x", "--over", "y", "--resolution", "15"]
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert done.exit_code == 0, done.stderr
    index = (tmp_path / "index.html").read_text()
    named = set(re.findall(r'(?:href|src)="([^"]*)"', index))
    assert named == {path.name for path in tmp_path.iterdir()} - {"index.html"}
    assert re.search(r'<img src="map.png" alt="[^"]+">', index)
    assert "<td>x × y</td>" in index
    before, folded = index.split("<details>")
    assert "outputs x y; branch of home. Direct: 1 curve" in before
    assert "least singular values of the grid" in folded
    assert "least singular values of the grid" not in re.sub(r'alt="[^"]*"', "", before)


def test_zeros_and_details_step_back(tmp_path: Path) -> None:
    figure = tmp_path / "map.png"
    figure.write_bytes(b"")
    rows = [{"slice": "x × y", "cells": 9, "lost": 0}, {"slice": "x × z", "cells": 0, "lost": 0}]
    index = write_index("survey", {"map.png": figure}, ["found"], rows, {"how": ["so"], "why": []})
    text = index.read_text()
    assert "<th>slice</th><th>cells</th></tr>" in text
    assert "<details><summary>how</summary><p>so</p></details>" in text
    assert "why" not in text
