"""What ``symbolic_singularities`` returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from closedchain.analysis.symbolic.coordinates import Coordinates
    from closedchain.analysis.symbolic.express import Meaning

Expr = Any
"""sympy expression."""

Role = Literal["scale", "representation", "inverse", "lever", "direct", "passive", "constraint"]
"""What the zeros of a factor are.

scale: none, it depends on sizes only. representation: of the way in which a spherical joint or a
pose is written, nothing of the robot. inverse, direct, constraint: singularities of that kind.
lever: one input of a leg loses its effect, which other inputs of the leg still have. passive:
joints of one leg move with its inputs and the platform at rest, a direct and inverse singularity at
once.
"""


@dataclass(frozen=True)
class Factor:
    """Factor of a determinant: ``expr`` to the power ``exponent``."""

    expr: Expr
    exponent: int
    role: Role
    meaning: str


@dataclass(frozen=True, eq=False)
class SymbolicLeg:
    """A leg in closed form.

    Attributes
    ----------
    start, end : str
        Platforms that it joins.
    joints : tuple of str
        Columns of the determinant: joints from start to end, a spherical joint as three hinges.
    inputs : tuple of str
    determinant : sympy expression or None
        Of the unit screws, rows (angular; linear), factored. With fewer than six freedoms rows
        that are zero are left out. None where the matrix is not square: see ``reason``.
    factors : tuple of Factor
    levers : mapping of input to expression
        Entries of Jq: pairing of the leg's driving wrench with the unit rate of the input.
    lever_factors : mapping of input to tuple of Factor
    force : mapping of input to (3,) sympy Matrix
        Force of that wrench, base axes; zero for a couple. It is of unit length unless said.
    reason : str
        Why there is no determinant.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> leg = cc.symbolic_singularities(m).legs[0]
    >>> leg.inputs, len(leg.joints)
    (('q1',), 4)
    """

    start: str
    end: str
    joints: tuple[str, ...]
    inputs: tuple[str, ...]
    determinant: Expr | None
    factors: tuple[Factor, ...]
    levers: Mapping[str, Expr]
    lever_factors: Mapping[str, tuple[Factor, ...]]
    force: Mapping[str, Expr]
    reason: str


@dataclass(frozen=True, eq=False)
class SymbolicDeterminant:
    """Determinant, factored, with the meaning of its factors; None where it was not expanded.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> det = cc.symbolic_singularities(m).det_Jx
    >>> [factor.role for factor in det.factors]
    ['direct']
    """

    expr: Expr | None
    factors: tuple[Factor, ...]
    note: str


@dataclass(frozen=True, eq=False)
class SymbolicSingularities:
    """Singularities in closed form.

    Attributes
    ----------
    legs : tuple of SymbolicLeg
    Jq : sympy Matrix (rows, n_inputs)
        Levers: one row for each driving wrench, in the order of ``rows``.
    Jx : sympy Matrix (rows, 6) or None
        Driving wrenches (force; moment about the base's origin), base axes: Jx (v_O; omega) =
        Jq qdot with the platform's twist at that origin. None with more platforms than the tip.
    rows : tuple of str
        Inputs of each row.
    det_Jq, det_Jx, det_output : SymbolicDeterminant
        Of Jq; of the driving and constraint wrenches on what can move; of the outputs on what the
        constraints leave free (1 where these are the platform's own twist).
    virtual_chain : SymbolicDeterminant or None
        Screws px py pz rx ry rz of the free platform: representation only.
    legend : mapping of symbol to Meaning
    assumptions : tuple of str
    values : callable

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> s = cc.symbolic_singularities(m)
    >>> print(s.legs[0].levers["q1"])  # zero where the rod is level: an inverse singularity
    -cos(q_b1)*cos(q_d1)
    >>> abs(s.evaluate(s.det_Jx.expr, m.home)) > 0.1
    True
    """

    name: str
    legs: tuple[SymbolicLeg, ...]
    Jq: Expr
    Jx: Expr | None
    rows: tuple[str, ...]
    det_Jq: SymbolicDeterminant
    det_Jx: SymbolicDeterminant
    det_output: SymbolicDeterminant
    virtual_chain: SymbolicDeterminant | None
    legend: Mapping[Expr, Meaning]
    assumptions: tuple[str, ...]
    text: str
    _symbols: Mapping[str, Expr] = field(repr=False)
    _parameters: Mapping[str, float] = field(repr=False)
    _coordinates: Coordinates = field(repr=False)

    @property
    def inverse(self) -> tuple[Factor, ...]:
        """Factors whose zeros are inverse singularities, each once."""
        return self._kind("inverse")

    @property
    def direct(self) -> tuple[Factor, ...]:
        """Factors whose zeros are direct singularities, each once."""
        return self._kind("direct")

    def values(self, q: ArrayLike) -> dict[Expr, float]:
        """Value of every symbol at a posture ``q`` (nq,), hinges too [m, rad]."""
        known = {**self._parameters, **self._coordinates.values(q)}
        return {symbol: known[name] for name, symbol in self._symbols.items() if name in known}

    def evaluate(self, expr: Expr, q: ArrayLike) -> float:
        """Value of an expression at a posture ``q`` (nq,)."""
        import sympy

        values = self.values(q)
        symbols = sorted(expr.free_symbols, key=str)
        function = sympy.lambdify(symbols, expr, "numpy")
        return float(np.asarray(function(*[values[s] for s in symbols])))

    @property
    def latex(self) -> str:
        """Determinants as LaTeX, one equation a line."""
        import sympy

        lines = [
            rf"D_{{{i}}} &= {sympy.latex(leg.determinant)}"
            for i, leg in enumerate(self.legs, 1)
            if leg.determinant is not None
        ]
        for name, found in (("J_q", self.det_Jq), ("J_x", self.det_Jx)):
            if found.expr is not None:
                lines.append(rf"\det {name} &= {sympy.latex(found.expr)}")
        body = " \\\\\n".join(lines)
        return f"\\begin{{aligned}}\n{body}\n\\end{{aligned}}"

    def _kind(self, role: Role) -> tuple[Factor, ...]:
        seen: dict[Expr, Factor] = {}
        groups = [f for leg in self.legs for fs in leg.lever_factors.values() for f in fs]
        for f in [*groups, *self.det_Jx.factors, *self.det_output.factors]:
            if f.role == role:
                seen.setdefault(f.expr, f)
        return tuple(seen.values())
