"""The outcome of tracing a self-motion: postures, measures, ends, and their export."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from closedchain.analysis.singularity.maps.measures import LONG_NAMES
from closedchain.analysis.structure.driving import dependence
from closedchain.closure.generic import generic_ranks
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.outcome import Ending
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import xarray as xr

STILL = 1e-9  # m or rad: an input that moves less is at rest


@dataclass(frozen=True)
class End:
    """How a self-motion ends.

    Attributes
    ----------
    how : str
        "closed loop", "joint limit", "singularity", "branch point" or "longest".
    joint : str or None
        The input, or else the joint, at its limit.
    kinds : frozenset of str
        Kinds of singularity there, as ``cc.classify`` has them.
    text : str
    ending : Ending
        What kind of end it was for the tracer.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> down = cc.self_motion(m, m.home, "x y z rx rz").ends[1]
    >>> down.how, down.joint
    ('joint limit', 'q1')
    """

    how: str
    joint: str | None
    kinds: frozenset[str]
    text: str
    ending: Ending


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """Postures along a self-motion, in order.

    Attributes
    ----------
    q : (n, nq) array
        On a closed loop the first posture is not repeated at the end.
    arclength : (n,) array
        Way from the start posture in the dimensionless motions of all joints, floating bodies
        included (lengths over ``mechanism.length``, angles in rad), added up over the chords;
        negative behind the start.
    length : float
        Of the whole curve in the same measure; of a loop, with the way back to its first posture.
    inputs : (n, n_inputs) array [m or rad]
    sigma_direct, sigma_inverse, sigma_constraint : (n,) arrays
        As ``cc.classify`` gives them. ``sigma_inverse`` belongs to the mechanism without locks.
    condition : (n,) array
        Of the dimensionless twist map; infinite, or huge by rounding, at singularities.
    residual, task_error : (n,) arrays
        Largest row of the closures, and of the tip against its pose at the start [m or rad].
    ends : (End, End)
        Behind the start and ahead of it.
    closed : bool
        Whether the curve is a loop.
    turns : mapping of joint name to int
        Whole turns that joints have made when a loop closes; joints without are left out. Their
        limits allow for going once round, from the first posture to the last, but not on and on.
    start : int
        Index of the start posture.
    singular, branch_points : tuples of int
        Indices of direct singularities, and of postures where other self-motions cross this one.
    degenerate : bool
        Whether the outputs and locks are as many as the freedoms, and yet leave one: every posture
        of the curve is an inverse singularity, or the outputs never change independently.
    outputs, locked : tuples of str

    Examples
    --------
    >>> m = cc.load("d1")
    >>> s = cc.self_motion(m, m.home, "x y z rx rz")
    >>> [end.how for end in s.ends]
    ['singularity', 'joint limit']
    >>> bool(s.task_error.max() < 1e-12)
    True
    """

    q: np.ndarray
    arclength: np.ndarray
    length: float
    inputs: np.ndarray
    sigma_direct: np.ndarray
    sigma_inverse: np.ndarray
    sigma_constraint: np.ndarray
    condition: np.ndarray
    residual: np.ndarray
    task_error: np.ndarray
    ends: tuple[End, End]
    closed: bool
    turns: Mapping[str, int]
    start: int
    singular: tuple[int, ...]
    branch_points: tuple[int, ...]
    degenerate: bool
    outputs: tuple[str, ...]
    locked: tuple[str, ...]
    mechanism: Mechanism = field(repr=False)

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def text(self) -> str:
        """What moves how far, how it ends, and the least singular values, in words."""
        m, n = self.mechanism, len(self.q)
        what = "loop" if self.closed else "curve"
        held = f", {' '.join(self.locked)} locked" if self.locked else ""
        lines = [
            f"{m.name}: self-motion with outputs {' '.join(self.outputs)} held{held}: a {what} of "
            f"{n} postures, length {self.length:.4g} (dimensionless, all joints)."
        ]
        generic = generic_ranks(m, self.outputs)
        if self.degenerate and generic.outputs.value < len(self.outputs):
            lines.append(f"  {dependence(generic, self.outputs)}")
        elif self.degenerate:
            lines.append(
                "  Every posture of it is an inverse singularity: in general these outputs"
                f"{' and locks' if self.locked else ''} leave no freedom."
            )
        if self.closed:
            made = ", ".join(f"{name} {count:+d}" for name, count in self.turns.items())
            lines.append(f"  It comes back to its start{f'; whole turns: {made}' if made else ''}.")
        else:
            for end, which, at in zip(self.ends, ("behind", "ahead"), (0, -1), strict=True):
                way = abs(float(self.arclength[at]))
                lines.append(f"  {which} the start it ends after {way:.4g}: {end.text}")
        ranges = [
            f"{name} {low:.4g} to {high:.4g} {unit}"
            for name, unit, low, high in zip(
                m.inputs, m.input_units, self.inputs.min(0), self.inputs.max(0), strict=True
            )
            if high - low > STILL
        ]
        lines.append(f"  inputs that move: {', '.join(ranges) or 'none'}")
        lines.append(
            "  least singular values: "
            + ", ".join(
                f"{kind} {getattr(self, f'sigma_{kind}').min():.3g}"
                for kind in ("direct", "inverse", "constraint")
            )
        )
        if self.branch_points:
            where = ", ".join(f"{self.arclength[i]:.4g}" for i in self.branch_points)
            lines.append(f"  branch points, where other self-motions cross, at {where}")
        inner = [i for i in self.singular if self.closed or 0 < i < n - 1]
        if len(self.singular) == n:
            lines.append("  every posture is a direct singularity")
        elif inner:
            where = ", ".join(f"{self.arclength[i]:.4g}" for i in inner)
            lines.append(f"  direct singularities at {where}")
        return "\n".join(lines)

    def to_dataset(self) -> xr.Dataset:
        """The postures and their measures over the arclength as an ``xarray.Dataset``."""
        require("a dataset is made with xarray", "maps")
        import xarray as xr

        m = self.mechanism
        sigmas = ("sigma_direct", "sigma_inverse", "sigma_constraint", "condition")
        return xr.Dataset(
            {
                "q": (("posture", "configuration"), self.q.copy(), {"units": "m or rad"}),
                "inputs": (
                    ("posture", "input"),
                    self.inputs.copy(),
                    {"units": " ".join(m.input_units)},
                ),
                **{
                    name: (
                        "posture",
                        getattr(self, name).copy(),
                        {"units": "1", "long_name": LONG_NAMES[name]},
                    )
                    for name in sigmas
                },
                **{
                    name: ("posture", getattr(self, name).copy(), {"units": "m or rad"})
                    for name in ("residual", "task_error")
                },
            },
            coords={
                "arclength": ("posture", self.arclength.copy(), {"units": "1"}),
                "input": list(m.inputs),
            },
            attrs={
                "mechanism": m.name,
                "outputs": " ".join(self.outputs),
                "locked": " ".join(self.locked),
                "closed": int(self.closed),
                "start": self.start,
                "length": self.length,
                "ends": "; ".join(end.text for end in self.ends),
                "singular": list(self.singular),
                "branch_points": list(self.branch_points),
            },
        )
