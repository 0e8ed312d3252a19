"""Exact numbers behind decimals: rationals and rationals times a square root."""

from __future__ import annotations

from fractions import Fraction
from math import sqrt

RADICALS = (2, 3, 5)
"""Square roots that results may hold; products of them too."""

_PRODUCTS: tuple[tuple[int, ...], ...] = ((), (3,), (2,), (5,), (2, 3), (2, 5), (3, 5))
_DENOMINATOR = 1000
_LONGEST = 10  # digits of a decimal that someone typed

Exact = dict[tuple[int, ...], Fraction]
"""Sum of rationals times square roots: radicands -> rational."""


def exact(value: float, tolerance: float = 1e-13) -> Exact | None:
    """Number of the form rational times sqrt(2, 3, 5 or a product of two), or None.

    Parameters
    ----------
    value : float
    tolerance : float
        Relative to the value, or to 1 where that is less.
    """
    margin = tolerance * max(1.0, abs(value))
    if abs(value) <= margin:
        return {}
    for radicands in _PRODUCTS:
        root = sqrt(_product(radicands))
        ratio = Fraction(value / root).limit_denominator(_DENOMINATOR)
        if abs(float(ratio) * root - value) <= margin:
            return {radicands: ratio}
    text = repr(abs(value))
    if len(text.replace(".", "").lstrip("0")) <= _LONGEST:
        return {(): Fraction(repr(value))}
    return None


def exact_or_rounded(value: float, tolerance: float = 1e-13) -> tuple[Exact, bool]:
    """As ``exact``; else the decimal that the number prints as, and False."""
    found = exact(value, tolerance)
    return (found, True) if found is not None else ({(): Fraction(repr(float(value)))}, False)


def _product(radicands: tuple[int, ...]) -> int:
    out = 1
    for radicand in radicands:
        out *= radicand
    return out
