"""Measures of maps from the twist map: efforts, speeds, forces, stiffness and transmission.

Each is a function of a mechanism and closed postures (n, nq) and gives values (n,). ``NAMED`` has
those that a name says, ``OF_DRIVES`` those that need the stiffness of the drives. With T the twist
map, tip twist = T input rates and efforts = -T^T wrench. Directions are those of the task's linear
outputs where its tip has any, else of all three.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from closedchain.analysis.forces.capabilities import drive_stiffness, twist_maps
from closedchain.closure.given import real_array
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError, known_names

SINGULAR = 1e-9  # share of the largest singular value below which a rank is lost


_Function = TypeVar("_Function", bound=Callable[..., np.ndarray])


class TipMeasure(Protocol):
    """A measure of closed postures (n, nq): values (n,)."""

    @property
    def __name__(self) -> str: ...

    def __call__(self, mechanism: Mechanism, postures: np.ndarray, /) -> np.ndarray:
        """Values (n,) at closed postures (n, nq)."""
        ...


def measured_in(unit: str) -> Callable[[_Function], _Function]:
    """Give a function its unit, which a map then says beside its values."""

    def marked(function: _Function) -> _Function:
        vars(function)["unit"] = unit
        return function

    return marked


@measured_in("N, N m per N")
def effort_per_force(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Largest input effort for unit force at the tip, any direction.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> print(cc.effort_per_force(m, m.home[None]).round(4))  # [N/N]
    [1.5635]
    """
    return np.asarray(np.linalg.norm(twist_maps(mechanism, postures)[:, :3], axis=1).max(axis=1))


@measured_in("N, N m per N m")
def effort_per_moment(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Largest input effort for unit moment at the tip, any direction.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> inputs = m.input_values(m.home) + [0.02, -0.01, 0, 0.02, 0.01, -0.02]
    >>> q = cc.direct(m, inputs).raise_if_failed().q
    >>> bool(cc.effort_per_moment(m, q[None])[0] > 0.0)  # [N/(N m)]
    True
    """
    return np.asarray(np.linalg.norm(twist_maps(mechanism, postures)[:, 3:], axis=1).max(axis=1))


@measured_in("m/s")
def least_speed(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Speed of the tip in its slowest direction, for input rates of unit size.

    The shortest half axis of the velocity ellipsoid. Missing at direct singularities.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> print(cc.least_speed(m, m.home[None]).round(4))  # [m/s] for 1 m/s
    [0.5774]
    """
    t = _linear(mechanism, postures)
    return _of_finite(t, lambda s: s[:, -1] if s.shape[1] == t.shape[1] else 0.0 * s[:, -1], np.nan)


@measured_in("N")
def least_force(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Force at the tip in its weakest direction, for efforts of unit size.

    The shortest half axis of the force ellipsoid; 0 at direct singularities.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> print(cc.least_force(m, m.home[None]).round(4))  # [N] for 1 N
    [0.5345]
    """
    return _of_finite(_linear(mechanism, postures), lambda s: 1.0 / s[:, 0], 0.0)


def isotropy(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Slowest by fastest direction of the tip: 1 where the velocity ellipsoid is a ball.

    0 at singularities.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> print(cc.isotropy(m, m.home[None]).round(4))
    [0.3086]
    """
    t = _linear(mechanism, postures)
    if t.shape[1] > t.shape[2]:
        return np.zeros(len(t))
    return _of_finite(t, lambda s: s[:, -1] / np.maximum(s[:, 0], 1e-300), 0.0)


def output_transmission(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Least cosine between how an input alone moves the tip and what it alone holds there.

    For each input the tip's twist with the others locked and the least wrench that asks effort of
    this input alone, lengths in ``mechanism.length``, in the task's linear outputs and, where it
    has rotations, all of these: 1 at best, 0 at singularities. Of a five-bar
    it is the sine of the angle between the two rods that meet. The output transmission index of
    Wang, Wu and Liu (2010) is this ratio of work to the most that such a wrench could do.

    Examples
    --------
    >>> m = cc.load("five_bar")
    >>> worst = cc.output_transmission(m, m.home[None])
    >>> bool(0.0 < worst[0] <= 1.0)
    True
    """
    outputs = mechanism.required_task().outputs
    rows = [i for i, name in enumerate(OUTPUTS) if name in outputs]
    if any(i >= 3 for i in rows):
        rows = [*(i for i in rows if i < 3), 3, 4, 5]
    t = twist_maps(mechanism, postures)[:, rows] * mechanism.column_scale[mechanism.input_v]
    t = t / np.array([mechanism.length] * 3 + [1.0] * 3)[rows, None]
    found = np.zeros(len(t))
    there = np.isfinite(t).all(axis=(1, 2))
    if not there.any() or t.shape[2] > t.shape[1]:
        return found
    s = np.linalg.svd(t[there], compute_uv=False)
    there[np.flatnonzero(there)[s[:, -1] <= SINGULAR * s[:, 0]]] = False
    wrenches = np.linalg.pinv(t[there])  # (n, inputs, 6): row i does work on column i alone
    sizes = np.linalg.norm(wrenches, axis=2) * np.linalg.norm(t[there], axis=1)
    found[there] = (1.0 / sizes).min(axis=1)
    return found


@dataclass(frozen=True)
class OfDrives:
    """What a measure of a tip that gives way needs: the stiffness of each drive, or one for all."""

    drives: tuple[float, ...]

    @classmethod
    def given(cls, drives: ArrayLike) -> Self:
        """The measure for such stiffnesses [N/m or N m/rad]. Raises ``ClosureError``."""
        return cls(tuple(real_array(drives, "stiffness").ravel().tolist()))

    def compliance(self, mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
        """Displacement by force (n,) [m/N] in the softest direction, infinite where singular."""
        one_for_all = len(self.drives) == 1
        drives = self.drives * len(mechanism.inputs) if one_for_all else self.drives
        k = drive_stiffness(mechanism, drives)
        t = twist_maps(mechanism, postures)[:, :3] / np.sqrt(k)
        return _of_finite(t, lambda s: s[:, 0] ** 2, np.inf)


@dataclass(frozen=True)
class TipCompliance(OfDrives):
    """Largest displacement of the tip's origin for unit force, any direction."""

    unit = "m/N"
    __name__ = "largest_compliance"

    def __call__(self, mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
        """Values (n,) [m/N], infinite at direct singularities."""
        return self.compliance(mechanism, postures)


@dataclass(frozen=True)
class TipStiffness(OfDrives):
    """Least force that moves the tip's origin by a unit, any direction."""

    unit = "N/m"
    __name__ = "least_stiffness"

    def __call__(self, mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
        """Values (n,) [N/m], zero at direct singularities."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / self.compliance(mechanism, postures))


def largest_compliance(drives: ArrayLike) -> TipCompliance:
    """Measure for maps: how far the tip's origin gives way to unit force, in the worst direction.

    Parameters
    ----------
    drives : (n_inputs,) array, or one number
        Stiffness of each input [N/m or N m/rad].

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> gives = cc.largest_compliance([1e5, 1e5, 1e5])  # a measure for cc.singularity_map
    >>> print((gives(m, m.home[None]) * 1e6).round(2))  # [um/N]
    [35.]
    """
    return TipCompliance.given(drives)


def least_stiffness(drives: ArrayLike) -> TipStiffness:
    """Measure for maps: force by displacement of the tip's origin, in the softest direction.

    Parameters
    ----------
    drives : (n_inputs,) array, or one number
        Stiffness of each input [N/m or N m/rad].

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> holds = cc.least_stiffness(1e5)  # a measure for cc.singularity_map
    >>> print((holds(m, m.home[None]) * 1e-6).round(4))  # [N/um]
    [0.0286]
    """
    return TipStiffness.given(drives)


NAMED: Mapping[str, TipMeasure] = MappingProxyType(
    {
        measure.__name__: measure
        for measure in (
            *(effort_per_force, effort_per_moment, least_speed),
            *(least_force, isotropy, output_transmission),
        )
    }
)
"""Measures that a name says."""

OF_DRIVES: Mapping[str, Callable[[ArrayLike], TipMeasure]] = MappingProxyType(
    {"largest_compliance": largest_compliance, "least_stiffness": least_stiffness}
)
"""Measures that need the stiffness of the drives."""


def tip_measure(name: str, drives: ArrayLike | None = None) -> TipMeasure:
    """Measure of a name, with the stiffness of the drives where it needs that.

    Raises
    ------
    ClosureError
        An unknown name; stiffnesses where none are needed, or the other way round.
    """
    if name in OF_DRIVES:
        if drives is None:
            raise ClosureError(f"{name} needs the stiffness of the drives: {name}=NUMBER")
        return OF_DRIVES[name](drives)
    if name not in NAMED:
        raise ClosureError(known_names(name, "measure", (*NAMED, *OF_DRIVES)))
    if drives is not None:
        raise ClosureError(f"{name} takes no numbers; {', '.join(OF_DRIVES)} do")
    return NAMED[name]


def _linear(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Twist maps (n, d, inputs) in the linear outputs."""
    outputs = mechanism.required_task().outputs
    rows = [OUTPUTS.index(name) for name in outputs if name in "xyz"] or [0, 1, 2]
    return twist_maps(mechanism, postures)[:, rows]


def _of_finite(
    t: np.ndarray, value: Callable[[np.ndarray], np.ndarray], otherwise: float
) -> np.ndarray:
    """A function of the singular values where the twist map exists, another number elsewhere."""
    found = np.full(len(t), otherwise)
    there = np.isfinite(t).all(axis=(1, 2))
    if there.any():
        with np.errstate(divide="ignore"):
            found[there] = value(np.linalg.svd(t[there], compute_uv=False))
    return found
