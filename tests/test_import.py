"""What importing costs, and which folder may import which."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import closedchain as cc

ROOT = Path(__file__).resolve().parents[1]
HEAVY = ("meshcat", "matplotlib", "xacro", "typer", "xarray", "numba", "llvmlite", "scipy.optimize")
ALLOWED = {
    "urdf": {"urdf"},
    "closure": {"urdf", "closure"},
    "robots": {"urdf", "closure", "robots"},
    "analysis": {"urdf", "closure", "analysis"},
}


def run(code: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, **options
    )


def test_import_loads_nothing_heavy() -> None:
    code = "import sys, json, closedchain; print(json.dumps(list(sys.modules)))"
    loaded = set(json.loads(run(code).stdout))
    assert loaded.isdisjoint(HEAVY)


@pytest.mark.slow
def test_import_is_quick() -> None:
    """About 0.2 s of an idle machine, most of it Pinocchio: SciPy waits for the first solve.

    In processor time, best of three, because the machine may be doing other work.
    """
    clock = (
        "import time; t = time.process_time(); import closedchain; print(time.process_time() - t)"
    )
    ours = f"import numpy, pinocchio, lxml.etree; {clock}"
    assert min(float(run(ours).stdout) for _ in range(3)) < 0.2
    assert min(float(run(clock).stdout) for _ in range(3)) < 0.5


def test_every_public_name_exists_once() -> None:
    assert len(set(cc.__all__)) == len(cc.__all__)
    for name in cc.__all__:
        assert hasattr(cc, name), name


@pytest.mark.parametrize("folder", sorted(ALLOWED))
def test_imports_run_one_way(folder: str) -> None:
    files = list((ROOT / folder).rglob("*.py"))
    assert files
    for file in files:
        for module in imported(file, folder):
            parts = module.split(".")
            if parts[0] == "closedchain" and len(parts) > 1:
                assert parts[1] in ALLOWED[folder], f"{file}: {module}"
            assert parts[0] not in ALLOWED, f"{file}: {module} is outside the package"


def imported(file: Path, folder: str) -> list[str]:
    """Modules that a file imports, at its top or inside functions; relative ones made absolute."""
    found = []
    inside = file.relative_to(ROOT).parent.parts
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ""
            if node.level:
                base = ".".join(("closedchain", *inside[: len(inside) - node.level + 1])) + "."
            if node.module == "closedchain":
                found += [f"closedchain.{alias.name}" for alias in node.names]
            else:
                found.append((base + (node.module or "")).rstrip("."))
    return [m for m in found if m != "closedchain.__version__"]


@pytest.mark.parametrize("folder", ["closure", "analysis"])
def test_general_code_names_no_robot(folder: str) -> None:
    names = {*cc.robots()} - {"delta"}  # which is a letter, too
    for file in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            words = {
                getattr(node, "id", None),
                getattr(node, "attr", None),
                node.value if isinstance(node, ast.Constant) else None,
            }
            strings = {w.lower() for w in words if isinstance(w, str)}
            assert strings.isdisjoint(names), f"{file}:{getattr(node, 'lineno', '?')}"


@pytest.mark.parametrize("folder", sorted(ALLOWED))
def test_folders_cannot_be_imported_by_themselves(folder: str) -> None:
    done = run(f"import {folder}", cwd=ROOT)
    assert done.returncode == 1
    assert f"ImportError: import closedchain.{folder}, not {folder}" in done.stderr
