"""Independent closure rows of a mechanism at a posture, eliminated: its closed motions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.tape.bodies import Entries
from closedchain.closure.tape.elimination import Elimination, Sparse, eliminate
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.rows import Kinematics


@dataclass(frozen=True, eq=False)
class EliminatedClosures:
    """Closure rows at the posture of some kinematics, and what their elimination gives.

    Attributes
    ----------
    kept : tuple of int
        Independent rows.
    columns, carried : tuple of int
        Tangent coordinates that may have a pivot, and those that are eliminated along and may not.
    samples : (n, nq) array
        Closed postures at which pivots are judged; q are the first inputs of the graph.
    """

    kinematics: Kinematics
    kept: tuple[int, ...]
    columns: tuple[int, ...]
    carried: tuple[int, ...]
    samples: np.ndarray

    @property
    def graph(self) -> Graph:
        """Where the expressions stand."""
        return self.kinematics.graph

    @cached_property
    def residual(self) -> Expr:
        """Largest of all closure rows [m or rad]."""
        return self.kinematics.closures.largest(self.graph)

    @cached_property
    def entries(self) -> list[Entries]:
        """The kept rows of K."""
        return [self.kinematics.closures.entries[r] for r in self.kept]

    @cached_property
    def factors(self) -> Elimination:
        """Elimination of the kept rows."""
        return eliminate(self.graph, self.entries, self.columns, self.samples.T, self.carried)

    @cached_property
    def basis(self) -> list[Sparse]:
        """Closed motions M, one for a unit rate of each free column."""
        return self.factors.kernel()
