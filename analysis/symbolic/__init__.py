"""Closed forms of singularities, derived from a description."""

from __future__ import annotations

from collections.abc import Mapping

from closedchain.analysis.symbolic.results import (
    Factor,
    SymbolicDeterminant,
    SymbolicLeg,
    SymbolicSingularities,
)
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.extras import require

__all__ = [
    "Factor",
    "SymbolicDeterminant",
    "SymbolicLeg",
    "SymbolicSingularities",
    "symbolic_singularities",
]


def symbolic_singularities(
    mechanism: Mechanism, names: Mapping[str, str] | None = None
) -> SymbolicSingularities:
    """Singularities of a mechanism of legs in closed form, derived from its description.

    Screws are (angular; linear), one column for each freedom of a leg from its start to its end,
    in unit rates (radians for circular guides). Exchanging the halves to (linear; angular) changes
    the sign of a determinant of six rows. A cut spherical joint is written as three hinges x, y, z
    from the leg to the platform; the factor that this brings in is marked as representation.
    Sizes are named parameters of the xacro file where the description has one, exact numbers else.

    Parameters
    ----------
    mechanism : Mechanism
        With a task, and with legs that decouple.
    names : mapping, optional
        Symbols by joint, parameter, or hinge (``a_S.y``); see ``express.Symbols`` for the others.

    Raises
    ------
    ClosureError
        A mechanism that is not made of legs, whose legs share a platform in a loop, or whose
        expressions grow too large; unknown names.

    Examples
    --------
    >>> s = cc.symbolic_singularities(cc.load("linear_delta"))
    >>> [factor.role for factor in s.legs[0].lever_factors["q1"]]
    ['inverse', 'inverse']
    """
    require("closed forms are derived with sympy", "symbolic")
    from closedchain.analysis.symbolic.closed_forms import derive  # only who asks waits for it

    return derive(mechanism, names)
