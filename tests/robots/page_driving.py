"""Pages with controls, driven in a browser: what they tell, and where things are."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from browser import Browser

HANDY = """
const element = (id) => document.getElementById(id);
const text = (id) => element(id).hidden ? "" : element(id).textContent;
// a browser without a window need not make frames
const settled = () => new Promise((done) => setTimeout(done, 150));
"""


def ask(browser: Browser, body: str) -> Any:
    """What statements in the page return."""
    return browser.script(HANDY + body)


def told(browser: Browser) -> dict[str, str]:
    """Texts of the read-outs."""
    names = ("residual", "tip-place", "kinds", "types", "distance", "sigma-direct",
             "sigma-inverse", "stop", "told", "limits")  # fmt: skip
    return dict(ask(browser, f"await settled(); return Object.fromEntries({json.dumps(names)}.map("
                    "(id) => [id, element(id) ? text(id) : '']));"))  # fmt: skip


def posture(browser: Browser) -> np.ndarray:
    return np.array(ask(browser, "await settled(); return instrument.posture();"))


def middle(browser: Browser, selector: str) -> tuple[float, float]:
    left, top, width, height = browser.place(selector)
    return left + 0.5 * width, top + 0.5 * height


def thumb(browser: Browser, i: int) -> tuple[float, float]:
    """Where the thumb of a slider is."""
    left, top, width, height = browser.place(f"#slider-{i}")
    low, high, value = ask(browser, f"const s = element('slider-{i}');"
                           "return [Number(s.min), Number(s.max), s.valueAsNumber];")  # fmt: skip
    return left + 8 + (width - 16) * (value - low) / (high - low), top + 0.5 * height
