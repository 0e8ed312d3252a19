"""Redundancy: motions of inputs and joints that leave the outputs at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank, null_space


@dataclass(frozen=True, eq=False)
class Redundancy:
    """Null space of [K; J] at a posture.

    Attributes
    ----------
    dimension : int
    inputs : (n_inputs, dimension) array
        Input rates of a basis of the null space. Each column has norm 1, its largest entry
        positive; a column is zero where the motion needs no input.
    joints : (nv, dimension) array
        The same motions in all joints [m/s, rad/s per unit of the input rates].
    outputs : tuple of str
    rank : Rank
        Of the dimensionless [K; J], with its gap.
    """

    dimension: int
    inputs: np.ndarray
    joints: np.ndarray
    outputs: tuple[str, ...]
    rank: Rank
    text: str


def redundancy(
    mechanism: Mechanism,
    q: ArrayLike,
    outputs: str | tuple[str, ...] | list[str] | None = None,
) -> Redundancy:
    """Find the motions of a closed posture that leave the outputs at rest.

    Parameters
    ----------
    q : (nq,) array
    outputs : str, optional
        Such as "x y z rx rz"; those of the task by default.

    Raises
    ------
    ClosureError
        Malformed or open posture, unknown outputs, no task.
    """
    at = first_order(mechanism, q, outputs)
    basis, rank = null_space(at.stacked)
    basis = _by_inputs(basis, mechanism.input_v)
    joints = basis * at.column_unit[:, None]
    inputs = joints[mechanism.input_v]
    sizes = np.linalg.norm(inputs, axis=0)
    still = sizes < 1e-9 * np.linalg.norm(joints, axis=0).max(initial=1e-300)
    sizes[still] = np.linalg.norm(joints[:, still], axis=0)
    joints, inputs = joints / sizes, inputs / sizes
    inputs[:, still] = 0.0
    lead = np.abs(np.where(still, joints, 0.0)).argmax(axis=0)
    signs = np.sign(np.where(still, joints[lead, range(lead.size)], _largest(inputs)))
    joints, inputs = joints * signs, inputs * signs
    return Redundancy(
        dimension=basis.shape[1],
        inputs=inputs,
        joints=joints,
        outputs=at.outputs,
        rank=rank,
        text=_text(mechanism, at.outputs, inputs, rank),
    )


def _by_inputs(basis: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Rotate an orthonormal basis so that its input parts are orthogonal, largest first."""
    if basis.shape[1] < 2:
        return basis
    _, _, vt = np.linalg.svd(basis[inputs], full_matrices=True)
    return np.asarray(basis @ vt.T)


def _largest(columns: np.ndarray) -> np.ndarray:
    """Signed entry of largest size in each column; the first one of near-equals."""
    sizes = np.abs(columns)
    rows = (sizes >= 0.999 * sizes.max(axis=0, initial=0.0)).argmax(axis=0)
    return np.asarray(columns[rows, range(columns.shape[1])])


def _text(mechanism: Mechanism, outputs: tuple[str, ...], inputs: np.ndarray, rank: Rank) -> str:
    head = (
        f"{mechanism.name}: with outputs {' '.join(outputs)} at rest, {inputs.shape[1]} freedom(s) "
        f"of motion remain; [K; J] has {rank}."
    )
    lines = [head]
    for column in inputs.T:
        if not column.any():
            lines.append("  a motion with all inputs at rest (direct singularity)")
            continue
        rates = zip(mechanism.inputs, column.round(12) + 0.0, strict=True)  # no -0
        lines.append("  input rates " + ", ".join(f"{n} {x:+.4f}" for n, x in rates))
    return "\n".join(lines)
