"""Derivatives of expressions, as expressions of the same graph.

What a derivative shares with the expression, or with another derivative, is one node and computed
once. ``min``, ``max``, ``abs`` and ``select`` are differentiated by the branch taken; truth values
do not change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from closedchain.closure.tape.expression import BOOLEAN, Expr, Graph, Number, arguments


def forward(graph: Graph, expressions: Sequence[Expr], seeds: Mapping[int, Number]) -> list[Expr]:
    """Derivatives of expressions in one direction of the inputs.

    Parameters
    ----------
    graph : Graph
        Where the expressions are.
    expressions : sequence of Expr
        Numbers to differentiate.
    seeds : mapping of int to Expr or float
        How fast each input changes, by its index; the others stay.

    Returns
    -------
    list of Expr, one for each expression.
    """
    zero = graph.constant(0.0)
    slopes: dict[int, Expr] = {}
    for i in needed(graph, expressions):
        node = graph.nodes[i]
        if node[0] == "input":
            slopes[i] = graph.lift(seeds.get(node[1], zero))
        elif node[0] == "const" or truth(graph, i):
            slopes[i] = zero
        else:
            slopes[i] = slope(graph, i, slopes)
    return [slopes[e.index] for e in expressions]


def gradient(graph: Graph, expression: Expr, inputs: Sequence[int]) -> list[Expr]:
    """Derivatives of one expression by many inputs, for about four times its own operations.

    Parameters
    ----------
    graph : Graph
        Where the expression is.
    expression : Expr
        A number.
    inputs : sequence of int
        Indices of the inputs to differentiate by.

    Returns
    -------
    list of Expr, one for each input.
    """
    zero = graph.constant(0.0)
    weights: dict[int, Expr] = {expression.index: graph.constant(1.0)}
    by_input: dict[int, Expr] = {}
    for i in reversed(needed(graph, [expression])):
        node = graph.nodes[i]
        weight = weights.pop(i, None)
        if weight is None or weight.value == 0.0 or node[0] == "const" or truth(graph, i):
            continue
        if node[0] == "input":
            by_input[node[1]] = weight
            continue
        for k, share in shares(graph, i, weight):
            weights[k] = weights[k] + share if k in weights else share
    return [by_input.get(k, zero) for k in inputs]


def needed(graph: Graph, expressions: Sequence[Expr]) -> list[int]:
    """Nodes that expressions depend on, earlier ones first."""
    found: set[int] = set()
    stack = [e.index for e in expressions]
    while stack:
        i = stack.pop()
        if i not in found:
            found.add(i)
            stack += arguments(graph.nodes[i])
    return sorted(found)


def truth(graph: Graph, i: int) -> bool:
    """Whether a node is a truth value."""
    node = graph.nodes[i]
    while node[0] == "select":
        node = graph.nodes[node[2]]
    return node[0] in BOOLEAN


def slope(graph: Graph, i: int, slopes: Mapping[int, Expr]) -> Expr:
    """Derivative of a node from those of its arguments."""
    op, *given = graph.nodes[i]
    if op == "select":
        return Expr(graph, given[0]).select(slopes[given[1]], slopes[given[2]])
    if op in ("min", "max"):
        return first_taken(graph, i).select(slopes[given[0]], slopes[given[1]])
    if op == "add":
        return slopes[given[0]] + slopes[given[1]]
    if op == "sub":
        return slopes[given[0]] - slopes[given[1]]
    if op == "mul":
        a, b = (Expr(graph, k) for k in given)
        return slopes[given[0]] * b + a * slopes[given[1]]
    return scaled(graph, i, slopes[given[0]])


def shares(graph: Graph, i: int, weight: Expr) -> list[tuple[int, Expr]]:
    """What a node's weight adds to the weights of its arguments."""
    op, *given = graph.nodes[i]
    zero = graph.constant(0.0)
    if op in ("select", "min", "max"):
        holds = Expr(graph, given[0]) if op == "select" else first_taken(graph, i)
        a, b = given[-2:]
        return [(a, holds.select(weight, zero)), (b, holds.select(zero, weight))]
    if op == "add":
        return [(given[0], weight), (given[1], weight)]
    if op == "sub":
        return [(given[0], weight), (given[1], -weight)]
    if op == "mul":
        a, b = given
        return [(a, weight * Expr(graph, b)), (b, weight * Expr(graph, a))]
    return [(given[0], scaled(graph, i, weight))]


def first_taken(graph: Graph, i: int) -> Expr:
    """Whether the first argument of a ``min`` or ``max`` is its value."""
    op, a, b = graph.nodes[i]
    first, second = Expr(graph, a), Expr(graph, b)
    return first < second if op == "min" else second < first


def scaled(graph: Graph, i: int, factor: Expr) -> Expr:
    """Derivative of a function of one number by that number, times a factor."""
    op, argument = graph.nodes[i]
    a, value = Expr(graph, argument), Expr(graph, i)
    if op == "neg":
        return -factor
    if op == "recip":
        return -(factor * (value * value))
    if op == "sin":
        return factor * a.cos()
    if op == "cos":
        return -(factor * a.sin())
    if op == "sqrt":
        return factor * (0.5 * value.recip())
    if op == "abs":
        return (a < 0.0).select(-factor, factor)
    raise TypeError(f"no derivative of {op!r} is known")
