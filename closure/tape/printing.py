"""A tape as statements of a language with curly braces; ``c_text`` and ``js_text`` say which.

All inputs are read before an output is written, so outputs may replace inputs.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from closedchain.closure.tape.expression import Node, Tape
from closedchain.closure.tape.lowering import depth_first, truth_values

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Language:
    """How a language writes what they do not all write alike.

    Attributes
    ----------
    number, truth : str
        What a declaration of a number and of a truth value begins with.
    functions : dict of str to str
        Names of sin, cos, sqrt and abs.
    least, greatest : str
        Patterns of the smaller and the larger of {0} and {1}; NaN where either is.
    literal : callable
        Text of a constant that is not negative.
    """

    number: str
    truth: str
    functions: dict[str, str]
    least: str
    greatest: str
    literal: Callable[[float], str] = repr

    def constant(self, value: float) -> str:
        """Text of a constant."""
        return self.literal(value) if value >= 0.0 else f"(-{self.literal(-value)})"

    def expression(self, node: Node, names: list[str]) -> str:
        """Right-hand side of an operation on named values."""
        op = node[0]
        if op in self.functions:
            return f"{self.functions[op]}({names[0]})"
        pattern = {**PATTERNS, "min": self.least, "max": self.greatest}[op]
        return pattern.format(*names)


PATTERNS = {
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "neg": "-({0})",
    "recip": "1 / {0}",
    "less": "{0} < {1}",
    "and": "{0} && {1}",
    "or": "{0} || {1}",
    "not": "!{0}",
    "select": "{0} ? {1} : {2}",
}


def checked(name: str) -> str:
    """Return a function's name, or raise ValueError where it can be none."""
    if not NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name of a function")
    return name


def statements(
    tape: Tape, language: Language, source: Callable[[int], str]
) -> tuple[list[str], list[str]]:
    """Lines that compute a tape, and what then stands for each output: a number or a truth value.

    ``source`` writes an input, by its index.
    """
    truths = truth_values(tape)
    names: dict[int, str] = {}
    lines: list[str] = []

    def declare(i: int, text: str) -> None:
        kind = language.truth if truths[i] else language.number
        names[i] = f"v{i}"
        lines.append(f"{kind} v{i} = {text};")

    for i, node in enumerate(tape.nodes):
        if node[0] == "const":
            names[i] = language.constant(float(node[1]))
    order = depth_first(tape.nodes, tape.outputs)
    used = {k for i in order for k in tape.nodes[i][1:]} | set(tape.outputs)
    for i, node in enumerate(tape.nodes):
        if node[0] == "input" and i in used:
            declare(i, source(node[1]))
    for i in order:
        node = tape.nodes[i]
        declare(i, language.expression(node, [names[k] for k in node[1:]]))
    return lines, [names[i] for i in tape.outputs]


def as_numbers(tape: Tape, names: list[str]) -> list[str]:
    """What stands for each output, truth values as 1.0 and 0.0."""
    truths = truth_values(tape)
    return [
        f"{name} ? 1.0 : 0.0" if truths[i] else name
        for i, name in zip(tape.outputs, names, strict=True)
    ]


def indented(lines: list[str], depth: int) -> str:
    """Lines of a block."""
    return "".join(f"{'    ' * depth}{line}\n" for line in lines)


def repeated(tape: Tape, state: int, language: Language) -> tuple[list[str], list[str], str]:
    """Body of a loop: lines, what stands for the new states, and for whether it runs on.

    Raises
    ------
    ValueError
        Where the outputs are not ``state`` numbers and a truth value.
    """
    truths = truth_values(tape)
    if len(tape.outputs) != state + 1 or not truths[tape.outputs[-1]]:
        raise ValueError(f"a loop of {state} states needs {state} outputs and then a truth value")
    lines, names = statements(
        tape, language, lambda k: f"s[{k}]" if k < state else f"p[{k - state}]"
    )
    return lines, as_numbers(tape, names)[:-1], names[-1]
