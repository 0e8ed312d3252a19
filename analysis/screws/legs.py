"""The velocity equation leg by leg, by reciprocal screws.

A wrench that does no work on the passive joints of a leg sees, of all that moves the leg's end
against its start, only the actuated joints: w o (V_end - V_start) = (w o $_actuated) qdot. A leg
gives as many such rows as its passive joints leave wrenches. Those that do no work on the actuated
joints either are the leg's constraints. Rows of legs to other platforms than the tip are combined
so that the twists of these platforms drop out.

Screws are those of the papers: twists (angular; linear at O), wrenches (force; moment about O) in
world axes, SI units, paired by the Klein form ``screws.klein``. Jx and Jq are in the order of
``velocity``: (linear at the tip's origin, angular).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.screws.circuit_matrix import body_of, si_screws
from closedchain.analysis.screws.drives import Drive, check_couplings, drives_of, tied_inputs
from closedchain.analysis.screws.leg_graph import LegChain, LegGraph, leg_graph
from closedchain.analysis.screws.network import column_names
from closedchain.analysis.structure.loops import LoopGraph, loops
from closedchain.analysis.structure.pair_screws import PairScrews, pair_screws
from closedchain.closure.closures import Closure
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE, Rank, null_space, numerical_rank


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg at a posture.

    Attributes
    ----------
    start, end : str
        Platforms that it joins; twists are of ``end`` against ``start``.
    joints : tuple of str
        Names of its freedoms from start to end. Chains side by side that act as one joint are
        written in brackets, one name for each freedom that they have together.
    inputs : tuple of str
        Inputs that drive it, through couplings too.
    screws : (n, 6) array
        Unit screws of the freedoms, in the sense from start to end.
    driving : (k, 6) array
        Wrenches reciprocal to all passive joints, but not to all joints: to all but one input's
        where such exist, and first. Of those that differ by constraint wrenches the one that is
        orthogonal to them about ``point``. Unit force where there is one.
    levers : (k, n_inputs) array
        Pairings of the driving wrenches with the inputs' unit rates.
    permission, restriction : (m, 6), (6 - m, 6) arrays
        Twists that the leg permits, and a complement, orthogonal about ``point``.
    actuation, constraint : (m, 6), (6 - m, 6) arrays
        Wrenches reciprocal to the restrictions, and those reciprocal to all that is permitted.
    point : (3,) array
        Where the leg's last joint sits [m, world axes]; for orthogonality, lengths are divided by
        the mechanism's characteristic length.
    rank : Rank
        Of the leg's screws.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> leg = cc.leg_velocity(m, m.home).legs[0]
    >>> leg.start, leg.end, leg.inputs
    ('base', 'platform', ('q1',))
    """

    start: str
    end: str
    joints: tuple[str, ...]
    inputs: tuple[str, ...]
    screws: np.ndarray
    driving: np.ndarray
    levers: np.ndarray
    permission: np.ndarray
    restriction: np.ndarray
    actuation: np.ndarray
    constraint: np.ndarray
    point: np.ndarray
    rank: Rank


@dataclass(frozen=True, eq=False)
class LegVelocity:
    """Velocity equation of a mechanism made of legs.

    Attributes
    ----------
    Jx : (k, 6) array
        Factor of the tip's twist (linear at its origin, angular; world axes) [m/s, rad/s].
    Jq : (k, n_inputs) array
        Factor of the input rates.
    legs : tuple of Leg
        In the order of their joints.
    platforms : tuple of str
        The tip, then the platforms whose twists are eliminated.
    rows : (rows, 6 platforms) array
        Left side before elimination, for the twists of ``platforms`` one after the other, each
        that of its point at the tip's origin: driving wrenches of all legs, then constraints.
    right : (rows, n_inputs) array
        Right side before elimination.
    owners : tuple of int
        Leg of each of these rows.
    rank : Rank
        Of the columns that are eliminated.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> found = cc.leg_velocity(m, m.home)
    >>> len(found.legs), found.Jx.shape, found.Jq.shape
    (3, (9, 6), (9, 3))
    """

    Jx: np.ndarray
    Jq: np.ndarray
    legs: tuple[Leg, ...]
    platforms: tuple[str, ...]
    rows: np.ndarray
    right: np.ndarray
    owners: tuple[int, ...]
    rank: Rank


@dataclass(frozen=True, eq=False)
class _Wrenches:
    """Of one leg: dimensionless wrenches (force, moment) about its point, as columns."""

    driving: np.ndarray
    constraint: np.ndarray
    permission: np.ndarray
    rank: Rank = field(repr=False)


def leg_velocity(mechanism: Mechanism, q: ArrayLike) -> LegVelocity:
    """Velocity equation Jx V = Jq qdot of a mechanism made of legs, at a closed posture.

    Where all legs end on the tip, the rows are the legs' own: driving wrenches, then constraints,
    the generalised Jacobian. Otherwise they are the combinations without the other platforms'
    twists, orthonormal in dimensionless form but for a factor, the characteristic length.

    Raises
    ------
    ClosureError
        Malformed or open posture; no task; a body that is in no leg, or a coupling between passive
        joints, which are named.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> found, rates = cc.leg_velocity(m, m.home), np.array([0.1, 0.2, 0.3])
    >>> tip = cc.acceleration(m, m.home, rates, [0.0, 0.0, 0.0]).tip_twist
    >>> bool(np.allclose(found.Jx @ tip, found.Jq @ rates))
    True
    """
    at = first_order(mechanism, q, task=False)
    graph, found, names = leg_structure(mechanism)
    drives = drives_of(mechanism, at.q)
    check_couplings(mechanism, graph, found.legs, drives)
    origin = mechanism.point(at.q, mechanism.required_task().tip)
    screws = pair_screws(mechanism, graph, at.q, origin)
    place = {body: 6 * i for i, body in enumerate(found.platforms)}
    lhs, rhs, owners, legs = [], [], [], []
    for number, chain in enumerate(found.legs):
        leg, wrenches, driven = _leg(mechanism, screws, chain, names, drives, origin)
        legs.append(leg)
        for kind in (wrenches.driving, wrenches.constraint):
            row = np.zeros((kind.shape[1], 6 * len(found.platforms)))
            if chain.end in place:
                row[:, place[chain.end] : place[chain.end] + 6] += kind.T
            if chain.start in place:
                row[:, place[chain.start] : place[chain.start] + 6] -= kind.T
            lhs.append(row)
            rhs.append(kind.T @ driven)
            owners.append(np.full(kind.shape[1], number))
    # driving rows of all legs, then their constraint rows
    order = [*range(0, len(lhs), 2), *range(1, len(lhs), 2)]
    left, right = np.vstack([lhs[i] for i in order]), np.vstack([rhs[i] for i in order])
    ties = tied_inputs(mechanism, at.q)
    jx, jq, rank = _eliminate(left, right, ties)
    # a wrench (force, moment / length) gives power / length
    twist_unit = np.repeat([1.0, 1.0 / mechanism.length], 3)
    rate_unit = mechanism.column_scale[mechanism.input_v] / mechanism.length
    return LegVelocity(
        Jx=jx / twist_unit,
        Jq=jq / rate_unit,
        legs=tuple(legs),
        platforms=tuple(graph.bodies[b].name for b in found.platforms),
        rows=left / np.tile(twist_unit, len(found.platforms)),
        right=right / rate_unit,
        owners=tuple(int(i) for i in np.concatenate([owners[i] for i in order])),
        rank=rank,
    )


@lru_cache(maxsize=8)  # mechanisms are immutable, and sweeps ask again and again for one
def leg_structure(
    mechanism: Mechanism,
) -> tuple[LoopGraph, LegGraph, tuple[tuple[str, ...], ...]]:
    """Bodies and pairs, legs, names of all freedoms; joints driven as at home.

    Raises
    ------
    ClosureError
        No task, or a body that is in no leg.
    """
    graph = loops(mechanism)
    tip = body_of(graph, mechanism.required_task().tip)
    drives = drives_of(mechanism, mechanism.home)
    names = column_names(graph)
    moved = {p for p, pair in enumerate(names) if any(name in drives for name in pair)}
    found = leg_graph(graph, tip, moved)
    return graph, found, names


def _eliminate(
    left: np.ndarray, right: np.ndarray, ties: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Rank]:
    """Drop the twists of all platforms but the first: Jx (k, 6), Jq (k, n_inputs)."""
    others = left[:, 6:]
    if others.shape[1]:
        combine, rank = null_space(others.T)
        rows = combine.T @ np.hstack([left[:, :6], right])
        # combinations of one loop's redundant rows say 0 = 0: an orthonormal row space has none
        _, s, vt = np.linalg.svd(rows, full_matrices=False)
        rows = vt[: np.count_nonzero(s > RANK_TOLERANCE * max(1.0, float(s.max(initial=0.0))))]
    else:
        rows, rank = np.hstack([left, right]), Rank(0, 0.0, 0.0)
    rows = np.vstack([rows, np.hstack([np.zeros((ties.shape[0], 6)), ties])])
    return rows[:, :6], rows[:, 6:], rank


def _leg(
    mechanism: Mechanism,
    at: PairScrews,
    chain: LegChain,
    names: tuple[tuple[str, ...], ...],
    drives: dict[str, Drive],
    origin: np.ndarray,
) -> tuple[Leg, _Wrenches, np.ndarray]:
    """A leg, its wrenches (6, k) about the tip's origin, and its inputs' screws (6, n_inputs)."""
    twists, joints = _listed(at, chain, names)
    length = mechanism.length
    scale = mechanism.column_scale
    driven = np.zeros((6, len(mechanism.inputs)))
    passive = []
    for column, name in zip(twists.T, joints, strict=True):
        if name in drives:
            unit = scale[mechanism.model.idx_vs[mechanism.model.getJointId(name)]]
            for number, ratio in drives[name].items():
                driven[:, number] += column * ratio * scale[mechanism.input_v[number]] / unit
        else:
            passive.append(column)
    chosen = [n for n in range(len(mechanism.inputs)) if driven[:, n].any()]
    point = _last_place(mechanism, at.graph, chain)
    to_point = _shift((point - origin) / length)
    local = _wrenches(to_point @ np.array(passive).reshape(-1, 6).T, to_point @ driven[:, chosen])
    # wrenches move with the transpose of the matrix that moves twists the other way
    at_tip = _Wrenches(
        driving=to_point.T @ local.driving,
        constraint=to_point.T @ local.constraint,
        permission=local.permission,
        rank=local.rank,
    )
    complement, _ = null_space(local.permission.T)
    to_world, to_world_wrench = _shift(-point / length), _shift(point / length).T

    def twists_si(space: np.ndarray) -> np.ndarray:
        moved = to_world @ space
        return np.vstack([moved[3:], moved[:3] * length]).T

    def wrenches_si(space: np.ndarray) -> np.ndarray:
        moved = to_world_wrench @ space
        return np.vstack([moved[:3], moved[3:] * length]).T

    unit_screws = si_screws(PairScrews(at.graph, (_shift(-origin / length) @ twists,), ()), length)
    driving = wrenches_si(local.driving)
    leg = Leg(
        start=at.graph.bodies[chain.start].name,
        end=at.graph.bodies[chain.end].name,
        joints=tuple(joints),
        inputs=tuple(mechanism.inputs[n] for n in chosen),
        screws=unit_screws,
        driving=driving,
        levers=at_tip.driving.T @ driven * length / scale[mechanism.input_v],
        permission=twists_si(local.permission),
        restriction=twists_si(complement),
        actuation=wrenches_si(local.permission),
        constraint=wrenches_si(local.constraint),
        point=point,
        rank=local.rank,
    )
    return leg, at_tip, driven


def _listed(
    at: PairScrews, chain: LegChain, names: tuple[tuple[str, ...], ...]
) -> tuple[np.ndarray, list[str]]:
    """Screws (6, n) of a leg's joints, from its start on, and the name of each one's joint."""
    columns: list[np.ndarray] = []
    joints: list[str] = []
    for element, sign in zip(chain.elements, chain.signs, strict=True):
        if element.composite:
            space = at.relative_motion(element.pairs, element.start, element.end).basis
            runs = (" ".join(at.graph.pairs[p].name for p in run) for run in element.members)
            name = f"[{' | '.join(runs)}]"
            columns.append(sign * space)
            joints += [name] * space.shape[1]
        else:
            (p,) = element.pairs
            order = slice(None) if sign > 0 else slice(None, None, -1)
            columns.append(sign * at.screws[p][:, order])
            joints += names[p][order]
    return np.hstack(columns), joints


def _wrenches(passive: np.ndarray, driven: np.ndarray) -> _Wrenches:
    """Wrenches (force, moment) of a leg from its passive (6, p) and its inputs' (6, k) twists.

    All orthonormality is that of the reference point.
    """
    twists = np.hstack([passive, driven])
    rank = numerical_rank(twists)
    constraint, _ = null_space(twists.T)
    permission, _ = null_space(constraint.T) if constraint.size else (np.eye(6), rank)
    driving = np.zeros((6, 0))
    for j in range(driven.shape[1]):
        others = np.delete(driven, j, axis=1)
        own, _ = null_space(np.hstack([passive, others, constraint]).T)
        driving = np.hstack([driving, own])
    free = 6 - numerical_rank(passive).value - constraint.shape[1]
    if free > driving.shape[1]:
        # inputs in one leg that no wrench tells apart: as many more as there are, on both
        basis = np.linalg.svd(driving, full_matrices=False)[0] if driving.size else driving
        rest, _ = null_space(np.hstack([passive, constraint, basis]).T)
        driving = np.hstack([driving, rest])
    return _Wrenches(_unit(driving, driven), _unit(constraint, driven), permission, rank)


def _unit(wrenches: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """Wrenches (6, k) of unit force, or unit couples, that push their first input forwards."""
    force = np.linalg.norm(wrenches[:3], axis=0)
    whole = np.linalg.norm(wrenches, axis=0)
    wrenches = wrenches / np.where(force > RANK_TOLERANCE * whole, force, whole)
    for k in range(wrenches.shape[1]):
        levers = driven.T @ wrenches[:, k]
        strong = np.flatnonzero(np.abs(levers) > RANK_TOLERANCE)
        if strong.size and levers[strong[0]] < 0.0:
            wrenches[:, k] *= -1.0
    return wrenches


def _shift(arm: np.ndarray) -> np.ndarray:
    """Matrix (6, 6) that moves the reference of twists (linear, angular) by ``arm`` (3,)."""
    x, y, z = arm
    out = np.eye(6)
    # w x arm = -[arm]x w
    out[:3, 3:] = -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return out


def _last_place(mechanism: Mechanism, graph: LoopGraph, chain: LegChain) -> np.ndarray:
    """Where the last pair of a leg sits, (3,) [m]; of pairs side by side the first."""
    pair = graph.pairs[chain.elements[-1].pairs[0]]
    data = mechanism.workspace.data
    if pair.joints:
        return np.array(data.oMi[mechanism.model.getJointId(pair.joints[-1])].translation)
    for closure in mechanism.closures:
        if isinstance(closure, Closure) and closure.name == pair.closure:
            frame: pin.SE3 = data.oMi[closure.joint1] * closure.placement1
            return np.array(frame.translation)
    raise AssertionError(pair.name)
