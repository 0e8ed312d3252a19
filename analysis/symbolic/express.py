"""Symbols for joints and parameters, and elements as sympy expressions in few words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from closedchain.analysis.symbolic.exact import RADICALS
from closedchain.analysis.symbolic.ring import PI, Angle, Element, Ring
from closedchain.urdf.errors import ClosureError

Expr = Any
"""sympy expression."""

_LARGE = 40  # terms beyond which products of cosines are left as they are
_TAKEN = ("sin", "cos", "tan", "sqrt", "pi")  # words of formulas, no names of symbols


@dataclass(frozen=True)
class Meaning:
    """What a symbol stands for: ``name`` of the joint or parameter, its unit, in words."""

    name: str
    unit: str
    text: str


class Symbols:
    """sympy symbols of parameters and coordinates.

    An input has its own name, a parameter too. A joint ``leg_kind`` such as ``a_R`` is ``q_ra``,
    the hinge ``a_S.y`` of a spherical joint ``q_ya``, any other joint ``q_`` and its name.
    ``names`` overrides this by the joint's name.
    """

    def __init__(
        self,
        parameters: Mapping[str, Meaning],
        coordinates: Mapping[str, Meaning],
        inputs: Mapping[str, str],
        names: Mapping[str, str],
    ) -> None:
        import sympy

        for name in names:
            if name not in coordinates and name not in parameters:
                known = ", ".join([*parameters, *coordinates])
                raise ClosureError(f"names: no joint or parameter {name!r}; known: {known}")
        for name, text in names.items():
            if not text.isidentifier() or text in _TAKEN:
                raise ClosureError(
                    f"names: {text!r} is no symbol for {name!r}: letters, digits and _ make one, a "
                    f"letter first, other than {', '.join(_TAKEN)}"
                )
        chosen: dict[str, str] = {p: names.get(p, p) for p in parameters}
        for name in coordinates:
            wanted = names.get(name, inputs.get(name, _short(name)))
            if name not in names and wanted in chosen.values():
                wanted = "q_" + re.sub(r"\W", "_", name)
            chosen[name] = wanted
        if len(set(chosen.values())) < len(chosen):
            raise ClosureError("names: two joints or parameters have one symbol")
        self.of = {name: sympy.Symbol(text, real=True) for name, text in chosen.items()}
        self.known = {**parameters, **coordinates}

    def legend(self, used: set[Expr]) -> dict[Expr, Meaning]:
        """Meaning of the symbols that are used."""
        out: dict[Expr, Meaning] = {}
        for name, symbol in self.of.items():
            if symbol in used:
                out[symbol] = self.known[name]
        return out

    def angle(self, angle: Angle) -> Expr:
        """Sum of joint angles."""
        import sympy

        total = sympy.Integer(0)
        for name, factor in angle.terms:
            rational = sympy.Rational(factor.numerator, factor.denominator)
            base = sympy.pi if name == PI else sympy.Integer(1) if name == "1" else self.of[name]
            total += rational * base
        return total

    def expression(self, ring: Ring, element: Element) -> Expr:
        """Expression of an element, as it stands."""
        import sympy

        angles = [self.angle(a) for a in ring.angles]
        known = [sympy.sin(a) for a in angles] + [sympy.cos(a) for a in angles]
        known += [sympy.sqrt(r) for r in RADICALS] + [self.of[v] for v in ring.variables]
        total = []
        for mono, coeff in element.items():
            term = sympy.Rational(int(coeff.numerator), int(coeff.denominator))
            for base, power in zip(known, mono, strict=True):
                if power:
                    term *= base**power
            total.append(term)
        return sympy.Add(*total)

    def short(self, ring: Ring, element: Element) -> Expr:
        """Expression with products of cosines as cosines of sums, where that is shorter."""
        import sympy
        from sympy.simplify.fu import TR8

        plain = self.expression(ring, element)
        if len(element) > _LARGE or len(element) < 2:
            return plain
        return min((plain, sympy.expand(TR8(plain))), key=sympy.count_ops)


def _short(name: str) -> str:
    stem, _, kind = name.rpartition("_")
    if not stem or not re.fullmatch(r"[A-Za-z]+\d*|\d+", stem):
        return "q_" + re.sub(r"\W", "_", name)
    number = re.fullmatch(r"[A-Za-z]{2,}(\d+)", stem)
    kind = kind.rpartition(".")[2].lower()
    return f"q_{kind}{number[1] if number else stem}"
