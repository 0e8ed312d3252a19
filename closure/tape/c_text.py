"""Tapes as C99 that needs nothing but <math.h>: for controllers and other programs."""

from __future__ import annotations

from closedchain.closure.tape.expression import Tape
from closedchain.closure.tape.printing import (
    Language,
    as_numbers,
    checked,
    indented,
    repeated,
    statements,
)

C = Language(
    "const double",
    "const int",
    {"sin": "sin", "cos": "cos", "sqrt": "sqrt", "abs": "fabs"},
    "({0} != {0} || {0} < {1}) ? {0} : {1}",
    "({0} != {0} || {0} > {1}) ? {0} : {1}",
)
INCLUDE = "#include <math.h>\n\n"


def c_function(tape: Tape, name: str) -> str:
    """C text of ``void name(const double *x, double *y)``: outputs y for inputs x.

    ``y`` may be ``x``. Truth values are written as 1 and 0.
    """
    lines, names = statements(tape, C, lambda k: f"x[{k}]")
    lines += [f"y[{k}] = {text};" for k, text in enumerate(as_numbers(tape, names))]
    head = f"void {checked(name)}(const double *x, double *y)\n{{\n"
    unused = ["(void)x;", "(void)y;"]
    return INCLUDE + head + indented([*unused, *lines], 1) + "}\n"


def c_loop(tape: Tape, state: int, name: str) -> str:
    """C text of ``void name(double *s, const double *p, int most)``: a tape repeated on ``s``.

    The tape's inputs are the ``state`` numbers of s, then those of p; its outputs the new s and
    whether it runs on. It is repeated until it does not, at most ``most`` times.
    """
    loop, numbers, running = repeated(tape, state, C)
    loop += [f"s[{k}] = {text};" for k, text in enumerate(numbers)]
    head = f"void {checked(name)}(double *s, const double *p, int most)\n{{\n"
    body = indented([*loop, f"if (!{running}) break;"], 2)
    begin = indented(["(void)s;", "(void)p;", "for (int tick = 0; tick < most; ++tick) {"], 1)
    return INCLUDE + head + begin + body + "    }\n}\n"
