"""``show``: figures as pictures with words, mechanisms and pages in frames."""

from __future__ import annotations

from typing import Any

import pytest
from matplotlib.figure import Figure

import closedchain as cc


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    import IPython.display

    found: list[Any] = []
    monkeypatch.setattr(IPython.display, "display", found.append)
    return found


def test_a_figure_becomes_a_picture_with_words(shown: list[Any]) -> None:
    figure = Figure(figsize=(2.0, 2.0))
    ax = figure.subplots()
    ax.plot([0.0, 1.0], [1.0, 3.0], label="q1")
    ax.set(title="inputs", xlabel="time [s]")
    cc.show(figure, dpi=40)
    (picture,) = shown
    assert picture.data.startswith(b"\x89PNG")
    assert picture.alt == "inputs over time [s]: q1 from 1 to 3."


def test_mechanisms_and_pages_stand_in_frames(shown: list[Any]) -> None:
    m = cc.load("five_bar")
    cc.show(m)
    cc.show(m.show(height=300))
    cc.show("<!doctype html><p>a page</p>")
    for frame in shown:
        assert "<iframe" in frame._repr_html_()
    assert shown[1].height == 300


def test_anything_else_is_refused(shown: list[Any]) -> None:
    with pytest.raises(cc.ClosureError, match="got int"):
        cc.show(7)  # type: ignore[arg-type]
    assert not shown
