"""How modes hang together in a slice: the search over a window."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from closedchain.closure.chart import TILTS, Chart, joint_index
from closedchain.closure.charting import chart_of
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.connections.connected import Connections, Searched
from closedchain.closure.modes.connections.covering import (
    Branches,
    Covering,
    covering_of,
)
from closedchain.closure.modes.connections.fitting import fitted
from closedchain.closure.modes.connections.meetings import Meetings
from closedchain.closure.modes.connections.passages import Passage, Passages
from closedchain.closure.modes.connections.window import (
    Over,
    Wanted,
    Window,
    names_and_ranges,
    window_of,
)
from closedchain.closure.progress import Count, Progress
from closedchain.closure.solve.alone import least_share
from closedchain.closure.solve.problem import Problem, problem_of
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError, known_names

SINGULAR = 1e-6  # share of the largest singular value: no branch is followed from there


@dataclass(frozen=True, eq=False)
class Modes:
    """Postures with the same coordinates held.

    Attributes
    ----------
    q : (n, nq) array
    names : tuple of str
    held : str
        What is held, in words.
    coordinates : tuple of str
        Inputs or joints that are held; none where the tip's pose is.
    outputs : tuple of str
        Of the tip that are held; none where joints are.
    beyond_limits : tuple of tuple of str
        Of each: joints outside their limits.
    """

    mechanism: Mechanism
    q: np.ndarray
    names: tuple[str, ...]
    held: str
    coordinates: tuple[str, ...]
    outputs: tuple[str, ...]
    beyond_limits: tuple[tuple[str, ...], ...]

    def chart(self, names: tuple[str, ...], start: np.ndarray) -> Chart:
        """Chart in which some of the coordinates vary. Raises ``ClosureError``."""
        known = self.coordinates or self.outputs
        if sum(name in OUTPUTS[3:] for name in self.outputs) > 1:
            known = (*known, *TILTS)
        for name in names:
            if name not in known:
                raise ClosureError(
                    f"{known_names(name, 'coordinate', known)}; only what the modes have held can "
                    f"vary: {self.held}"
                )
        return chart_of(self.mechanism, names, start, self.outputs or None)

    @cached_property
    def problem(self) -> Problem:
        """Equations with all of these coordinates held."""
        m = self.mechanism
        pins = [joint_index(m, name)[1] for name in self.coordinates]
        goals = ((m.required_task().tip, self.outputs),) if self.outputs else ()
        return problem_of(m, pins, goals)

    def take(self, which: list[int]) -> Modes:
        """Some of them."""
        return replace(
            self,
            q=self.q[which],
            names=tuple(self.names[i] for i in which),
            beyond_limits=tuple(self.beyond_limits[i] for i in which),
        )


def connections_of(
    modes: Modes,
    over: Over,
    *,
    resolution: int | Mapping[str, int] | None = None,
    limits: bool = True,
    progress: Progress | None = None,
) -> Connections:
    """Which modes are joined without a singularity while some coordinates vary, and which meet.

    See ``Postures.connections``.
    """
    ranges = names_and_ranges(over)
    names = tuple(ranges)
    if not modes.problem.square:
        raise ClosureError(f"{modes.held} leaves freedoms: its postures are no isolated modes")
    left_out = _left_out(modes, limits=limits)
    followed = modes.take([i for i, name in enumerate(modes.names) if name not in left_out])
    if not len(followed.q):
        raise ClosureError(
            f"there is no mode to follow with {modes.held}"
            + "".join(f"; {name}: {why}" for name, why in left_out.items())
        )
    chart = modes.chart(names, followed.q[0])
    branches = Branches(chart, limits)
    wanted = Wanted(ranges, resolution, limits)

    def report(what: str) -> Count:
        return lambda count: progress(what, count, 0) if progress is not None else None

    wanted = fitted(chart, wanted, followed.q, branches, report("fitting the window"))
    window = window_of(chart, wanted)
    search = Meetings(window, branches, followed.q, followed.names)
    meetings = search.found()
    covering = covering_of(window, followed.q, branches, report("following all postures"))
    passages, unconfirmed = Passages(covering, branches, followed.names).found()
    for name, post in zip(followed.names, covering.modes.tolist(), strict=True):
        if post < 0:
            left_out[name] = "it does not close on its own branch"
    groups = _groups(followed.names, passages, left_out)
    apart = [p for p in unconfirmed if not any(set(p) <= set(group) for group in groups)]
    return Connections(
        groups=groups,
        passages=tuple(passages),
        meetings=tuple(meetings),
        kind=chart.folds or "fixed joints",
        signs=_signs(followed.names, covering),
        bounded=tuple(_bounded(followed.names, covering, group) for group in groups),
        left_out=left_out,
        axes=dict(zip(names, window.axes, strict=True)),
        counts=_counts(followed.names, covering, groups),
        unconfirmed=tuple(apart),
        searched=_searched(window, covering, len(search.ways), limits=limits),
    )


def _left_out(modes: Modes, *, limits: bool) -> dict[str, str]:
    """Modes that cannot be followed, and why."""
    found = {}
    for name, q, beyond in zip(modes.names, modes.q, modes.beyond_limits, strict=True):
        if limits and beyond:
            found[name] = f"joints beyond their limits ({', '.join(beyond)})"
        elif least_share(modes.problem, q) < SINGULAR:
            found[name] = "it is singular"
    return found


def _groups(
    names: tuple[str, ...], passages: list[Passage], left_out: Mapping[str, str]
) -> tuple[tuple[str, ...], ...]:
    """Modes that passages join, in the order of the modes."""
    group = {name: i for i, name in enumerate(names)}
    for passage in passages:
        one, two = (group[name] for name in passage.modes)
        group = {name: one if g == two else g for name, g in group.items()}
    found: dict[int, list[str]] = {}
    for name in names:
        if name not in left_out:
            found.setdefault(group[name], []).append(name)
    return tuple(tuple(own) for own in found.values())


def _signs(names: tuple[str, ...], covering: Covering) -> dict[str, int]:
    """Sign of the determinant of each mode, where it tells sides apart."""
    sided = covering.window.chart.problem.signed
    return {
        name: int(np.sign(covering.det[post])) if sided and post >= 0 else 0
        for name, post in zip(names, covering.modes.tolist(), strict=True)
    }


def _counts(
    names: tuple[str, ...], covering: Covering, groups: tuple[tuple[str, ...], ...]
) -> np.ndarray:
    """Postures (groups, *grid) of each group over each grid point."""
    parts = [_part(names, covering, group) for group in groups]
    size = len(covering.window.beside)
    counts = [np.bincount(covering.point[covering.part == p], minlength=size) for p in parts]
    return np.array(counts, dtype=int).reshape(len(groups), *covering.window.shape)


def _part(names: tuple[str, ...], covering: Covering, group: tuple[str, ...]) -> int:
    """Connected part of the covering that a group lies in."""
    return int(covering.part[covering.modes[names.index(group[0])]])


def _bounded(names: tuple[str, ...], covering: Covering, group: tuple[str, ...]) -> bool:
    """Whether what a group reaches ends neither at the window's edge nor at a limit."""
    part = _part(names, covering, group)
    return not (covering.open_ended(part) or covering.limited(part) or covering.cut_short)


def _searched(window: Window, covering: Covering, ways: int, *, limits: bool) -> Searched:
    chart = window.chart
    return Searched(
        over=dict(zip(window.names, window.ranges, strict=True)),
        at=dict(zip(window.names, window.at.tolist(), strict=True)),
        units=chart.units,
        held=dict(chart.held),
        shape=window.shape,
        postures=covering.size,
        ways=ways,
        limits=limits,
        cut_short=covering.cut_short,
    )
