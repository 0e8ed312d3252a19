"""Closed forms of singularities: leg-screw determinants, Jq and det Jx, factored, from the URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from closedchain.analysis.screws.drives import Drive, check_couplings, couplings_of, drives_of
from closedchain.analysis.screws.leg_graph import LegChain
from closedchain.analysis.screws.legs import leg_structure
from closedchain.analysis.structure.loops import LoopGraph
from closedchain.analysis.symbolic.chain import Chains
from closedchain.analysis.symbolic.context import Context, input_names
from closedchain.analysis.symbolic.coordinates import Coordinates, point_values, sample, ties
from closedchain.analysis.symbolic.express import Expr, Meaning, Symbols
from closedchain.analysis.symbolic.legforms import leg_forms
from closedchain.analysis.symbolic.parameters import Sizes, sizes
from closedchain.analysis.symbolic.platform import (
    check_decoupled,
    platform_forms,
)
from closedchain.analysis.symbolic.results import (
    SymbolicDeterminant,
    SymbolicLeg,
    SymbolicSingularities,
)
from closedchain.analysis.symbolic.ring import Angle, TooLarge
from closedchain.analysis.symbolic.text import report
from closedchain.analysis.symbolic.virtual import virtual_chain
from closedchain.closure.joint_kinds import BY_SYMBOL
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError

_WRITTEN = ("R", "P", "U", "S", "C", "E")
"""Symbols of the pairs that the symbolic walk knows."""


def derive(mechanism: Mechanism, names: Mapping[str, str] | None) -> SymbolicSingularities:
    """What ``symbolic_singularities`` gives."""
    task = mechanism.required_task()
    graph, found, columns = leg_structure(mechanism)
    drives = drives_of(mechanism, mechanism.home)
    check_couplings(mechanism, graph, found.legs, drives)
    _refuse_unwritten(mechanism, graph, drives)
    check_decoupled(graph, found)
    size = sizes(mechanism.description)
    reading = Coordinates(mechanism, _reversed(graph, found.legs))
    postures = sample(mechanism, len([n for c in columns for n in c]) + 12)
    if not postures:
        raise ClosureError(f"{mechanism.name}: no closed posture found near home")
    tied = ties(mechanism, reading, postures)
    chains = Chains(mechanism.description, graph, size, tied)
    at = point_values(reading, postures[0], size.values)
    try:
        forms = [leg_forms(chains, leg, drives, at, mechanism.length) for leg in found.legs]
        together = platform_forms(chains, found, forms, task, mechanism.outputs())
    except TooLarge as error:
        raise ClosureError(f"{mechanism.name}: {error}; ask cc.singularity_set") from None
    symbols = Symbols(
        _sizes_meaning(size),
        _meanings(mechanism, columns, graph),
        input_names(mechanism),
        names or {},
    )
    context = Context(mechanism, chains, symbols, at, tuple(size.values))
    legs = tuple(context.leg(form, together) for form in forms)
    det_jx, det_out = context.determinants(together)
    parts = _Parts(
        legs=legs,
        Jq=context.jq(together),
        Jx=context.jx(together) if len(found.platforms) == 1 else None,
        rows=tuple(" ".join(context.input_of(j) for j in o) for o in together.owners),
        det_Jq=context.det_jq(together, legs),
        det_Jx=det_jx,
        det_output=det_out,
        chain=virtual_chain() if len(mechanism.outputs()) == 6 else None,
    )
    return _result(
        mechanism, parts, symbols, size.notes, tied, reading, context.relations, dict(size.values)
    )


def _refuse_unwritten(mechanism: Mechanism, graph: LoopGraph, drives: Mapping[str, Drive]) -> None:
    """Refuse cut joints and couplings that the symbolic walk does not write out."""
    for pair in graph.pairs:
        if pair.symbol not in _WRITTEN:
            raise ClosureError(
                f"{mechanism.name} has no closed forms: the closure {pair.name!r} is of kind "
                f"{BY_SYMBOL[pair.symbol].name}, which is not written out in symbols; ask "
                "cc.singularity_set"
            )
    for tie in couplings_of(mechanism):
        if any(len(part.coefficients) > 2 for part in tie.joints):
            raise ClosureError(
                f"{mechanism.name} has no closed forms: {tie.describe()} has a ratio that changes "
                "with the posture; ask cc.singularity_set"
            )
    for joint, drive in drives.items():
        if len(drive) > 1:
            names = " and ".join(mechanism.inputs[number] for number in sorted(drive))
            raise ClosureError(
                f"{mechanism.name} has no closed forms: the joint {joint!r} is moved by the inputs "
                f"{names} together; ask cc.singularity_set"
            )


@dataclass(frozen=True, eq=False)
class _Parts:
    legs: tuple[SymbolicLeg, ...]
    Jq: Expr
    Jx: Expr | None
    rows: tuple[str, ...]
    det_Jq: SymbolicDeterminant
    det_Jx: SymbolicDeterminant
    det_output: SymbolicDeterminant
    chain: SymbolicDeterminant | None


def _reversed(graph: LoopGraph, legs: Sequence[LegChain]) -> frozenset[str]:
    """Spherical closures that a leg passes from child to parent."""
    return frozenset(
        graph.pairs[e.pairs[0]].name
        for leg in legs
        for e, sign in zip(leg.elements, leg.signs, strict=True)
        if sign < 0 and not e.composite and graph.pairs[e.pairs[0]].symbol == "S"
    )


def _sizes_meaning(found: Sizes) -> dict[str, Meaning]:
    """What each parameter is: an angle where an origin is turned by it."""
    turned = {n for (_, what, _), x in found.laws.items() if what.endswith("rpy") for n in x.slopes}
    return {
        name: Meaning(name, "rad" if name in turned else "m", f"parameter {name} = {value:g}")
        for name, value in found.values.items()
    }


def _meanings(
    mechanism: Mechanism, columns: Sequence[Sequence[str]], graph: LoopGraph
) -> dict[str, Meaning]:
    """What each coordinate is."""
    joints = {j.name: j for j in mechanism.description.joints}
    inputs = input_names(mechanism)
    out: dict[str, Meaning] = {}
    for pair, names in zip(graph.pairs, columns, strict=True):
        for k, name in enumerate(names):
            if name in joints:
                slide = joints[name].type == "prismatic"
                driven = f", input {inputs[name]}" if name in inputs else ""
                text = f"{'slide' if slide else 'angle'} of joint {name}{driven}"
            elif pair.symbol == "S":
                slide = False
                text = f"hinge {name[-1]} of three that stand for the spherical joint {pair.name}"
            else:
                slide = pair.symbol == "P" or (pair.symbol, k) in {("C", 1), ("E", 0), ("E", 1)}
                text = f"{'slide' if slide else 'angle'} of the cut joint {pair.name}"
            out[name] = Meaning(name, "m" if slide else "rad", text)
    return out


def _result(
    mechanism: Mechanism,
    parts: _Parts,
    symbols: Symbols,
    notes: tuple[str, ...],
    tied: Mapping[str, Angle],
    reading: Coordinates,
    relations: list[Expr],
    parameters: Mapping[str, float],
) -> SymbolicSingularities:
    import sympy

    expressions = [leg.determinant for leg in parts.legs if leg.determinant is not None]
    expressions += [x for leg in parts.legs for x in leg.levers.values()]
    expressions += [parts.Jq, *([parts.Jx] if parts.Jx is not None else [])]
    for found in (parts.det_Jx, parts.det_output):
        if found.expr is not None:
            expressions.append(found.expr)
    used = set().union(*(e.free_symbols for e in expressions)) if expressions else set()
    assumptions = list(notes)
    shown = [f"{symbols.of[n]} = {symbols.angle(a)}" for n, a in tied.items() if n in symbols.of]
    if shown:
        assumptions.append("on closed postures of home's branch " + ", ".join(shown))
    for relation in dict.fromkeys(relations):
        assumptions.append(f"a closed loop gives {sympy.Eq(relation, 0).lhs} = 0")
    legend = symbols.legend(used)
    return SymbolicSingularities(
        name=mechanism.name,
        legs=parts.legs,
        Jq=parts.Jq,
        Jx=parts.Jx,
        rows=parts.rows,
        det_Jq=parts.det_Jq,
        det_Jx=parts.det_Jx,
        det_output=parts.det_output,
        virtual_chain=parts.chain,
        legend=legend,
        assumptions=tuple(assumptions),
        text=report(mechanism.name, parts, legend, assumptions),
        _symbols=dict(symbols.of),
        _parameters=parameters,
        _coordinates=reading,
    )
