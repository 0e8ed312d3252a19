"""The motion of all joints that the inputs drive, and the idle motions that they leave.

With K the constraint Jacobian, a and p its input and passive columns, K_p v_p = -K_a v_a and
K_p a_p = -K_a a_a - Kdot v. Idle motions, such as the spin of a rod between two balls, are the
kernel of K_p at a posture that is not singular; inertia decides how they accelerate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.analysis.first_order import FirstOrder, moving_joints
from closedchain.analysis.forces.drivetrain import drivetrain
from closedchain.analysis.singularity.deciding import Deciding
from closedchain.closure.ranks import RANK_TOLERANCE, Rank, kernel, least_solution, rank_above
from closedchain.urdf.errors import ClosureError

CONSISTENT = 1e-9  # share by which given input rates may miss what the loops demand


@dataclass(frozen=True, eq=False)
class DrivenMotion:
    """How inputs move everything at a posture, in SI units.

    Attributes
    ----------
    model : pin.Model
        The tree, with payloads.
    rank : Rank
        Of the dimensionless K_p.
    """

    at: FirstOrder
    model: pin.Model
    rank: Rank

    @cached_property
    def idle(self) -> np.ndarray:
        """Basis (nv, f) of the motions with all inputs at rest."""
        m = self.at.mechanism
        p = m.passive_v
        found = np.zeros((m.model.nv, p.size - self.rank.value))
        found[p] = kernel(self.at.K_passive, found.shape[1])
        return found * self.at.column_unit[:, None]

    def rates(self, inputs: np.ndarray, drift: np.ndarray | None = None) -> np.ndarray:
        """Rates (nv,) or (nv, k) of all joints with K rates = -drift, idle motions least.

        Parameters
        ----------
        inputs : (n_inputs,) or (n_inputs, k) array
        drift : (rows,) array, optional
            SI units; zero for velocities.

        Raises
        ------
        ClosureError
            The loops contradict the rates: there are more inputs than freedoms.
        """
        at, m = self.at, self.at.mechanism
        a, p = m.input_v, m.passive_v
        wanted = -at.K[:, a] @ (inputs.T / at.column_unit[a]).T
        if drift is not None:
            wanted = wanted - drift / at.row_unit
        passive, _ = least_solution(at.K_passive, wanted, self.rank.value)
        missed = np.abs(at.K_passive @ passive - wanted).max(initial=0.0)
        if missed > CONSISTENT * max(1.0, np.abs(wanted).max(initial=0.0)):
            raise ClosureError(
                f"the loops contradict these rates of the inputs {' '.join(m.inputs)} by "
                f"{missed:.3g}: there are more inputs than freedoms, and only some combinations "
                "are possible"
            )
        found = np.zeros((m.model.nv, *inputs.shape[1:]))
        found[a], found[p] = inputs, (passive.T * at.column_unit[p]).T
        return found

    @cached_property
    def mass(self) -> np.ndarray:
        """Mass matrix (nv, nv) of the tree with its armatures, by Pinocchio."""
        m = self.at.mechanism
        return tree_mass(self.model, m.workspace.data, self.at.q, drivetrain(m).armature)

    def settled(self, a: np.ndarray, bias: np.ndarray) -> np.ndarray:
        """Accelerations (nv,) with idle motions added as inertia has it.

        Parameters
        ----------
        a : (nv,) array
            Accelerations that the loops allow.
        bias : (nv,) array
            Efforts that the tree needs without acceleration.
        """
        return np.asarray(a - self.idle @ self._least(self.idle.T @ (self.mass @ a + bias)))

    @cached_property
    def dynamic(self) -> np.ndarray:
        """Motions (nv, n_inputs) by unit input accelerations, idle motions as inertia has them."""
        n = len(self.at.mechanism.inputs)
        found = self.rates(np.eye(n))
        return np.asarray(found - self.idle @ self._least(self.idle.T @ self.mass @ found))

    def _least(self, wanted: np.ndarray) -> np.ndarray:
        """Coefficients of the idle motions whose inertia answers to forces on them."""
        inertia = self.idle.T @ self.mass @ self.idle
        scale = np.abs(inertia).max(initial=0.0)
        if not scale:
            return np.zeros(wanted.shape)  # idle motions without inertia do not matter
        s = np.linalg.svd(inertia / scale, compute_uv=False)
        rank = rank_above(s, RANK_TOLERANCE).value
        return least_solution(inertia, wanted, rank)[0]


def driven_motion(at: FirstOrder, model: pin.Model) -> DrivenMotion:
    """How the inputs move everything, with the tree's model, payloads included.

    Raises
    ------
    ClosureError
        A direct singularity, or freedoms of the tip that no input drives.
    """
    decided = Deciding(at)
    generic, rank = decided.generic, decided.locked.rank
    found = DrivenMotion(at, model, rank)
    singular = rank.value < at.mechanism.passive_v.size - generic.motions + generic.inputs.value
    if singular or generic.undriven:
        free = found.idle
        why = "a direct singularity" if singular else "too few inputs"
        names = dict.fromkeys(n for k in range(free.shape[1])
                              for n in moving_joints(at.mechanism, free[:, k]))  # fmt: skip
        raise ClosureError(
            f"the inputs do not determine the motion ({why}): with all of them locked the joints "
            f"{', '.join(names)} can move"
        )
    return found


def tree_mass(model: pin.Model, data: pin.Data, q: np.ndarray, armature: np.ndarray) -> np.ndarray:
    """Mass matrix (nv, nv) of a tree with inertias (nv,) that move with single joints."""
    upper = np.triu(pin.crba(model, data, q))
    return np.asarray(upper + np.triu(upper, 1).T + np.diag(armature))
