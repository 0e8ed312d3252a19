"""The equations of a mechanism by Pinocchio: closures, then goals, dimensionless.

Rows are divided and columns multiplied by the mechanism's units (``length`` or 1), so that ranks,
steps and determinants mean the same for lengths and angles. ``closure.solve.system`` has the same
from machine code; here nothing need be known of the mechanism but its model, as when it is loaded.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.task import goal_rows
from closedchain.closure.unknowns import Unknowns


@dataclass(frozen=True, eq=False)
class Equations(Unknowns):
    """Closures and goals of a mechanism in some of its coordinates."""

    @cached_property
    def row_scale(self) -> np.ndarray:
        """Unit of each row, (rows,)."""
        if not self.goals:
            return self.mechanism.row_scale
        length = self.mechanism.length
        units = [np.where(g.translational, length, 1.0) for g in self.goals]
        return np.concatenate([self.mechanism.row_scale, *units])

    @cached_property
    def _scaling(self) -> np.ndarray:
        if not self.goals and self.free is self.mechanism.passive_v:
            return self.mechanism.passive_scaling
        return np.asfortranarray(self.mechanism.column_scale[self.free] / self.row_scale[:, None])

    def evaluate(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) [m, rad] and dimensionless Jacobian (rows, free) at ``q``."""
        values, jacobian = self.mechanism.workspace.evaluate(q)
        if self.goals:
            extra = [goal_rows(self.mechanism, g) for g in self.goals]
            values = np.concatenate([values, *(e[0] for e in extra)])
            jacobian = np.vstack([jacobian, *(e[1] for e in extra)])
        # columns are gathered, and stay, in the order in memory that LAPACK wants
        return values, jacobian.T.take(self.free, axis=0).T * self._scaling

    def residual(self, q: np.ndarray) -> np.ndarray:
        """Residual (rows,) [m, rad] alone at ``q``."""
        return self.evaluate(q)[0] if self.goals else self.mechanism.workspace.residual(q)
