"""The notebooks run from a clean kernel, and are stored with what they print and draw, in small."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import nbformat
import pytest
from kernels import run

NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"
PATHS = {path.name: path for path in sorted(NOTEBOOKS.glob("*.ipynb"))}


def read(name: str) -> nbformat.NotebookNode:
    return nbformat.read(PATHS[name], as_version=4)


def test_there_are_notebooks() -> None:
    wanted = {"d1_redundancy.ipynb", "d1_singularities.ipynb", "paper_experiments.ipynb"}
    assert wanted <= set(PATHS)


PICTURE = 90_000  # bytes
NOTEBOOK = 500_000  # bytes
TOGETHER = 3_000_000  # bytes


def outputs_of(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    return [output for cell in notebook.cells for output in cell.get("outputs", [])]


def pictures_of(notebook: nbformat.NotebookNode) -> list[list[str]]:
    """Pictures (PNG in base 64) below each cell."""
    return [
        [o.data["image/png"] for o in cell.get("outputs", []) if "image/png" in o.get("data", {})]
        for cell in notebook.cells
    ]


@pytest.mark.parametrize("name", PATHS)
def test_stored_with_small_pictures_and_nothing_of_the_machine(name: str) -> None:
    notebook = read(name)
    nbformat.validate(notebook)
    pictures = [picture for cell in pictures_of(notebook) for picture in cell]
    assert len(pictures) >= 2
    for picture in pictures:
        image = base64.b64decode(picture)
        assert image.startswith(b"\x89PNG")
        assert len(image) < PICTURE
    for output in outputs_of(notebook):
        assert output.output_type in ("stream", "display_data")
        assert output.get("name", "stdout") == "stdout"
        words = output.get("text", "") or str(
            {kind: text for kind, text in output.get("data", {}).items() if kind != "image/png"}
        )
        assert set(output.get("data", {})) <= {"text/plain", "text/latex", "image/png"}
        # no pages of megabytes, no folders, no addresses of objects, no bars of progress
        assert not re.search(r"<iframe|/home/|/tmp/|/root|/work|0x[0-9a-f]{6,}|\r", words)
    for cell in notebook.cells:
        assert cell.metadata == {}
        if cell.cell_type == "code":
            assert cell.execution_count is None
    assert PATHS[name].stat().st_size < NOTEBOOK


def test_all_notebooks_together_are_small() -> None:
    assert sum(path.stat().st_size for path in PATHS.values()) < TOGETHER


@pytest.mark.parametrize("name", PATHS)
def test_has_one_page_to_move(name: str) -> None:
    sources = "\n".join(cell.source for cell in read(name).cells if cell.cell_type == "code")
    assert re.search(r"(?<!plt)\.show\(", sources)
    assert "def show" not in sources  # there is one in the package


@pytest.mark.slow
@pytest.mark.parametrize("name", PATHS)
def test_runs_from_a_clean_kernel(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # nobody's own settings of IPython, Jupyter or Matplotlib
    for variable in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR", "MPLCONFIGDIR"):
        folder = tmp_path / variable.lower()
        folder.mkdir()
        monkeypatch.setenv(variable, str(folder))
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = read(name)
    stored = [len(cell) for cell in pictures_of(notebook)]
    work = tmp_path / "work"
    work.mkdir()
    run(notebook, work)
    outputs = outputs_of(notebook)
    warned = [output.text for output in outputs if output.get("name") == "stderr"]
    assert warned == []
    # what is stored is what comes out: as many pictures below each cell
    assert [len(cell) for cell in pictures_of(notebook)] == stored
    assert any("<iframe" in output.get("data", {}).get("text/html", "") for output in outputs)
    assert list(work.iterdir()) == []  # a notebook leaves nothing behind
