"""Tapes on complex numbers: real and imaginary parts, written out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.closure.tape.expression import Expr, Graph, Tape
from closedchain.closure.tape.machine import Compiled, compiled

Parts = tuple[Expr, Expr]
"""Real and imaginary part."""

HIGHEST = 32.0
"""Imaginary parts of angles beyond are taken for it: cosine and sine would leave the numbers."""

HALVINGS, TERMS = 6, 14
"""Of the exponential: its argument is halved so often, its series has so many terms."""


@dataclass(frozen=True, eq=False)
class ComplexTape:
    """A tape of ``inputs`` complex numbers as machine code on their parts."""

    inputs: int
    code: Compiled

    def run(self, x: np.ndarray) -> np.ndarray:
        """Outputs (outputs, n) for inputs (inputs, n), complex."""
        return joined(self.code.run(parted(x)))


def parted(x: np.ndarray) -> np.ndarray:
    """Parts (2 k, n) of complex numbers (k, n), one after the other."""
    parts = np.empty((2 * len(x), x.shape[1]))
    parts[0::2], parts[1::2] = x.real, x.imag
    return parts


def joined(parts: np.ndarray) -> np.ndarray:
    """Complex numbers (k, n) of parts (2 k, n)."""
    found = np.empty((len(parts) // 2, parts.shape[1]), dtype=complex)
    found.real, found.imag = parts[0::2], parts[1::2]
    return found


def complex_tape(tape: Tape) -> ComplexTape:
    """Machine code of a tape for complex numbers.

    Raises
    ------
    TypeError
        Where the tape compares.
    """
    g = Graph()
    found = on_complex(g, tape, complex_inputs(g, 0, tape.inputs))
    code = compiled(g.tape([x for parts in found for x in parts], 2 * tape.inputs), single=False)
    return ComplexTape(tape.inputs, code)


def complex_inputs(g: Graph, begin: int, count: int) -> list[Parts]:
    """Complex numbers from inputs: ``count`` of them, their parts from input ``begin`` on."""
    return [(g.input(begin + 2 * i), g.input(begin + 2 * i + 1)) for i in range(count)]


def on_complex(g: Graph, tape: Tape, given: Sequence[Parts]) -> list[Parts]:
    """Outputs of a tape for complex inputs, in a graph.

    Raises
    ------
    TypeError
        Where the tape compares.
    """
    zero = g.constant(0.0)
    values: list[Parts] = []
    for op, *rest in tape.nodes:
        if op == "const":
            values.append((g.constant(rest[0]), zero))
        elif op == "input":
            values.append(given[rest[0]])
        else:
            values.append(_operation(op, *(values[i] for i in rest)))
    return [values[i] for i in tape.outputs]


def _operation(op: str, a: Parts, b: Parts | None = None) -> Parts:
    """Parts of an operation on one or two numbers."""
    if op == "neg":
        return -a[0], -a[1]
    if op == "recip":
        size = squared(a).recip()
        return a[0] * size, -(a[1] * size)
    if op == "sqrt":
        return root(a)
    if op in ("sin", "cos"):
        grown = exponential(a[1].max(-HIGHEST).min(HIGHEST))
        shrunk = grown.recip()
        even, odd = 0.5 * (grown + shrunk), 0.5 * (grown - shrunk)
        cosine, sine = a[0].cos(), a[0].sin()
        return (sine * even, cosine * odd) if op == "sin" else (cosine * even, -(sine * odd))
    if b is None or op not in ("add", "sub", "mul"):
        raise TypeError(f"complex numbers have no {op}")
    if op == "add":
        return a[0] + b[0], a[1] + b[1]
    if op == "sub":
        return a[0] - b[0], a[1] - b[1]
    return product(a, b)


def product(a: Parts, b: Parts) -> Parts:
    """Of two complex numbers."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def squared(a: Parts) -> Expr:
    """Square of the modulus."""
    return a[0] * a[0] + a[1] * a[1]


def root(a: Parts) -> Parts:
    """Square root with a positive real part; its smaller part keeps its digits, too."""
    large = (0.5 * (squared(a).sqrt() + abs(a[0]))).sqrt()
    small = 0.5 * a[1] * large.recip()
    left = a[0] < 0.0
    imaginary = (a[1] < 0.0).select(-large, large)
    return left.select(abs(small), large), left.select(imaginary, small)


def exponential(x: Expr) -> Expr:
    """e to the power of a number of at most ``HIGHEST`` in size."""
    y = x * 0.5**HALVINGS
    found = x.graph.constant(1.0)
    for k in range(TERMS, 0, -1):
        found = 1.0 + found * (y * (1.0 / k))
    for _ in range(HALVINGS):
        found = found * found
    return found
