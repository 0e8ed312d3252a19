"""Notebooks as pages: text, code, and the pictures and tables that are stored with them."""

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
        pictures: dict[str, bytes] = {}
        parts = [_part(cell, notebook.stem, pictures) for cell in cells]
        for name, data in pictures.items():
            (folder / name).write_bytes(data)
        text = "\n\n".join(part for part in parts if part)
        (folder / f"{notebook.stem}.md").write_text(text + "\n", encoding="utf-8")


def _part(cell: dict[str, Any], stem: str, pictures: dict[str, bytes]) -> str:
    text = _joined(cell["source"]).strip()
    if cell["cell_type"] == "markdown" or not text:
        return text
    parts = [f"```python\n{text}\n```"]
    for output in cell.get("outputs", ()):
        data = output.get("data", {})
        if "image/png" in data:
            name = f"{stem}_{len(pictures) + 1}.png"
            pictures[name] = base64.b64decode(_joined(data["image/png"]))
            parts.append(f"![{_joined(data.get('text/plain', 'Figure'))}]({name})")
        else:
            told = _joined(output.get("text") or data.get("text/plain", "")).rstrip()
            parts += [f"```text\n{told}\n```"] if told else []
    return "\n\n".join(parts)


def _joined(text: str | list[str]) -> str:
    return text if isinstance(text, str) else "".join(text)
