"""What a path asks for: its samples, the way between them, and the velocities along it.

Between samples a path without times runs straight (a pose: about a fixed axis), its parameter being
the sample's index. A timed path runs along a spline through its samples, its parameter being time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.given import LARGEST_NUMBER, finite_vector, real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError, known_names

Path = ArrayLike | Mapping[str, ArrayLike] | Sequence[pin.SE3] | Callable[[float], Any]
Rates = ArrayLike | Callable[[float], ArrayLike]


@dataclass(frozen=True, eq=False)
class Prescribed:
    """What is asked for at one parameter: inputs (n_inputs,) or a tip pose, and how it changes.

    ``rate`` and ``second`` are derivatives by the parameter: of the inputs, or (linear, angular) of
    the tip along the world's axes.
    """

    value: Any
    rate: np.ndarray
    second: np.ndarray


@dataclass(frozen=True, eq=False)
class Route:
    """Samples of inputs (n, n_inputs) or of poses, and the parameter at each.

    ``rates`` and ``seconds`` (n, k), where given, are what is reported at the samples in place of
    the spline's derivatives.
    """

    knots: np.ndarray
    timed: bool
    inputs: np.ndarray | None
    poses: tuple[pin.SE3, ...]
    rates: np.ndarray | None = None
    seconds: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.knots.size)

    @cached_property
    def _points(self) -> np.ndarray:
        if self.inputs is not None:
            return self.inputs
        return np.array([pose.translation for pose in self.poses])

    @cached_property
    def _spline(self) -> Any:
        return _spline(self.knots, self._points)

    @cached_property
    def _turning(self) -> Any:
        from scipy.spatial.transform import Rotation, RotationSpline

        turns = Rotation.from_matrix(np.array([pose.rotation for pose in self.poses]))
        return RotationSpline(self.knots, turns)

    def sample(self, i: int) -> Any:
        """Inputs (n_inputs,) or pose of sample ``i``."""
        return self.poses[i] if self.inputs is None else self.inputs[i]

    def between(self, k: int, u: float) -> Prescribed:
        """What is asked for at parameter ``u`` of the piece that begins at sample ``k``."""
        if self.size == 1:
            width = 6 if self.inputs is None else self._points.shape[1]
            return Prescribed(self.sample(0), np.zeros(width), np.zeros(width))
        return self._smooth(k, u) if self.timed else self._straight(k, u)

    def reported(self, i: int) -> Prescribed:
        """What is asked for at sample ``i``, with the velocities given for it, if any."""
        found = self.between(min(i, self.size - 2), float(self.knots[i]))
        rate = found.rate if self.rates is None else self.rates[i]
        second = found.second if self.seconds is None else self.seconds[i]
        return Prescribed(found.value, rate, second)

    def _smooth(self, k: int, u: float) -> Prescribed:
        values, rate, second = (np.asarray(self._spline(u, nu)) for nu in range(3))
        at_knot = [i for i in (k, k + 1) if u == self.knots[i]]
        if self.inputs is not None:
            return Prescribed(self.inputs[at_knot[0]] if at_knot else values, rate, second)
        rotation = self._turning(u).as_matrix()
        # the spline's angular rates are along the axes of the body
        turning = [rotation @ self._turning(u, order) for order in (1, 2)]
        pose = self.poses[at_knot[0]] if at_knot else pin.SE3(rotation, values)
        return Prescribed(
            pose, np.concatenate([rate, turning[0]]), np.concatenate([second, turning[1]])
        )

    def _straight(self, k: int, u: float) -> Prescribed:
        share = u - float(self.knots[k])
        a, b = self._points[k], self._points[k + 1]
        value = b if share == 1.0 else a + share * (b - a)
        if self.inputs is not None:
            return Prescribed(value, b - a, np.zeros_like(a))
        first, last = self.poses[k], self.poses[k + 1]
        turn = pin.log3(first.rotation.T @ last.rotation)
        rotation = last.rotation if share == 1.0 else first.rotation @ pin.exp3(share * turn)
        rate = np.concatenate([b - a, first.rotation @ turn])
        return Prescribed(pin.SE3(rotation, value), rate, np.zeros(6))


def route(
    mechanism: Mechanism,
    path: Path,
    times: ArrayLike | None,
    velocities: Rates | None,
    accelerations: Rates | None,
) -> Route:
    """Check a path and what comes with it.

    Raises
    ------
    ClosureError
        Malformed samples, names, times or velocities.
    """
    instants = None if times is None else _times(times)
    if callable(path):
        if instants is None:
            raise ClosureError("a path that is a function of time needs times=")
        path = _sampled(path, instants)
    inputs, poses = _samples(mechanism, path)
    n = len(poses) if inputs is None else len(inputs)
    if instants is not None and instants.size != n:
        raise ClosureError(f"times: {instants.size} given for {n} samples of the path")
    if instants is None:
        if velocities is not None or accelerations is not None:
            raise ClosureError("velocities and accelerations belong to a timed path: give times=")
        return Route(np.arange(float(n)), False, inputs, poses)
    width = 6 if inputs is None else len(mechanism.inputs)
    rates = _rates(velocities, instants, width, "velocities")
    seconds = _rates(accelerations, instants, width, "accelerations")
    if rates is not None and seconds is None and n > 1:
        seconds = np.asarray(_spline(instants, rates)(instants, 1))
    return Route(instants, True, inputs, poses, rates, seconds)


def _spline(knots: np.ndarray, values: np.ndarray) -> Any:
    """Spline through all values, of degree 5 where there are enough of them."""
    from scipy.interpolate import make_interp_spline

    degree = {2: 1, 3: 2, 4: 3, 5: 3}.get(knots.size, 5)
    return make_interp_spline(knots, values, k=degree)


def _times(times: ArrayLike) -> np.ndarray:
    size = np.shape(times)[0] if np.ndim(times) == 1 else 1
    found = finite_vector(times, size, "times", "s")
    falls = np.flatnonzero(np.diff(found) <= 0.0)
    if falls.size:
        i = int(falls[0])
        raise ClosureError(
            f"times must rise: times[{i + 1}] = {found[i + 1]:g} follows times[{i}] = {found[i]:g}"
        )
    if not found.size:
        raise ClosureError("times must not be empty")
    return found


def _sampled(path: Callable[[float], Any], times: np.ndarray) -> Any:
    """Values of a function of time: a list, or a mapping of lists where it gives mappings."""
    values = [path(float(t)) for t in times]
    if not all(isinstance(value, Mapping) for value in values):
        return values
    names = list(values[0])
    if any(set(value) != set(names) for value in values):
        raise ClosureError("path: the function must give the same inputs at all times")
    return {name: [value[name] for value in values] for name in names}


def _samples(mechanism: Mechanism, path: Any) -> tuple[np.ndarray | None, tuple[pin.SE3, ...]]:
    if isinstance(path, pin.SE3):
        raise ClosureError("path: give a list of poses; for a single one use cc.inverse")
    if isinstance(path, Sequence) and any(isinstance(p, pin.SE3) for p in path):
        for i, pose in enumerate(path):
            if not isinstance(pose, pin.SE3) or not np.isfinite(pose.homogeneous).all():
                raise ClosureError(f"path[{i}] must be a pin.SE3 of finite numbers, got {pose!r}")
        mechanism.required_task()
        return None, tuple(pose.copy() for pose in path)
    if not mechanism.inputs:
        raise ClosureError(f"mechanism {mechanism.name!r} has no inputs (<transmission> elements)")
    if isinstance(path, Mapping):
        path = _columns(mechanism, path)
    return _table(path, len(mechanism.inputs), "path", " ".join(mechanism.inputs)), ()


def _columns(mechanism: Mechanism, path: Mapping[str, Any]) -> np.ndarray:
    for name in path:
        if name not in mechanism.inputs:
            raise ClosureError(known_names(str(name), "input", mechanism.inputs))
    missing = [name for name in mechanism.inputs if name not in path]
    if missing:
        raise ClosureError(f"path: no values for input {', '.join(missing)}")
    columns = {}
    for name in mechanism.inputs:
        size = np.shape(path[name])
        if len(size) != 1:
            raise ClosureError(f"path[{name!r}] must have shape (n,), got {size}")
        columns[name] = finite_vector(path[name], size[0], f"path[{name!r}]", "m or rad")
    sizes = {name: column.size for name, column in columns.items()}
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
        raise ClosureError(f"path: all inputs need as many samples, got {listed}")
    return np.stack(list(columns.values()), axis=-1)


def _rates(rates: Rates | None, times: np.ndarray, width: int, what: str) -> np.ndarray | None:
    if rates is None:
        return None
    values = [rates(float(t)) for t in times] if callable(rates) else rates
    table = _table(values, width, what, "per second")
    if len(table) != times.size:
        raise ClosureError(f"{what}: {len(table)} rows given for {times.size} times")
    return table


def _table(values: Any, width: int, what: str, unit: str) -> np.ndarray:
    """Check (n, width) finite numbers, n > 0."""
    table = real_array(values, what, f"a table (n, {width}) of numbers ({unit})")
    if table.ndim != 2 or table.shape[1] != width or not table.shape[0]:
        raise ClosureError(f"{what} must have shape (n, {width}) ({unit}), got {table.shape}")
    bad = np.argwhere(~(np.abs(table) <= LARGEST_NUMBER))
    if bad.size:
        raise ClosureError(
            f"{what} has entries that are not finite or beyond {LARGEST_NUMBER:g}, "
            f"first at row {bad[0][0]}, column {bad[0][1]}"
        )
    return table
