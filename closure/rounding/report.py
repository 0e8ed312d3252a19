"""What is said of a mechanism whose numbers are rounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from closedchain.closure.ranks import Rank

if TYPE_CHECKING:
    from closedchain.closure.mechanism import Mechanism
    from closedchain.closure.rounding.misfit import Misfit
    from closedchain.closure.rounding.parts import Part


@dataclass(frozen=True)
class Change:
    """A number that is read as another one.

    Attributes
    ----------
    where : str
        Joint or constraint, and what of it.
    is_length : bool
        Whether it is in m; else an angle or a component of an axis.
    printed, read : float
    """

    where: str
    is_length: bool
    printed: float
    read: float

    @property
    def off(self) -> float:
        """How far the two are apart."""
        return abs(self.read - self.printed)


@dataclass(frozen=True)
class Rounding:
    """A file with rounded numbers, and the exact mechanism that it is read as.

    Attributes
    ----------
    tolerance : float
        What roundings may leave open [m]; angles times the characteristic length.
    misfit : float
        Largest redundant row [m, rad] by the numbers as printed, with the kept rows closed to
        1e-12: over home and postures around it.
    kept, redundant : tuples of int
        Rows of the closures that are independent, and the others.
    rank : Rank
        Rank r by the numbers as printed, with the singular values around the cut: the smallest
        that counts, and the largest that rounding makes.
    changed : tuple of Change
        Numbers that are read as others.
    """

    tolerance: float
    misfit: float
    kept: tuple[int, ...]
    redundant: tuple[int, ...]
    rank: Rank
    changed: tuple[Change, ...]

    @property
    def text(self) -> str:
        """One sentence."""
        most = max((change.off for change in self.changed), default=0.0)
        count = len(self.changed)
        return (
            f"the numbers are rounded: of {len(self.kept) + len(self.redundant)} closure rows "
            f"{len(self.kept)} are independent, and with these closed the others miss by up to "
            f"{self.misfit:.2g} (tolerance {self.tolerance:.2g}; singular values "
            f"{self.rank.above:.3g} | {self.rank.below:.2g}). It is read as the nearest mechanism "
            f"that closes exactly: {count} number{'s' * (count != 1)} changed by up to {most:.2g}"
        )


def together(
    mechanism: Mechanism,
    tolerance: float,
    told: Sequence[tuple[Part, Misfit]],
    changed: tuple[Change, ...],
) -> Rounding:
    """Report on all parts of a mechanism; ``told`` are those with redundant rows.

    Rows of the other parts are kept.
    """
    redundant = sorted(
        part.rows[i] for part, missed in told for i in range(len(part.rows)) if i not in missed.kept
    )
    kept = tuple(sorted(set(range(mechanism.rows)) - set(redundant)))
    ranks = [missed.rank for _, missed in told]
    rank = Rank(len(kept), min(r.above for r in ranks), max(r.below for r in ranks))
    most = max(missed.missed for _, missed in told)
    return Rounding(tolerance, most, kept, tuple(redundant), rank, changed)
