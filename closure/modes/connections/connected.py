"""The result of asking how modes hang together in a slice."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from closedchain.closure.modes.connections.meetings import Meeting
from closedchain.closure.modes.connections.passages import Passage
from closedchain.urdf.errors import ClosureError, known_names


@dataclass(frozen=True, eq=False)
class Searched:
    """What was looked through.

    Attributes
    ----------
    over : mapping of coordinate to (lowest, highest)
        The window [m or rad].
    at : mapping of coordinate to value
        Those of the modes.
    units : tuple of str
        Of these coordinates, "m" or "rad".
    held : mapping of coordinate to value
        The others.
    shape : tuple of int
        Grid points along each coordinate.
    postures : int
        Over these grid points, that modes lead to without a singularity.
    ways : int
        Straight ways along which meetings were sought.
    limits : bool
        Whether joints were kept within their limits.
    cut_short : bool
        Whether there were more postures than are kept.

    Examples
    --------
    >>> m = cc.load("three_rpr")
    >>> modes = cc.postures(m, inputs=m.input_values(m.home), count=False)
    >>> looked = modes.connections("q2 q3", resolution=30).searched
    >>> list(looked.over), list(looked.held), looked.cut_short
    (['q2', 'q3'], ['q1'], False)
    """

    over: Mapping[str, tuple[float, float]]
    at: Mapping[str, float]
    units: tuple[str, ...]
    held: Mapping[str, float]
    shape: tuple[int, ...]
    postures: int
    ways: int
    limits: bool
    cut_short: bool


@dataclass(frozen=True, eq=False)
class Connections:
    """How modes hang together in a slice: what is joined without a singularity, and what meets.

    Attributes
    ----------
    groups : tuple of tuple of str
        Modes that are joined without a singularity, in the order of the postures: those of one
        group lie in one aspect.
    passages : tuple of Passage
        The proof of it: as few as join each group. ``passage(one, two)`` puts them together.
    meetings : tuple of Meeting
        Of each pair of modes that meet, the nearest place on a straight way, nearest first; and
        singularities at which a mode meets none of the others, where these are nearer.
    kind : str
        What the coordinates end at: "direct" singularities where inputs are held, "inverse" ones
        where the tip is; "fixed joints" where other joints are.
    signs : mapping of mode to int
        Of the determinant, where it tells sides apart; else 0.
    bounded : tuple of bool
        For each group, whether what it reaches lies within the window, and does not end at a
        joint limit: a wider window would show no more.
    left_out : mapping of mode to str
        Modes that were not followed, and why.
    axes : mapping of coordinate to (n,) array
        Values of the grid [m or rad].
    counts : (groups, *grid) int array
        How many postures of each group there are over each grid point.
    unconfirmed : tuple of (str, str)
        Pairs that the grid joins, by ways that did not hold when they were followed again.
    searched : Searched

    Examples
    --------
    >>> m = cc.load("three_rpr")
    >>> modes = cc.postures(m, inputs=m.input_values(m.home), count=False)
    >>> found = modes.connections({"q2": (2.0, 32.0), "q3": (2.0, 32.0)}, resolution=30)
    >>> [len(group) for group in found.groups]  # two aspects, three modes in each
    [3, 3]
    >>> {found.signs[name] for name in found.groups[0]}
    {1}
    """

    groups: tuple[tuple[str, ...], ...]
    passages: tuple[Passage, ...]
    meetings: tuple[Meeting, ...]
    kind: str
    signs: Mapping[str, int]
    bounded: tuple[bool, ...]
    left_out: Mapping[str, str]
    axes: Mapping[str, np.ndarray]
    counts: np.ndarray
    unconfirmed: tuple[tuple[str, str], ...]
    searched: Searched

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        for array in (self.counts, *self.axes.values()):
            array.setflags(write=False)

    @property
    def modes(self) -> tuple[str, ...]:
        """All modes, those left out at the end."""
        return (*(name for group in self.groups for name in group), *self.left_out)

    def joined(self, one: str, two: str) -> bool:
        """Whether two modes are known to be joined without a singularity. Raises ``KeyError``."""
        return any({self._known(one), self._known(two)} <= set(group) for group in self.groups)

    def passage(self, one: str, two: str) -> Passage:
        """A way without a singularity from a mode to another one.

        It may be put together of several passages; each keeps joints within their limits, and
        from one to the next a hinge with limits may have to be a whole turn back.

        Raises
        ------
        KeyError
            There is no such mode.
        ClosureError
            No way was found.
        """
        if one == two or not self.joined(one, two):
            what = "a mode needs no way to itself" if one == two else "no such way was found"
            raise ClosureError(f"from {one!r} to {two!r} without a singularity: {what}")
        ways: dict[str, list[Passage]] = {one: []}
        front = [one]
        while two not in ways:
            here = front.pop(0)
            for passage in (*self.passages, *(p.reversed() for p in self.passages)):
                if passage.modes[0] == here and passage.modes[1] not in ways:
                    ways[passage.modes[1]] = [*ways[here], passage]
                    front.append(passage.modes[1])
        first, *others = ways[two]
        for other in others:
            first = first.then(other)
        return first

    def meeting(self, one: str, two: str) -> Meeting | None:
        """Where two modes meet at a singularity, if they were seen to. Raises ``KeyError``."""
        pair = {self._known(one), self._known(two)}
        return next((m for m in self.meetings if set(m.modes) == pair), None)

    def _known(self, name: str) -> str:
        if name not in self.modes:
            raise KeyError(known_names(str(name), "mode", self.modes))
        return name

    @property
    def text(self) -> str:
        """What was found, and what that claims, in sentences."""
        lines = [self._where()]
        for group, bounded in zip(self.groups, self.bounded, strict=True):
            lines.append(self._group(group, bounded=bounded))
        lines += self._apart()
        lines += [self._meets(meeting) for meeting in self.meetings]
        lines += [f"{name} was not followed: {why}." for name, why in self.left_out.items()]
        for pair in self.unconfirmed:
            lines.append(
                f"The grid joins {' and '.join(pair)}, but the way did not hold when it was "
                "followed again: it is not counted."
            )
        if self.searched.cut_short:
            lines.append("There were too many postures: a part of the window was left out.")
        return "\n".join(lines)

    def _where(self) -> str:
        s = self.searched
        window = " and ".join(
            f"{name} from {low:.6g} to {high:.6g} {unit}"
            for (name, (low, high)), unit in zip(s.over.items(), s.units, strict=True)
        )
        grid = " by ".join(map(str, s.shape))
        limits = "joints within their limits" if s.limits else "limits of joints left aside"
        return (
            f"{window}, all else held, {limits}: {s.postures} postures over {grid} grid points "
            "are reached without a singularity."
        )

    def _group(self, group: tuple[str, ...], *, bounded: bool) -> str:
        ends = (
            " What they reach lies within the window: a wider one shows no more."
            if bounded
            else " What they reach goes on beyond the window or a limit."
        )
        if len(group) == 1:
            ends = ends.replace("they reach", "it reaches")
            return f"{group[0]} is joined with no other mode.{ends}"
        own = [p for p in self.passages if p.modes[0] in group]
        ways = "; ".join(
            f"{p.modes[0]} to {p.modes[1]} in {p.pieces} straight pieces, sigma at least "
            f"{p.sigma.min():.2g}"
            for p in own
        )
        return f"{listed(group)} are joined without a singularity: {ways}.{ends}"

    def _apart(self) -> list[str]:
        """What is claimed of modes that are not joined."""
        if len(self.groups) < 2:
            return []
        by_sign: dict[int, int] = {}
        for group in self.groups:
            sign = self.signs[group[0]]
            by_sign[sign] = by_sign.get(sign, 0) + 1
        lines = []
        if 1 in by_sign and -1 in by_sign:
            lines.append(
                "Modes of different signs of the determinant are joined by no way at all without "
                "a singularity."
            )
        if max(by_sign.values()) > 1:
            lines.append(
                "That other groups are apart is what the grid saw: narrower ways may join them, or "
                "ways outside the slice."
            )
        return lines

    def _meets(self, meeting: Meeting) -> str:
        place = ", ".join(
            f"{name} = {x:.6g}" for name, x in zip(meeting.names, meeting.values, strict=True)
        )
        what = f"{self.kind} singularity" if self.kind != "fixed joints" else "singularity"
        what = f"{'an' if what.startswith('inverse') else 'a'} {what}"
        where = f"at {place}{self._away(meeting)}"
        if len(meeting.modes) == 2:
            return f"{listed(meeting.modes)} meet at {what} {where}."
        if meeting.fold:
            return f"{meeting.modes[0]} meets none of the others but ends at {what} {where}."
        return f"{meeting.modes[0]} comes to {what} that is no fold {where}."

    def _away(self, meeting: Meeting) -> str:
        """How far away a meeting is, where the coordinates have one unit."""
        if len(set(self.searched.units)) > 1:
            return ""
        change = [
            float(x) - self.searched.at[name]
            for name, x in zip(meeting.names, meeting.values, strict=True)
        ]
        return f", {math.hypot(*change):.3g} {self.searched.units[0]} straight from here"


def listed(names: tuple[str, ...]) -> str:
    """Names in a row: a, b and c."""
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} and {names[-1]}"
