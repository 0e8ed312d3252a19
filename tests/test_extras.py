"""A core install: what works without the packages of the extras, and what the rest says."""

import ast
import re
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path

import pytest

from closedchain.urdf import extras

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
OPTIONAL = sorted({name for names in extras.EXTRAS.values() for name in names})
DRAGGED = ["dask", "IPython", "mujoco", "networkx", "pandas", "PIL", "tornado", "zmq"]

BARE = f"""
import sys

class Bare:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {[*OPTIONAL, *DRAGGED]!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Bare())
"""


def bare(code: str) -> subprocess.CompletedProcess[str]:
    """Python in which no package of an extra can be imported."""
    return subprocess.run(
        [sys.executable, "-c", BARE + textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_the_core_works_alone() -> None:
    done = bare(
        """
        import numpy as np
        import closedchain as cc

        m = cc.load("linear_delta")
        start = m.input_values(m.home)
        s = cc.direct(m, start + 0.02).raise_if_failed()
        t = cc.inverse(m, m.pose(s.q)).raise_if_failed()
        assert np.abs(m.input_values(t.q) - start - 0.02).max() < 1e-9
        assert cc.classify(m, s.q).kinds == frozenset()
        assert cc.mobility(m).finite == 3
        assert cc.postures(m, inputs=dict(zip(m.inputs, start))).count >= 1
        assert np.isfinite(cc.statics(m, s.q).inputs).all()
        assert cc.load_urdf(cc.export(m, "urdf")[0]).model.nv == m.model.nv
        assert "double" in str(cc.export_code(m, "c"))
        print("done")
        """
    )
    assert done.stdout == "done\n", done.stderr


def test_what_needs_more_names_the_extra() -> None:
    done = bare(
        """
        import closedchain as cc
        from closedchain.robots.viewer import static_page

        m = cc.load("linear_delta")
        for what in (
            lambda: cc.singularity_map(m, {"q1": [0.0, 0.1]}),
            lambda: cc.symbolic_singularities(m),
            lambda: static_page(m),
            lambda: cc.resets(m, 2).to_dataset(),
        ):
            try:
                what()
            except cc.ClosedChainError as error:
                print(error)
        """
    )
    maps, symbolic, view, data = done.stdout.splitlines()
    assert "pip install 'closedchain[maps]'" in maps, done.stderr
    assert "xarray" in maps
    assert symbolic.endswith(
        "not installed: sympy. pip install 'closedchain[symbolic]' brings them"
    )
    assert "'closedchain[view]'" in view
    assert "'closedchain[maps]'" in data


@pytest.mark.parametrize(
    ("command", "wanted"),
    [
        ("singularities d1 --out {}", "maps,figures,view"),
        ("closed-forms eclipse", "symbolic"),
        ("view d1 --html {}/page.html", "view"),
    ],
)
def test_commands_say_so_before_any_work(command: str, wanted: str, tmp_path: Path) -> None:
    words = command.format(tmp_path / "out").split()
    done = bare(f"sys.argv[1:] = {words!r}\nfrom closedchain.cli import main\nmain()")
    assert done.returncode == 1
    assert f"pip install 'closedchain[{wanted}]'" in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_extras_install_what_their_uses_import() -> None:
    imports = {"scikit-image": "skimage"}
    for extra, names in extras.EXTRAS.items():
        wanted = list(PROJECT["optional-dependencies"][extra])
        for own in [line for line in wanted if line.startswith("closedchain[")]:
            for other in own.removeprefix("closedchain[").rstrip("]").split(","):
                wanted += PROJECT["optional-dependencies"][other]
        installed = {re.split(r"[<>=!~ ]", line)[0] for line in wanted}
        assert set(names) <= {imports.get(name, name) for name in installed}, extra
    core = {re.split(r"[<>=!~ ]", line)[0] for line in PROJECT["dependencies"]}
    assert core.isdisjoint(OPTIONAL)


ENTRIES = {  # files whose functions are only reached through the one named
    "analysis/figures/legend.py": "analysis/figures/drawing.py",
    "analysis/figures/palette.py": "analysis/figures/drawing.py",
    "analysis/figures/panels.py": "analysis/figures/drawing.py",
    "analysis/figures/space.py": "analysis/figures/drawing.py",
    "analysis/figures/ticks.py": "analysis/figures/drawing.py",
    "analysis/singularity/maps/labels.py": "analysis/singularity/maps/mapping.py",
    "analysis/singularity/maps/saving.py": "analysis/singularity/maps/mapping.py",
    "analysis/singularity/maps/storage.py": "analysis/singularity/maps/mapping.py",
    "analysis/survey/set_tables.py": "analysis/survey/results_folder.py",
    "robots/_body.py": "robots/_recorder.py",
    "robots/_ground.py": "robots/_recorder.py",
    "robots/_layers.py": "robots/_recorder.py",
    "robots/_overlays.py": "robots/_recorder.py",
    "robots/_player.py": "robots/_recorder.py",
    **{
        f"analysis/symbolic/{name}.py": "analysis/symbolic/__init__.py"
        for name in ("closed_forms", "context", "express", "factors", "results", "ring")
    },
}


def test_every_use_of_an_optional_package_asks_first() -> None:
    seen = set()
    for folder in ("urdf", "closure", "robots", "analysis", "src/closedchain"):
        for file in (ROOT / folder).glob("*.py" if folder.startswith("src") else "**/*.py"):
            if {name.split(".")[0] for name in imported(file)} & set(OPTIONAL) - {"distributed"}:
                name = file.relative_to(ROOT).as_posix()
                seen.add(name)
                entry = ROOT / ENTRIES.get(name, name)
                assert re.search(r"\brequire\(", entry.read_text()), name
    assert set(ENTRIES) <= seen


def imported(file: Path) -> list[str]:
    """What a file imports when it runs."""
    found: list[str] = []
    pending: list[ast.AST] = [ast.parse(file.read_text())]
    while pending:
        node = pending.pop()
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found.append(node.module or "")
        pending += ast.iter_child_nodes(node)
    return found
