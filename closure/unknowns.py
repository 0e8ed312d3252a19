"""What is sought of a mechanism: some of its coordinates, so that frames come where they should."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.task import Goal


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Goals of a mechanism in the unknowns ``free`` (indices in v).

    ``within`` are limits (lower, upper) of q that steps are clipped to, if any.
    """

    mechanism: Mechanism
    free: np.ndarray
    goals: tuple[Goal, ...] = ()
    within: tuple[np.ndarray, np.ndarray] | None = field(default=None, repr=False)

    def move(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Posture after a dimensionless step (free,) of the unknowns."""
        v = np.zeros(self.mechanism.model.nv)
        v[self.free] = step * self.mechanism.column_scale[self.free]
        q = pin.integrate(self.mechanism.model, q, v)
        return q if self.within is None else np.clip(q, *self.within)
