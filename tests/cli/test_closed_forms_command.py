"""The command closed-forms."""

from __future__ import annotations

import json
from functools import partial

import commands
import pytest

run = partial(commands.run, "closed-forms")


@pytest.mark.slow
def test_text_json_and_latex() -> None:
    text = run("linear_delta")
    assert text.exit_code == 0
    assert "Jq, q1: -cos(q_b1)*cos(q_d1)" in text.stdout
    data = json.loads(run("linear_delta", "--json").stdout)
    assert data["legs"][0]["levers"]["q1"]["expression"] == "-cos(q_b1)*cos(q_d1)"
    assert {f["role"] for f in data["legs"][0]["levers"]["q1"]["factors"]} == {"inverse"}
    assert data["symbols"]["q_b1"]["unit"] == "rad"
    latex = run("linear_delta", "--latex", "--name", "leg1_B=theta").stdout
    assert latex.startswith(r"\begin{aligned}")
    assert r"\theta" in latex


def test_refusals() -> None:
    coupled = run("d1")
    assert coupled.exit_code == 1
    assert "do not decouple" in coupled.stderr
    assert coupled.stderr.count("\n") == 1
    unnamed = run("linear_delta", "--name", "b1")
    assert unnamed.exit_code == 1
    assert "--name: expected name=value, got 'b1'" in unnamed.stderr
