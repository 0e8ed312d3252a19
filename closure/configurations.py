"""Checks of configurations that a caller gives: their size, their numbers, their quaternions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.given import FLOAT, LARGEST_NUMBER, finite_vector
from closedchain.closure.joint_kinds import FLOATING
from closedchain.urdf.errors import ClosureError

QUATERNION_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Layout:
    """What a configuration must be: its size, and where its quaternions (x y z w) begin."""

    nq: int
    quaternions: tuple[int, ...]

    def one(self, q: ArrayLike) -> np.ndarray:
        """Check one configuration (nq,). Raises ``ClosureError``."""
        array = finite_vector(q, self.nq, "configuration q", "nq")
        if self.quaternions:
            numbers = array.tolist()
            for start in self.quaternions:
                x, y, z, w = numbers[start : start + 4]
                square = x * x + y * y + z * z + w * w
                if abs(square - 1.0) > QUATERNION_TOLERANCE:  # half of that would still do
                    norm = math.sqrt(square)
                    if abs(norm - 1.0) <= QUATERNION_TOLERANCE:
                        continue
                    raise ClosureError(
                        f"q[{start}:{start + 4}] is a quaternion (x y z w) of norm {norm:.6g}; it "
                        "must be 1 (integrate with pin.integrate, never add to q)"
                    )
        return array

    def many(self, q: ArrayLike) -> np.ndarray:
        """Check many configurations (n, nq). Raises ``ClosureError``."""
        if self._are_fine(array := np.array(q)):
            return array
        return np.array([self.one(one) for one in np.asarray(q)]).reshape(-1, self.nq)

    def _are_fine(self, q: np.ndarray) -> bool:
        """Whether every row of numbers passes ``one``, seen at once."""
        if q.dtype != FLOAT or q.shape[1] != self.nq:
            return False
        if not np.abs(q).max(initial=0.0) <= LARGEST_NUMBER:
            return False
        return all(
            (np.abs(np.linalg.norm(q[:, s : s + 4], axis=1) - 1.0) <= QUATERNION_TOLERANCE).all()
            for s in self.quaternions
        )


def layout_of(model: pin.Model) -> Layout:
    """Layout of the configurations of a model."""
    joints = list(model.joints)[1:]
    return Layout(model.nq, tuple(j.idx_q + 3 for j in joints if j.nq == FLOATING.nq))
