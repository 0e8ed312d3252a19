"""Scalar expressions with shared subexpressions and folded constants.

A ``Graph`` holds every operation once: building the same expression twice gives the same node.
Expressions are written in plain arithmetic; zeros, ones and signs are worked off as they arise, so
that what a mechanism's geometry makes vanish costs nothing. ``Graph.tape`` then lists the
operations that a choice of outputs needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Union

Number = Union[int, float, "Expr"]
Node = tuple[Any, ...]

ZERO = 1e-15
"""Constants nearer than this to 0, 1 or -1 are taken for them: rounding of exact geometry."""

BOOLEAN = frozenset({"less", "and", "or", "not"})
"""Operations whose results are truth values, for ``select``."""


class Graph:
    """Operations on numbers, each held once."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.nodes: list[Node] = []
        self._known: dict[Node, int] = {}

    def node(self, op: str, *args: Any) -> Expr:
        """Return the operation ``op`` on arguments (node numbers, or a value or index)."""
        key = (op, *args)
        index = self._known.get(key)
        if index is None:
            index = self._known[key] = len(self.nodes)
            self.nodes.append(key)
        return Expr(self, index)

    def constant(self, value: float) -> Expr:
        """Return a constant; next to nothing, it is nothing."""
        value = float(value)
        if not math.isfinite(value):
            raise ValueError(f"a tape holds finite constants, got {value}")
        for exact in (0.0, 1.0, -1.0):
            if abs(value - exact) < ZERO:
                value = exact
        return self.node("const", value + 0.0)  # no negative zero

    def input(self, index: int) -> Expr:
        """Return number ``index`` of the inputs."""
        return self.node("input", index)

    def inputs(self, begin: int, count: int) -> list[Expr]:
        """Inputs ``begin`` to ``begin + count``."""
        return [self.input(begin + k) for k in range(count)]

    def lift(self, value: Number) -> Expr:
        """Expression of this graph for a number or an expression."""
        return value if isinstance(value, Expr) else self.constant(value)

    def tape(self, outputs: Sequence[Number], inputs: int) -> Tape:
        """Operations needed for ``outputs``, in order, as functions of ``inputs`` numbers."""
        wanted = [self.lift(e).index for e in outputs]
        live: set[int] = set()
        stack = list(wanted)
        while stack:
            i = stack.pop()
            if i not in live:
                live.add(i)
                stack += arguments(self.nodes[i])
        new = {old: k for k, old in enumerate(sorted(live))}
        nodes = tuple(renumbered(self.nodes[old], new) for old in new)
        return Tape(nodes, tuple(new[i] for i in wanted), inputs)


@dataclass(frozen=True)
class Tape:
    """Straight-line arithmetic: ``nodes`` in order, each on earlier ones.

    Attributes
    ----------
    nodes : tuple of (operation, arguments)
        "const" with its value, "input" with its index, else with numbers of earlier nodes.
    outputs : tuple of int
        Nodes whose values are asked for.
    inputs : int
        How many numbers go in.
    """

    nodes: tuple[Node, ...] = field(repr=False)
    outputs: tuple[int, ...] = field(repr=False)
    inputs: int

    def count(self) -> int:
        """Count the operations, constants and inputs aside."""
        return sum(node[0] not in ("const", "input") for node in self.nodes)


def arguments(node: Node) -> tuple[int, ...]:
    """Numbers of the nodes that a node works on."""
    return () if node[0] in ("const", "input") else node[1:]


def renumbered(node: Node, new: dict[int, int]) -> Node:
    """Node with its arguments renumbered."""
    return node if node[0] in ("const", "input") else (node[0], *(new[i] for i in node[1:]))


class Expr:
    """A number that is computed: node ``index`` of a graph."""

    __slots__ = ("graph", "index")

    def __init__(self, graph: Graph, index: int) -> None:
        """Stand for a node."""
        self.graph = graph
        self.index = index

    @property
    def node(self) -> Node:
        """Operation and arguments."""
        return self.graph.nodes[self.index]

    @property
    def value(self) -> float | None:
        """Value of a constant, None for anything else."""
        node = self.node
        return float(node[1]) if node[0] == "const" else None

    def __repr__(self) -> str:
        """Operation and arguments."""
        return f"Expr{self.node}"

    def __hash__(self) -> int:
        """Hash by node."""
        return hash((id(self.graph), self.index))

    def __eq__(self, other: object) -> bool:
        """Whether both are the same node: equal by construction."""
        return isinstance(other, Expr) and self.graph is other.graph and self.index == other.index

    def __neg__(self) -> Expr:
        value, node = self.value, self.node
        if value is not None:
            return self.graph.constant(-value)
        if node[0] == "neg":
            return Expr(self.graph, node[1])
        if node[0] == "sub":
            return self.graph.node("sub", node[2], node[1])
        return self.graph.node("neg", self.index)

    def __add__(self, other: Number) -> Expr:
        g = self.graph
        other = g.lift(other)
        a, b = self.value, other.value
        if a is not None and b is not None:
            return g.constant(a + b)
        if a == 0.0:
            return other
        if b == 0.0:
            return self
        if other.node[0] == "neg":
            return self - Expr(g, other.node[1])
        if self.node[0] == "neg":
            return other - Expr(g, self.node[1])
        return g.node("add", *sorted((self.index, other.index)))

    __radd__ = __add__

    def __sub__(self, other: Number) -> Expr:
        g = self.graph
        other = g.lift(other)
        a, b = self.value, other.value
        if a is not None and b is not None:
            return g.constant(a - b)
        if b == 0.0:
            return self
        if a == 0.0:
            return -other
        if self.index == other.index:
            return g.constant(0.0)
        if other.node[0] == "neg":
            return self + Expr(g, other.node[1])
        return g.node("sub", self.index, other.index)

    def __rsub__(self, other: Number) -> Expr:
        return self.graph.lift(other) - self

    def __mul__(self, other: Number) -> Expr:
        g = self.graph
        other = g.lift(other)
        a, b = self.value, other.value
        if a is not None and b is not None:
            return g.constant(a * b)
        for one, two, value in ((self, other, a), (other, self, b)):
            if value == 0.0:
                return one
            if value == 1.0:
                return two
            if value == -1.0:
                return -two
        if self.node[0] == "neg":
            return -(Expr(g, self.node[1]) * other)
        if other.node[0] == "neg":
            return -(self * Expr(g, other.node[1]))
        return g.node("mul", *sorted((self.index, other.index)))

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> Expr:
        return self * self.graph.lift(other).recip()

    def __rtruediv__(self, other: Number) -> Expr:
        return self.graph.lift(other) * self.recip()

    def recip(self) -> Expr:
        """Return 1 / self."""
        value = self.value
        if value is not None:
            if value == 0.0:
                raise ZeroDivisionError("a tape would divide by a constant zero")
            return self.graph.constant(1.0 / value)
        if self.node[0] == "recip":
            return Expr(self.graph, self.node[1])
        return self.graph.node("recip", self.index)

    def _of(self, op: str, exact: Any) -> Expr:
        value = self.value
        return (
            self.graph.constant(exact(value))
            if value is not None
            else self.graph.node(op, self.index)
        )

    def sin(self) -> Expr:
        """Sine."""
        return self._of("sin", math.sin)

    def cos(self) -> Expr:
        """Cosine."""
        return self._of("cos", math.cos)

    def sqrt(self) -> Expr:
        """Square root."""
        return self._of("sqrt", math.sqrt)

    def __abs__(self) -> Expr:
        return self._of("abs", abs)

    def min(self, other: Number) -> Expr:
        """Return the smaller of two."""
        other = self.graph.lift(other)
        return self if self == other else self.graph.node("min", *sorted((self.index, other.index)))

    def max(self, other: Number) -> Expr:
        """Return the larger of two."""
        other = self.graph.lift(other)
        return self if self == other else self.graph.node("max", *sorted((self.index, other.index)))

    # -- truth values, for control on the tape -----------------------------------------------------

    def __lt__(self, other: Number) -> Expr:
        return self.graph.node("less", self.index, self.graph.lift(other).index)

    def __gt__(self, other: Number) -> Expr:
        return self.graph.node("less", self.graph.lift(other).index, self.index)

    def __and__(self, other: Expr) -> Expr:
        return self.graph.node("and", *sorted((self.index, other.index)))

    def __or__(self, other: Expr) -> Expr:
        return self.graph.node("or", *sorted((self.index, other.index)))

    def __invert__(self) -> Expr:
        node = self.node
        return Expr(self.graph, node[1]) if node[0] == "not" else self.graph.node("not", self.index)

    def select(self, then: Number, otherwise: Number) -> Expr:
        """Return ``then`` where this truth value holds, else ``otherwise``."""
        a, b = self.graph.lift(then), self.graph.lift(otherwise)
        return a if a == b else self.graph.node("select", self.index, a.index, b.index)


def total(terms: Iterable[Number]) -> Number:
    """Sum; 0 for none."""
    found: Number = 0.0
    for term in terms:
        found = found + term
    return found
