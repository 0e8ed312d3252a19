"""The command line without a process of its own: what a command says, and how it ends."""

from __future__ import annotations

import json
from typing import Any

from typer.testing import CliRunner, Result

from closedchain.cli import app


def run(*words: object) -> Result:
    """A command; an error that it does not tell in words is raised."""
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)


def good(*words: object) -> str:
    """What a command says that succeeds and complains of nothing."""
    done = run(*words)
    assert done.exit_code == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def data(*words: object) -> Any:
    """What such a command says as JSON."""
    return strict(good(*words, "--json"))


def strict(text: str) -> Any:
    """What a text says as JSON, which has neither NaN nor infinity."""

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)
