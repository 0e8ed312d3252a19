"""The first-order kinematics at one posture: K, J, their dimensionless forms and their columns.

Everything that the analysis asks at velocity level starts from these matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure.constraints import gaps
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.task import task_jacobian
from closedchain.urdf.errors import ClosureError

OPEN = 1e-6
"""A posture with a larger residual [m, rad] has no instantaneous kinematics worth reporting."""


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """Constraint and task Jacobians at a closed posture.

    Attributes
    ----------
    q : (nq,) array
    K : (rows, nv) array
        Constraint Jacobian, dimensionless.
    J : (d, nv) array
        Task Jacobian, dimensionless; no rows where no outputs were asked for.
    outputs : tuple of str
    values : (rows,) array
        Closure rows [m, rad].
    row_unit, output_unit, column_unit : arrays
        Units taken out of K's rows, J's rows and the columns: ``length`` or 1.
    """

    mechanism: Mechanism
    q: np.ndarray
    K: np.ndarray
    J: np.ndarray
    outputs: tuple[str, ...]
    values: np.ndarray
    row_unit: np.ndarray
    output_unit: np.ndarray
    column_unit: np.ndarray

    @property
    def K_passive(self) -> np.ndarray:
        """Columns of K that are no inputs, K_p."""
        return self.K[:, self.mechanism.passive_v]

    @property
    def stacked(self) -> np.ndarray:
        """[K; J], (rows + d, nv)."""
        return np.vstack([self.K, self.J])


def first_order(
    mechanism: Mechanism,
    q: ArrayLike,
    outputs: str | Sequence[str] | None = None,
    *,
    task: bool = True,
) -> FirstOrder:
    """Evaluate K and J at a closed posture.

    Parameters
    ----------
    q : (nq,) array
    outputs : str or sequence of str, optional
        Those of the task by default.
    task : bool
        False leaves J empty, for questions that concern no output.

    Raises
    ------
    ClosureError
        Malformed or open posture, unknown outputs, no task.
    """
    q = mechanism.configuration(q)
    values, jacobian = (np.array(part) for part in mechanism.workspace.evaluate(q))
    if values.size and np.abs(values).max() > OPEN:
        name, gap = gaps(mechanism, values)[0]
        raise ClosureError(
            f"the posture is not closed: closure {name} is open by {gap:.3g}; close it first "
            "(cc.close, cc.direct or cc.inverse)"
        )
    columns = mechanism.column_scale
    names: tuple[str, ...] = ()
    task_rows = np.zeros((0, mechanism.model.nv))
    if task:
        names = mechanism.outputs(outputs if outputs is None else _names(outputs))
        task_rows = task_jacobian(mechanism, q, names)
    units = np.array([mechanism.length if n in "xyz" else 1.0 for n in names])
    return FirstOrder(
        mechanism=mechanism,
        q=q,
        K=jacobian * columns / mechanism.row_scale[:, None],
        J=task_rows * columns / units[:, None],
        outputs=names,
        values=values,
        row_unit=mechanism.row_scale,
        output_unit=units,
        column_unit=columns,
    )


def _names(outputs: str | Sequence[str]) -> str | tuple[str, ...]:
    return outputs if isinstance(outputs, str) else tuple(outputs)


def tip_twists(mechanism: Mechanism, q: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Tip twists (6, k) (linear, angular), world-aligned at the tip, of motions (nv, k)."""
    return np.asarray(task_jacobian(mechanism, q, ("x", "y", "z", "rx", "ry", "rz")) @ motions)


def moving_joints(mechanism: Mechanism, motion: np.ndarray, share: float = 1e-6) -> list[str]:
    """Names of the joints that move in a motion (nv,), floating bodies under their joint's name."""
    scaled = np.abs(motion / mechanism.column_scale)
    floor = share * scaled.max(initial=0.0)
    model = mechanism.model
    return [
        model.names[i]
        for i in range(1, model.njoints)
        if scaled[model.idx_vs[i] : model.idx_vs[i] + model.nvs[i]].max() > floor
    ]
