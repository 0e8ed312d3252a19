"""What a person sees of a page: nothing covers the robot, sets do not look like legs."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, opened
from page_reading import HALVES, SQUARE, drawn, geometry

import closedchain as cc
from closedchain.robots.overlays import DASHES, PALETTE
from closedchain.robots.viewer import (
    Animation,
    Markers,
    Polyline,
    Readout,
    Surface,
    Trace,
    static_page,
)

LINE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]])

pytestmark = pytest.mark.slow  # a browser starts, and draws without a graphics card


@pytest.fixture(scope="module")
def bar() -> cc.Mechanism:
    return cc.load("five_bar")


def played(m: cc.Mechanism) -> str:
    """A motion with a way of the tip and eight read-outs."""
    inputs = m.input_values(m.home) + np.linspace(0.0, 0.1, 9)[:, None]
    q = np.array([cc.direct(m, one).raise_if_failed().q for one in inputs])
    t = np.linspace(0.0, 2.0, 9)
    readouts = [Readout(f"number {k}", np.cos(k * t), "N m") for k in range(8)]
    return static_page(m, animation=Animation(q, t, [Trace("P", values=t)], readouts))


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (1024, 700), (390, 844)])
def test_nothing_covers_the_robot(
    browser: Browser, bar: cc.Mechanism, width: int, height: int, tmp_path: Path
) -> None:
    """On a laptop and on a phone, of a page with controls and of one that plays."""
    browser.size(width, height, phone=width < 600)
    for page, parts in (
        (static_page(bar, controls=True), ["#controls"]),
        (played(bar), ["#readouts", "#player"]),
    ):
        with opened(browser, page, tmp_path):
            boxes = {name: browser.place(name) for name in ("#meshcat-pane canvas", *parts)}
            assert browser.run("document.documentElement.scrollWidth") == width
            inside = browser.run(
                f"[...document.querySelectorAll('{', '.join(f'{p} *' for p in parts)}')]"
                f".filter((e) => e.getBoundingClientRect().right > {width} + 0.5).length"
            )
        assert inside == 0
        area = sum(w * h for _, _, w, h in boxes.values())
        assert area == pytest.approx(width * height, rel=1e-3)  # no gap, and no overlap:
        for (a, b, c, d), (e, f, g, h) in itertools.combinations(boxes.values(), 2):
            assert a + c <= e or e + g <= a or b + d <= f or f + h <= b
        assert boxes["#meshcat-pane canvas"][3] > 0.4 * height


@pytest.mark.parametrize("width", [1200, 390])
def test_what_the_panel_says_fits(browser: Browser, width: int, tmp_path: Path) -> None:
    """Units of two words, and a tip with a long name."""
    ankle = cc.load("ankle")
    text = ankle.description.text.replace('"foot"', '"right_foot_sole_contact_frame"')
    browser.size(width, 800, phone=width < 600)
    for m in (ankle, cc.load_urdf(text, xacro=False)):
        with opened(browser, static_page(m, controls=True), tmp_path):
            over = browser.run(
                "[...document.querySelectorAll('#controls *')].filter((e) => "
                "e.getBoundingClientRect().right > document.querySelector('#controls')"
                ".clientWidth + document.querySelector('#controls').getBoundingClientRect().left"
                " + 0.5).map((e) => e.id || e.outerHTML.slice(0, 60))"
            )
        assert over == []


def test_a_coloured_way_has_a_dark_rim(bar: cc.Mechanism) -> None:
    line = Polyline(LINE, values=np.array([0.0, 1.0, 2.0]))
    page = static_page(bar, overlays=[line, Polyline(LINE)])
    rims = [c for c in drawn(page) if c["path"].endswith("/rim") and c["type"] == "set_object"]
    assert [rim["path"] for rim in rims] == ["/meshcat/robot/overlays/0/rim"]
    (material,) = rims[0]["object"]["materials"]
    assert (material["color"], material["side"]) == (0x222222, 1)


def test_kinds_are_drawn_with_their_dashes(bar: cc.Mechanism) -> None:
    """In the scene, in the legend; a line without a kind is whole."""
    lines = [Polyline(LINE, kind, label=f"<{kind}>", width=0.02) for kind in PALETTE]
    page = static_page(bar, overlays=[*lines, Polyline(LINE, width=0.02)])
    for i, kind in enumerate(PALETTE):
        _, arrays = geometry(page, i)
        first = arrays["position"][:, 1] < 1e-3  # the first leg of the line, along x
        along = np.unique(arrays["position"][first, 0].round(4))
        ends = 0.02 * np.cumsum([0.0, *(DASHES[kind] or (50.0,))])  # of dashes and gaps
        assert np.allclose(along[: len(ends)], ends, atol=2e-3)
        wanted = " ".join(f"{x:g}" for x in DASHES[kind]) or "none"
        shown = rf'<line [^>]*stroke-dasharray="{wanted}"/></svg>&lt;{kind}&gt;</p>'
        assert re.search(shown, page)
    assert len({*DASHES.values()}) == len(PALETTE)
    with pytest.raises(cc.ClosureError, match="dashes must be pairs"):
        Polyline(LINE, dashes=(1.0,))


# Machado, Oliveira and Fernandes, A physiologically-based model for simulation of color vision
# deficiency, IEEE TVCG 15, 2009: severity 1.0
SIGHTS = {
    "full": np.eye(3),
    "protan": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                        [-0.003882, -0.048116, 1.051998]]),
    "deutan": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                        [-0.011820, 0.042940, 0.968881]]),
    "tritan": np.array([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                        [0.004733, 0.691367, 0.303900]]),
}  # fmt: skip


def lab(linear: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB under D65."""
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    x = (to_xyz @ np.clip(linear, 0.0, 1.0)) / [0.9505, 1.0, 1.089]
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def seen(rgb: np.ndarray, sight: str) -> np.ndarray:
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return lab(SIGHTS[sight] @ linear)


@pytest.mark.parametrize("sight", SIGHTS)
def test_sets_are_not_coloured_like_legs(sight: str, d1: cc.Mechanism) -> None:
    """Nor like anything of a robot but its dark base, to people of any colour vision."""
    text = d1.description.text
    roles = dict(re.findall(r'<material [^>]*name="(\w+)"[^>]*>\s*<color rgba="([^"]*)"', text))
    assert {"active", "passive", "platform", "tool", "base"} <= set(roles)
    kinds = {
        k: np.array([int(c[i : i + 2], 16) for i in (1, 3, 5)]) / 255 for k, c in PALETTE.items()
    }
    for role in ("active", "passive", "platform"):
        own = seen(np.array(roles[role].split()[:3], dtype=float), sight)
        for kind, colour in kinds.items():
            assert np.linalg.norm(own - seen(colour, sight)) > 20.0, (role, kind)


def test_faces_and_balls_of_the_legend_are_as_drawn(bar: cc.Mechanism) -> None:
    page = static_page(
        bar,
        overlays=[
            Surface(SQUARE, HALVES, "inverse", label="a"),
            Markers(LINE, "direct", label="b"),
        ],
    )
    assert '<i class="face" style="background: #0072b2; opacity: 0.45"></i>a</p>' in page
    assert '<i class="ball" style="background: #d55e00"></i>b</p>' in page
