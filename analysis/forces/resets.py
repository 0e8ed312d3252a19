"""``resets``: random closed postures within limits, with velocities that the loops allow.

Coordinates are drawn evenly from ranges, and each posture is found by following the branch from a
posture nearby that was found before. What no such way leads to, or lies beyond a joint's limit, is
drawn again. The first postures found only serve as starts, and are not handed out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.forces.arranging import arranged, column_names
from closedchain.analysis.forces.random_motions import random_motions
from closedchain.closure.chart import Chart, joint_index, joint_names
from closedchain.closure.charting import chart_of
from closedchain.closure.generic import dimensionless_jacobian
from closedchain.closure.given import one_number, range_of, whole_number
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import null_space, numerical_rank
from closedchain.closure.solve.control import CLOSED
from closedchain.closure.solve.outcome import Ending
from closedchain.closure.solve.path import follower_of
from closedchain.closure.solve.samples import closed_samples
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import xarray as xr

SPAN = 0.5
"""Half width of a range that is not given, around the start [rad or characteristic lengths]."""
PIECE = 512  # postures that a thread follows at a time; part of no result
BATCH = 8192
POOL = 2048
SMALLEST = 0.02
"""Share of a way below which a sub-step is not cut any further: ways are short, and those that
lead nowhere would be cut finely."""
INDEPENDENT = 1e-3  # share of the largest singular value that an independent coordinate adds
TRIES = 200
"""Draws for each state that is asked for, at most."""


@dataclass(frozen=True, eq=False)
class Resets:
    """Random states.

    Attributes
    ----------
    q : (n, nq) array
        Closed postures, as Pinocchio has them; ``arranged`` has them as simulators do.
    v : (n, nv) array
        Velocities that the loops allow [m/s, rad/s].
    names : tuple of str
        Coordinates that were drawn.
    values : (n, k) array
        Their values [m or rad].
    branch : (n,) array of int
        Which of the starts a posture is on the branch of.
    residual : float
        Largest closure row of all postures [m, rad].
    accepted : float
        Share of the draws that became states.
    text : str
        The same in a sentence.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> r = cc.resets(m, 50, seed=1)
    >>> r.q.shape, r.v.shape, r.names
    ((50, 16), (50, 16), ('q1', 'q2', 'q3'))
    """

    mechanism: Mechanism = field(repr=False)
    q: np.ndarray
    v: np.ndarray
    names: tuple[str, ...]
    values: np.ndarray
    branch: np.ndarray
    residual: float
    accepted: float
    text: str

    def __len__(self) -> int:
        """Number of states."""
        return len(self.q)

    def arranged(self, joints: Sequence[str] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities in the order and conventions of MuJoCo: qpos and qvel.

        A floating body has its position and quaternion w x y z in the world, the velocity of its
        origin along the world's axes, and its angular velocity along its own; a ball its
        quaternion and angular velocity.

        Parameters
        ----------
        joints : sequence of str, optional
            Names in the simulator's order; all joints of the tree, in its order, by default.

        Raises
        ------
        ClosureError
            An unknown joint, or a floating body that does not float in the world.
        """
        return arranged(self.mechanism, self.q, self.v, joints)

    def to_dataset(self) -> xr.Dataset:
        """States as an xarray Dataset over ``state``, with the names of all columns."""
        require("a dataset is made with xarray", "maps")
        import xarray as xr

        m = self.mechanism
        columns = {
            "q": ("coordinate", self.q, {"units": "m, rad"}),
            "v": ("velocity", self.v, {"units": "m/s, rad/s"}),
            "values": ("drawn", self.values, {"units": "m, rad"}),
        }
        data = {name: (("state", dim), array, told) for name, (dim, array, told) in columns.items()}
        names = {
            "coordinate": column_names(m, of_q=True),
            "velocity": column_names(m, of_q=False),
            "drawn": list(self.names),
        }
        branch = ("state", self.branch)
        return xr.Dataset({**data, "branch": branch}, names, {"mechanism": m.name})


def resets(
    mechanism: Mechanism,
    n: int,
    seed: int = 0,
    *,
    over: Mapping[str, tuple[float, float] | None] | None = None,
    start: str | ArrayLike | None = None,
    speed: float = 1.0,
    workers: int | None = None,
) -> Resets:
    """Draw closed states at random.

    Parameters
    ----------
    n : int
        How many.
    seed : int
        The same seed gives the same states, whatever the number of threads.
    over : mapping of coordinate to (lower, upper), optional
        Coordinates drawn evenly, of inputs, joints and the tip as in maps; the others stay as at
        the start. None for a range: half a radian or characteristic length to both sides of the
        start, within the joint's limits. By default all inputs that do not depend on each other,
        and joints for the freedoms that they leave, so.
    start : name, (nq,) or (k, nq) array, optional
        Posture whose branch is meant, or several: then each state is on the branch of one of
        them, all alike. Home by default.
    speed : float
        Standard deviation of the rates of all joints, before they are made to fit the loops
        [rad/s, or characteristic lengths/s]; 0 for states at rest.
    workers : int, optional
        Threads; one for each core by default.

    Raises
    ------
    ClosureError
        Malformed numbers, unknown coordinates, starts that are not closed, or ranges in which next
        to nothing is found.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> r = cc.resets(m, 50, seed=1, over={"x": (-0.05, 0.05), "y": (-0.05, 0.05), "z": None})
    >>> bool(np.abs(r.values[:, :2]).max() <= 0.05), r.residual < 1e-12
    (True, True)
    """
    n, seed = whole_number(n, "n", 1), whole_number(seed, "seed", 0)
    speed = one_number(speed, "speed", itself=True)
    workers = None if workers is None else whole_number(workers, "workers", 1)
    if over is not None and not isinstance(over, Mapping):
        raise ClosureError(f"over must be ranges by coordinate, {{'q1': (0, 1)}}, got {over!r}")
    names = independent_joints(mechanism) if over is None else tuple(over)
    if not names:
        raise ClosureError("no coordinate to draw: no joint of one freedom moves, give over={...}")
    starts = _starts(mechanism, start)
    rng = np.random.default_rng(seed)
    counts = np.bincount(rng.integers(len(starts), size=n), minlength=len(starts))
    found, values, good, drawn, residual = [], [], 0, 0, 0.0
    with ThreadPoolExecutor(workers) as threads:
        for count, one, own in zip(counts, starts, rng.spawn(len(starts)), strict=True):
            chart = chart_of(mechanism, names, start=one)
            draw = _Draw(chart, _ranges(chart, over or {}), own, threads)
            part, met, tried = draw.states(int(count))
            found.append(part.q)
            values.append(part.values)
            good, drawn, residual = (
                good + met,
                drawn + tried,
                max(residual, part.residual.max(initial=0.0)),
            )
    q = np.concatenate(found)
    mixed = rng.permutation(n)
    wanted = rng.standard_normal((n, mechanism.model.nv))
    v = np.zeros((n, mechanism.model.nv))
    if speed:
        v = random_motions(mechanism).project(q[mixed], speed * wanted)
    branch = np.repeat(np.arange(len(starts)), counts)[mixed]
    share = good / drawn
    return Resets(
        mechanism=mechanism,
        q=q[mixed],
        v=v,
        names=names,
        values=np.concatenate(values)[mixed],
        branch=branch,
        residual=float(residual),
        accepted=share,
        text=f"{n} states, {share:.0%} of the draws; loops closed to {residual:.1e}",
    )


@dataclass(frozen=True, eq=False)
class _Part:
    """Postures (n, nq) with their coordinates (n, k) and residuals (n,)."""

    values: np.ndarray
    q: np.ndarray
    residual: np.ndarray

    def and_more(self, other: _Part, most: int) -> _Part:
        """These and those, ``most`` of them at most."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return _Part(*(np.concatenate(pair)[:most] for pair in pairs))


@dataclass(frozen=True, eq=False)
class _Draw:
    """Draws postures on one branch."""

    chart: Chart
    ranges: np.ndarray
    rng: np.random.Generator
    threads: ThreadPoolExecutor

    def states(self, count: int) -> tuple[_Part, int, int]:
        """As many postures, how many were found and how many were drawn for that."""
        start = self.chart.start[None]
        pool = _Part(self.chart.values(self.chart.start).reshape(1, -1), start, np.zeros(1))
        most, tried = TRIES * max(count, 64), 0
        while len(pool.q) < min(POOL, max(64, count // 8)) and tried < most // 8:
            size = min(4 * len(pool.q) + 60, POOL)
            pool, tried = pool.and_more(self._round(pool, size), POOL), tried + size
        found = _Part(pool.values[:0], pool.q[:0], pool.residual[:0])
        met = drawn = 0
        while len(found.q) < count:
            share = max(met / drawn, 0.02) if drawn else 0.5
            size = int(min(BATCH, (count - len(found.q)) / share + 64))
            more = self._round(pool, size)
            found = found.and_more(more, count)
            met, drawn = met + len(more.q), drawn + size
            if drawn > most and len(found.q) < count:
                raise ClosureError(
                    f"{len(found.q) or 'none'} of {count} states were found in {drawn} draws of "
                    f"{' '.join(self.chart.names)}: give ranges (over=, --over) that the branch "
                    "reaches"
                )
            pool = pool.and_more(more, POOL)
        return found, met, drawn

    def _round(self, pool: _Part, size: int) -> _Part:
        """What became states, of so many draws."""
        from scipy.spatial import KDTree

        low, high = self.ranges
        values = self.rng.uniform(low, high, (size, len(low)))
        scale = self.chart.scale
        _, near = KDTree(pool.values / scale).query(values / scale)
        known, ends = self.chart.targets(pool.values), self.chart.targets(values)

        def piece(a: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            part = slice(a, a + PIECE)
            return self._followed(pool.q[near[part]], known[near[part]], ends[part])

        runs = list(self.threads.map(piece, range(0, size, PIECE)))
        q, residual, good = (np.concatenate(parts) for parts in zip(*runs, strict=True))
        return _Part(values[good], q[good], residual[good])

    def _followed(
        self, q: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Postures at the ends of ways, their residuals, and which of them are states."""
        follower = follower_of(self.chart.problem)
        way = follower.run(q, begin, end, SMALLEST)
        residual, sense, facing, within = follower.check.run(np.concatenate([way.q.T, end.T]))
        good = way.started & (way.codes == Ending.ARRIVED.code)
        good &= (residual < CLOSED) & (sense >= 0.0) & (facing >= 0.0) & (within >= 0.0)
        return way.q, residual, good


def independent_joints(mechanism: Mechanism) -> tuple[str, ...]:
    """Inputs, then other joints of one freedom, each independent of those before it."""
    samples = closed_samples(mechanism)
    motions = min(
        (null_space(dimensionless_jacobian(mechanism, q))[0] for q in reversed(samples)),
        key=lambda basis: basis.shape[1],
    )
    chosen: list[str] = []
    columns: list[int] = []
    for name in joint_names(mechanism):
        column = joint_index(mechanism, name)[1]
        if numerical_rank(motions[[*columns, column]], INDEPENDENT).value > len(columns):
            chosen.append(name)
            columns.append(column)
    return tuple(chosen)


def _starts(mechanism: Mechanism, start: str | ArrayLike | None) -> np.ndarray:
    if start is None:
        return mechanism.closed_home()[None]
    if isinstance(start, str):
        return mechanism.posture(start)[None]
    found = np.atleast_2d(mechanism.configurations(start))
    for q in found:
        gap = float(np.abs(mechanism.workspace.residual(q)).max(initial=0.0))
        if gap >= CLOSED:
            raise ClosureError(f"a start is open by {gap:.3g}; close it first (cc.close)")
    if not len(found):
        raise ClosureError("start has no posture")
    return found


def _ranges(chart: Chart, over: Mapping[str, tuple[float, float] | None]) -> np.ndarray:
    """Lower and upper ends (2, k) of the coordinates that are drawn."""
    here = chart.values(chart.start).reshape(-1)
    limits = {}
    lower, upper = chart.mechanism.limits
    for name, column in zip(chart.joints, chart.pinned_q, strict=True):
        limits[name] = (lower[column], upper[column])
    found = []
    for name, value, scale in zip(chart.names, here, chart.scale, strict=True):
        asked = over.get(name)
        if asked is None:
            bounds = limits.get(name, (-np.inf, np.inf))
            low, high = np.clip([value - SPAN * scale, value + SPAN * scale], *bounds)
        else:
            low, high = range_of(asked, name)
            least, most = limits.get(name, (-np.inf, np.inf))
            if high < least or low > most:
                raise ClosureError(
                    f"all values of {name!r}, {low:g} to {high:g}, lie beyond its joint limits "
                    f"{least:g} to {most:g}"
                )
        found.append((low, high))
    return np.array(found).T
