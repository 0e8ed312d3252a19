"""The HTML page around a scene: style, legend, labels in the scene, player.

It loads nothing, and says so to the browser: a content security policy allows the scripts that
stand in the page, known by their digests, and forbids every other script and every connection.
Names from a description reach the page as text only, through `html.escape` or `json_in_script`.
Scripts are gzipped, so that a page is some hundred kilobytes; ``page/loader.js`` unpacks them.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
from typing import Any

import numpy as np

_POLICY = (
    "default-src 'none'; script-src {digests}; style-src 'unsafe-inline'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'"
)


@dataclass(frozen=True)
class Fragment:
    """What a page is put together of: HTML, CSS, and scripts that run once the scene is drawn."""

    body: str = ""
    style: str = ""
    scripts: tuple[str, ...] = ()

    def __add__(self, other: Fragment) -> Fragment:
        """Both, one after the other."""
        return Fragment(
            self.body + other.body, self.style + other.style, self.scripts + other.scripts
        )


def page(title: str, legend: str, commands: Sequence[bytes], rest: Fragment) -> str:
    """Put a page together; ``legend`` is HTML, ``commands`` are Meshcat's."""
    library = (files("meshcat") / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")
    loader = resource("loader.js")
    scripts = (library, resource("scene.js"), *rest.scripts)
    digests = (sha256(script.encode()).digest() for script in (loader, *scripts))
    known = " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)
    drawing = b"".join(struct.pack("<I", len(one)) + one for one in commands)
    packed = [_packed(drawing, 'data-packed="data" id="commands"')]
    packed += [_packed(script.encode(), 'data-packed="script"') for script in scripts]
    name = html.escape(title)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY.format(digests=known)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name}</title>\n<style>{resource('page.css')}{rest.style}</style></head>\n"
        '<body><div id="meshcat-pane"></div>\n'
        f'<details id="legend" open><summary><h1>{name}</h1></summary>\n{legend}</details>\n'
        f"{rest.body}{''.join(packed)}<script>{loader}</script></body></html>\n"
    )


def _packed(content: bytes, attributes: str) -> str:
    text = base64.b64encode(gzip.compress(content, mtime=0)).decode()
    return f'<script type="application/gzip" {attributes}>{text}</script>\n'


def resource(name: str) -> str:
    """Text of a file of the pages."""
    return (files("closedchain.robots.page") / name).read_text(encoding="utf-8")


def json_in_script(data: Any) -> str:
    """JSON that may stand in a ``<script>``: no text in it can end or open one."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def data_script(name: str, data: str) -> str:
    """JSON for the scripts of a page."""
    return f'<script type="application/json" id="{name}">{data}</script>\n'


def labels(root: str, texts: Sequence[tuple[str, np.ndarray]]) -> Fragment:
    """Texts at world positions (3,) [m]; ``root`` is Meshcat's path of the world's node."""
    if not texts:
        return Fragment()
    rows = [[not _is_number(text), text, [float(x) for x in np.round(at, 6)]] for text, at in texts]
    path = [part for part in root.split("/") if part]
    data = json_in_script({"root": path, "texts": rows})
    body = f'<div id="labels"></div>\n{data_script("texts", data)}'
    return Fragment(body, "", (resource("labels.js"),))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
