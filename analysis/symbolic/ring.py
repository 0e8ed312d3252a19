"""Polynomials in lengths, slides, cosines and sines, with exact coefficients.

A cosine and a sine are generators c, s with s^2 = 1 - c^2, one pair for each angle; an angle is a
sum of joint angles, so that a chain of parallel axes needs no addition theorem. Square roots are
generators w with w^2 = n. ``Ring.reduce`` brings every element to the one normal form that these
relations leave, so that elements are equal where their normal forms are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from typing import Any

from closedchain.analysis.symbolic.exact import RADICALS, Exact
from closedchain.urdf.errors import ClosureError

Element = Any
"""Element of a sympy polynomial ring; sympy carries no types."""
Vector = list[Element]
Matrix = list[list[Element]]

LARGEST = 20_000
"""Terms beyond which an expression is called too large."""

PI = "pi"  # name of the constant pi in an angle, beside those of joints and parameters


class Angle:
    """Rational combination of joint angles and pi."""

    __slots__ = ("terms",)

    def __init__(self, terms: Mapping[str, Fraction] | Iterable[tuple[str, Fraction]] = ()) -> None:
        items = terms.items() if isinstance(terms, Mapping) else terms
        self.terms = tuple(sorted((k, Fraction(v)) for k, v in items if v != 0))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Angle) and self.terms == other.terms

    def __hash__(self) -> int:
        return hash(self.terms)

    def __add__(self, other: Angle) -> Angle:
        total: dict[str, Fraction] = dict(self.terms)
        for k, v in other.terms:
            total[k] = total.get(k, Fraction(0)) + v
        return Angle(total)

    def __mul__(self, factor: int | Fraction) -> Angle:
        return Angle((k, v * factor) for k, v in self.terms)

    def __repr__(self) -> str:
        return " + ".join(f"{v}*{k}" for k, v in self.terms) or "0"

    @property
    def constant(self) -> Fraction:
        """Multiple of pi in it."""
        return dict(self.terms).get(PI, Fraction(0))

    @property
    def variable(self) -> Angle:
        """The rest."""
        return Angle((k, v) for k, v in self.terms if k != PI)


class TooLarge(ClosureError):
    """An expression outgrew ``LARGEST`` terms."""


class Ring:
    """Polynomials over the rationals in ``variables``, cosines and sines, and square roots.

    Parameters
    ----------
    variables : sequence of str
        Lengths and slides.
    angles : sequence of Angle
        Without pi, leading coefficient positive.
    """

    def __init__(self, variables: Sequence[str], angles: Sequence[Angle]) -> None:
        from sympy import QQ
        from sympy.polys.rings import PolyRing

        self.variables = tuple(variables)
        self.angles = tuple(angles)
        n, k = len(self.angles), len(self.variables)
        names = [f"s{i}" for i in range(n)] + [f"c{i}" for i in range(n)]
        names += [f"w{r}" for r in RADICALS] + [f"v{i}" for i in range(k)]
        self.R = PolyRing(names, QQ)
        gens = self.R.gens
        self.sines, self.cosines = gens[:n], gens[n : 2 * n]
        self.roots = dict(zip(RADICALS, gens[2 * n : 2 * n + len(RADICALS)], strict=True))
        self.values = dict(zip(self.variables, gens[2 * n + len(RADICALS) :], strict=True))
        self.zero, self.one = self.R.zero, self.R.one
        self._place = {angle: i for i, angle in enumerate(self.angles)}

    # -- elements --------------------------------------------------------------------------------

    def number(self, value: Exact | Fraction | int) -> Element:
        """Element of an exact number."""
        if not isinstance(value, dict):
            value = {(): Fraction(value)}
        out = self.zero
        for radicands, rational in value.items():
            term = self.R(self.R.domain(rational.numerator, rational.denominator))
            for radicand in radicands:
                term *= self.roots[radicand]
            out += term
        return out

    def cos_sin(self, angle: Angle) -> tuple[Element, Element]:
        """Cosine and sine of an angle; the constant part is taken apart exactly."""
        constant, rest = angle.constant % 2, angle.variable
        c0, s0 = (self.number(x) for x in _constant_cos_sin(constant))
        if not rest.terms:
            return c0, s0
        turned, sign = upright(rest)
        i = self._place[turned]
        c, s = self.cosines[i], sign * self.sines[i]
        return self.reduce(c * c0 - s * s0), self.reduce(s * c0 + c * s0)

    def reduce(self, element: Element, cosines: frozenset[int] = frozenset()) -> Element:
        """Normal form: no square of a sine (of a cosine, for the angles in ``cosines``) or root."""
        n = len(self.angles)
        out: dict[tuple[int, ...], Any] = {}
        stack = list(element.items())
        while stack:
            mono, coeff = stack.pop()
            for high, power in enumerate(mono):
                if power < 2 or high >= 2 * n + len(RADICALS):
                    continue
                if high < 2 * n and (high - n in cosines if high >= n else high not in cosines):
                    low = list(mono)
                    low[high] -= 2
                    stack.append((tuple(low), coeff))
                    low[(high + n) % (2 * n)] += 2
                    stack.append((tuple(low), -coeff))
                    break
                if high >= 2 * n:
                    low = list(mono)
                    low[high] -= 2
                    stack.append((tuple(low), coeff * RADICALS[high - 2 * n]))
                    break
            else:
                total = out.get(mono, 0) + coeff
                if total:
                    out[mono] = total
                else:
                    out.pop(mono, None)
        return self.R.from_dict(out)

    def mul(self, a: Element, b: Element) -> Element:
        """Product in normal form."""
        if not a or not b:
            return self.zero
        product = self.reduce(a * b)
        if len(product) > LARGEST:
            raise TooLarge(f"an expression grows beyond {LARGEST} terms")
        return product

    # -- vectors and matrices --------------------------------------------------------------------

    def dot(self, a: Vector, b: Vector) -> Element:
        """Scalar product."""
        total = self.zero
        for x, y in zip(a, b, strict=True):
            total += self.mul(x, y)
        return total

    def cross(self, a: Vector, b: Vector) -> Vector:
        """Vector product."""
        return [
            self.mul(a[1], b[2]) - self.mul(a[2], b[1]),
            self.mul(a[2], b[0]) - self.mul(a[0], b[2]),
            self.mul(a[0], b[1]) - self.mul(a[1], b[0]),
        ]

    def apply(self, matrix: Matrix, vector: Vector) -> Vector:
        """Matrix times vector."""
        return [self.dot(row, vector) for row in matrix]

    def product(self, a: Matrix, b: Matrix) -> Matrix:
        """Matrix times matrix."""
        columns = [list(column) for column in zip(*b, strict=True)]
        return [[self.dot(row, column) for column in columns] for row in a]

    def identity(self) -> Matrix:
        """Unit matrix (3, 3)."""
        return [[self.one if i == j else self.zero for j in range(3)] for i in range(3)]

    def rotation(self, axis: Vector, angle: Angle) -> Matrix:
        """Rodrigues' rotation (3, 3) about a unit axis."""
        if not angle.terms:
            return self.identity()
        c, s = self.cos_sin(angle)
        x, y, z = axis
        skew = [[self.zero, -z, y], [z, self.zero, -x], [-y, x, self.zero]]
        return [
            [
                self.mul(c, self.one if i == j else self.zero)
                + self.mul(s, skew[i][j])
                + self.mul(self.one - c, self.mul(axis[i], axis[j]))
                for j in range(3)
            ]
            for i in range(3)
        ]

    def det(self, matrix: Matrix) -> Element:
        """Determinant by expansion along rows, the sparsest first; minors are kept."""
        n = len(matrix)
        order = sorted(range(n), key=lambda i: sum(bool(x) for x in matrix[i]))
        rows = [matrix[i] for i in order]
        sign = _parity(order)
        known: dict[tuple[int, ...], Element] = {(): self.one}
        # minors of the last k rows, by columns
        for k in range(1, n + 1):
            row, new = rows[n - k], {}
            for columns in combinations(range(n), k):
                total = self.zero
                for place, column in enumerate(columns):
                    rest = columns[:place] + columns[place + 1 :]
                    minor = known.get(rest)
                    if row[column] and minor:
                        term = self.mul(row[column], minor)
                        total = total + term if place % 2 == 0 else total - term
                if total:
                    new[columns] = total
            known = new
        return sign * known.get(tuple(range(n)), self.zero)


def upright(angle: Angle) -> tuple[Angle, int]:
    """The angle or its negative, whichever has a positive first coefficient, and the sign."""
    negative = sum(v < 0 for _, v in angle.terms) * 2 > len(angle.terms)
    if sum(v < 0 for _, v in angle.terms) * 2 == len(angle.terms):
        negative = angle.terms[0][1] < 0
    return (angle * -1, -1) if negative else (angle, 1)


def _constant_cos_sin(turn: Fraction) -> tuple[Exact, Exact]:
    """Cosine and sine of ``turn`` times pi, a multiple of 1/12."""
    twelfths = turn * 12
    if twelfths.denominator != 1:
        raise AssertionError(turn)
    k = int(twelfths) % 24
    return _cosine(k), _cosine((k - 6) % 24)


def _cosine(k: int) -> Exact:
    """Exact cos(k pi / 12)."""
    k = min(k % 24, 24 - k % 24)
    sign = 1 if k <= 6 else -1
    k = k if k <= 6 else 12 - k
    quarter, half = Fraction(sign, 4), Fraction(sign, 2)
    table: tuple[Exact, ...] = (
        {(): Fraction(sign)},
        {(2, 3): quarter, (2,): quarter},
        {(3,): half},
        {(2,): half},
        {(): half},
        {(2, 3): quarter, (2,): -quarter},
        {},
    )
    return table[k]


def _parity(order: Sequence[int]) -> int:
    swaps = sum(a > b for i, a in enumerate(order) for b in order[i + 1 :])
    return -1 if swaps % 2 else 1


def evaluate(ring: Ring, element: Element, values: Mapping[str, float]) -> float:
    """Value of an element for joints [rad, m] and parameters."""
    points = _point(ring, values)
    total = 0.0
    for mono, coeff in element.items():
        term = float(coeff)
        for base, power in zip(points, mono, strict=True):
            if power:
                term *= base**power
        total += term
    return total


def angle_value(angle: Angle, values: Mapping[str, float]) -> float:
    """Value of an angle [rad]."""
    known = {PI: math.pi, "1": 1.0}
    return float(sum(float(v) * (known[k] if k in known else values[k]) for k, v in angle.terms))


def convert(element: Element, ring: Ring, to: Ring) -> Element:
    """The same element in another ring that has all its variables and angles."""
    n, m = len(ring.angles), len(to.angles)
    places = [to._place[a] for a in ring.angles] + [m + to._place[a] for a in ring.angles]
    places += [2 * m + i for i in range(len(RADICALS))]
    places += [2 * m + len(RADICALS) + to.variables.index(v) for v in ring.variables]
    out = {}
    for mono, coeff in element.items():
        new = [0] * len(to.R.gens)
        for place, power in zip(places, mono, strict=True):
            new[place] = power
        out[tuple(new)] = coeff
    assert len(places) == 2 * n + len(RADICALS) + len(ring.variables)
    return to.R.from_dict(out)


def _point(ring: Ring, values: Mapping[str, float]) -> list[float]:
    angles = [angle_value(a, values) for a in ring.angles]
    out = [math.sin(a) for a in angles] + [math.cos(a) for a in angles]
    return out + [math.sqrt(r) for r in RADICALS] + [values[v] for v in ring.variables]
