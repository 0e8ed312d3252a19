"""Lines of LLVM text: one operation on lanes of numbers or truth values at a time.

No flag lets LLVM change the arithmetic, so each lane gets the bits that one lane gets.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

INTRINSICS = ("fma", "fabs", "sqrt")


@dataclass(frozen=True)
class Shape:
    """What the code is written for.

    Attributes
    ----------
    lanes : int
        How many postures one operation works on.
    fused : bool
        Whether the machine multiplies and adds in one operation, with one rounding.
    """

    lanes: int
    fused: bool

    @property
    def numbers(self) -> str:
        """Type of the numbers."""
        return "double" if self.lanes == 1 else f"<{self.lanes} x double>"

    @property
    def truths(self) -> str:
        """Type of the truth values."""
        return "i1" if self.lanes == 1 else f"<{self.lanes} x i1>"

    @property
    def integers(self) -> str:
        """Type of the integers as wide as numbers."""
        return "i64" if self.lanes == 1 else f"<{self.lanes} x i64>"

    @property
    def suffix(self) -> str:
        """How intrinsic functions of this width end."""
        return "f64" if self.lanes == 1 else f"v{self.lanes}f64"

    def constant(self, value: float) -> str:
        """Constant number in every lane."""
        bits = f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"
        return bits if self.lanes == 1 else f"<{', '.join([f'double {bits}'] * self.lanes)}>"

    def integer(self, value: int) -> str:
        """Constant integer in every lane."""
        return str(value) if self.lanes == 1 else f"<{', '.join([f'i64 {value}'] * self.lanes)}>"

    def truth(self, value: bool) -> str:
        """Constant truth value in every lane."""
        word = "true" if value else "false"
        return word if self.lanes == 1 else f"<{', '.join([f'i1 {word}'] * self.lanes)}>"


class Writer:
    """Lines of one function; every method writes one operation and returns its name."""

    def __init__(self, shape: Shape) -> None:
        """Begin with no lines."""
        self.shape = shape
        self.lines: list[str] = []

    def line(self, text: str) -> str:
        """Write an operation."""
        name = f"%t{len(self.lines)}"
        self.lines.append(f"  {name} = {text}")
        return name

    def number(self, value: float) -> str:
        """Write a constant."""
        return self.shape.constant(value)

    def add(self, a: str, b: str) -> str:
        """Write a + b."""
        return self.line(f"fadd {self.shape.numbers} {a}, {b}")

    def sub(self, a: str, b: str) -> str:
        """Write a - b."""
        return self.line(f"fsub {self.shape.numbers} {a}, {b}")

    def mul(self, a: str, b: str) -> str:
        """Write a b."""
        return self.line(f"fmul {self.shape.numbers} {a}, {b}")

    def neg(self, a: str) -> str:
        """Write -a."""
        return self.line(f"fneg {self.shape.numbers} {a}")

    def recip(self, a: str) -> str:
        """Write 1 / a."""
        return self.line(f"fdiv {self.shape.numbers} {self.number(1.0)}, {a}")

    def fma(self, a: str, b: str, c: str) -> str:
        """Write a b + c, rounded once where the machine can."""
        if not self.shape.fused:
            return self.add(self.mul(a, b), c)
        return self.intrinsic("fma", a, b, c)

    def fms(self, a: str, b: str, c: str) -> str:
        """Write a b - c."""
        if not self.shape.fused:
            return self.sub(self.mul(a, b), c)
        return self.intrinsic("fma", a, b, self.neg(c))

    def fnma(self, a: str, b: str, c: str) -> str:
        """Write c - a b."""
        if not self.shape.fused:
            return self.sub(c, self.mul(a, b))
        return self.intrinsic("fma", self.neg(a), b, c)

    def intrinsic(self, name: str, *values: str) -> str:
        """Write a call of one of ``INTRINSICS``."""
        t = self.shape.numbers
        given = ", ".join(f"{t} {v}" for v in values)
        return self.line(f"call {t} @llvm.{name}.{self.shape.suffix}({given})")

    def abs(self, a: str) -> str:
        """Write \\|a\\|."""
        return self.intrinsic("fabs", a)

    def sqrt(self, a: str) -> str:
        """Write the square root."""
        return self.intrinsic("sqrt", a)

    def less(self, a: str, b: str) -> str:
        """Write a < b; false where either is NaN."""
        return self.line(f"fcmp olt {self.shape.numbers} {a}, {b}")

    def select(self, holds: str, a: str, b: str) -> str:
        """Write a where ``holds``, else b: numbers."""
        t = self.shape
        return self.line(f"select {t.truths} {holds}, {t.numbers} {a}, {t.numbers} {b}")

    def choose(self, holds: str, a: str, b: str) -> str:
        """Write a where ``holds``, else b: truth values."""
        t = self.shape.truths
        return self.line(f"select {t} {holds}, {t} {a}, {t} {b}")

    def either(self, a: str, b: str) -> str:
        """Write a or b."""
        return self.line(f"or {self.shape.truths} {a}, {b}")

    def both(self, a: str, b: str) -> str:
        """Write a and b."""
        return self.line(f"and {self.shape.truths} {a}, {b}")

    def invert(self, a: str) -> str:
        """Write not a."""
        return self.line(f"xor {self.shape.truths} {a}, {self.shape.truth(True)}")

    def min(self, a: str, b: str) -> str:
        """Write the smaller; NaN where either is NaN, so that no bound hides one."""
        return self.nan_of(a, self.select(self.less(a, b), a, b))

    def max(self, a: str, b: str) -> str:
        """Write the larger; NaN where either is NaN."""
        return self.nan_of(a, self.select(self.less(b, a), a, b))

    def nan_of(self, a: str, otherwise: str) -> str:
        """Write a where it is NaN."""
        nan = self.line(f"fcmp uno {self.shape.numbers} {a}, {a}")
        return self.select(nan, a, otherwise)

    def within(self, a: str, bound: float) -> str:
        """Write a, or NaN unless \\|a\\| <= bound."""
        t = self.shape.numbers
        inside = self.line(f"fcmp ole {t} {self.abs(a)}, {self.number(bound)}")
        return self.select(inside, a, self.number(float("nan")))

    def bits(self, a: str) -> str:
        """Write the bits of a as an integer."""
        return self.line(f"bitcast {self.shape.numbers} {a} to {self.shape.integers}")

    def odd(self, bits: str, then: str, otherwise: str) -> str:
        """Write ``then`` where the lowest bit of ``bits`` is set, else ``otherwise``."""
        t = self.shape
        low = self.line(f"and {t.integers} {self.bits(bits)}, {t.integer(1)}")
        set_ = self.line(f"icmp ne {t.integers} {low}, {t.integer(0)}")
        return self.select(set_, then, otherwise)

    def signed(self, a: str, bits: str, offset: int) -> str:
        """Write a, negated where the second lowest bit of bits + offset is set."""
        t = self.shape
        moved = self.line(f"add {t.integers} {self.bits(bits)}, {t.integer(offset)}")
        second = self.line(f"and {t.integers} {moved}, {t.integer(2)}")
        sign = self.line(f"shl {t.integers} {second}, {t.integer(62)}")
        flipped = self.line(f"xor {t.integers} {self.bits(a)}, {sign}")
        return self.line(f"bitcast {t.integers} {flipped} to {t.numbers}")

    def address(self, pointer: str, row: int) -> str:
        """Write the address of a row."""
        return self.line(f"getelementptr double, ptr {pointer}, i64 {row * self.shape.lanes}")

    def load(self, pointer: str, row: int) -> str:
        """Read a row."""
        t = self.shape
        place = self.address(pointer, row)
        return self.line(f"load {t.numbers}, ptr {place}, align {8 * t.lanes}")

    def store(self, value: str, pointer: str, row: int) -> None:
        """Write a row."""
        t = self.shape
        place = self.address(pointer, row)
        self.lines.append(f"  store {t.numbers} {value}, ptr {place}, align {8 * t.lanes}")

    def as_number(self, truth: str) -> str:
        """Write 1 where a truth value holds, else 0."""
        return self.select(truth, self.number(1.0), self.number(0.0))

    def as_truth(self, number: str) -> str:
        """Write whether a number is not 0."""
        return self.line(f"fcmp une {self.shape.numbers} {number}, {self.number(0.0)}")


def declarations(shape: Shape) -> list[str]:
    """Declare the intrinsic functions of a width."""
    t = shape.numbers
    return [
        f"declare {t} @llvm.{name}.{shape.suffix}({', '.join([t] * (3 if name == 'fma' else 1))})"
        for name in INTRINSICS
    ]
