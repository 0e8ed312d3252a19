"""The shape of the code: no import circles, no private names across modules, short functions."""

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("urdf", "closure", "robots", "analysis")
LINES = 60  # of a function
ARGUMENTS = 6  # of a function, keyword-only ones that a user reads by name apart
NEEDED = {  # functions whose arguments are the terms of one formula, or of one programme
    "closedchain.analysis.motion.follow.programme.programme",
    "closedchain.analysis.motion.follow.stepping.run",
    "closedchain.analysis.motion.follow.whole_path.optimise",
    "closedchain.analysis.motion.track.stops._slope",
    "closedchain.analysis.structure.poc._displacements",
    "closedchain.analysis.symbolic.closed_forms._result",
}

MODULES = {
    ".".join(("closedchain", *path.relative_to(ROOT).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): path
    for folder in FOLDERS
    for path in sorted((ROOT / folder).rglob("*.py"))
}


@cache
def tree(module: str) -> ast.Module:
    return ast.parse(MODULES[module].read_text())


def imports(module: str) -> list[tuple[str, str | None]]:
    """Modules of the house that a module imports anywhere, with the names taken from them."""
    found: list[tuple[str, str | None]] = []
    typing_only = set()
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            typing_only |= {id(n) for n in ast.walk(node)}
    for node in ast.walk(tree(module)):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            found += [(alias.name, None) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.append((inner, None) if inner in MODULES else (node.module, alias.name))
    return [(m, name) for m, name in found if m in MODULES]


def test_no_import_circles() -> None:
    """Lazy imports count; a package is what its ``__init__`` imports."""
    graph = {m: {other for other, _ in imports(m) if other != m} for m in MODULES}
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join((*path[path.index(module) :], module))
        if module not in done:
            for other in sorted(graph[module]):
                visit(other, (*path, module))
            done.add(module)

    for module in sorted(graph):
        visit(module, ())


def test_no_private_name_crosses_modules() -> None:
    for module in MODULES:
        for other, name in imports(module):
            assert name is None or not name.startswith("_"), f"{module} takes {name} of {other}"
            last = other.rpartition(".")[2]
            same = module.rpartition(".")[0] == other.rpartition(".")[0]
            assert not last.startswith("_") or same, f"{module} takes {other}"


@pytest.mark.parametrize("folder", FOLDERS)
def test_functions_are_short(folder: str) -> None:
    long, many = [], []
    for module in MODULES:
        if module.split(".")[1] != folder:
            continue
        for node in ast.walk(tree(module)):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            body = node.body[1:] if ast.get_docstring(node) else node.body
            size = (node.end_lineno or 0) - body[0].lineno + 1 if body else 0
            if size > LINES:
                long.append(f"{module}.{node.name}: {size} lines")
            arguments = [a.arg for a in (*node.args.posonlyargs, *node.args.args)]
            given = [a for a in arguments if a not in ("self", "cls")]
            if len(given) > ARGUMENTS and f"{module}.{node.name}" not in NEEDED:
                many.append(f"{module}.{node.name}: {len(arguments)} arguments")
    assert not long, "\n".join(long)
    assert not many, "\n".join(many)
