"""A long search for descriptions that are neither loaded nor refused by name: ``make fuzz``.

    python tests/fuzz/long.py [SECONDS]

Where atheris is installed (``pip install atheris``) the search is guided by coverage: it keeps
what reaches new lines of closedchain, in the folder .fuzz, and goes on from it the next time.
Elsewhere hypothesis draws new examples, of another seed each time. Either way the first
description that ends otherwise is written to .fuzz/failed.urdf, and the exit code is 1.
"""

from __future__ import annotations

import sys
import time
import traceback
import warnings
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[2] / ".fuzz"
SECONDS = 600
_MODULES = (
    "closedchain",
    "closedchain.urdf.reader",
    "closedchain.closure.loading",
    "closedchain.closure.position",
    "closedchain.analysis.structure.mobility",
    "closedchain.analysis.structure.loops",
    "closedchain.analysis.singularity.classify",
    "closedchain.robots.viewer",
)


def main() -> int:
    seconds = int(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    FOLDER.mkdir(exist_ok=True)
    warnings.simplefilter("error")  # as in the suite
    guided = find_spec("atheris") is not None
    with _instrumented(guided):
        for name in _MODULES:
            import_module(name)
    tests = import_module("test_mutated_descriptions")
    kinds = [
        tests.test_a_description_is_loaded_or_refused_by_name,
        tests.test_what_is_loaded_answers_questions,
    ]
    return _guided(kinds, seconds) if guided else _drawn(kinds, seconds)


def _instrumented(guided: bool) -> AbstractContextManager[Any]:
    if not guided:
        return nullcontext()
    import atheris

    return atheris.instrument_imports(include=["closedchain"])


def _guided(kinds: list[Any], seconds: int) -> int:
    import atheris

    entries = [kind.hypothesis.fuzz_one_input for kind in kinds]

    def one(data: bytes) -> None:
        try:
            entries[bool(data[:1] > b"\xe0")](data[1:])
        except Exception:  # whatever it is: the description is kept, and the run fails
            _keep()
            raise

    options = [f"-max_total_time={seconds}", "-max_len=4096", f"-artifact_prefix={FOLDER}/"]
    atheris.Setup([sys.argv[0], *options, str(FOLDER)], one)
    atheris.Fuzz()  # ends the process
    return 0


def _drawn(kinds: list[Any], seconds: int) -> int:
    from hypothesis import HealthCheck, Phase, given, settings
    from mutations import mutated

    many = settings(
        max_examples=500,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    end, count = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        for kind in kinds:
            try:
                many(given(mutated())(kind.hypothesis.inner_test))()
            except Exception:  # whatever it is: told, its description kept, and the run fails
                traceback.print_exc()
                _keep()
                return 1
            count += 500
    print(f"{count} descriptions, all loaded or refused by name")
    return 0


def _keep() -> None:
    from test_mutated_descriptions import LAST

    path = FOLDER / "failed.urdf"
    path.write_text(LAST[0], encoding="utf-8")
    print(f"the description is in {path}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
