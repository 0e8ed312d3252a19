"""Factors of elements, and their content: what all entries of a vector have in common.

Elements of the ring have no unique factors (1 - c^2 is both s s and (1 - c)(1 + c)), so that the
polynomials are factored in several normal forms, and that with most factors is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from closedchain.analysis.symbolic.ring import Element, Ring

if TYPE_CHECKING:
    from sympy.polys.rings import PolyRing

_MANY, _LONG = 12, 30
"""Beyond as many generators and terms sympy's dense factoring takes minutes: only generators that
are common to all terms are taken out then."""

Factored = tuple[Element, list[tuple[Element, int]]]
"""A number, and factors with their exponents."""


def factored(ring: Ring, element: Element) -> Factored:
    """Number and factors of a nonzero element; their product is the element, exactly."""
    best = _compact(element)
    flipped: frozenset[int] = frozenset()
    improved = True
    while improved:
        improved = False
        for i in _squares(ring, element, flipped):
            trial = flipped ^ {i}
            found = _compact(ring.reduce(element, trial))
            if _merit(found) > _merit(best):
                best, flipped, improved = found, trial, True
    # factors may fall apart further in forms of their own
    number, parts = best
    out: list[tuple[Element, int]] = []
    for part, power in parts:
        for i in range(len(ring.angles)):
            other = _compact(ring.reduce(part, frozenset({i})))
            if len(other[1]) > 1 or (other[1] and other[1][0][1] > 1):
                number *= other[0] ** power
                out += [(p, e * power) for p, e in other[1]]
                break
        else:
            out.append((part, power))
    merged: dict[Element, int] = {}
    for part, power in out:
        part = ring.reduce(part)
        merged[part] = merged.get(part, 0) + power
    check = ring.R(number)
    for part, power in merged.items():
        for _ in range(power):
            check = ring.mul(check, part)
    assert not ring.reduce(check - element)
    return number, list(merged.items())


def primitive(ring: Ring, vector: Sequence[Element]) -> tuple[Element, list[Element]]:
    """Common factor of the entries, and the vector without it."""
    content, rest = ring.one, list(vector)
    if not any(rest):
        return ring.zero, rest
    forms = [frozenset[int](), frozenset(range(len(ring.angles)))]
    forms += [frozenset({i}) for i in range(len(ring.angles))]
    for form in forms:
        shown = [ring.reduce(x, form) for x in rest]
        common = _common(shown)
        if common and not _constant(common):
            rest = [ring.reduce(x.exquo(common)) if x else x for x in shown]
            content = ring.mul(content, ring.reduce(common))
    number = rest[[bool(x) for x in rest].index(True)].content()
    for x in rest:
        if x:
            number = ring.R.domain.gcd(number, x.content())
    return content * number, [x.quo_ground(number) if x else x for x in rest]


def _common(elements: Sequence[Element]) -> Element:
    """Greatest common divisor, over the generators that occur only; numbers are no factors."""
    from sympy.polys.rings import PolyRing

    present = [x for x in elements if x]
    ring = present[0].ring
    if any(_constant(x) for x in present):
        return ring.one
    used = [i for i in range(ring.ngens) if all(any(mono[i] for mono in x) for x in present)]
    if not used:
        return ring.one
    occur = [i for i in range(ring.ngens) if any(mono[i] for x in present for mono in x)]
    small = PolyRing([ring.symbols[i] for i in occur], ring.domain)
    common = small.zero
    for x in sorted(present, key=len):
        there = _narrowed(small, occur, x)
        common = common.gcd(there) if common else there
        if _constant(common):
            return ring.one
    if common.LC < 0:
        common = -common
    return _widened(ring, occur, common)


def _narrowed(small: PolyRing, kept: Sequence[int], element: Element) -> Element:
    """A polynomial in a ring of those generators alone that occur in it."""
    return small.from_dict({tuple(m[i] for i in kept): c for m, c in element.items()})


def _widened(ring: PolyRing, kept: Sequence[int], element: Element) -> Element:
    """The other way round: a polynomial in all generators of a ring again."""
    out = {}
    for mono, coeff in element.items():
        full = [0] * ring.ngens
        for i, power in zip(kept, mono, strict=True):
            full[i] = power
        out[tuple(full)] = coeff
    return ring.from_dict(out)


def _compact(element: Element) -> Factored:
    """Factor over the generators that occur only."""
    from sympy.polys.rings import PolyRing

    ring = element.ring
    used = [i for i in range(ring.ngens) if any(mono[i] for mono in element)]
    if not used:
        return element.LC if element else ring.domain.zero, []
    small = PolyRing([ring.symbols[i] for i in used], ring.domain)
    there = _narrowed(small, used, element)
    if len(used) > _MANY and len(element) > _LONG:
        number, parts = _monomial(there)
    else:
        number, parts = there.factor_list()
    return number, [(_widened(ring, used, part), power) for part, power in parts]


def _monomial(element: Element) -> Factored:
    """Number and generators that every term has, and the rest as it is."""
    number, rest = element.primitive()
    least = [min(mono[i] for mono in rest) for i in range(rest.ring.ngens)]
    parts = [(rest.ring.gens[i], power) for i, power in enumerate(least) if power]
    for generator, power in parts:
        rest = rest.exquo(generator**power)
    return number, [*parts, (rest, 1)]


def _squares(ring: Ring, element: Element, flipped: frozenset[int]) -> list[int]:
    """Angles whose cosine (sine, if flipped) is squared somewhere."""
    shown = ring.reduce(element, flipped)
    n = len(ring.angles)
    return [i for i in range(n) if any(mono[i if i in flipped else n + i] >= 2 for mono in shown)]


def _merit(found: Factored) -> tuple[int, int]:
    return sum(power for _, power in found[1]), -sum(len(part) for part, _ in found[1])


def _constant(element: Element) -> bool:
    return all(not any(mono) for mono in element)
