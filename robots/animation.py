"""A motion for the page: postures over time, lines traced on the way, and numbers to read off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure import Mechanism
from closedchain.robots.overlays import Polyline, numbers, series, spots
from closedchain.urdf.errors import ClosureError

_BUDGET = 2_500_000  # bytes of poses in a page, before base64


@dataclass(frozen=True, eq=False)
class Trace:
    """A line drawn along the motion, with a ball that moves on it.

    Attributes
    ----------
    along : str or (n, 3) array
        A link or named point whose origin draws the line, or its world positions [m] at the times
        of the animation (for instance from ``Box.place``).
    values : (n,) array, optional
        Numbers at the times, shown by colour (cividis), with a colour bar.
    label, unit, limits, colour, width
        As for ``Polyline``.
    """

    along: str | np.ndarray
    values: np.ndarray | None = None
    label: str = ""
    unit: str = ""
    limits: tuple[float, float] | None = None
    colour: str = "#000000"
    width: float | None = None

    def line(self, points: np.ndarray) -> Polyline:
        """Line to draw through the positions (n, 3). Raises ``ClosureError``."""
        return Polyline(
            points,
            colour=self.colour,
            label=self.label,
            values=self.values,
            unit=self.unit,
            limits=self.limits,
            width=self.width,
        )


@dataclass(frozen=True, eq=False)
class Readout:
    """A number that the page shows over time: its name, values (n,) and unit."""

    name: str
    values: np.ndarray
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Animation:
    """Postures over time.

    Attributes
    ----------
    q : (n, nq) array, n >= 2
        Postures.
    times : (n,) array
        Rising times [s].
    traces : sequence of Trace
        Lines drawn along the motion.
    readouts : sequence of Readout
        Numbers over time.
    frame_rate : float
        Frames a second that the page keeps at most. The page holds postures given here, no others;
        in between it moves the bodies evenly.

    Raises
    ------
    ClosureError
        Wrong shapes, numbers that are not finite, times that do not rise.
    """

    q: np.ndarray
    times: np.ndarray
    traces: Sequence[Trace] = ()
    readouts: Sequence[Readout] = ()
    frame_rate: float = 30.0

    def __post_init__(self) -> None:
        q = numbers(self.q, "animation: q")
        if q.ndim != 2 or len(q) < 2:
            raise ClosureError(f"animation: q must have shape (n, nq), n >= 2, got {q.shape}")
        times = series(self.times, len(q), "animation: times")
        stuck = np.flatnonzero(np.diff(times) <= 0.0)
        if len(stuck):
            i = int(stuck[0])
            raise ClosureError(
                f"animation: times must rise; times[{i}] = {times[i]:.9g} s is followed by "
                f"{times[i + 1]:.9g} s"
            )
        if not (np.isfinite(self.frame_rate) and self.frame_rate > 0.0):
            raise ClosureError(
                f"animation: frame_rate must be positive [1/s], got {self.frame_rate!r}"
            )
        for trace in self.traces:
            what = f"trace {trace.label!r}"
            if not isinstance(trace.along, str):
                along = spots(trace.along, f"{what}: along", 2)
                if len(along) != len(q):
                    raise ClosureError(
                        f"{what}: along must have one position per posture, ({len(q)}, 3), "
                        f"got {along.shape}"
                    )
            # wrong values, limits and colours are found by the line
            trace.line(np.zeros((len(q), 3)) if isinstance(trace.along, str) else trace.along)
        readouts = tuple(
            Readout(r.name, series(r.values, len(q), f"readout {r.name!r}"), r.unit)
            for r in self.readouts
        )
        for name, value in (
            ("q", q),
            ("times", times),
            ("traces", tuple(self.traces)),
            ("readouts", readouts),
        ):
            object.__setattr__(self, name, value)

    def frames(self, bodies: int) -> np.ndarray:
        """Indices of the postures that a page of ``bodies`` moving bodies keeps.

        They are ``1 / frame_rate`` apart or more, or further where the page would grow too large;
        the first and the last are among them.
        """
        fitting = max(2, _BUDGET // (28 * max(1, bodies)))
        duration = float(self.times[-1] - self.times[0])
        gap = max(1.0 / self.frame_rate, duration / (fitting - 1))
        kept = [0]
        while True:
            # a hair less than the gap, so that even samples at the frame rate are all kept
            after = self.times[kept[-1]] + gap * (1.0 - 1e-6)
            following = int(np.searchsorted(self.times, after))
            if following >= len(self.times) - 1:
                break
            kept.append(following)
        return np.array([*kept, len(self.times) - 1])


def input_readouts(mechanism: Mechanism, q: ArrayLike) -> tuple[Readout, ...]:
    """Inputs of the mechanism along postures (n, nq). Raises ``ClosureError``."""
    rows = checked_postures(mechanism, q)[:, mechanism.input_q]
    named = zip(mechanism.inputs, rows.T, mechanism.input_units, strict=True)
    return tuple(Readout(name, values, unit) for name, values, unit in named)


def checked_postures(mechanism: Mechanism, q: ArrayLike) -> np.ndarray:
    """Postures (n, nq) of the mechanism. Raises ``ClosureError`` that names the wrong one."""
    rows = numbers(q, "animation: q")
    if rows.ndim != 2 or rows.shape[1] != mechanism.model.nq:
        raise ClosureError(
            f"animation: q must have shape (n, {mechanism.model.nq}) for {mechanism.name!r}, "
            f"got {rows.shape}"
        )
    for i, row in enumerate(rows):
        try:
            mechanism.configuration(row)
        except ClosureError as error:
            raise ClosureError(f"animation: posture {i}: {error}") from None
    return rows
