"""Tapes run by numpy, where they are too long to compile: the same calls, but slower."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from closedchain.closure.tape.expression import Tape
from closedchain.closure.tape.layout import Array, at
from closedchain.closure.tape.numbers import evaluate

BLOCK = 256
"""Postures at a time: enough to hide Python, few enough to stay in cache."""


def batch(tape: Tape) -> Callable[[int, int, int, int, int], None]:
    """Kernel ``(x, y, n, step_x, step_y)`` on addresses, as machine code has it."""

    def run(x: int, y: int, n: int, step_x: int, step_y: int) -> None:
        given = at(x, tape.inputs, n, step_x)
        out = at(y, len(tape.outputs), n, step_y)
        for k in range(0, n, BLOCK):
            out[:, k : k + BLOCK] = outputs(tape, given[:, k : k + BLOCK])

    return run


def loop(tape: Tape, state: int) -> Callable[[int, int, int, int, int, int], None]:
    """Kernel ``(s, p, n, step_s, step_p, most)`` on addresses, as machine code has it."""

    def run(s: int, p: int, n: int, step_s: int, step_p: int, most: int) -> None:
        states = at(s, state, n, step_s)
        given = at(p, tape.inputs - state, n, step_p)
        for k in range(0, n, BLOCK):
            part, fixed = states[:, k : k + BLOCK], given[:, k : k + BLOCK]
            for _ in range(most):
                found = outputs(tape, np.concatenate([part, fixed]))
                part[:] = found[:-1]
                if not found[-1].any():
                    break

    return run


def outputs(tape: Tape, x: Array) -> Array:
    """Outputs (outputs, n) for inputs (inputs, n); truth values as 1 and 0."""
    found = np.empty((len(tape.outputs), x.shape[1]))
    with np.errstate(all="ignore"):
        for row, value in zip(found, evaluate(tape, list(x)), strict=True):
            row[:] = value
    return found
