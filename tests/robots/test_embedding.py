"""``Mechanism.show``: the page of a mechanism inside a notebook."""

from __future__ import annotations

import html
import re
from pathlib import Path

import nbformat
import numpy as np
import pytest
from browser import Browser
from kernels import run
from page_reading import drawn, scripts

import closedchain as cc
from closedchain.robots.viewer import Animation

FRAME = re.compile(r'<iframe srcdoc="([^"]*)"')

pytestmark = pytest.mark.slow  # a browser starts, and draws without a graphics card


def held(frame: str) -> str:
    """The page in a frame."""
    (page,) = FRAME.findall(frame)
    return html.unescape(page)


def test_a_notebook_holds_the_whole_page(tmp_path: Path) -> None:
    """As a notebook runs it, and as a browser then shows what the notebook has kept."""
    cells = ['import closedchain as cc\nm = cc.load("linear_delta")', "m.show()"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(one) for one in cells])
    run(notebook, tmp_path)
    (output,) = notebook.cells[1].outputs
    frame = output["data"]["text/html"]
    assert len(frame) < 600_000
    assert "page of" in output["data"]["text/plain"]
    page = held(frame)
    assert page.startswith("<!DOCTYPE html>")
    (tmp_path / "page.html").write_text(f"<!DOCTYPE html><body>{frame}</body>")
    m = cc.load("linear_delta")
    known = cc.direct(m, [-0.2, -0.1, -0.15]).raise_if_failed().q
    with Browser(tmp_path) as browser:
        inside = "document.querySelector('iframe')?.contentWindow"
        browser.open((tmp_path / "page.html").as_uri(), ready=f"{inside}?.shown === true")
        q = browser.run(f"Array.from({inside}.instrument.toInputs([-0.2, -0.1, -0.15]).q)")
        assert browser.errors == []
    assert np.abs(np.array(q) - known).max() < 1e-12


def test_it_stands_as_the_catalogue_has_it(d1: cc.Mechanism) -> None:
    def root(shown: object) -> list[float]:
        moves = {c["path"]: c for c in drawn(shown.page) if c["type"] == "set_transform"}  # type: ignore[attr-defined]
        return [float(x) for x in moves["/meshcat/robot"]["matrix"]]

    assert root(d1.show()) == root(d1.show(up="y")) != root(d1.show(up="z"))


def test_options_are_those_of_a_page(d1: cc.Mechanism) -> None:
    motion = Animation(np.array([d1.home, d1.home]), [0.0, 1.0])
    played = d1.show(animation=motion, height=333, title="standing")
    assert 'height="333"' in played._repr_html_()
    assert "<h1>standing</h1>" in played.page
    assert 'id="player"' in played.page
    still = d1.show(controls=False)
    assert not any("globalThis.instrument" in script for script in scripts(still.page))
    for wrong in ({"height": 3}, {"up": "w"}, {"q": np.zeros(3)}):
        with pytest.raises(cc.ClosureError):
            d1.show(**wrong)
