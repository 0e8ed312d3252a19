"""What inputs move in a mechanism: joints of their own, and others through couplings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from closedchain.analysis.screws.circuit_matrix import driven_joints
from closedchain.analysis.screws.leg_graph import LegChain
from closedchain.analysis.structure.loops import LoopGraph
from closedchain.closure.closures import Coupling
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE
from closedchain.urdf.errors import ClosureError

Drive = Mapping[int, float]
"""Rate of a joint per rate of each input that moves it, by the input's number."""


def drives_of(mechanism: Mechanism, q: np.ndarray) -> dict[str, Drive]:
    """Joints that inputs move at ``q`` (nq,), directly or through couplings, and how fast.

    A coupling moves the one of its joints that nothing else moves.
    """
    found: dict[str, Drive] = {
        joint: {number: 1.0} for number, joint in enumerate(driven_joints(mechanism))
    }
    ties = couplings_of(mechanism)
    for _ in ties:
        for tie in ties:
            slopes = _slopes(tie, q)
            unmoved = [name for name in slopes if name not in found]
            if len(unmoved) == 1 and slopes[unmoved[0]] != 0.0:
                own = slopes.pop(unmoved[0])
                found[unmoved[0]] = _combined({name: -c / own for name, c in slopes.items()}, found)
    return found


def couplings_of(mechanism: Mechanism) -> list[Coupling]:
    """Couplings of a mechanism, in the order of its closures."""
    return [closure for closure in mechanism.closures if isinstance(closure, Coupling)]


def tied_inputs(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Dimensionless rows (k, n_inputs) that couplings demand of the input rates alone."""
    drives = drives_of(mechanism, q)
    units = mechanism.column_scale[mechanism.input_v]
    rows = []
    for tie in couplings_of(mechanism):
        slopes = _slopes(tie, q)
        if slopes.keys() <= drives.keys():
            row = np.zeros(len(mechanism.inputs))
            for number, rate in _combined(slopes, drives).items():
                row[number] = rate * units[number]
            size = np.abs(row).max()
            if size > RANK_TOLERANCE * units.max():
                rows.append(row / size)
    return np.array(rows).reshape(-1, len(mechanism.inputs))


def check_couplings(
    mechanism: Mechanism,
    graph: LoopGraph,
    legs: tuple[LegChain, ...],
    drives: Mapping[str, Drive],
) -> None:
    """Refuse couplings between passive joints, but those inside chains side by side."""
    inside = [
        {name for p in element.pairs for name in graph.pairs[p].joints}
        for leg in legs
        for element in leg.elements
        if element.composite
    ]
    for tie in couplings_of(mechanism):
        tied = {joint.joint for joint in tie.joints}
        passive = [joint.joint for joint in tie.joints if joint.joint not in drives]
        if not passive or any(tied <= names for names in inside):
            continue
        if tie.kind == "linear":
            raise ClosureError(
                f"{mechanism.name} is not made of legs: {tie.describe()} ties the passive joints "
                f"{', '.join(passive)}"
            )
        child = next(j.child for j in mechanism.description.joints if j.name == tie.follower)
        raise ClosureError(
            f"{mechanism.name} is not made of legs: body {child!r} follows the passive joint "
            f"{tie.leaders[0]!r} through a coupling"
        )


def _slopes(tie: Coupling, q: np.ndarray) -> dict[str, float]:
    """Derivative of a coupling by the value of each of its joints."""
    out: dict[str, float] = {}
    for part in tie.joints:
        out[part.joint] = out.get(part.joint, 0.0) + float(part.slope(float(q[part.q])))
    return out


def _combined(weights: Mapping[str, float], drives: Mapping[str, Drive]) -> Drive:
    """Sum of the drives of joints, weighted."""
    out: dict[int, float] = {}
    for name, weight in weights.items():
        for number, rate in drives[name].items():
            out[number] = out.get(number, 0.0) + weight * rate
    return out
