"""The result of a position solver: a posture and everything needed to trust it or not."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from closedchain.closure.equations import Equations
from closedchain.closure.ranks import Rank, numerical_rank
from closedchain.urdf.errors import ClosureError


@dataclass(frozen=True, eq=False)
class Solution:
    """A posture found by ``close``, ``direct`` or ``inverse``.

    Attributes
    ----------
    q : (nq,) array
        Configuration, write-protected; when not converged, the closest posture that was found.
    residual : float
        Largest absolute row of all equations that had to hold [m or rad].
    converged : bool
        True only if the residual is below 1e-12 and the branch of the guess was kept.
    iterations : int
        Evaluations of residual and Jacobian.
    message : str
        What happened, in words; names the closure that fails and joints beyond their limits.
    branch : int or None
        Sign of the determinant of the solved equations at ``q`` (which side of the singular set);
        None where the equations are not square.
    beyond_limits : tuple of str
        Joints outside their limits.
    equations : Equations or None
        What was solved, for the rank.
    """

    q: np.ndarray
    residual: float
    converged: bool
    iterations: int
    message: str
    branch: int | None = None
    beyond_limits: tuple[str, ...] = ()
    equations: Equations | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Write-protect the posture: a solution is a value."""
        self.q.setflags(write=False)

    @cached_property
    def rank_decision(self) -> Rank:
        """Rank of the scaled equations at ``q`` in the unknowns solved for, with its gap."""
        if self.equations is None:
            return Rank(0, 0.0, 0.0)
        return numerical_rank(self.equations.evaluate(self.q)[1])

    @property
    def rank(self) -> int:
        """Rank of the scaled equations at ``q`` in the unknowns solved for."""
        return self.rank_decision.value

    def raise_if_failed(self) -> Solution:
        """Return the solution itself, or raise ``ClosureError`` with its message."""
        if not self.converged:
            raise ClosureError(self.message)
        return self
