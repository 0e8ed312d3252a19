"""The command ``closedchain closed-forms``: singularities as factored expressions."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from closedchain import _arguments as arguments
from closedchain._options import Json, NoXacro, Robot, Settings, Variant
from closedchain._terminal import print_json, remark, say, tell

if TYPE_CHECKING:
    from closedchain.analysis.symbolic import SymbolicSingularities
    from closedchain.analysis.symbolic.results import Factor, SymbolicDeterminant


def closed_forms(
    robot: Robot,
    names: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="JOINT=SYMBOL", help="Symbol of a joint; q_... by default."),
    ] = None,
    latex: Annotated[
        bool, typer.Option("--latex", help="Print the determinants as LaTeX.")
    ] = False,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
    json: Json = False,
) -> None:
    """Singularities in closed form, where the legs decouple."""
    import closedchain as cc

    mechanism = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    if sys.stderr.isatty():
        remark("deriving closed forms ...")
    found = cc.symbolic_singularities(mechanism, arguments.assignments(names or (), "--name"))
    if json:
        print_json(_data(found))
    else:
        say(found.latex) if latex else tell(found.text)


def _data(found: SymbolicSingularities) -> dict[str, Any]:
    return {
        "mechanism": found.name,
        "legs": [
            {
                "from": leg.start,
                "to": leg.end,
                "joints": list(leg.joints),
                "determinant": None if leg.determinant is None else str(leg.determinant),
                "reason": leg.reason,
                "factors": _factors(leg.factors),
                "levers": {
                    name: {"expression": str(lever), "factors": _factors(leg.lever_factors[name])}
                    for name, lever in leg.levers.items()
                },
            }
            for leg in found.legs
        ],
        "det_Jq": _determinant(found.det_Jq),
        "det_Jx": _determinant(found.det_Jx),
        "det_output": _determinant(found.det_output),
        "virtual_chain": _determinant(found.virtual_chain) if found.virtual_chain else None,
        "symbols": {
            str(symbol): {"name": meaning.name, "unit": meaning.unit, "meaning": meaning.text}
            for symbol, meaning in found.legend.items()
        },
        "assumptions": list(found.assumptions),
    }


def _determinant(found: SymbolicDeterminant) -> dict[str, Any]:
    expression = None if found.expr is None else str(found.expr)
    return {"expression": expression, "note": found.note, "factors": _factors(found.factors)}


def _factors(factors: tuple[Factor, ...]) -> list[dict[str, Any]]:
    return [
        {"factor": str(f.expr), "exponent": f.exponent, "role": f.role, "meaning": f.meaning}
        for f in factors
    ]
