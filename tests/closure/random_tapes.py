"""Tapes to test with: of every operation, made at random, and a loop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from closedchain.closure.tape.expression import Expr, Graph, Tape

Maker = Callable[[Expr, Expr, Expr, Expr], Expr]

SMOOTH: tuple[Maker, ...] = (
    lambda a, b, c, t: (0.9 * a + 0.6 * b).sin(),
    lambda a, b, c, t: (a - b * c).sin(),
    lambda a, b, c, t: (a * b - c).cos(),
    lambda a, b, c, t: (a * 0.7 + b * c).sin(),
    lambda a, b, c, t: (2.0 + a * a).recip(),
    lambda a, b, c, t: 0.5 * (3.0 * a).cos() + (3.0 * a).sin(),
    lambda a, b, c, t: (a * a + 0.1).sqrt(),
    lambda a, b, c, t: -(a * b),
)
ROUGH: tuple[Maker, ...] = (
    lambda a, b, c, t: abs(a),
    lambda a, b, c, t: a.min(b),
    lambda a, b, c, t: a.max(b),
    lambda a, b, c, t: t.select(a, b),
)
LOGIC: tuple[Maker, ...] = (
    lambda a, b, t, u: t & u,
    lambda a, b, t, u: t | u,
    lambda a, b, t, u: ~t,
    lambda a, b, t, u: a < b,
    lambda a, b, t, u: t.select(u, a < b),
)


def random_expressions(
    graph: Graph, rng: np.random.Generator, inputs: int, length: int, rough: bool = True
) -> tuple[list[Expr], list[Expr]]:
    """Numbers and truth values that grow from ``inputs`` inputs; numbers stay of order one."""
    numbers: list[Expr] = list(graph.inputs(0, inputs))
    truths = [numbers[0] < numbers[-1], numbers[0] < 0.3]
    makers = SMOOTH + ROUGH if rough else SMOOTH
    for _ in range(length):
        a, b, c = (numbers[k] for k in rng.integers(max(0, len(numbers) - 30), len(numbers), 3))
        t, u = (truths[k] for k in rng.integers(0, len(truths), 2))
        numbers.append(makers[rng.integers(len(makers))](a, b, c, t))
        if rng.random() < 0.2:
            truths.append(LOGIC[rng.integers(len(LOGIC))](a, b, t, u))
    return numbers, truths


def random_tape(seed: int, inputs: int = 5, length: int = 150) -> Tape:
    """Tape of every operation whose outputs are numbers, truth values, an input and a constant."""
    rng = np.random.default_rng(seed)
    graph = Graph()
    numbers, truths = random_expressions(graph, rng, inputs, length)
    chosen = [numbers[k] for k in rng.integers(0, len(numbers), 12)]
    last = numbers[-1]
    return graph.tape([*chosen, last, *truths[-4:], numbers[1], 2.5, last], inputs)


def root_tape() -> Tape:
    """Newton's iteration for the square root of parameter 0, counting its steps."""
    g = Graph()
    x, steps, a = g.inputs(0, 3)
    runs = 1e-14 * a < abs(x * x - a)
    return g.tape([runs.select(0.5 * (x + a / x), x), runs.select(steps + 1.0, steps), runs], 3)
