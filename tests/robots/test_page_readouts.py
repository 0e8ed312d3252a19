"""What a page with controls tells: efforts, ellipsoids, names and limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import Browser, opened
from page_driving import ask, told
from page_reading import SLIDER

import closedchain as cc
from closedchain.robots.viewer import Controls, static_page

pytestmark = pytest.mark.slow  # a browser starts, and draws without a graphics card


def test_efforts_and_names_are_told_on_demand(
    browser: Browser, delta: cc.Mechanism, tmp_path: Path
) -> None:
    there = cc.direct(delta, [-0.2, -0.1, -0.15]).raise_if_failed().q
    page = static_page(delta, controls=Controls(places={"there <b>": there}))
    with opened(browser, page, tmp_path):
        found = ask(
            browser,
            """
            const told = {}, chooser = element("postures");
            told.places = [...chooser.options].map((o) => o.textContent);
            chooser.selectedIndex = chooser.options.length - 1;
            chooser.dispatchEvent(new Event("change"));
            told.q = instrument.posture();
            [4, 0, -10, 0.5, -0.25, 2].forEach((x, i) => {
              element(`load-${i}`).value = x;
              element(`load-${i}`).dispatchEvent(new Event("input"));
            });
            told.efforts = [0, 1, 2].map((i) => text(`effort-${i}`));
            element("weights").click();
            told.weightless = [0, 1, 2].map((i) => text(`effort-${i}`));
            told.before = element("signs").hidden;
            element("layer-names").click();
            viewer.render();
            told.after = element("signs").hidden;
            told.signs = [...document.querySelectorAll("#signs span")].map((s) => s.textContent);
            const driven = document.querySelectorAll("#signs .driven");
            told.driven = [...driven].map((s) => s.textContent);
            return told;
            """,
        )
    assert found["places"] == ["go to ...", *delta.postures, "there <b>"]
    assert found["q"] == there.tolist()
    load = [4, 0, -10, 0.5, -0.25, 2]
    known = cc.statics(delta, there, load).inputs
    assert np.allclose([float(x) for x in found["efforts"]], known, atol=6e-6)
    known = cc.statics(delta, there, load, gravity=False).inputs
    assert np.allclose([float(x) for x in found["weightless"]], known, atol=6e-6)
    assert found["before"] is True
    assert found["after"] is False
    assert {*(c.name for c in delta.closures), "leg1_B"} <= set(found["signs"])
    assert found["driven"] == [f"leg{k}_P (q{k})" for k in (1, 2, 3)]


def test_ellipsoids_move_with_the_tip(
    browser: Browser, delta: cc.Mechanism, tmp_path: Path
) -> None:
    q = cc.direct(delta, [-0.2, -0.1, -0.15]).raise_if_failed().q
    with opened(browser, static_page(delta, controls=True), tmp_path):
        found = ask(
            browser,
            f"""
            const seen = (name) => {{
              const node = viewer.scene_tree.find(["meshcat", "robot", "layers", name]).object;
              node.updateMatrix();
              return [node.visible, node.matrix.toArray()];
            }};
            const told = {{hidden: [seen("velocity")[0], seen("force")[0], seen("axes")[0]]}};
            for (const name of ["velocity", "force", "axes"]) element("layer-" + name).click();
            instrument.toPosture({q.tolist()});
            told.shown = [seen("velocity")[0], seen("force")[0], seen("axes")[0]];
            told.velocity = seen("velocity")[1];
            told.numbers = [text("axes-velocity"), text("axes-force"), text("effort-per-force")];
            return told;
            """,
        )
    assert found["hidden"] == [False, False, False]
    assert found["shown"] == [True, True, True]
    known = cc.capabilities(delta, q)
    speeds, forces = ([float(x) for x in t.split()] for t in found["numbers"][:2])
    assert np.allclose(speeds, known.velocity.radii, rtol=6e-3)
    assert np.allclose(forces, known.force.radii, rtol=6e-3)
    worst = np.linalg.norm(known.twist_map[:3], axis=0).max()
    assert float(found["numbers"][2]) == pytest.approx(worst, rel=6e-3)
    drawn = np.reshape(found["velocity"], (4, 4)).T
    assert np.allclose(drawn[:3, 3], delta.pose(q).translation, atol=1e-9)
    lengths = np.linalg.norm(drawn[:3, :3], axis=0)
    assert np.allclose(lengths / lengths[0], known.velocity.radii / known.velocity.radii[0])
    turned = np.abs((drawn[:3, :3] / lengths).T @ known.velocity.axes)
    assert np.allclose(turned, np.eye(3), atol=1e-6)


def test_limits_are_told(browser: Browser, tmp_path: Path) -> None:
    m = cc.load_urdf(SLIDER.replace("<group_state", '<transmission name="a"><joint name="a"/>'
                                    "</transmission><group_state"), xacro=False)  # fmt: skip
    with opened(browser, static_page(m, controls=True), tmp_path):
        ask(browser, "instrument.toInputs([4]);")
        assert told(browser)["limits"] == "at a joint's limit: s, a"
        ask(browser, "instrument.toInputs([4.5]);")
        assert told(browser)["limits"].endswith("beyond a joint's limit: a by 0.50000 rad")
