"""The matrix of a mechanism's circuits: pair screws with signs, a row block for each circuit.

What the network matrix and the second order have in common. Columns are the freedoms of all pairs,
stacked in the order of the pairs.
"""

from __future__ import annotations

import numpy as np

from closedchain.analysis.structure.loops import LoopGraph
from closedchain.analysis.structure.pair_screws import PairScrews
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError, known_names


def circuit_matrix(at: PairScrews) -> np.ndarray:
    """Dimensionless N: rows (angular, linear) of each circuit, then couplings."""
    columns = at.columns(range(len(at.graph.pairs)))
    width = at.graph.freedoms
    rows = [np.zeros((0, width))]
    for loop in at.graph.loops:
        twist = at.along(tuple(zip(loop.pairs, loop.signs, strict=True)), columns, width)
        rows.append(np.vstack([twist[3:], twist[:3]]))
    for coupling in at.couplings:
        rows.append(coupling.row(columns, width))
    return np.vstack(rows)


def column_units(screws: PairScrews, length: float) -> np.ndarray:
    """Unit of the rate of each column: ``length`` of a slider, 1 of a hinge."""
    angular = np.hstack([np.zeros((3, 0)), *(s[3:] for s in screws.screws)])
    return np.where(np.any(angular, axis=0), 1.0, length)


def si_screws(screws: PairScrews, length: float) -> np.ndarray:
    """All screws (joints, 6) in SI units, (angular; linear) at their reference point."""
    columns = np.hstack([np.zeros((6, 0)), *screws.screws])
    linear = columns[:3] * length / column_units(screws, length)
    return np.vstack([columns[3:], linear]).T


def centroid(mechanism: Mechanism) -> np.ndarray:
    """Mean (3,) of the joints' places [m] at the posture evaluated last: a reference point."""
    places = [np.array(m.translation) for m in list(mechanism.workspace.data.oMi)[1:]]
    return np.asarray(np.mean(places, axis=0)) if places else np.zeros(3)


def body_of(graph: LoopGraph, link: str) -> int:
    """Body that a link belongs to.

    Raises
    ------
    ClosureError
        Unknown link (lists the known ones); the cross link of a universal joint is inside a pair.
    """
    bodies = {name: i for i, body in enumerate(graph.bodies) for name in body.links}
    if link not in bodies:
        raise ClosureError(known_names(link, "link of a body", bodies))
    return bodies[link]


def driven_joints(mechanism: Mechanism) -> tuple[str, ...]:
    """Joint of each input, in the order of the inputs."""
    by_name = {spec.name: spec.joint for spec in mechanism.description.inputs}
    return tuple(by_name[name] for name in mechanism.inputs)
