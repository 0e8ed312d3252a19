"""Notebooks as pages: text, code, and the pictures, tables and live pages stored with them."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any


def write(root: Path, source: Path) -> None:
    """Write a page for every notebook of the repository."""
    folder = source / "notebooks"
    folder.mkdir(parents=True, exist_ok=True)
    for notebook in sorted((root / "notebooks").glob("*.ipynb")):
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        files: dict[str, bytes] = {}
        parts = [_part(cell, notebook.stem, files) for cell in cells]
        for name, data in files.items():
            (folder / name).write_bytes(data)
        text = "\n\n".join(part for part in parts if part)
        (folder / f"{notebook.stem}.md").write_text(text + "\n", encoding="utf-8")


def _part(cell: dict[str, Any], stem: str, files: dict[str, bytes]) -> str:
    text = _joined(cell["source"]).strip()
    if cell["cell_type"] == "markdown" or not text:
        return text
    shown = [
        _shown(output, f"{stem}_{len(files) + 1}", files) for output in cell.get("outputs", ())
    ]
    return "\n\n".join([f"```python\n{text}\n```", *filter(None, shown)])


def _shown(output: dict[str, Any], name: str, files: dict[str, bytes]) -> str:
    """An output as Markdown; what it shows besides is added to ``files``."""
    data = output.get("data", {})
    plain = _joined(output.get("text") or data.get("text/plain", "")).rstrip()
    if "image/png" in data:
        files[f"{name}.png"] = base64.b64decode(_joined(data["image/png"]))
        words = output.get("metadata", {}).get("image/png", {}).get("alt") or "Figure"
        return f"![{_one_line(words)}]({name}.png)"
    html = _joined(data.get("text/html", ""))
    if "<iframe" in html:
        files[f"{name}.html"] = html.encode()
        return f'<iframe class="robot" src="{name}.html" title="{name}" loading="lazy"></iframe>'
    if not plain or output.get("name") == "stderr":
        return ""
    return f"```text\n{plain}\n```"


def _one_line(words: str) -> str:
    return " ".join(words.replace("[", "(").replace("]", ")").split())


def _joined(text: str | list[str]) -> str:
    return text if isinstance(text, str) else "".join(text)
