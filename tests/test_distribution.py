"""Wheel and sdist: complete, well described, and usable in an environment of their own."""

import os
import re
import shutil
import site
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("urdf", "closure", "robots", "analysis")
NEEDED = ("pyproject.toml", "README.md", "LICENSE", "src", *FOLDERS)
TRIED = """
import closedchain as cc
from closedchain.robots.viewer import static_page
m = cc.load("linear_delta")
assert cc.direct(m, [-0.1, -0.15, -0.2]).converged
assert cc.load_urdf(m.description.text).inputs == m.inputs
page = static_page(m, controls=True)
assert "<script" in page and "linear_delta" in page
assert set(cc.export_code(m, "c")) == {"linear_delta.c", "linear_delta.h", "linear_delta_test.c"}
print(cc.__file__)
"""


def clean() -> dict[str, str]:
    """Environment of a process that must not find the checkout."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


def run(*words: object, cwd: Path) -> str:
    done = subprocess.run(
        [str(word) for word in words],
        cwd=cwd,
        env=clean(),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def of_the_package() -> dict[str, bytes]:
    """Files that belong into it, by their path inside."""
    top = ROOT / "src" / "closedchain"
    found = {path.name: path for path in top.iterdir() if path.is_file()}
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                found[path.relative_to(ROOT).as_posix()] = path
    return {f"closedchain/{name}": path.read_bytes() for name, path in found.items()}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with an sdist and the wheel that was built from it."""
    for module in ("build", "twine"):
        pytest.importorskip(module)
    copy = tmp_path_factory.mktemp("checkout")
    for name in NEEDED:
        source = ROOT / name
        if source.is_dir():
            leave = shutil.ignore_patterns("__pycache__", "*.egg-info")
            shutil.copytree(source, copy / name, symlinks=True, ignore=leave)
        else:
            shutil.copy(source, copy / name)
    assert (copy / "src" / "closedchain" / "urdf").is_symlink()
    run(sys.executable, "-m", "build", "--no-isolation", cwd=copy)
    return copy / "dist"


@pytest.mark.slow
def test_wheel_and_sdist_hold_every_file_of_the_package(built: Path) -> None:
    (wheel,), (sdist,) = built.glob("*.whl"), built.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if ".dist-info/" not in name]
        held = {name: archive.read(name) for name in names}
    assert held == of_the_package()
    assert {Path(name).suffix for name in held} >= {".py", ".xacro", ".js", ".css", ".c", ".typed"}
    with tarfile.open(sdist) as archive:
        inside = {m.name.partition("/")[2] for m in archive.getmembers() if m.isfile()}
    assert {f"src/{name}" for name in held} <= inside


@pytest.mark.slow
def test_their_descriptions_pass_twine(built: Path) -> None:
    told = run(sys.executable, "-m", "twine", "check", "--strict", *built.iterdir(), cwd=built)
    assert told.count("PASSED") == 2


@pytest.mark.slow
def test_the_wheel_works_where_nothing_else_of_the_checkout_is(built: Path, tmp_path: Path) -> None:
    """A new environment that borrows the dependencies of this one, so that nothing is fetched."""
    run(sys.executable, "-m", "venv", tmp_path / "env", cwd=tmp_path)
    python = tmp_path / "env" / "bin" / "python"
    (wheel,) = built.glob("*.whl")
    run(python, "-m", "pip", "install", "--no-deps", "--no-index", wheel, cwd=tmp_path)
    own = Path(run(python, "-c", "import site; print(site.getsitepackages()[0])", cwd=tmp_path))
    borrowed = "".join(f"site.addsitedir({path!r}); " for path in site.getsitepackages())
    (Path(str(own).strip()) / "zz_borrowed.pth").write_text(f"import site; {borrowed}\n")
    command = tmp_path / "env" / "bin" / "closedchain"
    listed = run(command, "list", cwd=tmp_path)
    assert re.search(r"^d1 ", listed, re.M)
    assert "mobility" in run(command, "info", "linear_delta", cwd=tmp_path).lower()
    where = run(python, "-c", TRIED, cwd=tmp_path).strip()
    assert Path(where).is_relative_to(tmp_path / "env")
