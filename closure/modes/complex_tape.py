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
        angles = x[list(self.turned)]
        every = np.concatenate([x, np.cos(angles), np.sin(angles)]).astype(complex)
        parts = np.empty((2 * len(every), x.shape[1]))
        parts[0::2], parts[1::2] = every.real, every.imag
        found = self.code.run(parts)
        return np.asarray(found[0::2] + 1j * found[1::2])


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
    """Square root with a positive real part."""
    size = (a[0] * a[0] + a[1] * a[1]).sqrt()
    real = (0.5 * (size + a[0])).max(0.0).sqrt()
    imaginary = (0.5 * (size - a[0])).max(0.0).sqrt()
    return real, (a[1] < 0.0).select(-imaginary, imaginary)
