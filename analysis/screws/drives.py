"""What inputs move in a mechanism: joints of their own, and others through couplings."""

from __future__ import annotations

import numpy as np

from closedchain.analysis.screws.circuit_matrix import driven_joints
from closedchain.analysis.screws.leg_graph import LegChain
from closedchain.analysis.structure.loops import LoopGraph
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE
from closedchain.urdf.errors import ClosureError

Drive = tuple[int, float]
"""Number of an input, and rate of a joint per rate of the input."""


def drives_of(mechanism: Mechanism) -> dict[str, Drive]:
    """Joints that inputs move, directly or through couplings, with input and ratio."""
    found: dict[str, Drive] = {
        joint: (number, 1.0) for number, joint in enumerate(driven_joints(mechanism))
    }
    couplings = mechanism.description.couplings
    for _ in couplings:
        for c in couplings:
            if c.leader in found and c.joint not in found:
                number, ratio = found[c.leader]
                found[c.joint] = (number, ratio * c.multiplier)
            elif c.joint in found and c.leader not in found and c.multiplier != 0.0:
                number, ratio = found[c.joint]
                found[c.leader] = (number, ratio / c.multiplier)
    return found


def tied_inputs(mechanism: Mechanism) -> np.ndarray:
    """Dimensionless rows (k, n_inputs) that couplings demand of the input rates alone."""
    drives = drives_of(mechanism)
    units = mechanism.column_scale[mechanism.input_v]
    rows = []
    for c in mechanism.description.couplings:
        if c.joint in drives and c.leader in drives:
            row = np.zeros(len(mechanism.inputs))
            for (number, ratio), factor in (
                (drives[c.joint], 1.0),
                (drives[c.leader], -c.multiplier),
            ):
                row[number] += factor * ratio * units[number]
            size = np.abs(row).max()
            if size > RANK_TOLERANCE * units.max():
                rows.append(row / size)
    return np.array(rows).reshape(-1, len(mechanism.inputs))


def check_couplings(
    mechanism: Mechanism,
    graph: LoopGraph,
    legs: tuple[LegChain, ...],
    drives: dict[str, Drive],
) -> None:
    """Refuse couplings between passive joints, but those inside chains side by side."""
    inside = [
        {name for p in element.pairs for name in graph.pairs[p].joints}
        for leg in legs
        for element in leg.elements
        if element.composite
    ]
    for c in mechanism.description.couplings:
        if c.joint in drives and c.leader in drives:
            continue
        if not any({c.joint, c.leader} <= names for names in inside):
            child = next(j.child for j in mechanism.description.joints if j.name == c.joint)
            raise ClosureError(
                f"{mechanism.name} is not made of legs: body {child!r} follows the passive joint "
                f"{c.leader!r} through a coupling"
            )
