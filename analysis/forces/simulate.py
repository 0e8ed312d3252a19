"""``simulate``: a mechanism moves under its efforts and loads, its loops closed at every step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.forces.arranging import column_names
from closedchain.analysis.forces.integrating import Efforts, State, Stepper
from closedchain.analysis.forces.loads import LARGEST_LOAD, Gravity, Wrenches
from closedchain.analysis.forces.orientation import Signs, signs
from closedchain.analysis.forces.plant import plant_under
from closedchain.closure.given import one_number
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.solve.outcome import Ending
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import xarray as xr

LEAST = 1e-9  # seconds: steps do not become shorter
NEAR = 1e-5  # share of the largest singular value of K that the least has at a singularity
MOST = 200_000  # steps
SAMPLES = 101
HALVINGS = 60
TOGETHER = 1e-9  # metres or radians by which joints may miss their limits that meet them at once


@dataclass(frozen=True)
class Event:
    """Something that happened: when [s], its kind and a sentence.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> push = np.full(3, 2e4)  # [N], upwards, until the sliders meet their ends
    >>> r = cc.simulate(m, m.home, None, push, until=2.0)
    >>> r.events[-1].kind, 0.0 < r.events[-1].t < 2.0
    ('limit', True)
    """

    t: float
    kind: str
    text: str


@dataclass(frozen=True, eq=False)
class Simulation:
    """A motion.

    Attributes
    ----------
    t : (n,) array
        Times [s].
    q, v : (n, nq), (n, nv) arrays
        States, closed to 1e-12.
    energy : (n,) array
        Kinetic energy and potential energy of gravity [J].
    work : (n,) array
        Work [J] done by input efforts and wrenches, less what damping and friction took.
    drift : float
        Largest change of ``energy - work`` by the time of the motion [W]: the error of the
        integration, and nothing else.
    residual : float
        Largest closure row of all samples [m, rad].
    events : tuple of Event
        Limits and singularities that were met.
    ending : Ending
    message : str
    steps : int

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> r = cc.simulate(m, m.home, None, None, until=0.05)
    >>> r.t.shape, r.residual < 1e-12
    ((101,), True)
    >>> bool(np.ptp(r.energy - r.work) < 1e-6)  # falling, nothing takes energy [J]
    True
    """

    mechanism: Mechanism = field(repr=False)
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    energy: np.ndarray
    work: np.ndarray
    drift: float
    residual: float
    events: tuple[Event, ...]
    ending: Ending
    message: str
    steps: int

    def to_dataset(self) -> xr.Dataset:
        """The motion as an xarray Dataset over ``time``, with the names of all columns."""
        require("a dataset is made with xarray", "maps")
        import xarray as xr

        m = self.mechanism
        data = {
            "q": (("time", "coordinate"), self.q, {"units": "m, rad"}),
            "v": (("time", "velocity"), self.v, {"units": "m/s, rad/s"}),
            "energy": ("time", self.energy, {"units": "J"}),
            "work": ("time", self.work, {"units": "J"}),
        }
        names = {
            "time": ("time", self.t, {"units": "s"}),
            "coordinate": column_names(m, of_q=True),
            "velocity": column_names(m, of_q=False),
        }
        return xr.Dataset(data, names, {"mechanism": m.name, "message": self.message})


def simulate(
    mechanism: Mechanism,
    q: ArrayLike,
    v: ArrayLike | None,
    efforts: ArrayLike | Callable[[float, np.ndarray, np.ndarray], ArrayLike] | None,
    until: float,
    *,
    every: float | None = None,
    accuracy: float = 1e-9,
    wrench: Wrenches | None = None,
    gravity: Gravity = True,
    payload: Mapping[str, float] | None = None,
    limits: bool = True,
) -> Simulation:
    """Move a mechanism from a state.

    Dormand and Prince's method with steps of its own choice; after each the loops are closed and
    the velocity made to fit them.

    Parameters
    ----------
    q : (nq,) array
        Closed posture.
    v : (nv,) array or None
        Velocities that the loops allow [m/s, rad/s]; None at rest.
    efforts : None, (n_inputs,) array, or f(t, q, v) -> (n_inputs,)
        At the driven joints [N, N m].
    until : float
        Time [s] of the end.
    every : float, optional
        Time between samples [s]; a hundredth of the whole by default.
    accuracy : float
        Error of one step in postures and velocities, in units of the characteristic length.
    wrench, gravity, payload
        As for ``statics``.
    limits : bool
        Whether the motion ends where a joint meets its limit; what happens there is not modelled.

    Raises
    ------
    ClosureError
        Malformed numbers, an open posture, velocities that the loops contradict, motions without
        inertia.

    Examples
    --------
    >>> m = cc.with_inertias(cc.load("linear_delta"))
    >>> held = cc.input_efforts(m, m.home)
    >>> r = cc.simulate(m, m.home, None, held, until=0.05)
    >>> bool(np.abs(r.q - m.home).max() < 1e-6), r.ending.word
    (True, 'arrived')
    """
    plant = plant_under(mechanism, wrench, gravity, payload)
    start = State(0.0, *plant.state(q, v), 0.0)
    until, accuracy = one_number(until, "until"), one_number(accuracy, "accuracy")
    gap = until / (SAMPLES - 1) if every is None else one_number(every, "every")
    if gap > until:
        raise ClosureError(f"every must be above zero and at most {until:g} s, got {gap}")
    stepper = Stepper(plant, _efforts(mechanism, efforts))
    plant.acceleration(start.q, start.v, stepper.efforts(0.0, start.q, start.v))
    count = int(np.ceil(until / gap - 1e-9))
    times = [*(gap * i for i in range(1, count)), until]
    run = _Run(stepper, accuracy, limits and not beyond_limits(mechanism, start.q))
    return run.through(start, times)


def _efforts(
    m: Mechanism, efforts: ArrayLike | Callable[[float, np.ndarray, np.ndarray], ArrayLike] | None
) -> Efforts:
    if callable(efforts):
        given = efforts
        return lambda t, q, v: m.input_vector(given(t, q, v), f"efforts at {t:.6g} s", LARGEST_LOAD)
    tau = np.zeros(len(m.inputs))
    if efforts is not None:
        tau = m.input_vector(efforts, "efforts", LARGEST_LOAD)
    return lambda t, q, v: tau


@dataclass(eq=False)
class _Run:
    """One simulation on its way."""

    stepper: Stepper
    accuracy: float
    limited: bool
    steps: int = 0
    h: float = 1e-3
    events: list[Event] = field(default_factory=list)
    side: Signs | None = None

    def through(self, start: State, times: list[float]) -> Simulation:
        """States at the times, as far as the motion goes."""
        samples, ending, message = [start], Ending.ARRIVED, ""
        self.side = signs(self.stepper.plant, start.q, None)
        for t in times:
            now, ending, message = self._to(samples[-1], t)
            if now.t > samples[-1].t:
                samples.append(now)
            if ending is not Ending.ARRIVED:
                break
        return self._told(samples, ending, message or f"moved for {samples[-1].t:.6g} s")

    def _to(self, now: State, t: float) -> tuple[State, Ending, str]:
        while now.t < t:
            if self.steps >= MOST:
                return now, Ending.BUDGET, f"{MOST} steps were used up at {now.t:.6g} s"
            h = min(self.h, t - now.t)
            last = h == t - now.t
            try:
                new, error = self.stepper.step(now, h)
            except ClosureError as refusal:
                new, error, why = now, np.inf, str(refusal)
            self.steps += 1
            if error <= self.accuracy:
                limit = self._limit(now, new)
                if limit is not None:
                    return limit[0], Ending.LIMIT, limit[1]
                met = self._look_for_singularities(now, new)
                if met is not None:
                    return met, *self._met(met)
                now = State(t, new.q, new.v, new.work) if last else new
            elif h <= LEAST:
                return now, *self._stopped(now, why if error == np.inf else "")
            factor = 0.1 if error == np.inf else 0.9 * (self.accuracy / max(error, 1e-300)) ** 0.2
            if not (last and error <= self.accuracy and factor < 1.0):
                grown = min(max(factor, 0.1), 5.0) * h
                self.h = max(LEAST, max(grown, self.h) if last and factor > 1.0 else grown)
        return now, Ending.ARRIVED, ""

    def _stopped(self, now: State, refusal: str) -> tuple[Ending, str]:
        """Why steps became too small: at a singularity of the closures, or for reasons unknown."""
        if self.stepper.plant.closed(now.q).least > NEAR:
            return Ending.STUCK, f"{refusal or 'the steps became too small'}, at {now.t:.6g} s"
        return self._met(now)

    def _met(self, now: State) -> tuple[Ending, str]:
        """Note that the motion ends at a singularity of the closures."""
        text = (
            f"a constraint singularity is met at {now.t:.6g} s: the closures lose rank, and what "
            "the mechanism does there is not determined"
        )
        self.events.append(Event(now.t, "constraint", text))
        return Ending.SINGULARITY, text

    def _limit(self, before: State, after: State) -> tuple[State, str] | None:
        """State at a limit that lies in a step, and a sentence."""
        m = self.stepper.plant.mechanism
        names = beyond_limits(m, after.q) if self.limited else ()
        if not names:
            return None
        inside, low, high = before, 0.0, after.t - before.t
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            tried, _ = self.stepper.step(before, middle)
            here = beyond_limits(m, tried.q)
            inside, low, high = (inside, low, middle) if here else (tried, middle, high)
        names = self._at_their_limits(inside.q, names)
        text = f"a joint meets its limit: {', '.join(names)}, at {inside.t:.6g} s"
        self.events.append(Event(inside.t, "limit", text))
        return inside, text

    def _at_their_limits(self, q: np.ndarray, names: tuple[str, ...]) -> tuple[str, ...]:
        """Which of the joints that a step takes beyond their limits are there, in their order."""
        model, (lower, upper) = (
            self.stepper.plant.mechanism.model,
            self.stepper.plant.mechanism.limits,
        )
        at = {name: model.idx_qs[model.getJointId(name)] for name in names}
        gaps = {n: min(abs(q[i] - lower[i]), abs(q[i] - upper[i])) for n, i in at.items()}
        return tuple(n for n, gap in gaps.items() if gap <= min(gaps.values()) + TOGETHER)

    def _look_for_singularities(self, before: State, after: State) -> State | None:
        """Note singularities in a step: determinants of steady orientation that change sign.

        Returns the last state before one of the closures themselves, where that is what was met.
        """
        plant, old = self.stepper.plant, self.side
        new = signs(plant, after.q, old)
        self.side = new
        if old is None or new is None:
            return None
        for kind, sign in old.values.items():
            if sign * new.values[kind] >= 0.0:
                continue
            low, high, lost = 0.0, after.t - before.t, False
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if high - low < LEAST * 1e-3 or middle in (low, high):
                    break
                try:
                    tried = signs(plant, self.stepper.step(before, middle)[0].q, old)
                except ClosureError:  # the closures lose rank on the way
                    tried, lost = None, True
                same = tried is not None and tried.values[kind] * sign > 0.0
                low, high = (middle, high) if same else (low, middle)
            if lost:
                return self.stepper.step(before, low)[0] if low > 0.0 else before
            t = before.t + low
            self.events.append(Event(t, kind, f"a {kind} singularity is passed at {t:.6g} s"))
        return None

    def _told(self, samples: list[State], ending: Ending, message: str) -> Simulation:
        plant = self.stepper.plant
        m = plant.mechanism
        t = np.array([s.t for s in samples])
        energy = np.array([plant.energy(s.q, s.v) for s in samples])
        work = np.array([s.work for s in samples])
        off = float(np.abs((energy - work) - (energy - work)[0]).max())
        gaps = [np.abs(m.workspace.residual(s.q)).max(initial=0.0) for s in samples]
        return Simulation(
            mechanism=m,
            t=t,
            q=np.array([s.q for s in samples]),
            v=np.array([s.v for s in samples]),
            energy=energy,
            work=work,
            drift=off / float(t[-1]) if t[-1] > 0.0 else 0.0,
            residual=float(max(gaps)),
            events=tuple(self.events),
            ending=ending,
            message=message,
            steps=self.steps,
        )
