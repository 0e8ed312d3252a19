"""Intervals hold the true values: against mpmath with fifty digits."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from closedchain.closure.modes.certificates import times
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.intervals import Interval, interval
from closedchain.closure.tape.numbers import evaluate

finite = st.floats(-50.0, 50.0, allow_subnormal=False)


def holds(box: Interval, value: mpmath.mpf) -> bool:
    return bool(mpmath.mpf(float(box.low)) <= value <= mpmath.mpf(float(box.high)))


@example(x=-1.0, y=0.0, width=2.0, share=0.0)  # x x may be -1, for all that is known
@given(x=finite, y=finite, width=st.floats(0.0, 8.0), share=st.floats(0.0, 1.0))
def test_every_value_of_a_box_lies_in_the_result(
    x: float, y: float, width: float, share: float
) -> None:
    def made(a: Expr, b: Expr) -> list[Expr]:
        s, c = a.sin(), a.cos()
        return [a + b, a - b, a * b, s, c, s * s + c * c, (a * a + 1.0).sqrt(), (s + 3.0).recip()]

    g = Graph()
    tape = g.tape(made(*g.inputs(0, 2)), 2)
    box = Interval(np.array(x), np.array(x + width))
    found = evaluate(tape, [box, interval(y)])
    inside = min(max(x + share * width, x), x + width)
    with mpmath.workdps(50):
        a, b = mpmath.mpf(inside), mpmath.mpf(y)
        s, c = mpmath.sin(a), mpmath.cos(a)
        true = [a + b, a - b, a * b, s, c, s * s + c * c, mpmath.sqrt(a * a + 1), 1 / (s + 3)]
        for number, value in zip(found, true, strict=True):
            assert holds(number, value)


def test_points_stay_narrow() -> None:
    x = interval(np.linspace(-3.0, 3.0, 101))
    g = Graph()
    a = g.input(0)
    (found,) = evaluate(g.tape([a.sin() * a.cos() + a], 1), [x])
    assert (found.high - found.low).max() < 1e-14


def test_extremes_within_are_found() -> None:
    g = Graph()
    a = g.input(0)
    low, high = np.array([0.5, 1.0, -0.1, 10.0]), np.array([2.0, 1.5, 0.1, 17.0])
    sine, cosine = evaluate(g.tape([a.sin(), a.cos()], 1), [Interval(low, high)])
    assert sine.high[0] == 1.0
    assert sine.high[1] < 1.0
    assert cosine.high[2] == 1.0
    assert (sine.low[3], sine.high[3]) == (-1.0, 1.0)
    assert math.isclose(float(cosine.low[0]), math.cos(2.0), abs_tol=1e-14)


def test_what_may_be_zero_has_no_bound_below() -> None:
    g = Graph()
    (found,) = evaluate(g.tape([g.input(0).recip()], 1), [Interval(np.array(-1.0), np.array(1.0))])
    assert (float(found.low), float(found.high)) == (-math.inf, math.inf)


def test_the_root_of_what_may_be_negative_has_no_bounds() -> None:
    g = Graph()
    low, high = np.array([-1.0, -2.0, 0.0]), np.array([4.0, -1.0, 4.0])
    (found,) = evaluate(g.tape([g.input(0).sqrt()], 1), [Interval(low, high)])
    assert found.low.tolist() == [-math.inf, -math.inf, 0.0]
    assert found.high.tolist() == [math.inf, math.inf, math.nextafter(2.0, 3.0)]


def test_what_is_unbounded_goes_on_without_warnings() -> None:
    g = Graph()
    x = g.input(0)
    root = x.sqrt() * x
    tape = g.tape([root, root.sin(), root.recip() * x + x.sqrt()], 1)
    found = evaluate(tape, [Interval(np.array([-1.0, 0.0]), np.array([1.0, 2.0]))])
    ends = np.array([[number.low, number.high] for number in found])
    assert not np.isnan(ends).any()
    assert ends[:, :, 0].tolist() == [[-math.inf, math.inf], [-1.0, 1.0], [-math.inf, math.inf]]


def test_intervals_are_not_compared() -> None:
    g = Graph()
    a = g.input(0)
    with pytest.raises(TypeError, match="not compared"):
        evaluate(g.tape([a.max(0.0)], 1), [interval(np.array(1.0))])


@given(seed=st.integers(0, 10_000), k=st.integers(1, 30))
def test_products_of_matrices_hold_every_product(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.integers(-8, 8, (1, k, 2))
    c = rng.standard_normal((1, 2, k))
    low = size * rng.standard_normal((1, k, 2))
    high = low + size * rng.choice([0.0, 1e-9, 1.0], (1, k, 2)) * rng.uniform(size=(1, k, 2))
    found = times(c, Interval(low, high))
    corners = [low, high, np.where(rng.uniform(size=low.shape) < 0.5, low, high)]
    for matrix in corners:
        for i in range(2):
            for j in range(2):
                pairs = zip(c[0, i], matrix[0, :, j], strict=True)
                true = sum(Fraction(float(a)) * Fraction(float(b)) for a, b in pairs)
                assert Fraction(float(found.low[0, i, j])) <= true
                assert true <= Fraction(float(found.high[0, i, j]))
    points = times(c, interval(low))
    share = np.abs(c) @ np.abs(low)
    assert ((points.high - points.low) < 1e-13 * share).all()
