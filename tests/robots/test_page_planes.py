"""Planes on a page: where the robot is in a map, and how a click in it leads elsewhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser, opened
from page_driving import ask, posture

import closedchain as cc
from closedchain.robots.viewer import PALETTE, Controls, Plane, static_page

pytestmark = pytest.mark.slow  # a browser starts, and draws without a graphics card


def test_a_plane_shows_where_it_is_and_leads_elsewhere(
    browser: Browser, delta: cc.Mechanism, tmp_path: Path
) -> None:
    curve = np.array([[-0.5, -0.5], [0.0, 0.5]])
    inputs = Plane(("q1", "q2"), [(-0.4, 0.0), (-0.3, 0.1)], [("direct", curve)])
    tip = Plane(("x", "z"), [(-0.2, 0.2), (-0.8, -0.4)], [("inverse", curve)])
    page = static_page(delta, controls=Controls(planes=[inputs, tip]))

    def mark(i: int) -> list[float]:
        moved = browser.run(f"document.getElementById('mark-{i}').getAttribute('transform')")
        return [float(x) for x in re.findall(r"-?\d[\d.e-]*", moved)]

    def other(i: int) -> str:
        return str(ask(browser, f"return text('other-{i}');"))

    with opened(browser, page, tmp_path):
        q1, q2, q3 = delta.input_values(delta.home)
        assert other(0) == ""
        assert np.allclose(mark(0), [500 * (q1 + 0.4), 200 - 500 * (q2 + 0.3)], atol=1e-9)
        assert np.allclose(mark(1), [100.0, 100.0], atol=1e-9)
        browser.click("#plane-0", (0.25, 0.5))
        first = posture(browser)
        known = cc.direct(delta, [-0.3, -0.1, q3]).raise_if_failed().q
        reached = delta.input_values(first)
        assert np.abs(reached - delta.input_values(known)).max() < 1.1e-3  # half a pixel
        assert np.abs(first - cc.direct(delta, reached).raise_if_failed().q).max() < 1e-12
        assert np.allclose(mark(0), [50.0, 100.0], atol=0.6)
        assert other(0) == ""
        browser.click("#plane-1", (0.75, 0.5))
        place = delta.pose(posture(browser)).translation
        assert np.allclose(place, [0.1, delta.pose(known).translation[1], -0.6], atol=2e-3)
        assert np.allclose(mark(1), [150.0, 100.0], atol=0.6)
        assert "the curves are of before" in other(0)  # the third leg moved
        assert "the curves are of before" in other(1)  # y is not what it was
        ask(browser, "element('plane-1').focus();")
        browser.key("ArrowLeft", 37)
        assert np.allclose(mark(1), [146.0, 100.0], atol=0.6)
    for name, dash in (("direct", "none"), ("inverse", "7 3")):
        assert re.search(rf'<polyline[^>]*stroke="{PALETTE[name]}"[^>]*dasharray="{dash}"', page)


def test_a_map_around_here_follows_the_branch(browser: Browser, tmp_path: Path) -> None:
    """It reaches the cells that Python reaches; its line is where det_inverse is 0."""
    m = cc.load("rpa3t")
    with opened(browser, static_page(m, controls=True), tmp_path):
        ask(browser, "element('pairs').selectedIndex = 1;"
            "element('pairs').dispatchEvent(new Event('change'));")  # fmt: skip
        told = ask(browser, "return [element('pairs').options[1].textContent, text('local')];")
        cells = ask(browser, "return await instrument.mapOver([0, 1]);")
        ends, legend = ask(browser, "return [text('local-ends'), text('local-legend')];")
        lines = ask(
            browser,
            "return [...document.querySelectorAll('#local-cells polyline')].map((line) =>"
            "line.getAttribute('points').split(' ').map((p) => p.split(',').map(Number)));",
        )
        x, y = lines[0][len(lines[0]) // 2]
        browser.click("#plane-0", (x / 200, y / 200))
        there = posture(browser)
    assert told[0] == "theta1 × theta2"
    assert "inverse singularities" in legend
    ranges = np.array([float(x) for x in re.findall(r"-?[\d.]+(?= to| rad)", ends)]).reshape(2, 2)
    axes = [np.linspace(low, high, 31) for low, high in ranges]
    reached = np.array([[one is not None for one in column] for column in cells]).ravel()
    assert 100 < reached.sum() < 900
    known = cc.singularity_map(
        m, {"theta1": axes[0], "theta2": axes[1]}, progress=False, keep_q=False
    )
    ok = (known["status"] == 0).to_numpy().ravel()
    assert (ok != reached).mean() < 0.05  # at the edge one more or one less
    assert cc.classify(m, there).sigma_inverse < 0.02 < cc.classify(m, m.home).sigma_inverse


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plane(("q1", "q2"), [(0.0, 0.0), (0.0, 1.0)]), "rising pairs"),
        (lambda: Plane(("q1", "q2"), [(0, 1), (0, 1)], [("odd", np.zeros((2, 2)))]), "'odd'"),
        (lambda: Plane(("q1", "q2"), [(0, 1), (0, 1)], [("direct", np.zeros(2))]), "must be"),
    ],
)
def test_planes_that_make_no_sense(make: Any, message: str) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        make()


def test_a_plane_over_what_nothing_moves_is_refused(delta: cc.Mechanism) -> None:
    for over in (("q1", "x"), ("leg1_B", "leg2_B"), ("x", "rx")):
        plane = Plane(over, [(0.0, 1.0), (0.0, 1.0)])
        with pytest.raises(cc.ClosureError, match="over two inputs"):
            static_page(delta, controls=Controls(planes=[plane]))
