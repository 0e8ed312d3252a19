"""``closedchain postures --html``: a page that goes to every posture."""

import json
import re
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

import closedchain as cc
from closedchain.cli import app


def test_a_page_goes_to_every_working_mode(tmp_path: Path) -> None:
    page = tmp_path / "modes.html"
    words = ["postures", "linear_delta", "--xyz", "0", "0", "-0.6", "--no-count", "--json"]
    done = CliRunner().invoke(app, [*words, "--html", str(page)])
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["count"] >= 8
    text = page.read_text()
    (data,) = re.findall(r'id="instrument">(.*?)</script>', text, re.S)
    m = cc.load("linear_delta")
    places = json.loads(data)["postures"]
    for q in found["q"]:
        assert q in places
        assert np.allclose(m.pose(np.array(q)).translation, [0, 0, -0.6], atol=1e-9)
    options = re.search(r'<select id="postures".*?</select>', text, re.S)
    assert options is not None
    named = set(re.findall("<option>(.*?)</option>", options[0]))
    assert {*found["names"], *m.postures} <= named
    assert len(places) == len(named) - 1  # without the heading
