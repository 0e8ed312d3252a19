"""What a built page would fetch from elsewhere: nothing."""

from __future__ import annotations

import re
from pathlib import Path

_FETCHED = (
    re.compile(r'<(?:script|img|iframe|source|video)\b[^>]*\bsrc="(?:https?:)?//[^"]*"', re.I),
    re.compile(r'<link\b(?=[^>]*rel="?(?:stylesheet|preload|icon|preconnect))[^>]*//[^>]*>', re.I),
    re.compile(r'class="[^"]*\bmermaid\b[^"]*"'),  # drawn by a script that the theme would fetch
)


def fetched(html: str) -> list[str]:
    """Elements of a page that make a browser fetch something from another host."""
    return [match[0] for pattern in _FETCHED for match in pattern.finditer(html)]


def fetching_pages(site: Path) -> list[str]:
    """A line for every page of a built site that is not all there."""
    found = []
    for page in sorted(site.rglob("*.html")):
        for element in fetched(page.read_text(encoding="utf-8")):
            found.append(f"{page.relative_to(site)} fetches from elsewhere: {element}")
    return found
