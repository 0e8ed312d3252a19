"""Davies' network matrix: the screws of all joints, written down circuit by circuit.

N qdot = 0 says that the rates of the joints around every circuit add up to no motion, each taken
with the sign in which the circuit passes its joint [Davies1981]_. With primary joints p, which
lead, and secondary joints s, which follow, N_s qdot_s = -N_p qdot_p. An Assur virtual chain is
a serial chain of six freedoms put between the base and the tip, which moves nothing and makes the
tip's motion a matter of joint rates.

Screws are (angular; linear at O) in world axes, the order of the papers, in SI units: 1 and m for
a hinge, m for a slider. Ranks are of the dimensionless matrix.

[Davies1981]_ T. H. Davies, Kirchhoff's circulation law applied to multi-loop kinematic chains,
Mech. Mach. Theory 16, 1981.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.screws.circuit_matrix import (
    body_of,
    centroid,
    circuit_matrix,
    column_units,
    driven_joints,
    si_screws,
)
from closedchain.analysis.structure.graph import short_cycles
from closedchain.analysis.structure.loops import Loop, LoopGraph, Pair, as_loop, loops
from closedchain.analysis.structure.pair_screws import PairScrews, pair_screws
from closedchain.closure.given import finite_vector
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE, Rank, null_space, numerical_rank
from closedchain.urdf.errors import ClosureError, known_names

VIRTUAL = ("virtual.px", "virtual.py", "virtual.pz", "virtual.rx", "virtual.ry", "virtual.rz")
"""Joints of the 3P3R virtual chain: along the world's x, y, z, then hinges x, y, z at the tip."""
_CONSISTENT = 1e-9  # dimensionless rate by which given primary rates may miss the circuits' demands


@dataclass(frozen=True)
class Circuit:
    """A circuit as a walk over pairs: sign +1 where a pair is passed from parent to child.

    Examples
    --------
    >>> m = cc.load("rpa3t")
    >>> net = cc.network(m, m.home)
    >>> len(net.circuits), net.matrix.shape[0] == 6 * len(net.circuits)
    (4, True)
    """

    pairs: tuple[str, ...]
    signs: tuple[int, ...]

    def __str__(self) -> str:
        """Signed names in the order of the walk."""
        named = zip(self.pairs, self.signs, strict=True)
        return " ".join(f"{'+' if sign > 0 else '-'}{name}" for name, sign in named)


@dataclass(frozen=True, eq=False)
class Network:
    """Network matrix of a mechanism at a posture.

    Attributes
    ----------
    matrix : (6 circuits + couplings, joints) array
        N: six rows (angular; linear at O) for each circuit, then one for each coupling of joints,
        SI units.
    screws : (joints, 6) array
        Unit screw of each joint: motion of its child against its parent.
    joints : tuple of str
        Names of the columns. Of a cut joint they are its name with a suffix: a spherical one turns
        about the world's axes, ``.x .y .z``; others are numbered.
    primary, secondary : tuple of str
        Joints that lead and joints that follow, in the order of their columns in N_p and N_s.
    circuits : tuple of Circuit
        Independent circuits, short ones preferred.
    rank : Rank
        Of N, dimensionless: joints less rank is the mobility.
    secondary_rank : Rank
        Of N_s, dimensionless: the secondary rates are determined where it is their number.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> net = cc.network(m, m.home)
    >>> net.mobility, net.primary
    (3, ('leg1_P', 'leg2_P', 'leg3_P'))
    """

    matrix: np.ndarray
    screws: np.ndarray
    joints: tuple[str, ...]
    primary: tuple[str, ...]
    secondary: tuple[str, ...]
    circuits: tuple[Circuit, ...]
    rank: Rank
    secondary_rank: Rank
    _pairs: Mapping[str, tuple[int, ...]] = field(repr=False)
    _scaled: np.ndarray = field(repr=False)
    _unit: np.ndarray = field(repr=False)

    def columns(self, joints: str | Sequence[str]) -> np.ndarray:
        """Column numbers of joints, or of all the freedoms of a pair by its name.

        Raises
        ------
        ClosureError
            Unknown names.
        """
        found: list[int] = []
        for name in [joints] if isinstance(joints, str) else joints:
            if name in self.joints:
                found.append(self.joints.index(name))
            elif name in self._pairs:
                found.extend(self._pairs[name])
            else:
                raise ClosureError(known_names(name, "joint", self.joints))
        return np.array(found, dtype=int)

    @property
    def N_p(self) -> np.ndarray:
        """Columns of the primary joints."""
        return self.matrix[:, self.columns(self.primary)]

    @property
    def N_s(self) -> np.ndarray:
        """Columns of the secondary joints."""
        return self.matrix[:, self.columns(self.secondary)]

    @property
    def mobility(self) -> int:
        """Freedoms at this posture to first order: joints less the rank of N."""
        return len(self.joints) - self.rank.value

    def circuit_screws(self, number: int) -> tuple[tuple[str, ...], np.ndarray]:
        """Joints of a circuit in the order of its walk, and their screws (n, 6) with its signs."""
        circuit = self.circuits[number]
        chosen: list[int] = []
        signs: list[int] = []
        for pair, sign in zip(circuit.pairs, circuit.signs, strict=True):
            at = self._pairs[pair] if sign > 0 else self._pairs[pair][::-1]
            chosen += at
            signs += [sign] * len(at)
        names = tuple(self.joints[i] for i in chosen)
        return names, np.array(signs)[:, None] * self.screws[chosen]

    def secondary_rates(self, primary: ArrayLike | Mapping[str, float]) -> np.ndarray:
        """Rates of the secondary joints, -N_s^-1 N_p qdot_p, in the order of ``secondary``.

        Parameters
        ----------
        primary : (n_primary,) array, or mapping of joint to rate
            [m/s or rad/s].

        Raises
        ------
        ClosureError
            Malformed rates; N_s leaves joints undetermined, which are named; the primary rates
            contradict each other.
        """
        p, s = self.columns(self.primary), self.columns(self.secondary)
        rates = self._primary(primary) / self._unit[p]
        if self.secondary_rank.value < s.size:
            free, _ = null_space(self._scaled[:, s])
            size = np.abs(free).max(axis=1)
            names = [n for n, x in zip(self.secondary, size, strict=True) if x > 1e-6 * size.max()]
            raise ClosureError(
                f"the primary joints do not determine the others: N_s has {self.secondary_rank}, "
                f"{s.size} needed; free to move are {', '.join(names)}"
            )
        wanted = -self._scaled[:, p] @ rates
        found = np.linalg.lstsq(self._scaled[:, s], wanted, rcond=RANK_TOLERANCE)[0]
        miss = np.abs(self._scaled[:, s] @ found - wanted).max(initial=0.0)
        if miss > _CONSISTENT * (1.0 + np.abs(wanted).max(initial=0.0)):
            raise ClosureError(
                "the rates of the primary joints contradict each other: the circuits are violated "
                f"at a rate of {miss:.3g}"
            )
        return np.asarray(found * self._unit[s])

    def _primary(self, values: ArrayLike | Mapping[str, float]) -> np.ndarray:
        if isinstance(values, Mapping):
            for name in values:
                if name not in self.primary:
                    raise ClosureError(known_names(str(name), "primary joint", self.primary))
            missing = [name for name in self.primary if name not in values]
            if missing:
                raise ClosureError(f"no rate for primary joint {', '.join(missing)}")
            values = [values[name] for name in self.primary]
        return finite_vector(values, len(self.primary), "primary rates", " ".join(self.primary))

    @property
    def text(self) -> str:
        """Size and rank of N, and its circuits."""
        rows, columns = self.matrix.shape
        lines = [f"N is {rows} x {columns}, {self.rank}; N_s has {self.secondary_rank}."]
        lines += [f"  circuit {i}: {circuit}" for i, circuit in enumerate(self.circuits, 1)]
        return "\n".join(lines)


def network(
    mechanism: Mechanism,
    q: ArrayLike,
    virtual: Literal["3P3R"] | None = None,
    *,
    primary: Sequence[str] | None = None,
) -> Network:
    """Write down Davies' network matrix N at a closed posture.

    Floating joints are no joints of the network: a floating platform is held by its legs alone.

    Parameters
    ----------
    q : (nq,) array
    virtual : "3P3R", optional
        Put this virtual chain between the task's base and tip. Its rates are the velocity of the
        tip's origin along the world's axes and the rates of the XYZ angles of the tip against the
        base; like these angles it is singular (gimbal lock) where the middle one is a right angle.
    primary : sequence of str, optional
        Joints that lead; those of the inputs by default. A pair's name stands for all its freedoms.
        ``VIRTUAL`` leads by the tip's motion.

    Raises
    ------
    ClosureError
        Malformed or open posture, unknown or repeated joints, a virtual chain of another kind or
        without a task, or one that would join a body to itself.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> net = cc.network(m, m.home)
    >>> rates = net.secondary_rates([0.1, 0.1, 0.1])  # of all joints that no input drives
    >>> rates.shape == (len(net.secondary),)
    True
    """
    at = first_order(mechanism, q, task=False)
    graph = loops(mechanism)
    at_origin = pair_screws(mechanism, graph, at.q, np.zeros(3))
    centre = pair_screws(mechanism, graph, at.q)
    if virtual is not None:
        if virtual != "3P3R":
            raise ClosureError(known_names(str(virtual), "virtual chain", ("3P3R",)))
        at_origin = _with_virtual(mechanism, at.q, at_origin, np.zeros(3))
        centre = _with_virtual(mechanism, at.q, centre, centroid(mechanism))
        graph = at_origin.graph
    names = column_names(graph)
    unit = column_units(at_origin, mechanism.length)
    rows = [np.repeat([1.0, mechanism.length], 3)] * len(graph.loops)
    slices = at_origin.columns(range(len(graph.pairs)))
    first = [c.parts[0] for c in at_origin.couplings]
    rows += [unit[[slices[part.pair].start + part.column]] for part in first]
    scaled = circuit_matrix(centre)
    row_unit = np.concatenate([np.zeros(0), *rows])
    matrix = circuit_matrix(at_origin) * row_unit[:, None] / unit
    flat = tuple(name for pair in names for name in pair)
    pairs = {
        pair.name: tuple(range(slices[p].start, slices[p].stop))
        for p, pair in enumerate(graph.pairs)
    }
    draft = Network(
        matrix=matrix,
        screws=si_screws(at_origin, mechanism.length),
        joints=flat,
        primary=(),
        secondary=(),
        circuits=tuple(_circuit(graph, loop) for loop in graph.loops),
        rank=numerical_rank(scaled),
        secondary_rank=Rank(0, 0.0, 0.0),
        _pairs=pairs,
        _scaled=scaled,
        _unit=unit,
    )
    lead = draft.columns(driven_joints(mechanism) if primary is None else tuple(primary))
    if np.unique(lead).size < lead.size:
        raise ClosureError("a primary joint is named twice")
    follow = np.setdiff1d(np.arange(len(flat)), lead)
    return replace(
        draft,
        primary=tuple(flat[i] for i in lead),
        secondary=tuple(flat[i] for i in follow),
        secondary_rank=numerical_rank(scaled[:, follow]),
    )


def column_names(graph: LoopGraph) -> tuple[tuple[str, ...], ...]:
    """Names of the freedoms of each pair: its joints', or its own with a suffix if it is cut."""

    def of(pair: Pair) -> tuple[str, ...]:
        if pair.joints:
            return pair.joints
        if pair.freedoms == 1:
            return (pair.name,)
        suffixes = "xyz" if pair.symbol == "S" else "12345"
        return tuple(f"{pair.name}.{suffix}" for suffix in suffixes[: pair.freedoms])

    return tuple(of(pair) for pair in graph.pairs)


def _circuit(graph: LoopGraph, loop: Loop) -> Circuit:
    return Circuit(tuple(graph.pairs[p].name for p in loop.pairs), loop.signs)


def _with_virtual(
    mechanism: Mechanism, q: np.ndarray, at: PairScrews, about: np.ndarray
) -> PairScrews:
    """Screws with a 3P3R chain from base to tip as one more pair, and circuits that pass it."""
    graph = at.graph
    task = mechanism.required_task()
    base, tip = body_of(graph, task.base), body_of(graph, task.tip)
    if base == tip:
        raise ClosureError(f"a virtual chain would join body {graph.bodies[tip].name!r} to itself")
    pair = Pair("virtual", "3P3R", base, tip, VIRTUAL, None, 6, ())
    edges = [*graph.edges, (base, tip)]
    found = tuple(as_loop(edges, walk) for walk in short_cycles(len(graph.bodies), edges))
    columns = np.zeros((6, 6))
    columns[:3, :3] = np.eye(3)
    here = mechanism.pose(q)
    arm = (np.array(here.translation) - about) / mechanism.length
    turned = mechanism.pose(q, task.base).rotation.copy()
    angles = _xyz_angles(turned.T @ here.rotation)
    for k in range(3):
        axis = turned[:, k].copy()
        columns[:, 3 + k] = np.concatenate([np.cross(arm, axis), axis])
        turned = turned @ pin.utils.rotate("xyz"[k], float(angles[k]))
    longer = replace(graph, pairs=(*graph.pairs, pair), loops=found, bridges=())
    return PairScrews(longer, (*at.screws, columns), at.couplings)


def _xyz_angles(rotation: np.ndarray) -> np.ndarray:
    """Angles (3,) with rotation = Rx(a) Ry(b) Rz(c)."""
    b = np.arcsin(np.clip(rotation[0, 2], -1.0, 1.0))
    if np.hypot(rotation[0, 0], rotation[0, 1]) < RANK_TOLERANCE:  # gimbal lock: any split will do
        return np.array([np.arctan2(rotation[2, 1], rotation[1, 1]), b, 0.0])
    a = np.arctan2(-rotation[1, 2], rotation[2, 2])
    return np.array([a, b, np.arctan2(-rotation[0, 1], rotation[0, 0])])
