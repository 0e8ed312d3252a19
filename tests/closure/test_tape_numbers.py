"""One tape on floats, complex numbers, exact and interval numbers, and duals."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import mpmath
import numpy as np
import pytest
from random_tapes import random_expressions, random_tape

from closedchain.closure.tape.derivative import forward, gradient
from closedchain.closure.tape.dual import Dual, jacobian, variables
from closedchain.closure.tape.expression import Graph, Tape
from closedchain.closure.tape.numbers import Functions, evaluate

MPMATH = Functions(
    sin=mpmath.sin,
    cos=mpmath.cos,
    sqrt=mpmath.sqrt,
    abs=abs,
    min=min,
    max=max,
    both=lambda a, b: a and b,
    either=lambda a, b: a or b,
    invert=lambda a: not a,
    select=lambda c, a, b: a if c else b,
    constant=mpmath.mpf,
)


@pytest.mark.parametrize("seed", range(4))
def test_floats_arrays_and_many_digits_agree(seed: int) -> None:
    tape = random_tape(seed)
    x = np.random.default_rng(seed).uniform(-1.5, 1.5, (5, 7))
    columns = np.array([np.broadcast_to(v, 7) for v in evaluate(tape, list(x))], dtype=float)
    for k in range(7):
        single = np.array(evaluate(tape, [float(v) for v in x[:, k]]), dtype=float)
        assert np.allclose(single, columns[:, k], rtol=1e-12, atol=1e-13)
        with mpmath.workdps(40):
            exact = evaluate(tape, [mpmath.mpf(float(v)) for v in x[:, k]], MPMATH)
        assert np.allclose([float(v) for v in exact], columns[:, k], rtol=1e-9, atol=1e-11)


def rational() -> Tape:
    g = Graph()
    x, y, z = g.inputs(0, 3)
    return g.tape([(x * y - 3.0 * z) / (x + 0.5), -x * (y - z), 0.25 - y * y], 3)


def test_exact_fractions() -> None:
    functions = Functions(constant=Fraction, recip=lambda x: 1 / x)
    x, y, z = Fraction(1, 3), Fraction(2, 7), Fraction(-5, 11)
    found = evaluate(rational(), [x, y, z], functions)
    expected = [(x * y - 3 * z) / (x + Fraction(1, 2)), -x * (y - z), Fraction(1, 4) - y * y]
    assert found == expected
    assert all(isinstance(v, Fraction) for v in found)


def test_complex_numbers() -> None:
    g = Graph()
    x, y = g.inputs(0, 2)
    tape = g.tape([x.sin() * y - y.cos() / x, (x * x + y).sqrt()], 2)
    a, b = 0.3 + 0.8j, -1.2 + 0.1j
    expected = [cmath.sin(a) * b - cmath.cos(b) / a, cmath.sqrt(a * a + b)]
    assert np.allclose(evaluate(tape, [a, b]), expected, rtol=1e-14)
    found = evaluate(tape, [np.array([a, 1]), np.array([b, 2])])
    assert np.allclose([v[0] for v in found], expected, rtol=1e-14)


def test_complex_numbers_are_not_compared() -> None:
    g = Graph()
    x, y = g.inputs(0, 2)
    for e in (x.min(y), abs(x), (x < y).select(x, y)):
        with pytest.raises(TypeError, match="complex numbers have no"):
            evaluate(g.tape([e], 2), [1j, 2.0])


@dataclass(frozen=True)
class Residue:
    """Number modulo 10007: a type that brings its own functions."""

    value: int
    FUNCTIONS: ClassVar[Functions]

    def __add__(self, other: Residue) -> Residue:
        return Residue((self.value + other.value) % 10007)

    def __sub__(self, other: Residue) -> Residue:
        return Residue((self.value - other.value) % 10007)

    def __mul__(self, other: Residue) -> Residue:
        return Residue(self.value * other.value % 10007)

    def __neg__(self) -> Residue:
        return Residue(-self.value % 10007)


def as_residue(value: float) -> Residue:
    fraction = Fraction(value)
    return Residue(fraction.numerator * pow(fraction.denominator, -1, 10007) % 10007)


Residue.FUNCTIONS = Functions(constant=as_residue, recip=lambda x: Residue(pow(x.value, -1, 10007)))


def test_a_type_brings_its_own_functions() -> None:
    given = [Fraction(3, 4), Fraction(-7, 2), Fraction(5)]
    exact = evaluate(rational(), given, Functions(constant=Fraction, recip=lambda x: 1 / x))
    found = evaluate(rational(), [as_residue(v) for v in given])
    assert found == [as_residue(v) for v in exact]


def test_inputs_are_counted() -> None:
    with pytest.raises(ValueError, match="takes 3 inputs, got 2"):
        evaluate(rational(), [1.0, 2.0])


def test_duals_follow_the_rules() -> None:
    x, y = variables(np.array([[0.7, 2.0], [1.3, -0.4]]))
    a, b = x.value, y.value
    cases = [
        (x / y, a / b, [1 / b, -a / b**2]),
        (3.0 / x - y, 3 / a - b, [-3 / a**2, -np.ones(2)]),
        (2.0 - x * y, 2 - a * b, [-b, -a]),
        (x / 4.0 + np.array([1.0, 2.0]), a / 4 + [1, 2], [np.full(2, 0.25), np.zeros(2)]),
        (np.array([5.0, 6.0]) * y, b * [5, 6], [np.zeros(2), np.array([5.0, 6.0])]),
    ]
    for found, value, slope in cases:
        assert isinstance(found, Dual)
        assert np.allclose(found.value, value, rtol=1e-15)
        assert np.allclose(found.slope, slope, rtol=1e-14)
    assert ((x < y) == (a < b)).all()
    assert ((x > 1.0) == (a > 1.0)).all()


def differences(tape: Tape, x: np.ndarray) -> np.ndarray:
    """Derivatives (outputs, inputs, n) by central differences of fourth order."""
    columns = []
    for k in range(tape.inputs):
        h = np.zeros_like(x)
        h[k] = 1e-3
        at = {s: np.array([np.broadcast_to(v, x.shape[1]) for v in evaluate(tape, list(x + s * h))])
              for s in (-2, -1, 1, 2)}  # fmt: skip
        columns.append((8.0 * (at[1] - at[-1]) - (at[2] - at[-2])) / 12e-3)
    return np.stack(columns, axis=1)


def derivatives(seed: int, rough: bool) -> tuple[Tape, list[Tape], Graph]:
    """A random tape, and tapes of its derivatives by forward and by reverse differentiation."""
    g = Graph()
    rng = np.random.default_rng(seed)
    numbers, _ = random_expressions(g, rng, 4, 14 if not rough else 40, rough)
    outputs = [*numbers[-5:], g.input(2), g.lift(2.0)]
    columns = [forward(g, outputs, {k: 1.0}) for k in range(4)]
    by_columns = [columns[k][row] for row in range(len(outputs)) for k in range(4)]
    by_rows = [e for output in outputs for e in gradient(g, output, range(4))]
    return g.tape(outputs, 4), [g.tape(by_columns, 4), g.tape(by_rows, 4)], g


def values(tape: Tape, x: np.ndarray) -> np.ndarray:
    return np.array([np.broadcast_to(v, x.shape[1]) for v in evaluate(tape, list(x))], dtype=float)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rough", [False, True])
def test_derivatives_agree(seed: int, rough: bool) -> None:
    """Forward and reverse on the graph, and duals; of operations with kinks too."""
    tape, (columns, rows), _ = derivatives(seed, rough)
    x = np.random.default_rng(seed + 50).uniform(-1.5, 1.5, (4, 30))
    found, slopes = jacobian(tape, x)
    assert np.allclose(found, values(tape, x), rtol=1e-13)
    shape = slopes.shape
    scale = 1.0 + np.abs(slopes).max()
    assert np.allclose(values(columns, x).reshape(shape), slopes, rtol=1e-9, atol=1e-11 * scale)
    assert np.allclose(values(rows, x).reshape(shape), slopes, rtol=1e-9, atol=1e-11 * scale)


@pytest.mark.parametrize("seed", range(5))
def test_derivatives_are_limits_of_differences(seed: int) -> None:
    tape, _, _ = derivatives(seed, False)
    x = np.random.default_rng(seed + 80).uniform(-1.5, 1.5, (4, 10))
    _, slopes = jacobian(tape, x)
    assert np.abs(slopes).max() > 0.1
    assert np.allclose(slopes, differences(tape, x), rtol=1e-4, atol=1e-4 * np.abs(slopes).max())


def test_derivatives_with_kinks() -> None:
    g = Graph()
    x, y = g.inputs(0, 2)
    cases = {
        "abs": (abs(x), lambda a, b: [math.copysign(1, a), 0]),
        "min": (x.min(y), lambda a, b: [a < b, a > b]),
        "max": (x.max(y), lambda a, b: [a > b, a < b]),
        "select": ((x < y).select(x * y, 3.0 * x), lambda a, b: [b, a] if a < b else [3, 0]),
        "truth": (
            ((x < y) & (x < 0.0)).select(y, x),
            lambda a, b: [0, 1] if a < min(b, 0) else [1, 0],
        ),
    }  # fmt: skip
    points = np.random.default_rng(3).uniform(-1, 1, (2, 20))
    for name, (e, expected) in cases.items():
        ahead = [forward(g, [e], {k: 1.0})[0] for k in range(2)]
        for made in (ahead, gradient(g, e, [0, 1])):
            found = values(g.tape(made, 2), points)
            assert found.T.tolist() == [list(map(float, expected(a, b))) for a, b in points.T], name


def test_directions_may_be_expressions() -> None:
    g = Graph()
    x, v = g.inputs(0, 2)
    acceleration = forward(g, forward(g, [x.sin()], {0: v}), {0: v})[0]
    t, u = 0.4, 1.7
    (found,) = evaluate(g.tape([acceleration], 2), [t, u])
    assert found == pytest.approx(-math.sin(t) * u * u, rel=1e-14)


def test_second_derivatives_are_symmetric() -> None:
    g = Graph()
    numbers, _ = random_expressions(g, np.random.default_rng(7), 3, 12, rough=False)
    slopes = gradient(g, numbers[-1], range(3))
    second = [forward(g, slopes, {k: 1.0}) for k in range(3)]
    x = np.random.default_rng(1).uniform(-1, 1, (3, 10))
    h = values(g.tape([e for row in second for e in row], 3), x).reshape(3, 3, 10)
    assert np.abs(h).max() > 1e-3
    assert np.allclose(h, h.transpose(1, 0, 2), rtol=1e-9, atol=1e-12)


def test_a_gradient_costs_little() -> None:
    """Reverse differentiation: a few times the operations, however many inputs."""
    g = Graph()
    numbers, _ = random_expressions(g, np.random.default_rng(0), 30, 300, rough=False)
    whole = sum((e * e for e in numbers[-40:]), start=g.lift(0.0))
    slopes = gradient(g, whole, range(30))
    assert g.tape(slopes, 30).count() < 5 * g.tape([whole], 30).count()
