"""Run the notebooks and store them with what they print and draw: python notebooks/store.py [NAME]

Pictures are stored small, in a few colours. Pages that move are not: each would be a megabyte, and
they come back when a notebook is run.
"""

from __future__ import annotations

import base64
import sys
import tempfile
from io import BytesIO
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

FOLDER = Path(__file__).resolve().parent
COLOURS = 48
WIDEST = 900  # pixels


def small(picture: str) -> str:
    """A picture (PNG in base 64) in fewer pixels and colours."""
    image = Image.open(BytesIO(base64.b64decode(picture))).convert("RGB")
    if image.width > WIDEST:
        size = WIDEST, round(image.height * WIDEST / image.width)
        image = image.resize(size, Image.Resampling.LANCZOS)
    out = BytesIO()
    few = image.quantize(COLOURS, dither=Image.Dither.NONE)
    few.save(out, format="PNG", optimize=True)
    return base64.b64encode(out.getvalue()).decode("ascii")


def kept(output: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """What is stored of an output: its words, and its picture in small."""
    if output.output_type == "stream":
        return output
    data = {}
    if "image/png" in output.data:
        data["image/png"] = small(output.data["image/png"])
    elif "text/latex" in output.data:
        data["text/latex"] = output.data["text/latex"]
    data["text/plain"] = output.data.get("text/plain", "")
    alt = output.metadata.get("image/png", {}).get("alt")
    metadata = {"image/png": {"alt": alt}} if alt else {}
    return nbformat.v4.new_output("display_data", data, metadata=metadata)


def store(path: Path) -> None:
    """Run one notebook in an empty folder and write it with its outputs."""
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=900, resources=resources).execute()
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.execution_count = None
            cell.outputs = [kept(output) for output in cell.outputs]
    nbformat.write(notebook, path)


if __name__ == "__main__":
    for name in sys.argv[1:] or sorted(path.name for path in FOLDER.glob("*.ipynb")):
        store(FOLDER / name)
        print(name, f"{(FOLDER / name).stat().st_size / 1000:.0f} kB")
