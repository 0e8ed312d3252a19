"""Ring elements turned into factors with roles and meanings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction

from closedchain.analysis.screws.drives import drives_of
from closedchain.analysis.symbolic.chain import Chains
from closedchain.analysis.symbolic.express import Expr, Symbols
from closedchain.analysis.symbolic.factors import factored
from closedchain.analysis.symbolic.legforms import LegForms
from closedchain.analysis.symbolic.platform import PlatformForms, determinant, rows_rank
from closedchain.analysis.symbolic.results import (
    Factor,
    Role,
    SymbolicDeterminant,
    SymbolicLeg,
)
from closedchain.analysis.symbolic.resum import on_closed, resummed
from closedchain.analysis.symbolic.ring import Element, Ring, TooLarge, convert
from closedchain.analysis.symbolic.spaces import Point
from closedchain.analysis.symbolic.zeros import (
    coordinates_in,
    dependent_meaning,
    lever_meaning,
    loses_constraint,
    zero,
)
from closedchain.closure.mechanism import Mechanism

WRITTEN_OUT = 250
"""Terms up to which a determinant of all legs is written out and factored."""

_NO_JOINTS = "depends on sizes only"
_HINGES = "representation only: hinges that stand for a spherical joint align (gimbal lock)"
_PASSIVE = "the leg's passive joints can move with its inputs and both of its ends at rest"
_CONSTRAINT = "the legs' constraints are dependent: the mechanism itself gains freedom or branches"
_OUTPUT = "what the constraints permit leaves some output at rest"


class Context:
    """What turns ring elements into factors with roles."""

    def __init__(
        self,
        mechanism: Mechanism,
        chains: Chains,
        symbols: Symbols,
        at: Point,
        parameters: tuple[str, ...],
    ) -> None:
        self.mechanism, self.chains, self.symbols = mechanism, chains, symbols
        self.at, self.parameters = at, parameters
        self.drives = drives_of(mechanism, mechanism.home)
        self.relations: list[Expr] = []

    def input_of(self, joint: str) -> str:
        """Input that drives a joint, through couplings too."""
        (number,) = self.drives[joint]
        return self.mechanism.inputs[number]

    # -- one leg ---------------------------------------------------------------------------------

    def leg(self, form: LegForms, together: PlatformForms) -> SymbolicLeg:
        """Determinant, levers and their meaning."""
        bodies = self.chains.graph.bodies
        ring = form.ring
        lever_parts: dict[str, list[tuple[Element, int]]] = {}
        levers: dict[str, Expr] = {}
        lever_factors: dict[str, tuple[Factor, ...]] = {}
        for drive in form.driving:
            for joint, lever in drive.levers.items():
                number, parts = factored(ring, lever)
                name = self.input_of(joint)
                lever_parts[name] = parts
                out = []
                for part, power in parts:
                    role: Role = "inverse" if self._joints(ring, part) else "scale"
                    meaning = _NO_JOINTS
                    if role == "inverse":
                        there = zero(ring, part, self.at, self.parameters)
                        meaning = (
                            lever_meaning(form, drive, joint, there, name)
                            if there is not None
                            else f"the leg's force does no work on {name}"
                        )
                        if not self._shared(ring, part, drive.levers.values()):
                            role, meaning = "lever", f"{meaning}; the leg has other inputs"
                    out.append(Factor(self.symbols.short(ring, part), power, role, meaning))
                levers[name], lever_factors[name] = product(number, out)
        determinant_, factors, reason = self._leg_determinant(form, lever_parts, lever_factors)
        force = {
            self.input_of(joint): self._force(together, drive.levers)
            for drive in form.driving
            for joint in drive.levers
        }
        return SymbolicLeg(
            start=bodies[form.chain.start].name,
            end=bodies[form.chain.end].name,
            joints=form.columns,
            inputs=tuple(self.input_of(j) for j in form.inputs),
            determinant=determinant_,
            factors=factors,
            levers=levers,
            lever_factors=lever_factors,
            force=force,
            reason=reason,
        )

    @staticmethod
    def _shared(ring: Ring, part: Element, levers: Iterable[Element]) -> bool:
        """Whether a factor is in all levers of a wrench."""
        found = [[p for p, _ in factored(ring, lever)[1]] for lever in levers]
        return all(part in parts or -part in parts for parts in found)

    def _leg_determinant(
        self,
        form: LegForms,
        lever_parts: Mapping[str, list[tuple[Element, int]]],
        lever_factors: Mapping[str, tuple[Factor, ...]],
    ) -> tuple[Expr | None, tuple[Factor, ...], str]:
        ring = form.ring
        if form.matrix is None:
            freedoms = len(form.columns)
            return None, (), f"no square matrix: its {freedoms} screws span no fixed subspace"
        value = ring.det(form.matrix)
        if not value:
            return None, (), "its screws are dependent at every posture"
        known = {
            part: f.meaning
            for name, parts in lever_parts.items()
            for (part, _), f in zip(parts, lever_factors[name], strict=True)
            if f.role == "inverse"
        }
        number, parts = factored(ring, value)
        out = []
        for part, power in parts:
            joints = self._joints(ring, part)
            role: Role = "passive"
            meaning = _PASSIVE
            if not joints:
                role, meaning = "scale", _NO_JOINTS
            elif set(joints) <= set(form.hinges):
                role, meaning = "representation", _HINGES
            elif part in known or -part in known:
                role, meaning = "inverse", known.get(part, known.get(-part, ""))
            out.append(Factor(self.symbols.short(ring, part), power, role, meaning))
        expr, factors = product(number, out)
        return expr, factors, ""

    def _force(self, together: PlatformForms, levers: Mapping[str, Element]) -> Expr:
        import sympy

        row = together.owners.index(tuple(levers))
        ring, wrench = together.ring, together.wrenches[row]
        return sympy.ImmutableMatrix([self.symbols.short(ring, x) for x in wrench[:3]])

    # -- all legs --------------------------------------------------------------------------------

    def jq(self, forms: PlatformForms) -> Expr:
        """Levers as a matrix, rows of driving wrenches, columns of inputs."""
        import sympy

        inputs = self.mechanism.inputs
        rows = []
        for levers in forms.levers:
            row = [sympy.Integer(0)] * len(inputs)
            for joint, lever in levers.items():
                ((number, ratio),) = self.drives[joint].items()
                row[number] += sympy.nsimplify(ratio) * self._factored(forms.ring, lever)
            rows.append(row)
        return sympy.ImmutableMatrix(rows) if rows else sympy.ImmutableMatrix(0, len(inputs), [])

    def jx(self, forms: PlatformForms) -> Expr:
        """Driving wrenches at the base's origin."""
        import sympy

        rows = [[self.symbols.short(forms.ring, x) for x in w] for w in forms.wrenches]
        return sympy.ImmutableMatrix(rows) if rows else None

    def det_jq(self, forms: PlatformForms, legs: tuple[SymbolicLeg, ...]) -> SymbolicDeterminant:
        """Product of the levers where each input has its own wrench."""
        import sympy

        single = all(len(o) == 1 for o in forms.owners)
        own = [self.input_of(j) for o in forms.owners for j in o]
        if not single or sorted(own) != sorted(self.mechanism.inputs):
            return SymbolicDeterminant(None, (), "Jq is not diagonal: inputs share wrenches")
        order = [own.index(n) for n in self.mechanism.inputs]
        expr: Expr = sympy.Integer(_parity(order))
        factors: list[Factor] = []
        for leg in legs:
            for name, lever in leg.levers.items():
                expr *= lever
                factors += leg.lever_factors[name]
        return SymbolicDeterminant(expr, tuple(factors), "")

    def determinants(self, forms: PlatformForms) -> tuple[SymbolicDeterminant, SymbolicDeterminant]:
        """det Jx and that of the outputs, without what both owe to the choice of constraints."""
        try:
            direct, why = determinant(forms, forms.driving, self.at)
            output, why_out = determinant(forms, forms.outputs, self.at)
        except TooLarge as error:
            nothing = SymbolicDeterminant(None, (), str(error))
            return nothing, nothing
        if direct is not None and len(direct) > WRITTEN_OUT:
            why = f"{len(direct)} terms: not written out or factored; the rows of Jx tell it"
            direct = None
        for_jx = self._platform(forms, direct, why, output, "direct")
        return for_jx, self._platform(forms, output, why_out, output, "inverse")

    def _platform(
        self,
        forms: PlatformForms,
        value: Element | None,
        why: str,
        shared: Element | None,
        role: Role,
    ) -> SymbolicDeterminant:
        if value is None or not value:
            return SymbolicDeterminant(None, (), why or "it is zero at every posture")
        ring, value = resummed(forms.ring, value)
        relations = [convert(r, forms.ring, ring) for r in forms.relations]
        number, parts = factored(ring, value)
        common = self._forced(forms, shared)
        out: list[Factor] = []
        for part, power in parts:
            if not self._joints(ring, part):
                out.append(Factor(self.symbols.short(ring, part), power, "scale", _NO_JOINTS))
                continue
            if (kind := common.get(self.symbols.short(ring, part))) is not None:
                if kind == "constraint":
                    expr = self.symbols.short(ring, part)
                    out.append(Factor(expr, power, "constraint", _CONSTRAINT))
                continue
            divisor, (scale, pieces), used = on_closed(ring, part, relations)
            if used is not None:
                expr = self.symbols.expression(ring, divisor)
                out.append(Factor(1 / expr, power, "scale", _NO_JOINTS))
                self.relations.append(self.symbols.expression(ring, used[1]))
            number *= scale**power
            for piece, exponent in pieces:
                out.append(self._piece(forms, ring, piece, exponent * power, role, used))
        expr, factors = product(number, _merged(out))
        return SymbolicDeterminant(expr, factors, "")

    def _piece(
        self,
        forms: PlatformForms,
        ring: Ring,
        piece: Element,
        power: int,
        role: Role,
        used: tuple[int, Element] | None,
    ) -> Factor:
        expr = self.symbols.short(ring, piece)
        if not self._joints(ring, piece):
            return Factor(expr, power, "scale", _NO_JOINTS)
        meaning = _OUTPUT if role == "inverse" else "the forces of the driven legs are dependent"
        relation = None
        if used is not None:
            angle = ring.angles[used[0] % len(ring.angles)]
            relation = used[1], [k for k, _ in angle.terms if k in self.at]
        there = zero(ring, piece, self.at, self.parameters, relation)
        if there is not None and role == "direct":
            names = [" and ".join(self.input_of(j) for j in o) for o in forms.owners]
            meaning = dependent_meaning(forms, there, names)
        return Factor(expr, power, role, meaning)

    def _forced(self, forms: PlatformForms, shared: Element | None) -> dict[Expr, str]:
        """Factors that come with the constraints: true losses of rank, and accidents of choice."""
        out: dict[Expr, str] = {}
        if shared is None or not shared:
            return out
        ring, value = resummed(forms.ring, shared)
        for part, _ in factored(ring, value)[1]:
            if not self._joints(ring, part):
                continue
            there = zero(ring, part, self.at, self.parameters)
            if there is None:
                continue
            expr = self.symbols.short(ring, part)
            if loses_constraint(forms, self.at, there):
                out[expr] = "constraint"
            elif not _loses_output(forms, self.at, there):
                out[expr] = "choice"
        return out

    def _joints(self, ring: Ring, element: Element) -> list[str]:
        return coordinates_in(ring, element, self.parameters)

    def _factored(self, ring: Ring, element: Element) -> Expr:
        number, parts = factored(ring, element)
        named = [Factor(self.symbols.short(ring, p), e, "scale", "") for p, e in parts]
        return product(number, named)[0]


def product(number: object, factors: list[Factor]) -> tuple[Expr, tuple[Factor, ...]]:
    """Expression of a factored element; minus signs are gathered where they read best."""
    import sympy

    value = Fraction(str(number.LC if hasattr(number, "LC") else number))
    tidy = []
    for f in factors:
        terms = f.expr.as_ordered_terms()
        if all(term.could_extract_minus_sign() for term in terms):
            value *= (-1) ** f.exponent
            f = replace(f, expr=-f.expr)
        tidy.append(f)
    for i, f in enumerate(tidy):
        bright = any(t.could_extract_minus_sign() for t in f.expr.as_ordered_terms())
        if value < 0 and f.expr.is_Add and bright and f.exponent % 2:
            tidy[i], value = replace(f, expr=-f.expr), -value
    expr: Expr = sympy.Rational(value.numerator, value.denominator)
    for f in tidy:
        expr *= f.expr**f.exponent
    return expr, tuple(tidy)


def _loses_output(forms: PlatformForms, generic: Point, there: Point) -> bool:
    rows = [*forms.constraints, *forms.outputs]
    return rows_rank(forms, rows, there) < rows_rank(forms, rows, generic)


def _merged(factors: list[Factor]) -> list[Factor]:
    out: dict[Expr, Factor] = {}
    for f in factors:
        old = out.get(f.expr)
        out[f.expr] = (
            f if old is None else Factor(f.expr, old.exponent + f.exponent, f.role, f.meaning)
        )
    return list(out.values())


def _parity(order: list[int]) -> int:
    swaps = sum(a > b for i, a in enumerate(order) for b in order[i + 1 :])
    return -1 if swaps % 2 else 1


def input_names(mechanism: Mechanism) -> dict[str, str]:
    """Input by driven joint."""
    return {spec.joint: spec.name for spec in mechanism.description.inputs}
