"""How every solver ends: one enumeration of endings, one result that carries them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np


class Ending(Enum):
    """Why a solver ended. The value is the word in public results; ``sentence`` is for people.

    ``code`` is a small integer for arrays and machine code; ``Ending.of`` takes it back.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> ending = cc.direct(m, [-0.1, -0.15, -0.2]).ending
    >>> ending.word, ending.good
    ('arrived', True)
    >>> ending.sentence
    'what was asked for was reached'
    """

    # -- as asked
    ARRIVED = "arrived", "what was asked for was reached"
    CLOSED = "closed", "the curve closes on itself"
    UNTRIED = "untried", "nothing was tried"

    # -- the start
    SINGULAR_START = "singular start", "the start is singular: no branch leads on from it"
    OPEN_START = "open start", "the start does not close, and no closed posture lies beside it"
    UNREACHED = "unreached", "the first sample is not reached from the start"

    # -- Newton's method, which must not change branch
    FAR = "far", "Newton's steps are long or do not shrink: another solution may be nearer"
    SLOW = "slow", "Newton's method needs too many steps"
    SINGULAR = "singular", "the Jacobian of the equations is singular"
    OTHER_SIDE = "other side", "the determinant of the Jacobian changes sign: another branch"
    RANK = "rank", "the Jacobian changes so much that it may lose rank on the way"

    # -- descent from anywhere
    OPEN = "open", "the equations stay open: their least value is not zero"
    OTHER_BRANCH = "other branch", "only another branch reaches what was asked for"

    # -- on the way
    FOLD = "fold", "the Jacobian for the prescribed coordinates loses rank"
    DEGENERATE = "degenerate", "the equations lose rank, so that the curve has no single direction"
    SINGULARITY = "singularity", "a singularity was met"
    STUCK = "stuck", "steps became too small with no singularity in sight"
    CONTRADICTION = "contradiction", "the path contradicts the loops"
    LOST = "lost", "the errors of the integration grow without bound"

    # -- what a posture or a range does not allow
    MIRRORED = "mirrored", "the loops close only with a joint's axis reversed"
    REVERSED = "reversed", "the tip would point backwards"
    LIMIT = "joint limit", "a joint reaches its limit"
    SPEED = "speed limit", "a joint would have to move faster than it may"
    EDGE = "edge of the range", "the edge of the range of the coordinates"
    LEAVES = "leaves the branch", "the curve leaves the branch that was asked for"

    # -- the work
    BUDGET = "cut short", "the number of steps that was allowed is used up"
    INTERRUPTED = "interrupted", "the work was interrupted"

    sentence: str
    code: int

    def __new__(cls, word: str, sentence: str) -> Ending:
        """Make a member from its word and its sentence; codes count up from 0."""
        member = object.__new__(cls)
        member._value_ = word
        member.sentence = sentence
        member.code = len(cls.__members__)
        return member

    @classmethod
    def of(cls, code: int) -> Ending:
        """Ending with a ``code``; raises ``IndexError`` for others."""
        return _BY_CODE[code]

    @classmethod
    def named(cls, word: str) -> Ending:
        """Ending with a ``word``; raises ``KeyError`` for others."""
        return _BY_WORD[word]

    @property
    def word(self) -> str:
        """Its word in public results."""
        return str(self.value)

    @property
    def good(self) -> bool:
        """Whether it is what was asked for."""
        return self in (Ending.ARRIVED, Ending.CLOSED)


_BY_CODE = tuple(Ending)
_BY_WORD = {e.word: e for e in Ending}
_GOOD = tuple(e.code for e in Ending if e.good)


@dataclass(frozen=True, eq=False)
class Outcome:
    """Postures that a solver gives, many at once; one posture is a batch of one.

    Attributes
    ----------
    q : (n, nq) array
        The solution, or the last good posture; write-protected like the rest.
    residual : (n,) array
        Largest row of all equations, in the unit of the solver's rows [m or rad; or none].
    branch : (n,) array of int
        Sign of the determinant of the equations; 0 where they are singular or not square.
    codes : (n,) array of int
        ``Ending.code`` of each.
    reached : (n,) array
        Share of the way that was gone, 1 where there is no way.
    evaluations : int
        Of the equations, all postures together.
    """

    q: np.ndarray
    residual: np.ndarray
    branch: np.ndarray
    codes: np.ndarray
    reached: np.ndarray
    evaluations: int = 0

    def __post_init__(self) -> None:
        """Write-protect the arrays: a result is a value."""
        for array in (self.q, self.residual, self.branch, self.codes, self.reached):
            array.setflags(write=False)

    @classmethod
    def one(cls, q: np.ndarray, residual: float, branch: int | None, ending: Ending) -> Outcome:
        """Outcome of one posture (nq,) without a way."""
        numbers = (np.array([residual]), np.array([branch or 0]), np.array([ending.code]))
        return cls(np.array(q)[None], *numbers, np.ones(1))

    def __len__(self) -> int:
        """Return the number of postures."""
        return len(self.q)

    @property
    def converged(self) -> np.ndarray:
        """Which ones are what was asked for, (n,) of bool."""
        return np.asarray(np.isin(self.codes, _GOOD))

    @property
    def good(self) -> bool:
        """Whether all of them are what was asked for."""
        return bool(self.converged.all())

    @property
    def posture(self) -> np.ndarray:
        """The only posture (nq,); raises ``ValueError`` where there are more."""
        (posture,) = self.q
        return np.asarray(posture)

    @property
    def endings(self) -> tuple[Ending, ...]:
        """Why each one ended."""
        return tuple(Ending.of(int(code)) for code in self.codes)

    @property
    def ending(self) -> Ending:
        """Why the only one ended; raises ``ValueError`` where there are more."""
        (ending,) = self.endings
        return ending
