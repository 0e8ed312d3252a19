"""A tape on any kind of number: floats, arrays, complex numbers, duals, intervals, ring elements.

Numbers need ``+``, ``-``, ``*``, unary ``-`` and, unless told otherwise, ``1.0 / x``. What plain
arithmetic does not cover comes from ``Functions``: given ones, else those that the number type
carries as ``FUNCTIONS``, else numpy's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from closedchain.closure.tape.expression import Node, Tape

Value = Any


@dataclass(frozen=True)
class Functions:
    """Functions of a number type that operators do not cover.

    Attributes
    ----------
    sin, cos, sqrt, abs : callable
        Of one number.
    min, max : callable
        Of two numbers.
    less : callable
        Truth value of a < b, as ``both``, ``either``, ``invert`` and ``select`` take it.
    both, either, invert : callable
        And, or, not.
    select : callable
        ``select(c, a, b)``: a where c holds, else b.
    constant : callable
        Number for a float of the tape.
    recip : callable
        1 / x.
    """

    sin: Callable[[Value], Value] = np.sin
    cos: Callable[[Value], Value] = np.cos
    sqrt: Callable[[Value], Value] = np.sqrt
    abs: Callable[[Value], Value] = np.abs
    min: Callable[[Value, Value], Value] = np.minimum
    max: Callable[[Value, Value], Value] = np.maximum
    less: Callable[[Value, Value], Value] = lambda a, b: a < b
    both: Callable[[Value, Value], Value] = np.logical_and
    either: Callable[[Value, Value], Value] = np.logical_or
    invert: Callable[[Value], Value] = np.logical_not
    select: Callable[[Value, Value, Value], Value] = np.where
    constant: Callable[[float], Value] = float
    recip: Callable[[Value], Value] = lambda x: 1.0 / x


NUMPY = Functions()
"""For floats, complex numbers and arrays of them."""

ORDERED = frozenset({"less", "min", "max", "abs"})
"""Operations that complex numbers do not have."""


def evaluate(
    tape: Tape, inputs: Sequence[Value], functions: Functions | None = None
) -> list[Value]:
    """Outputs of a tape for its inputs, in the arithmetic of the inputs' own type.

    Truth values come out as what ``functions.less`` makes, constants as what
    ``functions.constant`` makes: numpy's default leaves them single numbers. Values
    are dropped after their last use, so memory holds the live ones alone.

    Raises
    ------
    TypeError
        Where the tape compares and numpy's complex numbers go in.
    ValueError
        Where the number of inputs is not the tape's.
    """
    if len(inputs) != tape.inputs:
        raise ValueError(f"the tape takes {tape.inputs} inputs, got {len(inputs)}")
    functions = functions or carried(inputs)
    if functions is NUMPY and any(np.iscomplexobj(x) for x in inputs):
        refused = sorted({node[0] for node in tape.nodes} & ORDERED)
        if refused:
            raise TypeError(f"complex numbers have no {', '.join(refused)}")
    names = operations(functions)
    last = last_uses(tape)
    values: dict[int, Value] = {}
    for i, node in enumerate(tape.nodes):
        op = node[0]
        if op == "const":
            values[i] = functions.constant(node[1])
        elif op == "input":
            values[i] = inputs[node[1]]
        else:
            values[i] = names[op](*(values[k] for k in node[1:]))
            for k in set(node[1:]):
                if last[k] == i:
                    del values[k]
    return [values[i] for i in tape.outputs]


def carried(inputs: Sequence[Value]) -> Functions:
    """Functions that the type of an input carries, else numpy's."""
    for x in inputs:
        found = getattr(type(x), "FUNCTIONS", None)
        if isinstance(found, Functions):
            return found
    return NUMPY


def operations(functions: Functions) -> dict[str, Callable[..., Value]]:
    """What each operation of a tape does."""
    return {
        "add": lambda a, b: a + b,
        "sub": lambda a, b: a - b,
        "mul": lambda a, b: a * b,
        "neg": lambda a: -a,
        "recip": functions.recip,
        "sin": functions.sin,
        "cos": functions.cos,
        "sqrt": functions.sqrt,
        "abs": functions.abs,
        "min": functions.min,
        "max": functions.max,
        "less": functions.less,
        "and": functions.both,
        "or": functions.either,
        "not": functions.invert,
        "select": functions.select,
    }


def last_uses(tape: Tape) -> dict[int, int]:
    """Node that uses each node last; outputs are used at the end."""
    last: dict[int, int] = {}
    node: Node
    for i, node in enumerate(tape.nodes):
        if node[0] not in ("const", "input"):
            for k in node[1:]:
                last[k] = i
    for i in tape.outputs:
        last[i] = len(tape.nodes)
    return last
