"""Tapes that run over blocks of postures as machine code.

``compiled`` runs a tape as it is, ``looped`` repeats it until it says that it is done. Both work on
structures of arrays: row k holds number k of every posture. The same inputs give the same bits
wherever they stand in a batch, and alone.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from closedchain.closure.tape import cache, drivers, interpreter, native
from closedchain.closure.tape.codegen import body
from closedchain.closure.tape.expression import Tape
from closedchain.closure.tape.layout import Array, address, in_place, matching, step
from closedchain.closure.tape.lowering import lowered, truth_values

PIECE = 4000
"""Operations of one function of machine code; longer tapes become several."""

GENERATOR = (
    *("codegen", "copies", "drivers", "expression", "lowering"),
    *("machine", "native", "sincos", "writer"),
)
"""Modules that decide what code a tape becomes."""

LIMIT = 100_000
"""Operations beyond which compiling would take most of a minute, and numpy runs the tape."""


@dataclass(frozen=True)
class Kernel:
    """What runs a tape on raw addresses. Threads may share it; Python's lock is free meanwhile.

    Attributes
    ----------
    call : callable
        On integers: addresses, counts and steps as ``Compiled`` and ``Looped`` say. Nothing is
        checked.
    lanes : int
        Postures that one operation works on; 1 where numpy runs the tape.
    machine_code : bool
        Whether it is machine code; tapes of more than ``LIMIT`` operations are run by numpy.
    packed : object
        Machine code that takes the address of its arguments instead.
    """

    call: Callable[..., None] = field(repr=False)
    lanes: int
    machine_code: bool
    packed: Callable[..., None] | None = field(repr=False, default=None)

    def bound(self, arguments: list[int], kept: object) -> Callable[[], None]:
        """Fix the arguments: calls then cost next to nothing. ``kept`` lives as long."""
        if self.packed is None:
            fixed: Any = functools.partial(self.call, *arguments)
        else:
            given = np.array(arguments, dtype=np.int64)
            fixed = functools.partial(self.packed, ctypes.c_void_p(given.ctypes.data))
            kept = (kept, given)
        fixed.kept = kept
        return fixed


@dataclass(frozen=True)
class Compiled:
    """A tape on this machine.

    Attributes
    ----------
    inputs, outputs : int
        How many numbers go in and come out.
    kernel : Kernel
        Its ``call(x, y, n, step_x, step_y)`` reads row k of the inputs at ``x + 8 k step_x`` and
        writes row k of the outputs at ``y + 8 k step_y``, each of n numbers. The outputs must not
        overlap the inputs.
    """

    inputs: int
    outputs: int
    kernel: Kernel

    def run(self, x: Array) -> Array:
        """Outputs (outputs, n) for inputs (inputs, n); truth values come out as 1 and 0."""
        x = matching(x, self.inputs, "x")
        out = np.empty((self.outputs, x.shape[1]))
        self.run_into(x, out)
        return out

    def run_into(self, x: Array, out: Array) -> None:
        """Write the outputs for ``x`` (inputs, n) into ``out`` (outputs, n), which is separate.

        Columns of larger arrays will do; the rows of ``out`` must be contiguous.
        """
        self.kernel.call(*self.arguments(matching(x, self.inputs, "x"), out))

    def bound(self, x: Array, out: Array) -> Callable[[], None]:
        """``run_into`` for two arrays that stay: calls read what ``x`` holds then."""
        in_place(x, self.inputs, "x")
        return self.kernel.bound(self.arguments(x, out), (x, out))

    def arguments(self, x: Array, out: Array) -> list[int]:
        """Arguments of the kernel."""
        n = x.shape[1]
        in_place(out, self.outputs, "out")
        if out.shape[1] != n:
            raise ValueError(f"x holds {n} postures and out {out.shape[1]}")
        return [address(x), address(out), n, step(x), step(out)]


@dataclass(frozen=True)
class Looped:
    """A tape that repeats itself on this machine.

    Attributes
    ----------
    states, parameters : int
        How many numbers change and how many stay.
    kernel : Kernel
        Its ``call(s, p, n, step_s, step_p, most)`` changes the states at ``s + 8 k step_s`` in
        place, with the parameters at ``p + 8 k step_p``.
    """

    states: int
    parameters: int
    kernel: Kernel

    def run(self, state: Array, parameters: Array, most: int) -> None:
        """Repeat the tape on ``state`` (states, n) in place, at most ``most`` times.

        ``parameters`` (parameters, n) stay as they are. A block of postures is finished when the
        tape says of each that it no longer runs; until then it repeats for all of the block, so
        the tape itself must keep a state that has ended.
        """
        parameters = matching(parameters, self.parameters, "parameters")
        self.kernel.call(*self.arguments(state, parameters, most))

    def bound(self, state: Array, parameters: Array, most: int) -> Callable[[], None]:
        """``run`` for two arrays that stay: calls begin with what they hold then."""
        in_place(parameters, self.parameters, "parameters")
        return self.kernel.bound(self.arguments(state, parameters, most), (state, parameters))

    def arguments(self, state: Array, parameters: Array, most: int) -> list[int]:
        """Arguments of the kernel."""
        n = parameters.shape[1]
        in_place(state, self.states, "state")
        if state.shape[1] != n:
            raise ValueError(f"parameters hold {n} postures and state {state.shape[1]}")
        places = [address(state), address(parameters)]
        return [*places, n, step(state), step(parameters), int(most)]


def compiled(tape: Tape, lanes: int = 0, single: bool = True) -> Compiled:
    """Machine code for a tape, in as many lanes as the machine has unless told otherwise.

    There is code for one lane as well, for single postures, unless ``single`` is False: it takes
    half as long to make then, and single postures about as long as a block.

    Raises
    ------
    TypeError
        Where a truth value meets arithmetic, or a number stands for a truth value.
    """
    truth_values(tape)
    if tape.count() > LIMIT:
        kernel = Kernel(interpreter.batch(tape), 1, False)
    else:
        kernel = machine_code(tape, None, lanes, single)
    return Compiled(tape.inputs, len(tape.outputs), kernel)


def looped(tape: Tape, state: int, lanes: int = 0, single: bool = True) -> Looped:
    """Machine code that repeats a tape.

    The tape's inputs are ``state`` numbers of state and then the parameters; its outputs are the
    new state and, last, the truth value whether it runs on. Lanes as for ``compiled``.

    Raises
    ------
    TypeError
        As for ``compiled``.
    ValueError
        Where the tape does not have that form.
    """
    truths = truth_values(tape)
    if len(tape.outputs) != state + 1 or not truths[tape.outputs[-1]]:
        raise ValueError(f"a loop of {state} states needs {state} outputs and then a truth value")
    if not 0 <= state <= tape.inputs:
        raise ValueError(f"{state} states among {tape.inputs} inputs")
    if tape.count() > LIMIT:
        kernel = Kernel(interpreter.loop(tape, state), 1, False)
    else:
        kernel = machine_code(tape, state, lanes, single)
    return Looped(state, tape.inputs - state, kernel)


def machine_code(tape: Tape, state: int | None, lanes: int, single: bool) -> Kernel:
    """Kernel of machine code, from disk where it is known; a loop where ``state`` is given."""
    here = native.host()
    lanes = lanes or here.lanes
    widths = (lanes, 1) if single or lanes == 1 else (lanes,)
    what = repr((tape.nodes, tape.outputs, tape.inputs, state, widths, PIECE))
    made_by = generator()
    name = cache.key(made_by, repr(here), what) if made_by else ""
    objects = cache.read(name) if name else None
    if objects is None:
        objects = native.object_code(text(tape, state, widths))
        if name:
            cache.write(name, objects)
    code = native.loaded(objects)
    entry, count = ("run", 5) if state is None else ("loop", 6)
    return Kernel(code.function(entry, count), lanes, True, code.function(f"{entry}_packed", 1))


@functools.cache
def generator() -> str:
    """Digest of the modules that decide what code is made; "" where their text is not installed."""
    digest = hashlib.sha256()
    for name in GENERATOR:
        try:
            source = pkgutil.get_data("closedchain.closure.tape", f"{name}.py")
        except OSError:
            source = None
        if source is None:
            return ""
        digest.update(source)
    return digest.hexdigest()


def text(tape: Tape, state: int | None, widths: tuple[int, ...]) -> str:
    """LLVM text of a tape for numbers of lanes, the widest first, and what runs it."""
    program = lowered(tape, PIECE)
    head = tape.inputs if state is None else state
    memory = drivers.Memory(head, len(tape.outputs), tape.inputs - head, program.rows)
    driver = drivers.batch if state is None else drivers.loop
    bodies = [body(program, head, native.host().shape(w)) for w in sorted(set(widths))]
    return "\n".join([driver(memory, widths), *bodies])
