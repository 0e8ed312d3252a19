"""The parts of programs that are the same for all mechanisms: files of this package."""

from __future__ import annotations

import re
from importlib.resources import files

MARK = re.compile(r"^(?:/\* == (\w+) \*/|// == (\w+))\n", re.M)


def resource(name: str) -> str:
    """Text of a file."""
    return (files("closedchain.closure.code") / name).read_text(encoding="utf-8")


def blocks(name: str) -> list[tuple[str, str]]:
    """Parts of a file, each under the word of the mark before it."""
    text = resource(name)
    marks = list(MARK.finditer(text))
    ends = [mark.start() for mark in marks[1:]] + [len(text)]
    return [
        (mark[1] or mark[2], text[mark.end() : end]) for mark, end in zip(marks, ends, strict=True)
    ]
