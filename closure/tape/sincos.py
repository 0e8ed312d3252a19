"""Sine and cosine in straight-line arithmetic, for code generators.

The argument is reduced by multiples of pi/2 held in four parts (after Cody and Waite), the result
kept as a sum of two numbers, and both functions read from the polynomials of fdlibm on
[-pi/4, pi/4]. No branches and no tables, so lanes cost what one number costs. About one unit in
the last place for |x| <= RANGE; NaN for what lies beyond, for infinities and for NaN.
"""

from __future__ import annotations

from typing import Protocol, TypeVar

RANGE = 1.6e6
"""Largest argument [rad]: below 2^20 quarter turns, whose products with PARTS are exact."""

QUARTERS = 0.6366197723675814
"""2 / pi."""

PARTS = (
    float.fromhex("0x1.921fb544p+0"),
    float.fromhex("0x1.0b4611a6p-34"),
    float.fromhex("0x1.3198a2ep-69"),
    float.fromhex("0x1.b839a252049c1p-104"),
)
"""pi/2 in parts: three of at most 33 bits, and the rest."""

ROUNDING = 1.5 * 2.0**52
"""Added and taken away again, it rounds to an integer; meanwhile that integer is the low bits."""

SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)

V = TypeVar("V")


class Arithmetic(Protocol[V]):
    """What a code generator must write: each method returns the name of a new value."""

    def number(self, value: float) -> V:
        """Write a constant."""

    def add(self, a: V, b: V) -> V:
        """Write a + b."""

    def sub(self, a: V, b: V) -> V:
        """Write a - b."""

    def mul(self, a: V, b: V) -> V:
        """Write a b."""

    def fma(self, a: V, b: V, c: V) -> V:
        """Write a b + c."""

    def fnma(self, a: V, b: V, c: V) -> V:
        """Write c - a b."""

    def within(self, a: V, bound: float) -> V:
        """Write a, or NaN unless \\|a\\| <= bound."""

    def odd(self, bits: V, then: V, otherwise: V) -> V:
        """Write ``then`` where the lowest bit of ``bits`` is set, else ``otherwise``."""

    def signed(self, a: V, bits: V, offset: int) -> V:
        """Write a, negated where the second lowest bit of bits + offset is set."""


def sincos(write: Arithmetic[V], argument: V) -> tuple[V, V]:
    """Write sine and cosine of a value [rad]."""
    x = write.within(argument, RANGE)
    bits = write.add(write.mul(x, write.number(QUARTERS)), write.number(ROUNDING))
    high, low = reduced(write, x, write.sub(bits, write.number(ROUNDING)))
    sine, cosine = polynomials(write, high, low)
    return (
        write.signed(write.odd(bits, cosine, sine), bits, 0),
        write.signed(write.odd(bits, sine, cosine), bits, 1),
    )


def reduced(write: Arithmetic[V], x: V, k: V) -> tuple[V, V]:
    """Write x - k pi/2 as a sum of two numbers, the second below the last place of the first."""
    a, b, c, d = (write.number(part) for part in PARTS)
    one = write.fnma(k, a, x)  # exact
    second = write.mul(k, b)
    two = write.sub(one, second)
    lost = write.sub(write.sub(one, two), second)
    third = write.mul(k, c)
    high = write.sub(two, third)
    rest = write.add(write.sub(write.sub(two, high), third), lost)
    return high, write.fnma(k, d, rest)


def polynomials(write: Arithmetic[V], x: V, y: V) -> tuple[V, V]:
    """Write sine and cosine of x + y, where |x + y| <= pi/4 and y is tiny."""
    z = write.mul(x, x)
    half = write.number(0.5)
    s = write.number(SINE[-1])
    for value in SINE[-2:0:-1]:
        s = write.fma(s, z, write.number(value))
    v = write.mul(z, x)
    inner = write.sub(write.mul(z, write.fnma(v, s, write.mul(half, y))), y)
    sine = write.sub(x, write.fnma(v, write.number(SINE[0]), inner))
    c = write.number(COSINE[-1])
    for value in COSINE[-2::-1]:
        c = write.fma(c, z, write.number(value))
    c = write.mul(c, z)
    one = write.number(1.0)
    h = write.mul(half, z)
    w = write.sub(one, h)
    lost = write.sub(write.sub(one, w), h)
    cosine = write.add(w, write.add(lost, write.sub(write.mul(z, c), write.mul(x, y))))
    return sine, cosine
