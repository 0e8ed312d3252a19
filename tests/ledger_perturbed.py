"""Whether the tests that the ledgers name would notice a wrong implementation.

    python tests/ledger_perturbed.py            all claims of docs/papers, some minutes
    python tests/ledger_perturbed.py 6 2026-12-01   six of them, drawn for a day
    python tests/ledger_perturbed.py d1         those of one ledger

Each implementation is perturbed by one part in a thousand: every number that it returns, or every
number that an object of the class holds, each number by another amount; counts by one, verdicts by
a member of their set. Then the test named with it is run, in a process of its own, and must fail.
"""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import inspect
import io
import math
import os
import random
import sys
import time
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SIZE = 1e-3
"""By how much a number is perturbed, of itself."""
ZERO = 1e-9
"""Share of the largest number of an array below which one is taken for zero."""


@dataclass(frozen=True)
class Claim:
    """A row of a ledger: an implementation and a test that is named with it."""

    ledger: str
    row: str
    implementation: str
    test: str

    def __str__(self) -> str:
        return f"{self.ledger} {self.row}: {self.implementation} by {self.test}"


def claims() -> list[Claim]:
    """All of them, in the order of the pages; a pair that several rows name is there once."""
    sys.path.insert(0, str(ROOT / "tests"))
    from test_ledger import LEDGERS, names, rows

    found: dict[tuple[str, str], Claim] = {}
    for ledger in LEDGERS:
        for row in rows(ledger):
            for implementation in names(row[2]):
                for test in names(row[3]):
                    claim = Claim(ledger, row[0], implementation, test)
                    found.setdefault((implementation, test), claim)
    return list(found.values())


# -- perturbing -----------------------------------------------------------------------------------


def perturb(reference: str) -> None:
    """Perturb an implementation, ``FILE.py::NAME`` or ``FILE.py::CLASS.NAME``, wherever it is used.

    Raises
    ------
    TypeError
        It is neither a function nor a class that can be perturbed.
    """
    path, _, name = reference.partition("::")
    module = import_module("closedchain." + path.removesuffix(".py").replace("/", "."))
    owner: Any = module
    *outer, last = name.split(".")
    for part in outer:
        owner = getattr(owner, part)
    target = inspect.getattr_static(owner, last)
    if isinstance(target, property):
        target = target.fget
    target = getattr(target, "func", target)  # cached_property
    target = inspect.unwrap(getattr(target, "__func__", target))  # static and class methods
    if isinstance(target, type):
        _perturb_class(target)
    elif isinstance(target, np.ndarray | Mapping | float | int):
        _perturb_constant(target)
    elif isinstance(target, types.FunctionType):
        _perturb_function(target)
    else:
        raise TypeError(f"{reference} is a {type(target).__name__}")


def _perturb_function(function: types.FunctionType) -> None:
    """Exchange a function's code, so that it is perturbed under every name that it goes by."""
    closure = function.__closure__
    original = types.FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, closure
    )
    original.__kwdefaults__ = function.__kwdefaults__
    table = function.__globals__.setdefault("__perturbed__", {})
    key = function.__qualname__
    table[key] = lambda *args, **kwargs: perturbed(original(*args, **kwargs))
    # the code must have as many free variables as the function
    free = function.__code__.co_freevars
    inner = f"    def w(*args, **kwargs):\n        {', '.join(free) or 'pass'}\n"
    text = "def outer():\n"
    text += "".join(f"    {name} = None\n" for name in free)
    text += inner + f"        return __perturbed__[{key!r}](*args, **kwargs)\n    return w\n"
    space: dict[str, Any] = {}
    exec(text, space)
    function.__code__ = space["outer"]().__code__
    function.__defaults__ = function.__kwdefaults__ = None


def _perturb_constant(value: Any) -> None:
    """Put a perturbed value in the place of a constant in all modules that hold it."""
    other = perturbed(value)
    for module in list(sys.modules.values()):
        for name, held in list(getattr(module, "__dict__", {}).items()):
            if held is value:
                setattr(module, name, other)


def _perturb_class(kind: type) -> None:
    """Perturb the numbers of every object that is made."""
    init: Callable[..., None] = kind.__init__  # type: ignore[misc]

    def change(made: Any) -> None:
        fields = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ()
        amounts = _amounts()
        for name in [f.name for f in fields] or list(vars(made)):
            object.__setattr__(made, name, _changed(getattr(made, name), amounts))

    def changed(self: Any, *args: Any, **kwargs: Any) -> None:
        init(self, *args, **kwargs)
        change(self)

    for made in gc.get_objects():  # those at the top of a module
        if type(made) is kind:
            change(made)
    kind.__init__ = changed  # type: ignore[misc]


def perturbed(value: Any) -> Any:
    """A value with its numbers perturbed, each by another amount."""
    amounts = _amounts()
    return _changed(value, amounts)


def _amounts() -> Iterator[float]:
    """Factors close to 1 that do not repeat, so that no ratio and no angle stays what it was."""
    i = 0
    while True:
        i += 1
        yield 1.0 + SIZE * (0.6 + 0.4 * math.cos(2.399963 * i)) * (1 if i % 2 else -1)


def _changed(value: Any, by: Iterator[float]) -> Any:
    import pinocchio as pin

    if isinstance(value, bool | np.bool_ | str | bytes | None | Path):
        return value
    if isinstance(value, float | np.floating):
        return type(value)(value * next(by) if abs(value) > ZERO else next(by) - 1.0)
    if isinstance(value, int | np.integer):
        return type(value)(value + 1)
    if isinstance(value, np.ndarray):
        return _changed_array(value, by)
    if isinstance(value, pin.SE3):
        turn = pin.exp3(np.array([next(by) - 1.0 for _ in range(3)]))
        return pin.SE3(value.rotation @ turn, _changed_array(value.translation, by))
    if isinstance(value, frozenset | set):
        return type(value)(sorted(value)[1:]) if value else type(value)({"direct"})
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*(_changed(item, by) for item in value))
    if isinstance(value, tuple | list):
        return type(value)(_changed(item, by) for item in value)
    if isinstance(value, dict | types.MappingProxyType):
        return type(value)({key: _changed(item, by) for key, item in value.items()})
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        if type(value).__name__ == "Mechanism":
            return value
        copy = object.__new__(type(value))
        for name, item in vars(value).items():
            object.__setattr__(copy, name, _changed(item, by))
        return copy
    return value


def _changed_array(array: np.ndarray, by: Iterator[float]) -> np.ndarray:
    if array.dtype.kind not in "fc":
        return (
            array if array.dtype.kind == "b" else array + 1 if array.dtype.kind in "iu" else array
        )
    flat = np.array(array, dtype=array.dtype).reshape(-1)
    largest = float(np.abs(flat[np.isfinite(flat)]).max(initial=0.0))
    scale = largest if largest > ZERO else 1.0
    factors = np.fromiter(by, float, flat.size)
    # what is zero is so for a reason, and is perturbed too
    flat = np.where(np.abs(flat) <= ZERO * scale, scale * (factors - 1.0), flat * factors)
    return flat.reshape(array.shape).astype(array.dtype)


# -- running --------------------------------------------------------------------------------------


def noticed(claim: Claim) -> str:
    """What the test makes of the perturbed implementation, in a process of its own.

    "failed" is right, "passed" is wrong; "error" is neither.
    """
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        code = 70
        try:
            os.close(read)
            code = _run(claim)
        finally:
            os.write(write, bytes([min(code, 255)]))
            os._exit(0)
    os.close(write)
    answer = os.read(read, 1)
    os.close(read)
    os.waitpid(child, 0)
    return {b"\x00": "passed", b"\x01": "failed"}.get(answer, "error")


def _run(claim: Claim) -> int:
    import pytest

    class Perturbing:
        """Perturbs when all tests are collected: what a test module is made of stays right."""

        def pytest_collection_finish(self, session: pytest.Session) -> None:
            perturb(claim.implementation)

    quiet = io.StringIO()
    verbose = "VERBOSE" in os.environ
    with contextlib.nullcontext() if verbose else contextlib.redirect_stdout(quiet):
        options = ["-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header"]
        return int(pytest.main([claim.test, *options], plugins=[Perturbing()]))


def main(arguments: list[str]) -> int:
    os.chdir(ROOT)
    wanted = claims()
    if arguments and arguments[0].isdigit():
        day = random.Random(arguments[1] if len(arguments) > 1 else "")
        wanted = day.sample(wanted, min(int(arguments[0]), len(wanted)))
    elif arguments:
        wanted = [claim for claim in wanted if " ".join(arguments) in str(claim)]
    import pytest  # noqa: F401 (imported once, for all children)

    import closedchain.analysis.singularity.classify
    import closedchain.robots.viewer  # noqa: F401

    wrong = 0
    for claim in wanted:
        begin = time.monotonic()
        verdict = noticed(claim)
        wrong += verdict != "failed"
        said = "" if verdict == "failed" else f"   <- {verdict}, must fail"
        print(f"{time.monotonic() - begin:5.1f} s  {claim}{said}", flush=True)
    print(f"{len(wanted) - wrong} of {len(wanted)} tests notice")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
