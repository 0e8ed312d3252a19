"""A tape made ready for a machine: kinds checked, multiply-adds chosen, long ones cut into pieces.

What is decided here is decided once, for every vector width: which product is fused into which
sum, and where a long tape is cut. So all widths do the same arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from closedchain.closure.tape.expression import BOOLEAN, Node, Tape, arguments

ARITHMETIC = frozenset({"add", "sub", "mul", "neg", "recip", "sin", "cos", "sqrt", "abs"})


@dataclass(frozen=True)
class Piece:
    """A stretch of a program that becomes one function.

    Attributes
    ----------
    nodes : tuple of int
        Nodes to compute, in order; constants and inputs are made where they are used.
    taken : dict of int to int
        Node of an earlier piece to the scratch row that holds it.
    kept : dict of int to int
        Node of this piece to the scratch row that later pieces find it in.
    """

    nodes: tuple[int, ...] = field(repr=False)
    taken: dict[int, int] = field(repr=False)
    kept: dict[int, int] = field(repr=False)


@dataclass(frozen=True)
class Program:
    """A tape for machines: its nodes with multiply-adds, in pieces.

    Attributes
    ----------
    nodes : tuple of (operation, arguments)
        As in a tape; besides fma, fms and fnma: a b + c, a b - c and c - a b of nodes a, b, c.
    truths : tuple of bool
        Which nodes are truth values.
    outputs : tuple of int
        Nodes whose values are asked for.
    inputs : int
        How many numbers go in.
    pieces : tuple of Piece
        At least one; together they compute every node but constants, inputs and fused products.
    rows : int
        Scratch rows that the pieces pass values through.
    """

    nodes: tuple[Node, ...] = field(repr=False)
    truths: tuple[bool, ...] = field(repr=False)
    outputs: tuple[int, ...] = field(repr=False)
    inputs: int
    pieces: tuple[Piece, ...] = field(repr=False)
    rows: int


def lowered(tape: Tape, length: int) -> Program:
    """Prepare a tape, cut so that no piece has more than ``length`` operations.

    Raises
    ------
    TypeError
        Where a truth value meets arithmetic, or a number stands for a truth value.
    """
    truths = truth_values(tape)
    nodes = fused(tape)
    order = depth_first(nodes, tape.outputs)
    chunks = [order[k : k + length] for k in range(0, len(order), length)] or [[]]
    pieces, rows = passing(nodes, chunks)
    return Program(tuple(nodes), tuple(truths), tape.outputs, tape.inputs, pieces, rows)


def truth_values(tape: Tape) -> list[bool]:
    """Tell which nodes are truth values; refuse a tape that mixes them with numbers."""
    truths: list[bool] = []
    for i, node in enumerate(tape.nodes):
        op, kinds = node[0], [truths[k] for k in arguments(node)]
        if op == "select":
            good = kinds[0] and kinds[1] == kinds[2]
        elif op in ("and", "or", "not"):
            good = all(kinds)
        elif op in ARITHMETIC or op in ("min", "max", "less", "const", "input"):
            good = not any(kinds)
        else:
            raise TypeError(f"node {i} of the tape: no operation is called {op!r}")
        if not good:
            raise TypeError(f"node {i} of the tape: {op} mixes truth values and numbers")
        truths.append(op in BOOLEAN or (op == "select" and kinds[1]))
    return truths


def fused(tape: Tape) -> list[Node]:
    """Put products that are used once into the sum that uses them; they stay as unused nodes.

    Of two such products in one sum the later is put inside: it is ready last.
    """
    uses = [0] * len(tape.nodes)
    for node in tape.nodes:
        for k in arguments(node):
            uses[k] += 1
    for k in tape.outputs:
        uses[k] += 1
    nodes = list(tape.nodes)
    for i, node in enumerate(tape.nodes):
        if node[0] not in ("add", "sub"):
            continue
        products = [k for k in node[1:] if nodes[k][0] == "mul" and uses[k] == 1]
        if products:
            product = max(products)
            nodes[i] = multiply_add(node, product, nodes[product])
    return nodes


def depth_first(nodes: Sequence[Node], outputs: Sequence[int]) -> list[int]:
    """Operations needed for the outputs, each just before its first use: few values wait at a time.

    Machine code in this order keeps more of them in registers than in the order of writing.
    """
    order: list[int] = []
    seen: set[int] = set()
    for output in outputs:
        stack = [output]
        while stack:
            i = stack[-1]
            waiting = [k for k in reversed(arguments(nodes[i])) if k not in seen]
            if i in seen or not waiting:
                stack.pop()
                if i not in seen and nodes[i][0] not in ("const", "input"):
                    order.append(i)
                seen.add(i)
            else:
                stack += waiting
    return order


def multiply_add(node: Node, product: int, factors: Node) -> Node:
    """One operation for a sum and the product in it."""
    op, first, second = node
    if op == "add":
        return ("fma", *factors[1:], second if first == product else first)
    return ("fms", *factors[1:], second) if first == product else ("fnma", *factors[1:], first)


def passing(nodes: Sequence[Node], chunks: list[list[int]]) -> tuple[tuple[Piece, ...], int]:
    """Find a scratch row for every value that a later piece needs; rows are used again."""
    home = {i: k for k, chunk in enumerate(chunks) for i in chunk}
    last: dict[int, int] = {}
    for k, chunk in enumerate(chunks):
        for i in chunk:
            for a in arguments(nodes[i]):
                if a in home and home[a] < k:
                    last[a] = k
    held: dict[int, int] = {}
    free: list[int] = []
    rows = 0
    pieces = []
    for k, chunk in enumerate(chunks):
        needed = {a for i in chunk for a in arguments(nodes[i]) if a in home and home[a] < k}
        taken = {a: held[a] for a in sorted(needed)}
        kept = {}
        for i in (i for i in chunk if i in last):
            if not free:
                free.append(rows)
                rows += 1
            kept[i] = held[i] = free.pop()
        free += [held.pop(a) for a in sorted(held) if last[a] == k]
        pieces.append(Piece(tuple(chunk), taken, kept))
    return tuple(pieces), rows
