"""The results of position solvers: postures and everything needed to trust them or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from closedchain.closure.ranks import Rank, numerical_rank
from closedchain.closure.solve.outcome import Ending, Outcome
from closedchain.urdf.errors import ClosureError

Jacobian = Callable[[np.ndarray], np.ndarray]
"""Scaled Jacobian (rows, unknowns) of what was solved, at a posture (nq,)."""


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
    ending : Ending
        Why the solver ended.
    jacobian : callable or None
        Of what was solved, for the rank.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> s = cc.direct(m, [-0.1, -0.15, -0.2])
    >>> s.converged, s.residual < 1e-12, s.beyond_limits
    (True, True, ())
    >>> far = cc.direct(m, [-0.1, -0.15, 0.9])
    >>> far.converged, "direct singularity" in far.message
    (False, True)
    """

    q: np.ndarray
    residual: float
    converged: bool
    iterations: int
    message: str
    branch: int | None = None
    beyond_limits: tuple[str, ...] = ()
    ending: Ending = Ending.ARRIVED
    jacobian: Jacobian | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Write-protect the posture: a solution is a value."""
        self.q.setflags(write=False)

    @cached_property
    def rank_decision(self) -> Rank:
        """Rank of the scaled equations at ``q`` in the unknowns solved for, with its gap."""
        if self.jacobian is None:
            return Rank(0, 0.0, 0.0)
        return numerical_rank(self.jacobian(self.q))

    @property
    def rank(self) -> int:
        """Rank of the scaled equations at ``q`` in the unknowns solved for."""
        return self.rank_decision.value

    def raise_if_failed(self) -> Solution:
        """Return the solution itself, or raise ``ClosureError`` with its message."""
        if not self.converged:
            raise ClosureError(self.message)
        return self


def found_on_branch(
    q: np.ndarray, residual: float, iterations: int, branch: int | None, jacobian: Jacobian
) -> Solution:
    """Solution that is what was asked for, with all joints within their limits.

    Solvers that take microseconds make these: the fields are set at once, without the dataclass's
    own constructor, which sets them one by one and takes as long as a step of Newton's method.
    """
    q.setflags(write=False)
    found = object.__new__(Solution)
    found.__dict__.update(
        q=q,
        residual=residual,
        converged=True,
        iterations=iterations,
        message=f"closed to {residual:.1e} on the branch of the guess",
        branch=branch,
        beyond_limits=(),
        ending=_ARRIVED,
        jacobian=jacobian,
    )
    return found


_ARRIVED = Ending.ARRIVED


@dataclass(frozen=True, eq=False)
class Solutions(Outcome):
    """Postures found by ``direct`` or ``inverse`` for many requests at once.

    As ``Outcome``: ``q`` (n, nq), ``residual`` (n,), ``converged`` (n,), ``branch`` (n,),
    ``endings``. One that did not converge has the last posture on the way, and ``reached`` tells
    how far that is; ask for it alone to get a full account.

    Attributes
    ----------
    within : (n,) array
        How far all joints are within their limits [m or rad]; negative beyond one.
    iterations : (n,) array of int
        Evaluations of residual and Jacobian for each.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> s = cc.direct(m, np.linspace([-0.2, -0.2, -0.2], [-0.1, -0.1, 0.9], 5))
    >>> s.converged.tolist()
    [True, True, True, True, False]
    >>> s[0].raise_if_failed().q.shape
    (16,)
    """

    within: np.ndarray = field(default_factory=lambda: np.zeros(0))
    iterations: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))

    def __getitem__(self, index: int) -> Solution:
        """Return one of them as a ``Solution``."""
        ending = Ending.of(int(self.codes[index]))
        branch = int(self.branch[index])
        message = ending.sentence
        if not ending.good:
            message += f", after {self.reached[index]:.1%} of the way"
        return Solution(
            q=self.q[index].copy(),
            residual=float(self.residual[index]),
            converged=ending.good,
            iterations=int(self.iterations[index]),
            message=message,
            branch=branch or None,
            ending=ending,
        )
