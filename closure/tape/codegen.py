"""Straight-line LLVM code of a program, for any number of lanes.

Written as text, which LLVM reads faster than anything else can build it. One function
``body_L(x, p, y, w)`` for L lanes: row k of x, p, y and w is at 8 L k bytes; inputs come from the
``head`` rows of x and from p for the rest, outputs go to y, and w is scratch memory of
``program.rows`` rows.
"""

from __future__ import annotations

from collections.abc import Callable

from closedchain.closure.tape.expression import arguments
from closedchain.closure.tape.lowering import Piece, Program
from closedchain.closure.tape.sincos import sincos
from closedchain.closure.tape.writer import Shape, Writer, declarations

PLAIN: dict[str, Callable[..., str]] = {
    "add": Writer.add,
    "sub": Writer.sub,
    "mul": Writer.mul,
    "neg": Writer.neg,
    "recip": Writer.recip,
    "sqrt": Writer.sqrt,
    "abs": Writer.abs,
    "min": Writer.min,
    "max": Writer.max,
    "less": Writer.less,
    "and": Writer.both,
    "or": Writer.either,
    "not": Writer.invert,
    "fma": Writer.fma,
    "fms": Writer.fms,
    "fnma": Writer.fnma,
}


class Stretch:
    """Writes one piece of a program."""

    def __init__(self, program: Program, piece: Piece, head: int, shape: Shape) -> None:
        """Write nothing yet."""
        self.program, self.piece, self.head = program, piece, head
        self.write = Writer(shape)
        self.names: dict[int, str] = {}
        self.turns: dict[int, tuple[str, str]] = {}

    def written(self) -> list[str]:
        """Lines of the piece: its operations, then what later pieces need."""
        for i in self.piece.nodes:
            self.names[i] = self.operation(i)
        for i, row in self.piece.kept.items():
            self.write.store(self.shown(i), "%w", row)
        return self.write.lines

    def name(self, i: int) -> str:
        """Name of a node's value; constants, inputs and values kept earlier are fetched."""
        found = self.names.get(i)
        if found is None:
            found = self.names[i] = self.fetched(i)
        return found

    def fetched(self, i: int) -> str:
        """Fetch a constant, an input or a value of an earlier piece."""
        op, *given = self.program.nodes[i]
        if op == "const":
            return self.write.number(given[0])
        if op == "input":
            k = given[0]
            return self.write.load(*(("%x", k) if k < self.head else ("%p", k - self.head)))
        number = self.write.load("%w", self.piece.taken[i])
        return self.write.as_truth(number) if self.program.truths[i] else number

    def operation(self, i: int) -> str:
        """Write node ``i``."""
        node = self.program.nodes[i]
        op, values = node[0], [self.name(k) for k in arguments(node)]
        if op in ("sin", "cos"):
            if node[1] not in self.turns:
                self.turns[node[1]] = sincos(self.write, values[0])
            return self.turns[node[1]][op == "cos"]
        if op == "select":
            kind = self.write.choose if self.program.truths[i] else self.write.select
            return kind(*values)
        return PLAIN[op](self.write, *values)

    def shown(self, i: int) -> str:
        """Name of a node's value as a number."""
        name = self.name(i)
        return self.write.as_number(name) if self.program.truths[i] else name

    def outputs(self, wanted: list[tuple[int, int]]) -> None:
        """Write outputs: pairs of a row and a node."""
        for row, i in wanted:
            self.write.store(self.shown(i), "%y", row)


def body(program: Program, head: int, shape: Shape) -> str:
    """Text of ``body_L``: the program, one function a piece."""
    texts, calls = [], []
    home = {i: k for k, piece in enumerate(program.pieces) for i in piece.nodes}
    wanted: list[list[tuple[int, int]]] = [[] for _ in program.pieces]
    for row, i in enumerate(program.outputs):
        wanted[home.get(i, -1)].append((row, i))
    whole = len(program.pieces) == 1
    for k, piece in enumerate(program.pieces):
        name = f"body_{shape.lanes}" + ("" if whole else f"_{k}")
        stretch = Stretch(program, piece, head, shape)
        stretch.written()
        stretch.outputs(wanted[k])
        texts.append(function(name, stretch.write.lines))
        calls.append(f"  call void @{name}(ptr %x, ptr %p, ptr %y, ptr %w)")
    if not whole:
        texts.append(function(f"body_{shape.lanes}", calls))
    return "\n".join([*texts, *declarations(shape)])


def function(name: str, lines: list[str]) -> str:
    """Text of a function of the four pointers."""
    given = ", ".join(f"ptr noalias %{p}" for p in "xpyw")
    head = f"define internal void @{name}({given}) noinline nounwind {{"
    return "\n".join([head, *lines, "  ret void", "}"])
