"""``export_code``: a mechanism's position problems as text in C or JavaScript."""

from __future__ import annotations

import re

from closedchain.closure.code.c_program import DOUBLE, FLOAT, CProgram
from closedchain.closure.code.cases import cases_of
from closedchain.closure.code.js_program import JsProgram
from closedchain.closure.code.program import Program
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve import control
from closedchain.closure.tape.verified import verify
from closedchain.urdf.errors import ClosureError

LANGUAGES = ("c", "js")
NUMBERS = {"double": (DOUBLE, control.DOUBLE), "float": (FLOAT, control.SINGLE)}
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def export_code(
    mechanism: Mechanism,
    language: str,
    *,
    name: str | None = None,
    outputs: str | tuple[str, ...] | list[str] | None = None,
    number: str = "double",
) -> dict[str, str]:
    """Write a mechanism as a program that needs nothing of closedchain, nor of anything else.

    It solves the direct and the inverse position problem along the branch of a guess, by the same
    steps as ``cc.direct`` and ``cc.inverse``, and tells the tip's pose, twist map, singular values
    and determinants. Its header, or the head of the module, documents it.

    Parameters
    ----------
    language : "c" or "js"
        C99 that needs <math.h> alone: ``NAME.h``, ``NAME.c`` and a self-test ``NAME_test.c``.
        Or a module of JavaScript, ``NAME.mjs``.
    name : str, optional
        What the files, and in C all functions, begin with; made of the mechanism's by default.
    outputs : str, optional
        Outputs that ``inverse`` prescribes; those of the task by default.
    number : "double" or "float"
        Numbers of the C program. With float, postures are closed to 2e-5 m.

    Returns
    -------
    dict of str to str
        Texts of files by name.

    Raises
    ------
    ClosureError
        Unknown language, number, outputs, a name that is none, or a mechanism with neither inputs
        nor a task, or with an open home.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> sorted(cc.export_code(m, "c"))
    ['linear_delta.c', 'linear_delta.h', 'linear_delta_test.c']
    >>> sorted(cc.export_code(m, "js"))
    ['linear_delta.mjs']
    """
    if language not in LANGUAGES:
        raise ClosureError(f"code can be written in {' or '.join(LANGUAGES)}, not in {language!r}")
    if number not in NUMBERS or (language == "js" and number != "double"):
        allowed = " or ".join(NUMBERS) if language == "c" else "double"
        raise ClosureError(f"numbers of {language} programs are {allowed}, not {number!r}")
    if not mechanism.inputs and mechanism.task is None:
        raise ClosureError(
            f"{mechanism.name!r} has neither inputs (<transmission>) nor a <task>: there is no "
            "position problem to write down"
        )
    mechanism.closed_home()
    real, precision = NUMBERS[number]
    names = () if mechanism.task is None and outputs is None else mechanism.outputs(outputs)
    program = Program(mechanism, precision, names)
    verify(mechanism, names)
    called = program_name(mechanism.name) if name is None else name
    if not NAME.fullmatch(called):
        raise ClosureError(
            f"a program cannot be called {called!r}: letters, digits and _, a letter first"
        )
    if language == "js":
        return {f"{called}.mjs": JsProgram(program).module()}
    return CProgram(program, called, real).files(cases_of(program))


def program_name(name: str) -> str:
    """Name of a program made of a mechanism's."""
    found = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    return found if re.match(r"[a-z]", found) else f"m_{found}".rstrip("_")
