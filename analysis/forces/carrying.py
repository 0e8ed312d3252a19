"""What every joint carries, given the multipliers of the closure rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.first_order import FirstOrder
from closedchain.analysis.forces.cut_wrenches import cut_wrenches, on_bodies
from closedchain.analysis.forces.loads import Loads, added, carried, moving_efforts, no_forces
from closedchain.closure.closures import Coupling

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Carrying:
    """What the joints carry, given the multipliers of the closure rows."""

    at: FirstOrder
    on: Loads
    rows: Mapping[str, np.ndarray]

    def of(
        self, multipliers: np.ndarray, motion: Motion, forces: list[pin.Force]
    ) -> dict[str, np.ndarray]:
        """Wrenches (6,) by joint, of the tree and then the cut ones."""
        m = self.at.mechanism
        cut = cut_wrenches(m, self.rows, multipliers)
        all_forces = added([forces, on_bodies(m, cut)], m.model)
        moving_efforts(m, self.on, motion, all_forces)
        return {**carried(m), **cut}

    def internal(self, multipliers: np.ndarray) -> dict[str, np.ndarray]:
        """Wrenches (6, k) by joint that multipliers (rows, k) put on a mechanism without load."""
        m = self.at.mechanism
        still = np.zeros(m.model.nv)
        columns = [
            self.of(column, (self.at.q, still, still), no_forces(m.model))
            for column in multipliers.T
        ]
        names = [*carried(m), *self.rows]
        return {n: np.array([c[n] for c in columns]).reshape(-1, 6).T for n in names}

    def strain(self, wrenches: Mapping[str, np.ndarray], multipliers: np.ndarray) -> np.ndarray:
        """All wrenches as moments, and what the couplings do, (n,) or (n, k)."""
        m = self.at.mechanism
        unit = np.array([m.length] * 3 + [1.0] * 3)
        parts = [(unit * w.T).T for w in wrenches.values()]
        parts += [
            multipliers[where]
            for closure, where in zip(m.closures, m.row_slices, strict=True)
            if isinstance(closure, Coupling)
        ]
        return np.concatenate(parts) if parts else np.zeros((0, *multipliers.shape[1:]))
