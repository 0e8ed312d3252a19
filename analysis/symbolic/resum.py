"""Fewer cosines by other angles, and by what closed loops say."""

from __future__ import annotations

from itertools import permutations

from closedchain.analysis.symbolic.factors import Factored, factored
from closedchain.analysis.symbolic.ring import Element, Ring, convert, upright

_TRIED = 400  # terms beyond which sums of angles are not tried


def used_angles(ring: Ring, element: Element) -> list[int]:
    """Numbers of the angles that occur."""
    n = len(ring.angles)
    return [i for i in range(n) if any(mono[i] or mono[n + i] for mono in element)]


def resummed(ring: Ring, element: Element) -> tuple[Ring, Element]:
    """The element in sums and differences of its angles, where that has fewer terms."""
    if not 1 < len(element) <= _TRIED:
        return ring, element
    while True:
        best: tuple[Ring, Element] | None = None
        for i, j in permutations(used_angles(ring, element), 2):
            for sign in (1, -1):
                there, found = _replaced(ring, element, i, j, sign)
                if len(found) < len(best[1] if best else element):
                    best = there, found
        if best is None:
            return ring, element
        ring, element = best


def _replaced(ring: Ring, element: Element, i: int, j: int, sign: int) -> tuple[Ring, Element]:
    """Angle i written as (i + sign j) - sign j."""
    total, turned = upright(ring.angles[i] + ring.angles[j] * sign)
    if not total.terms:
        return ring, element
    angles = [*ring.angles, *([total] if total not in ring.angles else [])]
    to = Ring(ring.variables, angles)
    inside = convert(element, ring, to)
    n, k = len(angles), to.angles.index(total)
    c, s = to.cosines[k], to.sines[k] * turned
    cj, sj = to.cosines[j], to.sines[j] * sign
    cosine, sine = c * cj + s * sj, s * cj - c * sj
    out = to.zero
    for mono, coeff in inside.items():
        rest = list(mono)
        powers = rest[i], rest[n + i]
        rest[i] = rest[n + i] = 0
        term = to.R.from_dict({tuple(rest): coeff})
        for base, power in zip((sine, cosine), powers, strict=True):
            for _ in range(power):
                term = to.mul(term, base)
        out += term
    return to, to.reduce(out)


def on_closed(
    ring: Ring, element: Element, relations: list[Element]
) -> tuple[Element, Factored, tuple[int, Element] | None]:
    """Factors of an element that relations, zero on closed postures, let fall apart further.

    Returns a divisor k, the factors of k times the element on closed postures, and the generator
    and relation used; 1, the factors as they are and None where no relation helps.
    """
    plain = factored(ring, element)
    if len(element) == 1:
        return ring.one, plain, None
    n = len(ring.angles)
    for relation in relations:
        terms = [ring.R.from_dict({m: c}) for m, c in relation.items()]
        for one, two in (terms, terms[::-1]):
            (mono,) = one
            for g in [x for x in range(2 * n) if mono[x] == 1]:
                if any(mono[x] for x in range(2 * n) if x != g):
                    continue
                gen = ring.R.gens[g]
                k = one.exquo(gen)
                if any(m[g] > 1 for m in element) or not any(m[g] for m in element):
                    continue
                with_g = ring.R.from_dict({m: c for m, c in element.items() if m[g]}).exquo(gen)
                rest = ring.R.from_dict({m: c for m, c in element.items() if not m[g]})
                new = ring.mul(k, rest) - ring.mul(two, with_g)
                if not new:
                    continue
                found = factored(ring, new)
                if sum(e for p, e in found[1] if used_angles(ring, p)) > sum(
                    e for p, e in plain[1] if used_angles(ring, p)
                ):
                    return k, found, (g, relation)
    return ring.one, plain, None
