"""Many complex paths followed together, each with a step length of its own, as machine code.

A path moves all that is prescribed of a system straight from one place to another, through complex
values, where with probability one nothing is singular before the end.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closedchain.closure.modes.complex_tape import joined, parted
from closedchain.closure.modes.path_control import (
    AFAR,
    ARRIVED,
    ASKING,
    LEAST,
    REST,
    RUNNING,
    SCALARS,
    SHIFT,
    SLOPE,
)
from closedchain.closure.modes.path_tapes import VECTORS, PathTapes
from closedchain.closure.modes.places import Place
from closedchain.closure.modes.systems import System, sizes
from closedchain.closure.tape.interpreter import outputs
from closedchain.closure.tape.machine import Looped, looped

FIRST = 0.02  # step along a path
LATE = 0.1  # share of the way that is left
LARGE = (10.0, 3.0)  # lengths, and imaginary parts of angles, of paths that go to infinity
GROWTH = (0.03, 10.0)
"""Between these their logarithms grow, by the logarithm of what is left of the way: as its negative
power if the end is infinite. Less where it is not, more where infinity is passed on the way."""

TICKS = 64  # steps of Newton's method before those that have ended are set aside
MOST = 20_000  # of these for a path


@dataclass(frozen=True, eq=False)
class Arrived:
    """Ends of paths: postures (n, nq), and whether each arrived (n,), or went to infinity (n,)."""

    q: np.ndarray
    good: np.ndarray
    infinite: np.ndarray


@dataclass(frozen=True, eq=False)
class _Ended:
    """Postures (n, nq), which arrived (n,), shares of the way (n,), slopes there (n, m)."""

    q: np.ndarray
    good: np.ndarray
    share: np.ndarray
    slope: np.ndarray


@dataclass(frozen=True, eq=False)
class Paths:
    """Machine code that follows the solutions of a system."""

    system: System

    @cached_property
    def _tapes(self) -> PathTapes:
        return PathTapes(self.system)

    @cached_property
    def _steps(self) -> Looped:
        return looped(self._tapes.step_tape, self._tapes.states, single=False)

    def track(self, one: Place, two: Place, q: np.ndarray) -> Arrived:
        """Follow paths from solutions (n, nq) at one place to another."""
        start = {"step": FIRST, "phase": SLOPE}
        ended = self._ended(one, two, q.astype(complex), start)
        numbers, rest = self.system.numbers, 1.0 - ended.share
        growth = rest * numbers.growth(ended.q, ended.slope)
        infinite = (rest < LATE) & (growth > GROWTH[0]) & (growth < GROWTH[1])
        infinite &= ~ended.good & numbers.far(ended.q, *LARGE)
        return Arrived(ended.q, ended.good, infinite)

    def closed(self, place: Place, q: np.ndarray) -> np.ndarray:
        """Solutions (m, nq) at a place that bounded Newton steps reach from postures (n, nq)."""
        start = {"share": 1.0, "phase": AFAR}
        ended = self._ended(place, place, q.astype(complex), start)
        return np.asarray(ended.q[ended.good])

    def _ended(self, one: Place, two: Place, q: np.ndarray, start: dict[str, float]) -> _Ended:
        """Where ways from postures (n, nq) end."""
        n, own, numbers = len(q), self.system.numbers.own, self.system.numbers
        state = np.zeros((self._tapes.states, n))
        state[: 2 * len(own)] = state[2 * len(own) : 4 * len(own)] = parted(q[:, own].T)
        fresh = {"status": RUNNING, "last": np.inf, **start}
        for name, value in fresh.items():
            state[len(state) - len(SCALARS) + SCALARS.index(name)] = value
        both = [
            *(_rows(p.targets, n) for p in (one, two)),
            *(_rows(p.given, n) for p in (one, two)),
        ]
        whole = self._run(state, np.concatenate([parted(x) for x in both]))
        found, _ = numbers.between(one, two, q, np.ones(n))
        here = dict(zip(SCALARS, whole[-len(SCALARS) :], strict=True))
        first = 2 * len(own) * VECTORS.index("slope")
        found[:, own] = joined(whole[: 2 * len(own)]).T
        slope = joined(whole[first : first + 2 * len(own)]).T
        return _Ended(found, here["status"] == ARRIVED, here["share"], slope)

    def _run(self, state: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """State (states, n) when every path has ended; those that have are set aside meanwhile."""
        whole, lanes = state.copy(), np.arange(state.shape[1])
        status = len(state) - len(SCALARS) + SCALARS.index("status")
        for _ in range(0, MOST, TICKS):
            self._steps.run(state, parameters, TICKS)
            asking = np.flatnonzero(state[status] == ASKING)
            if asking.size:
                state[:, asking] = self._judged(state[:, asking], parameters[:, asking])
            on = state[status] < 0.0
            if not on.all():
                whole[:, lanes[~on]] = state[:, ~on]
                lanes = lanes[on]
                state, parameters = (np.ascontiguousarray(x[:, on]) for x in (state, parameters))
            if not lanes.size:
                break
        whole[:, lanes] = state
        return whole

    def _judged(self, state: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """State (states, n) of paths that ask, after Newton's step by LAPACK."""
        system, m = self.system, len(self.system.numbers.own)
        here = dict(zip(SCALARS, state[-len(SCALARS) :], strict=True))
        sloping = here["phase"] == SLOPE
        rest = REST * (1.0 - here["share"])
        beside = np.maximum(SHIFT * here["step"], np.minimum(rest, LEAST))
        tried = here["share"] + np.where(sloping, beside, here["step"])
        tried = np.where(sloping | (tried < 1.0 - 1e-14), tried, 1.0)
        x, y = (joined(state[2 * m * k : 2 * m * (k + 1)]) for k in range(2))
        p, n = system.prescribed, system.numbers.count
        parts = joined(parameters)
        ends = [parts[k * p : (k + 1) * p].T for k in range(2)]
        given = [parts[2 * p + k * n : 2 * p + (k + 1) * n].T for k in range(2)]
        one, two = (Place(*place) for place in zip(ends, given, strict=True))
        q = one.given.copy()
        q[:, system.numbers.own] = np.where(sloping, x, y).T
        q, targets = system.numbers.between(one, two, q, tried)
        assert system.slow is not None, "paths of this system do not ask"
        moved, step = system.slow(q, targets)
        own = system.numbers.own
        told = [parted(q[:, own].T), parted(moved[:, own].T), sizes(system.relative, q, step)[None]]
        numbers = np.nan_to_num(np.concatenate(told), nan=np.inf)
        return outputs(self._tapes.judge_tape, np.concatenate([state, numbers]))[:-1]


class Followed(ABC):
    """What has a system of equations, whose solutions are followed."""

    @cached_property
    @abstractmethod
    def system(self) -> System:
        """Its equations. Raises ``ArithmeticError`` where they depend on each other everywhere."""

    @cached_property
    def paths(self) -> Paths:
        """What follows its solutions."""
        return Paths(self.system)


def _rows(numbers: np.ndarray, n: int) -> np.ndarray:
    """Numbers (k,) or (n, k) of one place or many as columns (k, n)."""
    return np.broadcast_to(numbers, (n, numbers.shape[-1])).T
