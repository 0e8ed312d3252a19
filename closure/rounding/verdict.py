"""Whether a file's numbers are rounded, and the exact mechanism that they stand for.

The question is put so: is there a mechanism within the tolerance of what is printed whose rows
depend on each other exactly, as rows of lower rank do? If so, that one is meant. Numbers that close
as they stand, with ranks that leave no doubt, are never touched.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from closedchain.closure.closures import Closure
from closedchain.closure.constraints import flipped_axes
from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE, Rank, independent_rows
from closedchain.closure.rounding.refit import POSTURES, Build, Movable, refit
from closedchain.closure.rounding.report import Change, Rounding
from closedchain.closure.rounding.settling import Settled, spread
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.descend import descend
from closedchain.closure.solve.newton import largest
from closedchain.closure.solve.starts import scattered, turned
from closedchain.urdf.digits import Number, default_tolerance, numbers, with_numbers

NONE = 1e-11
"""Tolerance [m] below which numbers are printed in full."""

_DOUBT = 1e-12  # dimensionless row or share of a singular value that rounding may have made
_RANKS = 4  # that are tried, from the least
_CLEAR = 0.1  # share of their size that singular values of the kept rows have where these are clear
_NOTHING = 1e-15  # change of a number that is none


def meant(
    build: Build, mechanism: Mechanism, tolerance: float | None
) -> tuple[Mechanism, Rounding | None]:
    """The mechanism that a file stands for, home as stated; with a report if it is another one.

    Parameters
    ----------
    build : callable
        Mechanism, home as stated, of a description.
    mechanism : Mechanism
        By the numbers as printed, home as stated.
    tolerance : float or None
        What roundings may leave open [m]; by the printed digits where None.
    """
    found = numbers(mechanism.description)
    if tolerance is None:
        tolerance = default_tolerance(mechanism.description, mechanism.length)
    share = tolerance / mechanism.length
    if tolerance < NONE or not any(isinstance(c, Closure) for c in mechanism.closures):
        return mechanism, None
    start = _nearly_closed(mechanism, share)
    if start is None:
        return mechanism, None
    for spots, rank in _along(mechanism, start, share):
        if not _doubtful(spots, rank):
            return mechanism, None
        for weights, values in _attempts(found, tolerance, mechanism.length):
            model = build(with_numbers(mechanism.description, found, values))
            now = [n if n.value == v else _at(n, v) for n, v in zip(found, values, strict=True)]
            movable = Movable(build, tuple(now), weights, rank, share)
            exact = refit(movable, model, [spot.q for spot in spots])
            if exact is None:
                continue
            changed = tuple(_changes(mechanism, exact))
            most = max((one.off * (1.0 if one.is_length else mechanism.length) for one in changed),
                       default=0.0)  # fmt: skip
            if most <= tolerance:
                return exact, _report(mechanism, exact, spots, tolerance, changed)
    return mechanism, None


def _nearly_closed(mechanism: Mechanism, share: float) -> np.ndarray | None:
    """Posture (nq,) whose rows are open by no more than the ``share``, beside home if there is."""
    everything = np.arange(mechanism.model.nv)
    equations = Equations(mechanism, everything)
    starts = [*scattered(mechanism, mechanism.home), *turned(mechanism, mechanism.home, everything)]
    for start in starts:
        near = descend(equations, start, floor=share)
        near_enough = largest(near.values / equations.row_scale) <= share
        if near_enough and not flipped_axes(mechanism, near.q):
            return near.q
    return None


def _along(
    mechanism: Mechanism, start: np.ndarray, share: float
) -> Iterator[tuple[list[Settled], int]]:
    """Postures along the motions for one rank after the other, from the least that may be."""
    equations = Equations(mechanism, np.arange(mechanism.model.nv))
    s = np.linalg.svd(equations.evaluate(start)[1], compute_uv=False)
    rank = int((s > share * s.max(initial=0.0)).sum())
    tried = 0
    while rank < mechanism.rows and rank <= mechanism.model.nv and tried < _RANKS:
        spots = spread(mechanism, start, rank, share, POSTURES) if rank else []
        higher = max((_count(spot, share) for spot in spots), default=rank)
        if higher > rank:  # the start is special: elsewhere more rows are independent
            rank = higher
            continue
        if spots:
            yield spots, rank
        elif not rank:
            return
        rank, tried = rank + 1, tried + 1


def _count(spot: Settled, share: float) -> int:
    return int((spot.values > share * spot.values[0]).sum())


def _doubtful(spots: Sequence[Settled], rank: int) -> bool:
    """Whether rounding may be at work: rows that stay open, or small singular values."""
    small = max((float(s.values[rank] / s.values[0]) for s in spots if rank < s.values.size),
                default=0.0)  # fmt: skip
    return small > RANK_TOLERANCE or max(spot.open for spot in spots) > _DOUBT


def _attempts(
    found: Sequence[Number], tolerance: float, length: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Weights (n,) and first values (n,) of the numbers: what may move, and from where.

    Angles printed for a multiple of 15 degrees are that first; then every rounded number moves as
    its last digit lets it; then every number.
    """
    printed = np.array([n.value for n in found])
    snapped = np.array([n.meant for n in found])
    units = np.array([n.unit for n in found])
    if (snapped != printed).any():
        yield np.where(snapped != printed, 0.0, units), snapped
    if units.any():
        yield units, printed
    yield np.array([tolerance if n.is_length else tolerance / length for n in found]), printed


def _at(number: Number, value: float) -> Number:
    return Number(number.owner, number.part, number.index, value, number.unit, value)


def _report(
    printed: Mechanism,
    exact: Mechanism,
    spots: Sequence[Settled],
    tolerance: float,
    changed: tuple[Change, ...],
) -> Rounding:
    """What the printed numbers miss at postures (nq,) along the motions.

    Postures at which the kept rows are much less independent than all rows tell of the choice, not
    of the numbers, and are left out.
    """
    rank = spots[0].rank
    equations = Equations(printed, np.arange(printed.model.nv))
    jacobians = np.array([equations.evaluate(spot.q)[1] for spot in spots])
    kept = independent_rows(jacobians, rank)
    others = [row for row in range(exact.rows) if row not in kept]
    missed, above, below = 0.0, np.inf, 0.0
    for spot, jacobian in zip(spots, jacobians, strict=True):
        least = np.linalg.svd(jacobian[list(kept)], compute_uv=False)[-1] if rank else np.inf
        values = _kept_closed(equations, spot.q, kept)
        if values is not None and (spot is spots[0] or least > _CLEAR * spot.values[rank - 1]):
            missed = max(missed, largest(values[others]))
        above = min(above, float(spot.values[rank - 1]) if rank else np.inf)
        below = max(below, float(spot.values[rank]) if rank < spot.values.size else 0.0)
    return Rounding(tolerance, missed, kept, tuple(others), Rank(rank, above, below), changed)


def _kept_closed(equations: Equations, q: np.ndarray, kept: Sequence[int]) -> np.ndarray | None:
    """Rows (rows,) [m, rad] with the kept ones closed, by Newton steps of least length from q."""
    rows = list(kept)
    for _ in range(20):
        values, matrix = equations.evaluate(q)
        if largest(values[rows]) < 1e-13:
            return values
        scaled = values[rows] / equations.row_scale[rows]
        q = equations.move(q, -np.linalg.lstsq(matrix[rows], scaled, rcond=None)[0])
    return values if largest(values[rows]) < CLOSED else None


def _changes(printed: Mechanism, exact: Mechanism) -> Iterator[Change]:
    for old, new in zip(numbers(printed.description), numbers(exact.description), strict=True):
        if abs(new.value - old.value) > _NOTHING:
            kind = "" if old.part.endswith("axis") else " xyz" if old.index < 3 else " rpy"
            yield Change(f"{old.owner} {old.part}{kind}", old.is_length, old.value, new.value)
