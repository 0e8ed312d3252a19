"""Screws of the kinematic pairs at a posture, and what loops of them demand.

All screws are dimensionless twists (6,), (linear over the characteristic length, angular), along
the world's axes, of the point of the moving body that is at a common reference point. Rates are
dimensionless too: sliding rates over the characteristic length.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from closedchain.analysis.screws.twists import TwistSpace, twist_space
from closedchain.analysis.structure.graph import Walk, shortest_walks
from closedchain.analysis.structure.loops import LoopGraph, Pair
from closedchain.closure.closures import Closure, Coupling
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank, null_space, numerical_rank
from closedchain.closure.rows import by_columns


@dataclass(frozen=True)
class CoupledRate:
    """A joint's part in a coupling at a posture, dimensionless.

    ``pair`` and ``column`` among its freedoms say whose rate it is; ``slope`` and ``bend`` are the
    first and second derivative of the coupling by the joint's value.
    """

    pair: int
    column: int
    slope: float
    bend: float


@dataclass(frozen=True)
class CoupledRates:
    """A coupling as a row in the rates of pairs: the sum of slope times rate is zero.

    The first part is the follower's, whose unit the row has.
    """

    parts: tuple[CoupledRate, ...]

    @property
    def pairs(self) -> frozenset[int]:
        """Pairs that it ties to each other."""
        return frozenset(part.pair for part in self.parts)

    def row(self, columns: Mapping[int, slice], width: int) -> np.ndarray:
        """Row (1, width) where the rates of pairs are stacked in ``columns``."""
        row = np.zeros((1, width))
        for part in self.parts:
            row[0, columns[part.pair].start + part.column] += part.slope
        return row


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
            if coupling.pairs <= columns.keys():
                rows.append(coupling.row(columns, width))
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
            slides = [screw.is_length for screw in closure.joint_kind.screws]
            scale = np.where(slides, mechanism.length, 1.0)
            return dimensionless(_free_screws(data, closure), scale)
        ids = [model.getJointId(name) for name in pair.joints]
        columns = [model.idx_vs[j] for j in ids]
        jacobian = np.hstack(
            [
                by_columns(pin.getJointJacobian(model, data, j, pin.WORLD))[:, [c]]
                for j, c in zip(ids, columns, strict=True)
            ]
        )
        return dimensionless(jacobian, mechanism.column_scale[columns])

    return PairScrews(
        graph, tuple(screws(pair) for pair in graph.pairs), _couplings(mechanism, graph, q)
    )


def _free_screws(data: pin.Data, closure: Closure) -> np.ndarray:
    """What a cut joint leaves free, at the world's origin (6, freedoms) [m, rad].

    A ball turns about the world's axes.
    """
    one = data.oMi[closure.joint1] * closure.placement1
    two = data.oMi[closure.joint2] * closure.placement2
    kind, gap = closure.joint_kind, one.actInv(two)
    twists = kind.twists(gap.translation.tolist(), gap.rotation.tolist())
    columns = []
    for screw, (v, w) in zip(kind.screws, twists, strict=True):
        along_world = kind.turns_freely and screw.pair == "R"
        angular = np.array(w) if along_world else one.rotation @ w
        linear = one.rotation @ v + np.cross(two.translation, angular)
        columns.append(np.concatenate([linear, angular]))
    return np.array(columns).reshape(-1, 6).T


def _couplings(mechanism: Mechanism, graph: LoopGraph, q: np.ndarray) -> tuple[CoupledRates, ...]:
    place = {
        name: (p, i) for p, pair in enumerate(graph.pairs) for i, name in enumerate(pair.joints)
    }
    found = []
    for coupling in mechanism.closures:
        if not isinstance(coupling, Coupling):
            continue
        row_unit = mechanism.length if coupling.length_row else 1.0
        parts = []
        for joint in coupling.joints:
            unit, value = float(mechanism.column_scale[joint.v]), float(q[joint.q])
            slope, bend = joint.slope(value) * unit, joint.curvature(value) * unit**2
            parts.append(CoupledRate(*place[joint.joint], slope / row_unit, bend / row_unit))
        found.append(CoupledRates(tuple(parts)))
    return tuple(found)
