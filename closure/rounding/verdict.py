"""Whether a file's numbers are rounded, and the exact mechanism that they stand for.

The question is put so: is there a mechanism within the tolerance of what is printed whose rows
depend on each other exactly, as rows of lower rank do? If so, that one is meant. Numbers that close
as they stand, with ranks that leave no doubt, are never touched.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from closedchain.closure.closures import Closure
from closedchain.closure.constraints import flipped_axes
from closedchain.closure.equations import Equations
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import RANK_TOLERANCE
from closedchain.closure.rounding.attempts import attempts
from closedchain.closure.rounding.bending import Around
from closedchain.closure.rounding.misfit import Misfit, misfit
from closedchain.closure.rounding.parts import Part, parts_of
from closedchain.closure.rounding.refit import POSTURES, Build, Movable, Search, Spot, refit
from closedchain.closure.rounding.report import Change, Rounding, together
from closedchain.closure.rounding.settling import Along, Settled
from closedchain.closure.solve.descend import Descent, descend
from closedchain.closure.solve.leaving import left
from closedchain.closure.solve.newton import largest
from closedchain.closure.solve.starts import scattered, turned
from closedchain.urdf.digits import default_tolerance, numbers

NONE = 1e-11
"""Tolerance [m] below which numbers are printed in full."""

_DOUBT = 1e-12  # dimensionless row or share of a singular value that rounding may have made
_RANKS = 4  # that are tried, from the least
_NOTHING = 1e-15  # change of a number that is none


@dataclass(frozen=True, eq=False)
class _Question:
    """A part of a mechanism as printed, and the tolerance [m]."""

    part: Part
    printed: Mechanism
    tolerance: float

    @property
    def share(self) -> float:
        return self.tolerance / self.printed.length

    @property
    def equations(self) -> Equations:
        return self.part.equations(self.part.alone(self.printed))


def meant(
    build: Build, mechanism: Mechanism, tolerance: float | None
) -> tuple[Mechanism, Rounding | None, tuple[str, ...]]:
    """The mechanism that a file stands for, home as stated; with a report if it is another one.

    The sentences are on closures whose rows nearly depend on each other, and yet are taken as
    printed: no mechanism was found within the tolerance in which they do.

    Parameters
    ----------
    build : callable
        Mechanism, home as stated, of a description.
    mechanism : Mechanism
        By the numbers as printed, home as stated.
    tolerance : float or None
        What roundings may leave open [m]; by the printed digits where None.
    """
    if tolerance is None:
        tolerance = default_tolerance(mechanism.description, mechanism.length)
    if tolerance < NONE or not any(isinstance(c, Closure) for c in mechanism.closures):
        return mechanism, None, ()
    exact, told, doubts = mechanism, [], []
    for part in parts_of(mechanism):
        found = _of_part(_Question(part, mechanism, tolerance), build, exact)
        if isinstance(found, str):
            doubts.append(found)
        elif found is not None:
            exact, missed = found
            told.append((part, missed))
    if exact is mechanism:
        return mechanism, None, tuple(doubts)
    changes = tuple(_changes(mechanism, exact))
    return exact, together(mechanism, tolerance, told, changes), tuple(doubts)


def _of_part(
    asked: _Question, build: Build, before: Mechanism
) -> tuple[Mechanism, Misfit] | str | None:
    """The mechanism with the numbers of one part as they are read, and what the printed ones miss.

    ``before`` has the numbers of other parts as they are read; it is returned where those of this
    one stand as printed. A sentence where rows nearly depend on each other and cannot be made to;
    None where no row is redundant, or nothing closes nearly.
    """
    start = _nearly_closed(asked)
    if start is None:
        return None
    doubt: str | None = None
    owners = asked.part.owners(asked.printed)
    found = [n for n in numbers(before.description) if n.owner in owners]
    for search, begin, spots in _searches(asked, start):
        rank = max(spot.rank for spot in spots)
        plain = [spot for spot in spots if spot.rank == rank]
        if not _doubtful(spots):
            return before, misfit(asked.equations, plain)
        doubt = doubt or _doubt(asked, plain[0])
        if len(spots) == 1 and rank < asked.equations.free.size:
            continue  # the motions that this rank promises lead nowhere
        length = asked.printed.length
        for attempt in attempts(before.description, found, asked.tolerance, length, owners):
            movable = Movable(asked.part, build, attempt, search)
            exact = refit(movable, build(attempt.description), begin, spots)
            if exact is not None and _near(asked, exact):
                return exact, misfit(asked.equations, plain)
    return doubt


def _doubt(asked: _Question, spot: Spot) -> str:
    rank = spot.rank
    names = [asked.printed.closures[i].name for i in asked.part.closures]
    listed = ", ".join(repr(name) for name in names[:4])
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    above = f"{spot.values[rank - 1]:.3g} | " if rank else ""
    below = f"{spot.values[rank]:.2g}" if rank < spot.values.size else "0"
    count = len(asked.part.rows)
    return (
        f"of the {count} rows of {listed}{more} hardly more than {rank} are independent "
        f"(singular values {above}{below}). Rounded numbers may look so; but no mechanism in which "
        f"the others depend on these was found within the tolerance of {asked.tolerance:.2g} m, "
        "and the numbers are taken as printed"
    )


def _nearly_closed(asked: _Question) -> np.ndarray | None:
    """Posture (nq,) whose rows are open by no more than the tolerance, beside home if there is."""
    equations, home = asked.equations, asked.printed.home
    alone, free = equations.mechanism, equations.free
    if _near_enough(asked, alone, home, equations.residual(home) / equations.row_scale):
        return home
    for start in (*scattered(alone, home, free), *turned(alone, home, free)):
        near = descend(equations, start, floor=asked.share)
        if _closed_enough(asked, near):
            return near.q
    return None


def _closed_enough(asked: _Question, near: Descent) -> bool:
    equations = asked.equations
    return _near_enough(asked, equations.mechanism, near.q, near.values / equations.row_scale)


def _independent(matrix: np.ndarray, share: float) -> int:
    """How many rows of a matrix rounding cannot make dependent."""
    s = np.linalg.svd(matrix, compute_uv=False)
    return int((s > share * max(1.0, s.max(initial=0.0))).sum())


def _near_enough(asked: _Question, alone: Mechanism, q: np.ndarray, rows: np.ndarray) -> bool:
    return largest(rows) <= asked.share and not flipped_axes(alone, q)


def _searches(
    asked: _Question, start: np.ndarray
) -> Iterator[tuple[Search, np.ndarray, Sequence[Spot]]]:
    """Postures, and how they were looked for from which one (nq,): the least ranks first."""
    equations, share = asked.equations, asked.share
    values, matrix = equations.evaluate(start)
    rank = _independent(matrix, share)
    tried, special = 0, True
    while rank < values.size and rank <= equations.free.size and tried < _RANKS:
        along = Along(rank, share)
        spots = along.spread(equations, start, POSTURES)
        few = len(spots) < POSTURES // 2 and rank < equations.free.size
        higher = max((_count(spot, share) for spot in spots), default=rank)
        if special and (few or higher > rank):
            # closed to the first order in directions in which nothing moves: perhaps everywhere,
            # or as where a linkage lies flat, and what it is shows elsewhere
            special = False
            around = Around(share)
            bent = around.spread(equations, start, POSTURES)
            if len(bent) >= POSTURES // 2:
                yield around, start, bent
            away = None
            if few:
                away = left(equations, start, lambda near: _closed_enough(asked, near), share)
            if away is not None:
                start, rank = away, _independent(equations.evaluate(away)[1], share)
                continue
        if higher > rank:  # the start is special: elsewhere more rows are independent
            rank = higher
            continue
        if spots:
            yield along, start, spots
        rank, tried = rank + 1, tried + 1


def _count(spot: Settled, share: float) -> int:
    return int((spot.values > share * spot.size).sum())


def _doubtful(spots: Sequence[Spot]) -> bool:
    """Whether rounding may be at work: rows that stay open, or small singular values."""
    small = [float(s.values[s.rank] / s.size) for s in spots if s.rank < s.values.size]
    return max(small, default=0.0) > RANK_TOLERANCE or max(spot.open for spot in spots) > _DOUBT


def _near(asked: _Question, exact: Mechanism) -> bool:
    """Whether no number has moved by more than the tolerance."""
    length = asked.printed.length
    off = (one.off * (1.0 if one.is_length else length) for one in _changes(asked.printed, exact))
    return max(off, default=0.0) <= asked.tolerance


def _changes(printed: Mechanism, exact: Mechanism) -> Iterator[Change]:
    for old, new in zip(numbers(printed.description), numbers(exact.description), strict=True):
        if abs(new.value - old.value) > _NOTHING:
            kind = "" if old.part.endswith("axis") else " xyz" if old.index < 3 else " rpy"
            yield Change(f"{old.owner} {old.part}{kind}", old.is_length, old.value, new.value)
