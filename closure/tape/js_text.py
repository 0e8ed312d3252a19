"""Tapes as JavaScript modules: for pages that show a mechanism and let it be moved."""

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

JAVASCRIPT = Language(
    "const",
    "const",
    {"sin": "Math.sin", "cos": "Math.cos", "sqrt": "Math.sqrt", "abs": "Math.abs"},
    "Math.min({0}, {1})",
    "Math.max({0}, {1})",
)


def js_function(tape: Tape, name: str) -> str:
    """JavaScript text of ``export function name(x, y)``: outputs y for inputs x, arrays both.

    ``y`` may be ``x``. Truth values are written as 1 and 0.
    """
    lines, names = statements(tape, JAVASCRIPT, lambda k: f"x[{k}]")
    lines += [f"y[{k}] = {text};" for k, text in enumerate(as_numbers(tape, names))]
    return f"export function {checked(name)}(x, y) {{\n{indented(lines, 1)}}}\n"


def js_loop(tape: Tape, state: int, name: str) -> str:
    """JavaScript text of ``export function name(s, p, most)``: a tape repeated on ``s``.

    The tape's inputs are the ``state`` numbers of s, then those of p; its outputs the new s and
    whether it runs on. It is repeated until it does not, at most ``most`` times.
    """
    loop, numbers, running = repeated(tape, state, JAVASCRIPT)
    loop += [f"s[{k}] = {text};" for k, text in enumerate(numbers)]
    body = indented([*loop, f"if (!{running}) break;"], 2)
    begin = "    for (let tick = 0; tick < most; ++tick) {\n"
    return f"export function {checked(name)}(s, p, most) {{\n{begin}{body}    }}\n}}\n"
