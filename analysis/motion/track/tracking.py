"""Following a path of inputs or of tip poses, with velocities and accelerations of all joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.motion.track.davies_steps import integrate
from closedchain.analysis.motion.track.demands import Demand, InputDemand, TipDemand
from closedchain.analysis.motion.track.routes import Path, Rates, Route, route
from closedchain.analysis.motion.track.states import State, Stuck, state, states
from closedchain.analysis.motion.track.stops import Stop, kinds_at, stop
from closedchain.analysis.progress import reporting
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.position import direct, inverse
from closedchain.closure.progress import Progress
from closedchain.closure.solve.factors import factorise
from closedchain.closure.solve.outcome import Ending
from closedchain.urdf.errors import ClosureError, known_names

METHODS = ("predictor-corrector", "davies")
Method = Literal["predictor-corrector", "davies"]
_AT_START = 1e-6


@dataclass(frozen=True, eq=False)
class _Job:
    """What is followed, and how."""

    demand: Demand
    route: Route
    method: str
    gain: float
    inner: int


@dataclass(frozen=True, eq=False)
class Track:
    """Postures at the samples of a path, as far as it could be followed.

    Attributes
    ----------
    q : (reached, nq) array
    reached : int
        Number of samples reached, from the first on.
    parameters : (reached,) array
        Path parameter of each: its time, or its index for a path without times.
    times : (reached,) array or None
        None for a path without times.
    qdot, qddot : (reached, nv) arrays or None
        Velocities and accelerations of all joints [m/s, rad/s, m/s^2, rad/s^2]; None without times.
        Those that an Euler step was taken with, feedback included, for "davies"; least-squares ones
        where there are more demands than freedoms.
    residual : (reached,) array
        Largest row of the closures, and of the tip's goal along a path of poses [m or rad].
    branch : int or None
        Sign of the determinant that is kept; None where the equations are not square.
    stop : Stop or None
        Why not all samples were reached; None also where ``until`` ended it.
    method : str

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> times = np.linspace(0.0, 1.0, 21)
    >>> t = cc.track(m, m.input_values(m.home) + np.outer(times, [0.05, 0.0, 0.0]), times=times)
    >>> t.complete, t.q.shape, bool(t.residual.max() < 1e-12)
    (True, (21, 16), True)
    """

    q: np.ndarray
    reached: int
    parameters: np.ndarray
    times: np.ndarray | None
    qdot: np.ndarray | None
    qddot: np.ndarray | None
    residual: np.ndarray
    branch: int | None
    stop: Stop | None
    method: str
    _job: _Job = field(repr=False)

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        for array in (self.q, self.parameters, self.times, self.qdot, self.qddot, self.residual):
            if array is not None:
                array.setflags(write=False)

    @property
    def complete(self) -> bool:
        """Whether the last sample was reached."""
        return self.reached == self._job.route.size

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism that was moved."""
        return self._job.demand.mechanism

    @property
    def beyond_limits(self) -> tuple[str, ...]:
        """Joints outside their limits at some sample."""
        found = (beyond_limits(self.mechanism, q) for q in self.q)
        return tuple(dict.fromkeys(chain.from_iterable(found)))

    def raise_if_stopped(self) -> Track:
        """Return the track itself, or raise ``ClosureError`` with the message of its stop."""
        if self.stop is not None:
            raise ClosureError(self.stop.message)
        return self

    def resume(
        self,
        *,
        until: float | None = None,
        guess: ArrayLike | None = None,
        progress: bool | Progress = False,
    ) -> Track:
        """Follow the same path further, to its end or to ``until``.

        Parameters
        ----------
        until : float, optional
            Path parameter beyond which no sample is taken.
        guess : (nq,) array, optional
            Posture near the next sample, on the branch to go on with: the way past a singularity.
            Without it the path goes on from the last posture.
        progress : bool or callable
            As in :func:`track`.

        Returns
        -------
        Track
            From the first sample on; itself where the path is complete.
        """
        if self.complete:
            return self
        if guess is None and self.reached:
            first, q = self.reached - 1, self.q[-1]
            kept = first
        else:
            first, kept = self.reached, self.reached
            q = self._job.demand.mechanism.home if guess is None else guess
            begun = _begin(self._job, first, q)
            if isinstance(begun, Stop):
                return replace(self, stop=begun)
            q = begun
        more = _run(self._job, first, np.asarray(q), until, progress)
        return _joined(self, more, kept)


def track(
    mechanism: Mechanism,
    path: Path,
    *,
    method: Method = "predictor-corrector",
    times: ArrayLike | None = None,
    velocities: Rates | None = None,
    accelerations: Rates | None = None,
    outputs: str | Sequence[str] | None = None,
    start: ArrayLike | Track | None = None,
    gain: float = 0.0,
    inner: int = 0,
    until: float | None = None,
    progress: bool | Progress = False,
) -> Track:
    """Follow a path of inputs or of tip poses on one branch.

    Parameters
    ----------
    path : (n, n_inputs) array, mapping of input name to (n,), sequence of pin.SE3, or callable
        Inputs [m or rad] or poses of the tip in the world. A callable gives one sample, of either
        sort, at a time; it is asked at ``times`` only.
    method : "predictor-corrector" or "davies"
        The first steps as finely as it must, keeps every posture closed to 1e-12, and stops at a
        singularity with a report. The second takes one Euler step a sample, with the errors fed
        back; it may drift, and crosses singularities without noticing unless it meets one exactly.
    times : (n,) array, optional
        Rising [s]. A timed path runs through its samples along a spline (of degree 5 from six
        samples on; orientations along a cubic one); without times it runs straight from one to the
        next, orientations about fixed axes.
    velocities, accelerations : (n, n_inputs) or (n, 6) arrays, or callables of time, optional
        Of the inputs, or (linear, angular) of the tip along the world's axes, at the samples: what
        ``qdot`` and ``qddot`` are for. Those of the spline where not given; accelerations are then
        those of a spline through the velocities, if these are given.
    outputs : str or sequence of str, optional
        Components of the poses that are prescribed; those of the task by default. Where they leave
        freedoms, the joints move as little as possible (dimensionless, from posture to posture).
    start : (nq,) array or Track, optional
        Posture whose branch is kept, or a track whose last posture it is; home by default. From
        there the first sample is reached as by ``cc.direct`` or ``cc.inverse``.
    gain : float
        K_e [1/s; per sample without times] of "davies"; 0 is no feedback, 1/dt is Newton's step.
    inner : int
        Newton iterations after each step of "davies".
    until : float, optional
        Path parameter (time, or index) beyond which no sample is taken; ``Track.resume`` goes on.
    progress : bool or callable
        True for a bar on a terminal, or a function of (what, done, total).

    Returns
    -------
    Track

    Raises
    ------
    ClosureError
        Malformed path, times that do not rise, unknown names or method.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> sliders = np.linspace([-0.14, -0.14, -0.14], [-0.1, -0.2, -0.14], 5)
    >>> poses = [m.pose(q) for q in cc.track(m, sliders).q]
    >>> cc.track(m, poses[::-1]).complete  # back along the same poses of the tip
    True
    """
    if method not in METHODS:
        raise ClosureError(known_names(str(method), "method", METHODS))
    if not np.isfinite(gain) or gain < 0.0 or inner < 0:
        raise ClosureError(f"gain and inner must not be negative, got {gain!r} and {inner!r}")
    if until is not None and np.isnan(until):
        raise ClosureError("until must be a number, got nan")
    if method != "davies" and (gain or inner):
        raise ClosureError('gain and inner belong to method="davies"')
    way = route(mechanism, path, times, velocities, accelerations)
    demand: Demand
    if way.inputs is not None:
        if outputs is not None:
            raise ClosureError("outputs belong to a path of poses; this one is of inputs")
        demand = InputDemand(mechanism, mechanism.passive_v)
    else:
        names = None if outputs is None else outputs if isinstance(outputs, str) else tuple(outputs)
        every = np.arange(mechanism.model.nv)
        demand = TipDemand(mechanism, every, mechanism.outputs(names))
    job = _Job(demand, way, method, float(gain), int(inner))
    begun = _begin(job, 0, _posture(mechanism, start))
    if isinstance(begun, Stop):
        return _collected(job, 0, [], begun, None)
    return _run(job, 0, begun, until, progress)


def _posture(mechanism: Mechanism, start: ArrayLike | Track | None) -> ArrayLike:
    if start is None:
        return mechanism.home
    if not isinstance(start, Track):
        return start
    if start.mechanism.model.nq != mechanism.model.nq:
        raise ClosureError(f"start is a track of another mechanism, {start.mechanism.name!r}")
    if start.stop is not None:
        return start.stop.q
    return start.q[-1] if start.reached else mechanism.home


def _begin(job: _Job, i: int, guess: ArrayLike) -> np.ndarray | Stop:
    """Posture at sample ``i`` on the branch of the guess, or why there is none."""
    m, sample = job.demand.mechanism, job.route.sample(i)
    if isinstance(job.demand, TipDemand):
        found = inverse(m, sample, guess, job.demand.outputs)
    else:
        found = direct(m, sample, guess)
    if found.converged:
        return np.array(found.q)
    u = float(job.route.knots[i])
    message = f"sample {i} is not reached from the start: {found.message}"
    return Stop(u, frozenset(), message, m.configuration(guess), u, Ending.UNREACHED)


def _run(
    job: _Job, first: int, q: np.ndarray, until: float | None, progress: bool | Progress
) -> Track:
    """Follow the path from sample ``first``, at posture ``q``."""
    way = job.route
    last = way.size - 1
    if until is not None:
        last = max(first, int(np.searchsorted(way.knots, until, side="right")) - 1)
    found: list[State] = []
    end: Stop | None = None
    branch = factorise(job.demand.linearise(q, way.between(first, _knot(way, first))).matrix).sign
    with reporting(progress) as report:
        for step in _steps(job, first, q, branch):
            if isinstance(step, Stuck):
                end = stop(job.demand, way, step)
                break
            found.append(step)
            if report is not None:
                report("track", first + len(found), way.size)
            if first + len(found) > last:
                break
    if not found:
        u = _knot(way, first)
        outputs = job.demand.outputs if isinstance(job.demand, TipDemand) else None
        kinds = kinds_at(job.demand.mechanism, q, outputs, _AT_START)
        what = " and ".join(sorted(kinds)) or "unclassified"
        message = f"the posture at sample {first} is singular already ({what})"
        end = Stop(u, kinds, message, q, u, Ending.SINGULAR_START)
    return _collected(job, first, found, end, branch)


def _knot(way: Route, i: int) -> float:
    return float(way.knots[i])


def _steps(job: _Job, first: int, q: np.ndarray, branch: int | None) -> Iterator[State | Stuck]:
    demand, way = job.demand, job.route
    if job.method == "davies":
        yield from integrate(demand, way, q, first, job.gain, job.inner)
        return
    piece = max(min(first, way.size - 2), 0)
    start = state(demand, way, q, _knot(way, first), piece)
    if start is None:
        return
    yield start
    yield from states(demand, way, start, first, branch)


def _collected(
    job: _Job, first: int, states: list[State], end: Stop | None, branch: int | None
) -> Track:
    """Track of the samples from ``first`` on."""
    m, way = job.demand.mechanism, job.route
    reached = len(states)
    q = np.array([s.q for s in states]).reshape(reached, m.model.nq)
    parameters = np.array(way.knots[first : first + reached])
    qdot = qddot = None
    if way.timed:
        motions = [_motion(job, s, first + i) for i, s in enumerate(states)]
        qdot, qddot = np.array(motions).reshape(reached, 2, m.model.nv).swapaxes(0, 1).copy()
    return Track(
        q=q,
        reached=reached,
        parameters=parameters,
        times=parameters if way.timed else None,
        qdot=qdot,
        qddot=qddot,
        residual=np.array([s.residual for s in states]),
        branch=branch,
        stop=end,
        method=job.method,
        _job=job,
    )


def _motion(job: _Job, found: State, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Velocities and accelerations at sample ``i``: those asked for there, if any were given."""
    given = job.route.rates is not None or job.route.seconds is not None
    if not given or job.method == "davies":
        return found.qdot, found.qddot
    piece = max(min(i, job.route.size - 2), 0)
    again = state(job.demand, job.route, found.q, found.u, piece, job.route.reported(i))
    return (found.qdot, found.qddot) if again is None else (again.qdot, again.qddot)


def _joined(before: Track, after: Track, kept: int) -> Track:
    """The first ``kept`` samples of one track, then those of the other."""

    def both(a: np.ndarray | None, b: np.ndarray | None) -> np.ndarray | None:
        return None if a is None or b is None else np.concatenate([a[:kept], b])

    parameters = np.concatenate([before.parameters[:kept], after.parameters])
    return replace(
        after,
        q=np.concatenate([before.q[:kept], after.q]),
        reached=kept + after.reached,
        parameters=parameters,
        times=None if before.times is None else parameters,
        qdot=both(before.qdot, after.qdot),
        qddot=both(before.qddot, after.qddot),
        residual=np.concatenate([before.residual[:kept], after.residual]),
        branch=before.branch if after.branch is None else after.branch,
    )
