"""Pages that lead to other postures: assembly modes, and a series of postures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import Browser, opened
from page_driving import ask, posture, told

import closedchain as cc
from closedchain.robots.viewer import Controls, PostureSeries, static_page

pytestmark = pytest.mark.slow  # a browser starts, and draws without a graphics card


def test_a_mode_is_gone_to_at_the_inputs_of_now(
    browser: Browser, delta: cc.Mechanism, tmp_path: Path
) -> None:
    held = dict(zip(delta.inputs, delta.input_values(delta.home), strict=True))
    modes = cc.postures(delta, inputs=held, count=False)
    assert modes.count == 2
    page = static_page(delta, controls=Controls(modes=dict(zip(modes.names, modes.q, strict=True))))
    values = [-0.2, -0.1, -0.15]
    with opened(browser, page, tmp_path):
        found = ask(
            browser,
            f"""
            const list = element("modes"), seen = [];
            instrument.toInputs({values});
            for (const i of [1, 2, 1]) {{
              list.selectedIndex = i;
              list.dispatchEvent(new Event("change"));
              seen.push([instrument.posture(), text("told")]);
            }}
            return {{seen, names: [...list.options].map((o) => o.textContent)}};
            """,
        )
    assert found["names"] == ["mode ...", *modes.names]
    for (q, sentence), start in zip(found["seen"], modes.q[[0, 1, 0]], strict=True):
        known = cc.direct(delta, values, start).raise_if_failed().q
        assert np.abs(np.array(q) - known).max() < 1e-11
        assert sentence == ""


def test_a_series_is_gone_through_by_slider_and_by_click(
    browser: Browser, delta: cc.Mechanism, tmp_path: Path
) -> None:
    values = [[-0.2, -0.1, x] for x in (-0.3, -0.2, -0.1)]
    q = [cc.direct(delta, one).raise_if_failed().q for one in values]
    held = dict(zip(delta.inputs, values[0], strict=True))
    modes = cc.postures(delta, inputs=held, count=False).q
    q.append(max(modes, key=lambda one: np.abs(one - q[0]).max()))  # another assembly mode
    tips = np.array([delta.pose(one).translation for one in q])
    series = PostureSeries(np.array(q), tips, "heights <i>")
    page = static_page(delta, controls=Controls(series=[series]))
    with opened(browser, page, tmp_path):
        browser.click("#series-0", (0.99, 0.5))
        slid, stranger = posture(browser), told(browser)["told"]
        ask(browser, f"instrument.toPosture({q[0].tolist()});")
        x, y = ask(browser, f"return instrument.onScreen({tips[1].tolist()}).slice(0, 2);")
        browser.drag((x, y), (x + 80, y))
        dragged = posture(browser)
        x, y = ask(browser, f"return instrument.onScreen({tips[1].tolist()}).slice(0, 2);")
        browser.click_at(x + 3, y)
        clicked, familiar = posture(browser), told(browser)["told"]
        slider = browser.run("document.getElementById('series-0').valueAsNumber")
        label = browser.run("document.querySelector('.series label').textContent")
    assert slid.tolist() == q[3].tolist()
    assert "No way along the branch led here" in stranger
    assert dragged.tolist() == q[0].tolist()
    assert clicked.tolist() == q[1].tolist()
    assert familiar == ""
    assert slider == 1
    assert label == "heights <i>"
    with pytest.raises(cc.ClosureError, match="one posture for each of 4 points"):
        PostureSeries(series.q[:2], tips, "too few")
