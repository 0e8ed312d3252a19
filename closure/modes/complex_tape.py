"""A tape on complex numbers as machine code: real and imaginary parts, written out.

Angles may be complex: their cosine and sine are formed by numpy and go in as numbers of their own,
so that all that is left is arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closedchain.closure.tape.expression import Expr, Graph, Tape
from closedchain.closure.tape.machine import Compiled, compiled


@dataclass(frozen=True, eq=False)
class ComplexTape:
    """A tape of ``inputs`` complex numbers.

    Attributes
    ----------
    turned : tuple of int
        Inputs whose cosine and sine are wanted.
    code : Compiled
        Parts of the inputs, then parts of these cosines and sines; parts of the outputs.
    """

    inputs: int
    turned: tuple[int, ...]
    code: Compiled

    def run(self, x: np.ndarray) -> np.ndarray:
        """Outputs (outputs, n) for inputs (inputs, n), complex."""
        first, count = 2 * self.inputs, len(self.turned)
        parts = np.empty((first + 4 * count, x.shape[1]))
        parts[0:first:2], parts[1:first:2] = x.real, x.imag
        if count:
            at = 2 * np.array(self.turned)
            cosine, sine = np.cos(parts[at]), np.sin(parts[at])
            grown = np.exp(parts[at + 1])
            shrunk = 1.0 / grown
            even, odd = 0.5 * (grown + shrunk), 0.5 * (grown - shrunk)
            parts[first : first + 2 * count : 2] = cosine * even
            parts[first + 1 : first + 2 * count : 2] = -(sine * odd)
            parts[first + 2 * count :: 2] = sine * even
            parts[first + 2 * count + 1 :: 2] = cosine * odd
        found = self.code.run(parts)
        out = np.empty((len(found) // 2, x.shape[1]), dtype=complex)
        out.real, out.imag = found[0::2], found[1::2]
        return out


Parts = tuple[Expr, Expr]


def complex_tape(tape: Tape) -> ComplexTape:
    """Machine code of a tape for complex numbers.

    Raises
    ------
    TypeError
        Where the tape compares, or turns by what is no input.
    """
    turned = tuple(
        sorted(
            {
                tape.nodes[node[1]][1]
                for node in tape.nodes
                if node[0] in ("sin", "cos") and tape.nodes[node[1]][0] == "input"
            }
        )
    )
    g = Graph()
    total = tape.inputs + 2 * len(turned)
    given = [(g.input(2 * i), g.input(2 * i + 1)) for i in range(total)]
    zero = g.constant(0.0)
    values: list[Parts] = []
    for node in tape.nodes:
        op = node[0]
        if op == "const":
            values.append((g.constant(node[1]), zero))
        elif op == "input":
            values.append(given[node[1]])
        elif op in ("sin", "cos"):
            if tape.nodes[node[1]][0] != "input":
                raise TypeError(f"complex numbers: {op} of what is no input")
            place = turned.index(tape.nodes[node[1]][1])
            first = tape.inputs + (len(turned) if op == "sin" else 0)
            values.append(given[first + place])
        else:
            values.append(_operation(op, *(values[i] for i in node[1:])))
    out = [part for i in tape.outputs for part in values[i]]
    return ComplexTape(tape.inputs, turned, compiled(g.tape(out, 2 * total), single=False))


def _operation(op: str, a: Parts, b: Parts | None = None) -> Parts:
    """Parts of an operation on one or two numbers."""
    if op == "neg":
        return -a[0], -a[1]
    if op == "recip":
        size = (a[0] * a[0] + a[1] * a[1]).recip()
        return a[0] * size, -(a[1] * size)
    if op == "sqrt":
        return _root(a)
    if b is None or op not in ("add", "sub", "mul"):
        raise TypeError(f"complex numbers have no {op}")
    if op == "add":
        return a[0] + b[0], a[1] + b[1]
    if op == "sub":
        return a[0] - b[0], a[1] - b[1]
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _root(a: Parts) -> Parts:
    """Square root with a positive real part; its smaller part keeps its digits, too."""
    size = (a[0] * a[0] + a[1] * a[1]).sqrt()
    large = (0.5 * (size + abs(a[0]))).max(1e-300).sqrt()
    small = 0.5 * a[1] * large.recip()
    left = a[0] < 0.0
    imaginary = (a[1] < 0.0).select(-large, large)
    return left.select(abs(small), large), left.select(imaginary, small)
