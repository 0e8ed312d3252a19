"""The equations of a task with its redundancy: what is held, what is free, what bounds it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.analysis.motion.track.routes import Route
from closedchain.analysis.structure.mobility import generic_rank
from closedchain.closure.given import real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.system import System
from closedchain.closure.task import goal
from closedchain.urdf.errors import ClosureError, known_names

Limits = Mapping[str, tuple[float, float]]
Speeds = float | Mapping[str, float] | ArrayLike


@dataclass(frozen=True, eq=False)
class Bounds:
    """Limits of joints with one freedom, and of input speeds.

    Attributes
    ----------
    names : tuple of str
    in_q, in_v : (b,) arrays of int
    lower, upper : (b,) arrays [m or rad]
        One of them may be infinite.
    speeds : (n_inputs,) array or None
        Largest speeds [m/s or rad/s]; may be infinite.
    """

    names: tuple[str, ...]
    in_q: np.ndarray
    in_v: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    speeds: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Problem:
    """A task, the inputs that are locked, and the bounds.

    Attributes
    ----------
    outputs : tuple of str
    route : Route
        Timed, of poses.
    locked : tuple of str
        Inputs that do not move.
    enforced : bool
        Whether steps keep the bounds.
    """

    mechanism: Mechanism
    outputs: tuple[str, ...]
    route: Route
    locked: tuple[str, ...]
    bounds: Bounds
    enforced: bool = True

    @property
    def times(self) -> np.ndarray:
        """Instants of the samples (n,) [s]."""
        return self.route.knots

    @cached_property
    def free(self) -> np.ndarray:
        """Columns of v that are not locked."""
        m = self.mechanism
        fixed = [int(m.input_v[m.inputs.index(n)]) for n in self.locked]
        return np.setdiff1d(np.arange(m.model.nv), fixed)

    @cached_property
    def rank(self) -> int:
        """Generic rank of closures and task."""
        return generic_rank(self.mechanism) + len(self.outputs)

    @cached_property
    def freedoms(self) -> int:
        """Freedoms k that the task and the locks leave."""
        return max(self.free.size - self.rank, 0)

    @cached_property
    def unit(self) -> np.ndarray:
        """Unit of each free column."""
        return self.mechanism.column_scale[self.free]

    def pose(self, piece: int, u: float) -> pin.SE3:
        """Pose wanted at time ``u`` of the piece that begins at sample ``piece``."""
        pose = self.route.between(piece, u).value
        assert isinstance(pose, pin.SE3)
        return pose

    def equations(self, pose: pin.SE3) -> System:
        """Closures and the tip at ``pose``, in the free columns."""
        tip = self.mechanism.required_task().tip
        return System(self.mechanism, self.free, (goal(self.mechanism, tip, pose, self.outputs),))

    def held(self, pose: pin.SE3, anchor: np.ndarray, basis: np.ndarray) -> System:
        """The same, and no motion away from posture ``anchor`` along ``basis`` (free, k)."""
        plain = self.equations(pose)
        if not basis.shape[1]:
            return plain
        return Held(plain.mechanism, plain.free, plain.goals, None, anchor, basis)

    def moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Posture after a dimensionless step (free,)."""
        v = np.zeros(self.mechanism.model.nv)
        v[self.free] = step * self.unit
        return np.asarray(pin.integrate(self.mechanism.model, q, v))


@dataclass(frozen=True, eq=False)
class Held(System):
    """Closures and goals, and the coordinates along ``basis`` (free, k) kept as at ``anchor``.

    The null motion itself serves as the coordinate, so no input needs to be an admissible one.
    """

    anchor: np.ndarray = field(default_factory=lambda: np.zeros(0))
    basis: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @cached_property
    def row_scale(self) -> np.ndarray:
        """Unit of each row; the coordinates have none."""
        plain = System(self.mechanism, self.free, self.goals).row_scale
        return np.concatenate([plain, np.ones(self.basis.shape[1])])

    def evaluate(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (rows,) and dimensionless Jacobian (rows, free) at ``q``."""
        values, matrix = super().evaluate(q)
        model, units = self.mechanism.model, self.mechanism.column_scale
        turn = pin.dDifference(model, self.anchor, q, pin.ARG1) * units
        slopes = (self._weights @ turn)[:, self.free]
        matrix = np.asfortranarray(np.vstack([matrix, slopes]))
        return np.concatenate([values, self._along(q)]), matrix

    def residual(self, q: np.ndarray) -> np.ndarray:
        """Residual (rows,) alone at ``q``."""
        return np.concatenate([super().residual(q), self._along(q)])

    @cached_property
    def _weights(self) -> np.ndarray:
        weights = np.zeros((self.basis.shape[1], self.mechanism.model.nv))
        weights[:, self.free] = self.basis.T
        return weights / self.mechanism.column_scale

    def _along(self, q: np.ndarray) -> np.ndarray:
        """Coordinates along the basis, from the anchor on."""
        return np.asarray(self._weights @ pin.difference(self.mechanism.model, self.anchor, q))


def bounds_of(mechanism: Mechanism, limits: Limits | None, speeds: Speeds | None) -> Bounds:
    """Limits of all joints with one freedom, those of the inputs replaced where given.

    Raises
    ------
    ClosureError
        Unknown inputs, limits that do not rise, speeds that are not positive.
    """
    given = dict(limits or {})
    for name, pair in given.items():
        if name not in mechanism.inputs:
            raise ClosureError(known_names(str(name), "input", mechanism.inputs))
        ends = real_array(pair, f"limits of {name}", "two rising numbers")
        if ends.shape != (2,) or not ends[0] < ends[1]:
            raise ClosureError(f"limits of {name} must be two rising numbers, got {pair!r}")
    model = mechanism.model
    by_q = dict(zip(mechanism.input_q.tolist(), mechanism.inputs, strict=True))
    names, rows = [], []
    for j in range(1, model.njoints):
        if model.nqs[j] != 1 or model.nvs[j] != 1:
            continue
        i = int(model.idx_qs[j])
        name = by_q.get(i, model.names[j])
        low, high = (float(x[i]) for x in mechanism.limits)
        low, high = given.get(name, (low, high)) if i in by_q else (low, high)
        if np.isfinite([low, high]).any():
            names.append(name)
            rows.append((i, int(model.idx_vs[j]), float(low), float(high)))
    table = np.array(rows).reshape(-1, 4)
    return Bounds(
        names=tuple(names),
        in_q=table[:, 0].astype(int),
        in_v=table[:, 1].astype(int),
        lower=table[:, 2],
        upper=table[:, 3],
        speeds=_speeds(mechanism, speeds),
    )


def _speeds(mechanism: Mechanism, speeds: Speeds | None) -> np.ndarray | None:
    if speeds is None:
        return None
    if isinstance(speeds, Mapping):
        for name in speeds:
            if name not in mechanism.inputs:
                raise ClosureError(known_names(str(name), "input", mechanism.inputs))
        found = real_array([speeds.get(n, np.inf) for n in mechanism.inputs], "speed_limits")
    else:
        wanted = f"one number, or one for each of {' '.join(mechanism.inputs)}"
        found = real_array(speeds, "speed_limits", wanted)
        if found.shape not in ((), (1,), (len(mechanism.inputs),)):
            raise ClosureError(f"speed_limits must be {wanted}")
        found = np.array(np.broadcast_to(found, (len(mechanism.inputs),)))
    if not (found > 0.0).all():
        raise ClosureError(f"speed_limits must be positive, got {speeds!r}")
    return found


def locks_of(
    mechanism: Mechanism, lock: str | Sequence[str] | Mapping[str, float] | None, q: np.ndarray
) -> dict[str, float]:
    """Locked inputs and their values: those given, or those of the posture ``q``.

    Raises
    ------
    ClosureError
        Unknown or repeated inputs, values that are not finite.
    """
    if lock is None:
        return {}
    names = lock.replace(",", " ").split() if isinstance(lock, str) else list(lock)
    for name in names:
        if name not in mechanism.inputs:
            raise ClosureError(known_names(str(name), "input", mechanism.inputs))
    if len(set(names)) < len(names):
        raise ClosureError(f"lock: an input is named twice in {' '.join(names)}")
    here = dict(zip(mechanism.inputs, mechanism.input_values(q), strict=True))
    values = lock if isinstance(lock, Mapping) else here
    found = {n: float(values[n]) for n in mechanism.inputs if n in names}
    for name, value in found.items():
        if not np.isfinite(value):
            raise ClosureError(f"lock: the value of {name} must be finite, got {value!r}")
    return found
