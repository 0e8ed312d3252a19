"""First-order jets: a number and its rate, through the same algebra as plain numbers.

What is written over any kind of number gives its own time derivative when it is run on jets; no
derivative is written by hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from closedchain.closure.tape.vectors import Scalar


class Jet:
    """A value that moves at a rate."""

    __slots__ = ("rate", "value")

    def __init__(self, value: Scalar, rate: Scalar) -> None:
        """Pair a value with its rate."""
        self.value = value
        self.rate = rate

    def __repr__(self) -> str:
        """Value and rate."""
        return f"Jet({self.value!r}, {self.rate!r})"

    def __neg__(self) -> Jet:
        """Return -x."""
        return Jet(-self.value, -self.rate)

    def __add__(self, other: Any) -> Jet:
        """Return x + y."""
        value, rate = _parts(other)
        return Jet(self.value + value, self.rate + rate)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Jet:
        """Return x - y."""
        value, rate = _parts(other)
        return Jet(self.value - value, self.rate - rate)

    def __rsub__(self, other: Any) -> Jet:
        """Return y - x."""
        return -self + other

    def __mul__(self, other: Any) -> Jet:
        """Return x y."""
        value, rate = _parts(other)
        return Jet(self.value * value, self.rate * value + self.value * rate)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Jet:
        """Return x / y."""
        value, rate = _parts(other)
        quotient = self.value / value
        return Jet(quotient, (self.rate - quotient * rate) / value)

    def __rtruediv__(self, other: Any) -> Jet:
        """Return y / x."""
        return Jet(other, 0.0) / self


def jets(values: Sequence[Scalar], rates: Sequence[Scalar]) -> list[Jet]:
    """Jet of each value with its rate."""
    return [Jet(value, rate) for value, rate in zip(values, rates, strict=True)]


def parts(numbers: Sequence[Any]) -> list[tuple[Scalar, Scalar]]:
    """Value and rate of each number; what is no jet does not move."""
    return [(x.value, x.rate) if type(x) is Jet else (x, 0.0) for x in numbers]


def _parts(number: Any) -> tuple[Scalar, Scalar]:
    return (number.value, number.rate) if isinstance(number, Jet) else (number, 0.0)
