"""Screws of the kinematic pairs at a posture, and what loops of them demand.

All screws are dimensionless twists (6,), (linear over the characteristic length, angular), along
the world's axes, of the point of the moving body that is at a common reference point. Rates are
dimensionless too: sliding rates over the characteristic length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.screws.twists import TwistSpace, twist_space
from closedchain.analysis.structure.graph import Walk, shortest_walks
from closedchain.analysis.structure.loops import LoopGraph, Pair
from closedchain.closure.closures import Closure
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank, null_space, numerical_rank


@dataclass(frozen=True)
class CoupledRates:
    """A coupling as a row in the rates of two pairs: follower - ratio leader = 0.

    ``follower`` and ``leader`` are (pair, column among its freedoms).
    """

    follower: tuple[int, int]
    leader: tuple[int, int]
    ratio: float


@dataclass(frozen=True, eq=False)
class PairScrews:
    """Screws of all pairs of a mechanism at a closed posture, one (6, freedoms) array a pair."""

    graph: LoopGraph
    screws: tuple[np.ndarray, ...]
    couplings: tuple[CoupledRates, ...]

    def columns(self, pairs: Sequence[int]) -> dict[int, slice]:
        """Columns of each pair where the rates of ``pairs`` are stacked."""
        out, start = {}, 0
        for p in pairs:
            out[p] = slice(start, start + self.graph.pairs[p].freedoms)
            start = out[p].stop
        return out

    def along(self, walk: Walk, columns: dict[int, slice], width: int) -> np.ndarray:
        """Twist (6, width) that the rates give the end of a walk against its start."""
        out = np.zeros((6, width))
        for p, sign in walk:
            out[:, columns[p]] += sign * self.screws[p]
        return out

    def conditions(self, pairs: Sequence[int]) -> tuple[np.ndarray, dict[int, slice]]:
        """Rows that the rates of ``pairs`` must meet for their loops and couplings to hold.

        Returns the matrix (6 loops + couplings, freedoms) and the columns of each pair.
        """
        columns = self.columns(pairs)
        width = sum(self.graph.pairs[p].freedoms for p in pairs)
        rows = [self.along(walk, columns, width) for walk in _loops_within(self.graph, pairs)]
        for coupling in self.couplings:
            (p, i), (k, j) = coupling.follower, coupling.leader
            if p in columns and k in columns:
                row = np.zeros((1, width))
                row[0, columns[p].start + i] += 1.0
                row[0, columns[k].start + j] -= coupling.ratio
                rows.append(row)
        return (np.vstack(rows) if rows else np.zeros((0, width))), columns

    def rank(self, pairs: Sequence[int]) -> Rank:
        """Number of independent conditions on the rates of ``pairs``."""
        return numerical_rank(self.conditions(pairs)[0])

    def relative_motion(self, pairs: Sequence[int], a: int, b: int) -> TwistSpace:
        """Twists of body ``b`` against body ``a`` in the sub-mechanism made of ``pairs``."""
        conditions, columns = self.conditions(pairs)
        edges = self.graph.edges
        walk = shortest_walks(len(self.graph.bodies), edges, pairs, a)[b]
        motions, _ = null_space(conditions)
        return twist_space(self.along(walk, columns, conditions.shape[1]) @ motions)


def _loops_within(graph: LoopGraph, pairs: Sequence[int]) -> list[Walk]:
    """One loop for each pair beyond a spanning forest of ``pairs``."""
    count, edges = len(graph.bodies), graph.edges
    forest: list[int] = []
    chords: list[int] = []
    labels = list(range(count))
    for p in pairs:
        a, b = (labels[k] for k in edges[p])
        if a == b:
            chords.append(p)
        else:
            forest.append(p)
            labels = [a if k == b else k for k in labels]
    return [
        ((p, 1), *shortest_walks(count, edges, forest, edges[p][1])[edges[p][0]]) for p in chords
    ]


def pair_screws(
    mechanism: Mechanism, graph: LoopGraph, q: np.ndarray, about: np.ndarray | None = None
) -> PairScrews:
    """Screws of all pairs at a closed posture ``q`` (nq,).

    ``about`` (3,) [m] is their reference point in the world, the joints' centroid by default.
    """
    model, data = mechanism.model, mechanism.workspace.data
    pin.computeJointJacobians(model, data, q)
    places = [np.array(m.translation) for m in list(data.oMi)[1:]]
    centre = np.mean(places, axis=0) if places else np.zeros(3)
    if about is not None:
        centre = about
    arm = pin.skew(centre)
    closures = {c.name: c for c in mechanism.closures if isinstance(c, Closure)}

    def dimensionless(at_origin: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Screws at the world's origin [m, rad], per unit rates, moved to the centre."""
        linear = at_origin[:3] - arm @ at_origin[3:]
        return np.vstack([linear / mechanism.length, at_origin[3:]]) * scale

    def screws(pair: Pair) -> np.ndarray:
        if pair.closure is not None:
            closure = closures[pair.closure]
            free = _free_screws(data, closure)
            slides = ~np.any(free[3:], axis=0)
            return dimensionless(free, np.where(slides, mechanism.length, 1.0))
        ids = [model.getJointId(name) for name in pair.joints]
        columns = [model.idx_vs[j] for j in ids]
        jacobian = np.hstack(
            [
                pin.getJointJacobian(model, data, j, pin.WORLD)[:, [c]]
                for j, c in zip(ids, columns, strict=True)
            ]
        )
        return dimensionless(jacobian, mechanism.column_scale[columns])

    return PairScrews(
        graph, tuple(screws(pair) for pair in graph.pairs), _couplings(mechanism, graph)
    )


def _free_screws(data: pin.Data, closure: Closure) -> np.ndarray:
    """What a cut joint leaves free, at the world's origin (6, freedoms) [m, rad]."""
    one = data.oMi[closure.joint1] * closure.placement1
    two = data.oMi[closure.joint2] * closure.placement2
    arm = pin.skew(one.translation)
    x, y, z = one.rotation.T

    def turn(axis: np.ndarray) -> np.ndarray:
        return np.concatenate([arm @ axis, axis])

    def slide(axis: np.ndarray) -> np.ndarray:
        return np.concatenate([axis, np.zeros(3)])

    free = {
        "revolute": lambda: [turn(z)],
        "prismatic": lambda: [slide(z)],
        "cylindrical": lambda: [turn(z), slide(z)],
        "universal": lambda: [turn(z), turn(two.rotation[:, 2])],
        "spherical": lambda: [turn(axis) for axis in np.eye(3)],
        "planar": lambda: [slide(x), slide(y), turn(z)],
    }
    return np.array(free[closure.kind]()).T


def _couplings(mechanism: Mechanism, graph: LoopGraph) -> tuple[CoupledRates, ...]:
    place = {
        name: (p, i) for p, pair in enumerate(graph.pairs) for i, name in enumerate(pair.joints)
    }
    scale = {
        name: mechanism.column_scale[mechanism.model.idx_vs[mechanism.model.getJointId(name)]]
        for name in place
    }
    return tuple(
        CoupledRates(
            follower=place[c.joint],
            leader=place[c.leader],
            ratio=c.multiplier * float(scale[c.leader] / scale[c.joint]),
        )
        for c in mechanism.description.couplings
    )
