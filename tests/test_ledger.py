"""The ledgers of the papers: every equation once, every name in them exists."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LEDGERS = {path.stem: path for path in sorted((ROOT / "docs" / "papers").glob("*.md"))}
STATUSES = ("reproduced", "corrected", "refuted", "not applicable", "open")
COLUMNS = ("what it says", "implementation", "test", "status")
NUMBERED = {"d1": 35, "eclipse": 20, "linear_delta": 32, "rpa3t": 17, "rus6": 5}
"""Numbered equations of the papers; other ledgers must have no gap."""


def tables(text: str) -> dict[str, list[list[str]]]:
    """Tables of a page by the title of their first column: rows of cells."""
    found: dict[str, list[list[str]]] = {}
    for block in re.findall(r"(?:^\|.*\|$\n?)+", text, re.M):
        lines = [
            # a bar in a formula is written \|
            [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
            for line in block.splitlines()
        ]
        if tuple(lines[0][1:]) == COLUMNS:
            assert lines[0][0] not in found, f"two tables begin with {lines[0][0]!r}"
            found[lines[0][0]] = lines[2:]
    return found


def rows(name: str) -> list[list[str]]:
    return [row for table in tables(LEDGERS[name].read_text()).values() for row in table]


@cache
def defined(file: Path) -> frozenset[str]:
    """Names that a module defines at its top or in its classes: f, C, C.f, CONSTANT."""
    found: set[str] = set()

    def collect(body: list[ast.stmt], prefix: str) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found.add(prefix + node.name)
                if isinstance(node, ast.ClassDef):
                    collect(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.Assign):
                found.update(prefix + t.id for t in node.targets if isinstance(t, ast.Name))
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found.add(prefix + node.target.id)

    collect(ast.parse(file.read_text()).body, "")
    return frozenset(found)


def names(cell: str) -> list[str]:
    return re.findall(r"`([^`\s]+::[^`\s]+)`", cell)


def test_there_are_ledgers() -> None:
    assert "d1" in LEDGERS


@pytest.mark.parametrize("name", LEDGERS)
def test_every_equation_appears_once(name: str) -> None:
    found = tables(LEDGERS[name].read_text())
    assert "eq" in found, "no table with the columns eq, " + ", ".join(COLUMNS)
    equations = [re.fullmatch(r"\(?(\d+)([a-z]?)\)?", row[0]) for row in found["eq"]]
    assert all(equations), [row[0] for row in found["eq"]]
    keys = [(int(e[1]), e[2]) for e in equations if e]  # (3), or (3a) and (3b)
    assert keys == sorted(set(keys))
    numbers = sorted({number for number, _ in keys})
    assert numbers == list(range(1, NUMBERED.get(name, numbers[-1]) + 1))
    whole = {number for number, letter in keys if not letter}
    assert whole.isdisjoint(number for number, letter in keys if letter), "3 and 3a"


@pytest.mark.parametrize("name", LEDGERS)
def test_rows_are_whole(name: str) -> None:
    for row in rows(name):
        assert len(row) == 5, row
        first, says, implementation, test, status = row
        assert first, row
        assert says, row
        kind = next((s for s in STATUSES if re.match(rf"{s}\b", status)), None)
        assert kind, f"{first}: status {status!r} must begin with one of {STATUSES}"
        if kind != "reproduced":
            assert len(status) > len(kind) + 5, f"{first}: {kind}, but how or why?"
        for cell, optional in (
            (implementation, ("refuted", "not applicable", "open")),
            (test, ("not applicable", "open")),
        ):
            assert names(cell) or (cell == "-" and kind in optional), f"{first}: {cell!r}"


@pytest.mark.parametrize("name", LEDGERS)
def test_every_name_exists(name: str) -> None:
    for row in rows(name):
        for cell in row:
            for reference in names(cell):
                path, _, what = reference.partition("::")
                assert (ROOT / path).is_file(), f"{row[0]}: there is no file {path}"
                assert what in defined(ROOT / path), f"{row[0]}: {path} does not define {what}"
        for reference in names(row[3]):
            assert re.match(r"tests/.*::(\w+\.)?test_\w+$", reference), f"{row[0]}: {reference}"
        for reference in names(row[2]):
            assert not reference.startswith("tests/"), f"{row[0]}: {reference}"
