"""Tapes as machine code over blocks of postures.

``compiled`` makes code for a tape as it is, ``looped`` code that repeats a tape until it says that
it is done. Both work on structures of arrays: row k holds number k of every posture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from closedchain.closure.tape import drivers, native
from closedchain.closure.tape.codegen import body
from closedchain.closure.tape.expression import Tape
from closedchain.closure.tape.lowering import Program, lowered

Array = NDArray[np.float64]

PIECE = 2000
"""Operations of a function; LLVM's time for a longer one grows faster than its length."""


@dataclass(frozen=True)
class Compiled:
    """A tape that runs on this machine. Threads may share it.

    Attributes
    ----------
    inputs, outputs : int
        How many numbers go in and come out.
    lanes : int
        Postures that one operation works on.
    call : callable
        ``call(x, y, n, step_x, step_y)`` on raw addresses: row k of the inputs is at
        ``x + 8 k step_x``, row k of the outputs at ``y + 8 k step_y``, each of n numbers. The
        outputs must not overlap the inputs. Nothing is checked.
    """

    inputs: int
    outputs: int
    lanes: int
    call: Callable[[int, int, int, int, int], None] = field(repr=False)
    code: native.Loaded = field(repr=False)

    def run(self, x: Array) -> Array:
        """Outputs (outputs, n) for inputs (inputs, n)."""
        x = np.asarray(x, dtype=np.float64)
        out = np.empty((self.outputs, x.shape[1] if x.ndim == 2 else 0))
        self.run_into(x, out)
        return out

    def run_into(self, x: Array, out: Array) -> None:
        """Write the outputs for ``x`` (inputs, n) into ``out`` (outputs, n), which is separate.

        Columns of larger arrays will do; rows must be contiguous.
        """
        x, n = matching(x, self.inputs, "x"), out.shape[-1]
        if x.shape[1] != n:
            raise ValueError(f"x holds {x.shape[1]} postures and out {n}")
        in_place(out, self.outputs, "out")
        self.call(x.ctypes.data, out.ctypes.data, n, step(x), step(out))


@dataclass(frozen=True)
class Looped:
    """A tape that repeats itself on this machine. Threads may share it.

    Attributes
    ----------
    states, parameters : int
        How many numbers change and how many stay.
    lanes : int
        Postures that one operation works on.
    call : callable
        ``call(s, p, n, step_s, step_p, most)`` on raw addresses, as in ``Compiled``.
    """

    states: int
    parameters: int
    lanes: int
    call: Callable[[int, int, int, int, int, int], None] = field(repr=False)
    code: native.Loaded = field(repr=False)

    def run(self, state: Array, parameters: Array, most: int) -> None:
        """Repeat the tape on ``state`` (states, n) in place, at most ``most`` times.

        ``parameters`` (parameters, n) stay as they are. A block of postures is finished when the
        tape says of each that it no longer runs; until then it repeats for all of the block, so
        the tape itself must keep a state that has ended.
        """
        parameters, n = matching(parameters, self.parameters, "parameters"), state.shape[-1]
        if parameters.shape[1] != n:
            raise ValueError(f"parameters hold {parameters.shape[1]} postures and state {n}")
        in_place(state, self.states, "state")
        given = parameters.ctypes.data
        self.call(state.ctypes.data, given, n, step(state), step(parameters), most)


def compiled(tape: Tape, lanes: int = 0) -> Compiled:
    """Machine code for a tape, in as many lanes as the machine has unless told otherwise."""
    lanes = lanes or native.host().lanes
    program = lowered(tape, PIECE)
    memory = drivers.Memory(tape.inputs, len(tape.outputs), 0, program.rows)
    text = drivers.batch(memory, lanes) + "\n" + bodies(program, tape.inputs, lanes)
    code = native.loaded(native.object_code(text))
    return Compiled(tape.inputs, len(tape.outputs), lanes, code.function("run", 5), code)


def looped(tape: Tape, state: int, lanes: int = 0) -> Looped:
    """Machine code that repeats a tape.

    The tape's inputs are ``state`` numbers of state and then the parameters; its outputs are the
    new state and, last, the truth value whether it runs on.

    Raises
    ------
    ValueError
        Where the tape does not have that form.
    """
    lanes = lanes or native.host().lanes
    program = lowered(tape, PIECE)
    if len(tape.outputs) != state + 1 or not program.truths[tape.outputs[-1]]:
        raise ValueError(f"a loop of {state} states needs {state} outputs and then a truth value")
    if not 0 <= state <= tape.inputs:
        raise ValueError(f"{state} states among {tape.inputs} inputs")
    memory = drivers.Memory(state, state + 1, tape.inputs - state, program.rows)
    text = drivers.loop(memory, lanes) + "\n" + bodies(program, state, lanes)
    code = native.loaded(native.object_code(text))
    return Looped(state, tape.inputs - state, lanes, code.function("loop", 6), code)


def bodies(program: Program, head: int, lanes: int) -> str:
    """Text of a program for one lane and for ``lanes``."""
    return "\n".join(body(program, head, native.host().shape(w)) for w in sorted({1, lanes}))


def matching(x: Any, count: int, name: str) -> Array:
    """Array of ``count`` rows of numbers, copied where the rows are not contiguous."""
    x = np.asarray(x, dtype=np.float64)
    if x.ndim != 2 or x.shape[0] != count:
        raise ValueError(f"{name} must have the shape ({count}, n), got {x.shape}")
    return x if straight(x) else np.ascontiguousarray(x)


def in_place(x: Array, count: int, name: str) -> None:
    """Refuse an array that cannot be written row by row."""
    if x.dtype != np.float64 or x.ndim != 2 or x.shape[0] != count:
        raise ValueError(f"{name} must be float64 of shape ({count}, n), got {x.dtype} {x.shape}")
    if not (x.flags.writeable and straight(x)):
        raise ValueError(f"{name} must be writeable, its rows contiguous")


def straight(x: Array) -> bool:
    """Whether the rows are contiguous and follow each other in whole steps."""
    if x.size == 0:
        return True
    return x.strides[0] % 8 == 0 and (x.strides[1] == 8 or x.shape[1] == 1) and x.flags.aligned


def step(x: Array) -> int:
    """Numbers from one row to the next."""
    return x.strides[0] // 8
