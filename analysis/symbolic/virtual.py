"""The free platform's virtual chain 3P3R: its determinant says nothing of the robot."""

from __future__ import annotations

from fractions import Fraction

from closedchain.analysis.symbolic.chain import AXES
from closedchain.analysis.symbolic.express import Meaning, Symbols
from closedchain.analysis.symbolic.factors import factored
from closedchain.analysis.symbolic.results import Factor, SymbolicDeterminant
from closedchain.analysis.symbolic.ring import Angle, Ring
from closedchain.analysis.symbolic.walk import Slide, Step, Turn, angles_of, walk


def virtual_chain() -> SymbolicDeterminant:
    """Determinant of the screws px py pz rx ry rz, rows (angular; linear)."""
    slides, turns = ("p_x", "p_y", "p_z"), ("f_x", "f_y", "f_z")
    steps: list[Step] = [Slide(n, axis, 1) for n, axis in zip(slides, AXES, strict=True)]
    steps += [
        Turn(n, axis, Angle({n: Fraction(1)}), 1) for n, axis in zip(turns, AXES, strict=True)
    ]
    ring = Ring(slides, angles_of(steps, {}))
    screws = walk(steps, ring, {}).screws
    columns = [screws[n] for n in (*slides, *turns)]
    number, parts = factored(ring, ring.det([list(row) for row in zip(*columns, strict=True)]))
    own = {n: n for n in (*slides, *turns)}
    symbols = Symbols({}, {n: Meaning(n, "", n) for n in own}, own, {})
    meaning = "representation only: gimbal lock of the angles that write the platform's pose"
    factors = tuple(
        Factor(symbols.short(ring, part), power, "representation", meaning) for part, power in parts
    )
    expr = int(number)
    for f in factors:
        expr *= f.expr**f.exponent
    return SymbolicDeterminant(expr, factors, "")
