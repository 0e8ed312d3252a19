"""Redundancy: motions of inputs and joints that leave the outputs at rest, and inputs to lock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.first_order import FirstOrder, first_order
from closedchain.analysis.singularity.classify import SINGULAR
from closedchain.analysis.singularity.deciding import Deciding
from closedchain.analysis.structure.driving import driving
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.analysis.velocity import velocity_at
from closedchain.closure.given import finite_vector
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import Rank
from closedchain.urdf.errors import ClosureError, known_names

_LISTED = 8  # choices that must not be locked, in the text


@dataclass(frozen=True, eq=False)
class Split:
    """Velocity equation V = G Q + Q_* with some inputs singled out [Gallardo2010, eq. (30)]_.

    Attributes
    ----------
    free : tuple of str
        The inputs singled out: what Q_* is made of.
    chosen : tuple of str
        The others, whose rates are Q.
    outputs : tuple of str
        What V (d,) holds, in order [m/s, rad/s].
    G : (d, d) array
        Output rates per unit rate of the chosen inputs.
    coefficients : (d, k) array
        Output rates per unit rate of the free inputs.
    sigma : float
        Smallest singular value of the dimensionless G; 0 where the free inputs cannot be locked.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> split = cc.redundancy(m, m.home, "x y z rx rz").split("q3")
    >>> v = [0.01, 0.0, 0.0, 0.0, 0.0]  # wanted output rates
    >>> rates = split.rates(v, free=0.02)  # of the other inputs, while q3 moves at 0.02 m/s
    >>> bool(np.allclose(split.G @ rates + split.q_star([0.02]), v))
    True
    """

    free: tuple[str, ...]
    chosen: tuple[str, ...]
    outputs: tuple[str, ...]
    G: np.ndarray
    coefficients: np.ndarray
    sigma: float

    def q_star(self, rates: ArrayLike) -> np.ndarray:
        """Q_* (d,) [m/s, rad/s] of rates (k,) of the free inputs."""
        values = finite_vector(rates, len(self.free), "rates of the free inputs", "per second")
        return np.asarray(self.coefficients @ values)

    def rates(self, outputs: ArrayLike, free: ArrayLike | float = 0.0) -> np.ndarray:
        """Rates Q (d,) of the chosen inputs for output rates V (d,) and rates of the free ones.

        Raises
        ------
        ClosureError
            Malformed numbers, or a G that is singular.
        """
        wanted = finite_vector(outputs, len(self.outputs), "output rates", "m/s, rad/s")
        rates = np.full(len(self.free), free) if np.ndim(free) == 0 else free
        given = finite_vector(rates, len(self.free), "rates of the free inputs", "per second")
        if self.sigma < SINGULAR:
            raise ClosureError(
                f"G is singular with {' '.join(self.free)} free (smallest singular value "
                f"{self.sigma:.3g}): the other inputs alone do not produce all outputs"
            )
        return np.asarray(np.linalg.solve(self.G, wanted - self.q_star(given)))


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
    generic : int
        Freedoms of the mechanism beyond the outputs at a generic posture, 0 at least.
    surplus : int
        Inputs beyond the mechanism's mobility: redundancy of actuation, which adds forces but no
        motion. Negative where freedoms are not driven.
    twist_map : (d, n_inputs) array or None
        As ``cc.velocity`` gives it; None as well where there are more inputs than freedoms.
    locks : mapping of names to float
        For each choice of ``generic`` inputs: the smallest singular value of the dimensionless
        map (d, d) from the other inputs to the outputs. 0 where these inputs cannot be locked.
        Empty without such choices or without a twist map.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> r = cc.redundancy(m, m.home, "x y z rx rz")
    >>> r.dimension, r.lockable
    (1, (('q1',), ('q2',), ('q3',)))
    >>> split = r.split("q3")
    >>> split.G.shape
    (5, 5)
    """

    dimension: int
    inputs: np.ndarray
    joints: np.ndarray
    outputs: tuple[str, ...]
    rank: Rank
    generic: int
    surplus: int
    twist_map: np.ndarray | None
    locks: Mapping[tuple[str, ...], float]
    text: str
    _names: tuple[str, ...] = field(repr=False)
    _units: tuple[np.ndarray, np.ndarray] = field(repr=False)

    @property
    def lockable(self) -> tuple[tuple[str, ...], ...]:
        """Choices of inputs that may be locked without losing an output."""
        return tuple(names for names, sigma in self.locks.items() if sigma > SINGULAR)

    def split(self, free: str | Sequence[str]) -> Split:
        """Split the velocity equation as V = G Q + Q_* for a choice of the free inputs.

        Parameters
        ----------
        free : str or sequence of str
            As many inputs as there are beyond the outputs.

        Raises
        ------
        ClosureError
            Unknown or repeated names, a wrong number of them, or no map from inputs to outputs.
        """
        names = tuple(free.replace(",", " ").split()) if isinstance(free, str) else tuple(free)
        for name in names:
            if name not in self._names:
                raise ClosureError(known_names(str(name), "input", self._names))
        if self.twist_map is None:
            raise ClosureError(
                "there is no map from inputs to outputs to be split: "
                + (
                    f"there are {len(self._names)} inputs for "
                    f"{len(self._names) - self.surplus} freedoms, so they have to agree"
                    if self.surplus > 0
                    else "the inputs do not determine the motion (a direct singularity, or "
                    "freedoms that are not driven)"
                )
            )
        count = len(self._names) - len(self.outputs)
        if len(set(names)) != count or len(names) != count:
            raise ClosureError(
                f"G is square with {count} distinct input{'s' * (count != 1)} free, "
                f"got {' '.join(names) or 'none'}"
            )
        chosen = tuple(n for n in self._names if n not in names)
        here = [self._names.index(n) for n in chosen]
        rest = [self._names.index(n) for n in names]
        return Split(
            free=names,
            chosen=chosen,
            outputs=self.outputs,
            G=self.twist_map[:, here],
            coefficients=self.twist_map[:, rest],
            sigma=_smallest(self.twist_map, here, *self._units),
        )


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
        Malformed or open posture, unknown outputs, no task, no inputs.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> r = cc.redundancy(m, m.home, "x y z rx rz")
    >>> print(r.inputs[:, 0].round(3) + 0.0)  # the coupler slides while the tool rests
    [0.577 0.577 0.577 0.    0.    0.   ]
    """
    mechanism.required_inputs()
    at = first_order(mechanism, q, outputs)
    decided = Deciding(at)
    rank = decided.held.rank
    still = decided.stacked_factors.kernel(mechanism.model.nv - rank.value)
    basis = _by_inputs(still, mechanism.input_v)
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
    mobility = mechanism.model.nv - generic_rank(mechanism)
    generic = max(mobility - len(at.outputs), 0)
    surplus = len(mechanism.inputs) - mobility
    twist_map = velocity_at(decided).twist_map if surplus == 0 else None
    units = at.output_unit, at.column_unit[mechanism.input_v]
    locks = {} if twist_map is None else _locks(mechanism.inputs, twist_map, generic, units)
    return Redundancy(
        dimension=basis.shape[1],
        inputs=inputs,
        joints=joints,
        outputs=at.outputs,
        rank=rank,
        generic=generic,
        surplus=surplus,
        twist_map=twist_map,
        locks=MappingProxyType(locks),
        text=_text(at, inputs, rank, surplus, twist_map, locks),
        _names=mechanism.inputs,
        _units=units,
    )


def _locks(
    names: tuple[str, ...],
    twist_map: np.ndarray,
    generic: int,
    units: tuple[np.ndarray, np.ndarray],
) -> dict[tuple[str, ...], float]:
    """Smallest singular value of the square map that each choice of locked inputs leaves."""
    if not generic:
        return {}
    found = {}
    for locked in combinations(range(len(names)), generic):
        others = [i for i in range(len(names)) if i not in locked]
        found[tuple(names[i] for i in locked)] = _smallest(twist_map, others, *units)
    return found


def _smallest(
    twist_map: np.ndarray, columns: list[int], output_unit: np.ndarray, input_unit: np.ndarray
) -> float:
    """Smallest singular value of dimensionless columns of a twist map."""
    scaled = (twist_map * input_unit / output_unit[:, None])[:, columns]
    return float(np.linalg.svd(scaled, compute_uv=False)[-1])


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


def _text(
    at: FirstOrder,
    inputs: np.ndarray,
    rank: Rank,
    surplus: int,
    twist_map: np.ndarray | None,
    locks: Mapping[tuple[str, ...], float],
) -> str:
    mechanism = at.mechanism
    left = inputs.shape[1]
    remain = (
        "1 freedom of motion remains" if left == 1 else f"{left or 'no'} freedoms of motion remain"
    )
    lines = [
        f"{mechanism.name}: with outputs {' '.join(at.outputs)} at rest, {remain}; "
        f"[K; J] has {rank}."
    ]
    for column in inputs.T:
        if not column.any():
            driven = "direct singularity" if surplus >= 0 else "freedoms that are not driven"
            lines.append(f"  a motion with all inputs at rest ({driven})")
            continue
        rates = zip(mechanism.inputs, column.round(12) + 0.0, strict=True)  # no -0
        lines.append("  input rates " + ", ".join(f"{n} {x:+.4f}" for n, x in rates))
    mobility = len(mechanism.inputs) - surplus
    if surplus > 0:
        lines.append(
            f"  {len(mechanism.inputs)} inputs drive {mobility} freedoms: redundancy of actuation, "
            f"degree {surplus}. It adds no motion; rates of the inputs must agree with the loops."
        )
    if surplus < 0:
        lines.append(
            f"  {len(mechanism.inputs)} inputs for {mobility} freedoms: {-surplus} not driven."
        )
        lines.extend(f"  {sentence}" for sentence in driving(mechanism, at.outputs))
    if surplus == 0 and twist_map is None:
        lines.append("  the inputs do not determine the motion: no choice of inputs to lock.")
    if locks:
        best = sorted(locks.items(), key=lambda item: -round(item[1], 9))  # ties in order
        may = ", ".join(f"{' '.join(n)} {s:.4g}" for n, s in best if s > SINGULAR)
        dead = [" ".join(n) for n, s in locks.items() if s <= SINGULAR]
        if len(dead) > _LISTED:
            dead = [*dead[:_LISTED], f"and {len(dead) - _LISTED} other choices"]
        lines.append(f"  may be locked (smallest singular value left): {may or 'none'}")
        if dead:
            lines.append(f"  must not be locked: {', '.join(dead)}")
    return "\n".join(lines)
