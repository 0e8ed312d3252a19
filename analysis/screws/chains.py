"""Joint screws of a mechanism, and what its independent circuits ask of the joints' rates.

Screws are those of ``screws``: (angular; linear at O) in SI units, O the world's origin, along the
world's axes, motion of a pair's child against its parent. Around a circuit they add up to zero,
each with the sign of the direction in which the circuit passes its pair.

For the second order a pair counts as parts, in order from parent to child, as the table of joint
kinds has them: a universal joint as two revolutes, a ball in a slot as a slide and a ball, a
revolute as one part. The screws of a part stand still in what comes before it, or span the same
motions always, so that the accelerator across the part is S times the second rates. Where a
spherical joint is written as three revolutes, as the papers do, the Lie products among these
change its own second rates and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import first_order
from closedchain.analysis.screws import shifted
from closedchain.analysis.screws.circuit_matrix import (
    body_of,
    centroid,
    circuit_matrix,
    column_units,
    driven_joints,
    si_screws,
)
from closedchain.analysis.structure.graph import Walk, shortest_walks
from closedchain.analysis.structure.loops import LoopGraph, loops
from closedchain.analysis.structure.pair_screws import CoupledRates, pair_screws
from closedchain.closure.joint_kinds import BY_SYMBOL
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank, numerical_rank
from closedchain.urdf.errors import ClosureError, known_names


@dataclass(frozen=True, eq=False)
class Circuits:
    """Joint screws and circuit conditions at a posture whose inputs determine the motion.

    Attributes
    ----------
    graph : LoopGraph
    screws : tuple of (freedoms, 6) arrays
        Of each pair, per unit rate, SI.
    columns : tuple of slice
        Rates of each pair where those of all pairs are stacked.
    N : (6 loops + couplings, freedoms) array
        Dimensionless: the screws around each circuit with signs, then the couplings.
    unit : (freedoms,) array
        Unit taken out of each rate: ``length`` for sliding, 1 for turning.
    centre : (3,) array
        Reference point of N's rows [m].
    inputs : (n_inputs,) array of int
        Columns of the inputs, in their order.
    rank : Rank
        Of N's other columns.
    couplings : tuple of CoupledRates
        In the order of N's last rows.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> c = cc.accelerators(m, m.home, [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]).circuits
    >>> c.N.shape[1] == sum(pair.freedoms for pair in c.graph.pairs)
    True
    """

    mechanism: Mechanism
    q: np.ndarray
    graph: LoopGraph
    screws: tuple[np.ndarray, ...]
    columns: tuple[slice, ...]
    N: np.ndarray
    unit: np.ndarray
    centre: np.ndarray
    inputs: np.ndarray
    rank: Rank
    couplings: tuple[CoupledRates, ...] = ()

    @property
    def walks(self) -> tuple[Walk, ...]:
        """Independent circuits as closed chains of (pair, sign)."""
        return tuple(tuple(zip(c.pairs, c.signs, strict=True)) for c in self.graph.loops)

    def body(self, link: str) -> int:
        """Body that a link is part of. Raises ``ClosureError``."""
        return body_of(self.graph, link)

    def chain(self, start: str, end: str, through: Iterable[str] | None = None) -> Walk:
        """Shortest chain of pairs between two links, of all pairs or only of those named.

        Raises
        ------
        ClosureError
            Unknown names, or no chain joins the two.
        """
        names = [pair.name for pair in self.graph.pairs]
        chosen = list(names if through is None else through)
        for name in chosen:
            if name not in names:
                raise ClosureError(known_names(name, "pair", names))
        used = [names.index(name) for name in chosen]
        bodies = len(self.graph.bodies)
        walks = shortest_walks(bodies, self.graph.edges, used, self.body(start))
        if self.body(end) not in walks:
            raise ClosureError(f"no chain of these pairs joins {start} to {end}")
        return walks[self.body(end)]

    def twists(self, walk: Walk, rates: np.ndarray) -> np.ndarray:
        """Twists (parts, k, 6) of the parts of a chain in k motions (freedoms, k), in order."""
        found = [np.zeros((0, rates.shape[1], 6))]
        for p, sign in walk:
            own = self.screws[p][:, None, :] * rates[self.columns[p]][:, :, None]
            first = np.cumsum([0, *BY_SYMBOL[self.graph.pairs[p].symbol].parts[:-1]])
            found.append(sign * np.add.reduceat(own, first, axis=0)[::sign])
        return np.concatenate(found)

    def bends(self, rates: np.ndarray) -> np.ndarray:
        """Bilinear form (couplings, m, m), in m motions (freedoms, m), of the couplings.

        What the second rates of a coupling's joints add up to is less than zero by u^T B u in
        motion u; dimensionless, and zero where the coupling is linear.
        """
        out = np.zeros((len(self.couplings), rates.shape[1], rates.shape[1]))
        for k, coupling in enumerate(self.couplings):
            for part in coupling.parts:
                column = self.columns[part.pair].start + part.column
                rate = rates[column] / self.unit[column]
                out[k] += part.bend * np.outer(rate, rate)
        return out

    def solve(
        self,
        inputs: np.ndarray,
        lie_screws: np.ndarray | None = None,
        bends: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rates of all pairs with the inputs' as given and sum $ w + L = 0 around each circuit.

        Parameters
        ----------
        inputs : (n_inputs, k) array
            Rates, or second rates, of the inputs in k motions, SI.
        lie_screws : (loops, 6, k) array, optional
            L of each circuit, SI; zero for first rates.
        bends : (couplings, k) array, optional
            What couplings that are not linear add to their second rates, as from ``bends``.

        Returns
        -------
        (freedoms, k) array, (k,) array
            The rates, and by how much the conditions fail at their best, dimensionless and
            relative: more inputs than freedoms can contradict each other.
        """
        others = np.delete(np.arange(self.unit.size), self.inputs)
        wanted = -self.N[:, self.inputs] @ (inputs / self.unit[self.inputs][:, None])
        if lie_screws is not None:
            here = shifted(np.moveaxis(lie_screws, 1, -1), self.centre)
            here[..., 3:] /= self.mechanism.length
            flat = np.moveaxis(here, -1, 1).reshape(6 * len(self.graph.loops), inputs.shape[1])
            wanted[: flat.shape[0]] -= flat
        if bends is not None:
            wanted[6 * len(self.graph.loops) :] -= bends
        passive = np.linalg.lstsq(self.N[:, others], wanted, rcond=None)[0]
        miss = np.abs(self.N[:, others] @ passive - wanted).max(axis=0, initial=0.0)
        rates = np.empty((self.unit.size, inputs.shape[1]))
        rates[self.inputs], rates[others] = inputs, passive * self.unit[others][:, None]
        return rates, miss / (1.0 + np.abs(wanted).max(axis=0, initial=0.0))


def circuits(mechanism: Mechanism, q: ArrayLike) -> Circuits:
    """Joint screws and circuit conditions of a mechanism at a closed posture ``q`` (nq,).

    Raises
    ------
    ClosureError
        Malformed or open posture; inputs that do not determine the motion (a direct singularity,
        or too few inputs).
    """
    q = first_order(mechanism, q, task=False).q
    graph = loops(mechanism)
    centre = centroid(mechanism)
    pairs = pair_screws(mechanism, graph, q, centre)
    columns = tuple(pairs.columns(range(len(graph.pairs))).values())
    unit = column_units(pairs, mechanism.length)
    rows = circuit_matrix(pairs)
    at_origin = shifted(si_screws(pairs, mechanism.length), -centre)
    inputs = _input_columns(mechanism, graph, columns)
    passive = np.delete(rows, inputs, axis=1)
    rank = numerical_rank(passive)
    if rank.value < passive.shape[1]:
        raise ClosureError(
            f"the inputs do not determine the motion: the circuits have {rank} in the other "
            f"joints, {passive.shape[1]} needed (a direct singularity, or too few inputs)"
        )
    screws = tuple(at_origin[where] for where in columns)
    return Circuits(
        mechanism, q, graph, screws, columns, rows, unit, centre, inputs, rank, pairs.couplings
    )


def _input_columns(
    mechanism: Mechanism, graph: LoopGraph, columns: tuple[slice, ...]
) -> np.ndarray:
    place = {
        joint: columns[p].start + i
        for p, pair in enumerate(graph.pairs)
        for i, joint in enumerate(pair.joints)
    }
    return np.array([place[joint] for joint in driven_joints(mechanism)], dtype=int)
