"""The Markdown pages of the repository as pages of the site, their links turned along."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

TOP = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "examples/README.md": "examples.md",
}
_LINK = re.compile(r"(\]\()(?![a-z]+:|#)([^)\s#]+)((?:#[^)\s]*)?\))")
_FENCE = re.compile(r"(^```.*?^```)", re.M | re.S)


def gather(root: Path, source: Path) -> None:
    """Copy all pages, images and what else they link to into the folder ``source``."""
    sources = [root / name for name in TOP] + sorted((root / "docs").rglob("*.md"))
    for page in sources:
        target = source / place(page.relative_to(root).as_posix())
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(turned(root, page), encoding="utf-8")
        for linked in links(root, page):
            copied = source / place(linked)
            if (root / linked).is_file() and copied.suffix != ".md":
                copied.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(root / linked, copied)
    shutil.copy(root / "website" / "site.css", source / "site.css")


def place(path: str) -> str:
    """Path in the site of a file of the repository, both with slashes."""
    if path in TOP:
        return TOP[path]
    if path.startswith("notebooks/") and path.endswith(".ipynb"):
        return path.removesuffix(".ipynb") + ".md"
    return path.removeprefix("docs/") if path.startswith("docs/") else f"files/{path}"


def links(root: Path, page: Path) -> list[str]:
    """Files of the repository that a page links to, by their paths."""
    found: list[str] = []

    def note(target: str) -> str:
        found.append(_path(root, page, target))
        return target

    _each_link(page.read_text(encoding="utf-8"), note)
    return found


def turned(root: Path, page: Path) -> str:
    """Text of a page with its links as they are in the site."""
    own = os.path.dirname(place(page.relative_to(root).as_posix()))

    def turn(target: str) -> str:
        return os.path.relpath(place(_path(root, page, target)), own or ".").replace(os.sep, "/")

    return _each_link(page.read_text(encoding="utf-8"), turn)


def _path(root: Path, page: Path, target: str) -> str:
    return Path(os.path.normpath(page.parent / target)).relative_to(root).as_posix()


def _each_link(text: str, change: Callable[[str], str]) -> str:
    """Change the target of every link and image outside fenced code."""
    parts = _FENCE.split(text)
    parts[::2] = [_LINK.sub(lambda m: m[1] + change(m[2]) + m[3], part) for part in parts[::2]]
    return "".join(parts)
