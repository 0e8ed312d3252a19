"""Intervals with outward rounding, as a number type for tapes: results hold the true values.

Bounds are arrays, so that many boxes are worked on at once. Sums, products, quotients and roots are
rounded correctly by the processor, so one step outwards makes each bound sound; sine and cosine may
be off by a few units in the last place, and are widened by as many.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Union

import numpy as np

from closedchain.closure.tape.numbers import Functions

WIDER = 4  # units in the last place that sine and cosine are trusted to
HALF_TURN = np.pi
LARGEST_ANGLE = 1e6  # rad: beyond, the reduction by whole turns is not trusted

Operand = Union["Interval", float, np.ndarray]


@dataclass(frozen=True, eq=False)
class Interval:
    """Numbers between ``low`` and ``high``, arrays of one shape; infinite if nothing is known."""

    low: np.ndarray
    high: np.ndarray

    __array_ufunc__ = None  # numpy leaves mixed operations to us
    FUNCTIONS: ClassVar[Functions]

    def __add__(self, other: Operand) -> Interval:
        """Sum."""
        b = interval(other)
        return outward(self.low + b.low, self.high + b.high)

    __radd__ = __add__

    def __neg__(self) -> Interval:
        """Negative, exact."""
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Operand) -> Interval:
        """Difference."""
        b = interval(other)
        return outward(self.low - b.high, self.high - b.low)

    def __rsub__(self, other: Operand) -> Interval:
        """Difference."""
        return interval(other) - self

    def __mul__(self, other: Operand) -> Interval:
        """Product."""
        a, b = self, interval(other)
        if b.low is b.high:
            a, b = b, a
        with np.errstate(over="ignore", invalid="ignore"):
            low, high = a.low * b.low, a.low * b.high
            low, high = np.minimum(low, high), np.maximum(low, high)
            if a.low is not a.high:  # else it is one number
                one, two = a.high * b.low, a.high * b.high
                low = np.minimum(low, np.minimum(one, two))
                high = np.maximum(high, np.maximum(one, two))
        unknown = np.isnan(low)  # zero times infinity
        return outward(np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high))

    __rmul__ = __mul__

    @property
    def middle(self) -> np.ndarray:
        """Some number within."""
        return 0.5 * (self.low + self.high)

    @property
    def size(self) -> np.ndarray:
        """Largest absolute value within."""
        return np.maximum(np.abs(self.low), np.abs(self.high))


def interval(value: Operand) -> Interval:
    """Interval that holds a number exactly."""
    if isinstance(value, Interval):
        return value
    exact = np.asarray(value, dtype=float)
    return Interval(exact, exact)


def outward(low: np.ndarray, high: np.ndarray, steps: int = 1) -> Interval:
    """Interval between bounds moved outwards by units in the last place."""
    for _ in range(steps):
        low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
    return Interval(low, high)


def _recip(x: Interval) -> Interval:
    """1 / x; everything where x may be zero."""
    x = interval(x)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        found = outward(1.0 / x.high, 1.0 / x.low)
    around = (x.low <= 0.0) & (x.high >= 0.0)
    return Interval(np.where(around, -np.inf, found.low), np.where(around, np.inf, found.high))


def _sqrt(x: Interval) -> Interval:
    """Square root; everything where x may be negative, as where it is there is none."""
    x = interval(x)
    with np.errstate(invalid="ignore"):
        found = outward(np.sqrt(x.low), np.sqrt(x.high))
    below = x.low < 0.0
    low = np.where(below, -np.inf, np.maximum(found.low, 0.0))
    return Interval(low, np.where(below, np.inf, found.high))


def _sin(x: Interval) -> Interval:
    return _wave(interval(x), np.sin, 0.5)


def _cos(x: Interval) -> Interval:
    return _wave(interval(x), np.cos, 0.0)


def _wave(x: Interval, function: np.ufunc, top: float) -> Interval:
    """Sine or cosine, largest at ``top`` half turns and every whole turn from there."""
    with np.errstate(invalid="ignore"):
        one, two = function(x.low), function(x.high)
    found = outward(np.minimum(one, two), np.maximum(one, two), WIDER)
    # an extreme may lie within: half turns are counted from slightly outside
    begin = (x.low - 1e-9) / HALF_TURN - top
    end = (x.high + 1e-9) / HALF_TURN - top
    highest = np.floor(end / 2.0) >= np.ceil(begin / 2.0)
    lowest = np.floor((end - 1.0) / 2.0) >= np.ceil((begin - 1.0) / 2.0)
    wild = (x.size > LARGEST_ANGLE) | ~np.isfinite(x.size)
    low = np.where(lowest | wild, -1.0, found.low)
    high = np.where(highest | wild, 1.0, found.high)
    return Interval(np.maximum(low, -1.0), np.minimum(high, 1.0))


def _no_order(*_: object) -> Interval:
    raise TypeError("intervals are not compared")


Interval.FUNCTIONS = Functions(
    sin=_sin,
    cos=_cos,
    sqrt=_sqrt,
    abs=_no_order,
    min=_no_order,
    max=_no_order,
    less=_no_order,
    select=_no_order,
    constant=interval,
    recip=_recip,
)
