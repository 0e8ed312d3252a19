"""All postures of a mechanism with something held: the result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.connections.connected import Connections
from closedchain.closure.modes.connections.connecting import Modes, connections_of
from closedchain.closure.modes.connections.window import Over
from closedchain.closure.progress import Progress
from closedchain.closure.solution import Solution


@dataclass(frozen=True, eq=False)
class Family:
    """Postures that are not isolated.

    Attributes
    ----------
    dimension : int
        Of the motions that are left there: the rank that the equations lack.
    q : (nq,) array
        One posture of it.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> found = cc.postures(m, fixed={"q1": -0.14}, count=False, starts=100)
    >>> found.families[0].dimension  # two freedoms are left
    2
    """

    dimension: int
    q: np.ndarray


@dataclass(frozen=True, eq=False)
class Postures:
    """Postures of a mechanism with inputs, a pose or joints held, each shape once.

    Two postures are one where all joints stand at the same points with the same axes: other
    spellings of a universal joint, or a leg turned by half with its slide reversed, do not count.

    Attributes
    ----------
    q : (n, nq) array
        Real postures, in an order that does not change with small changes of what is held.
    names : tuple of str
        Of each: the description's, where it has one; else the sign of the determinant and a number.
    complete : str
        "counted": all complex solutions were found, and a check of their number holds; what is
        real among them is here. "searched": many starts led to these, see ``unseen``.
    complex_count : int or None
        Finite complex solutions, a multiple one as often as it counts; None where not counted.
    infinite : int
        Generic solutions that go to infinity at these values.
    multiplicity : (n,) array of int
        More than 1 where solutions meet: there the posture is singular.
    certified : (n,) array of bool
        Whether the posture is proved to exist, and alone in its box.
    radius : (n,) array
        Half the sides of that box, dimensionless; NaN without.
    beyond_limits : tuple of tuple of str
        Of each: joints outside their limits.
    families : tuple of Family
        What is not isolated.
    hits : (n,) array of int
        How many random starts led to each.
    starts : int
    unseen : float
        Least estimate of how many postures no start led to [Chao1984]; from the hits.
    held : str
    pinned : mapping of joint to value [m or rad]
    target_pose : tuple of float
        x y z qx qy qz qw of the tip where its pose is held, and ``outputs`` that count.
    notes : tuple of str

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> found = cc.postures(m, pose=m.pose(m.home), count=False)
    >>> found.complete, len(found)  # each leg has two working modes
    ('searched', 8)
    >>> "home" in found.names, found[0].converged
    (True, True)
    """

    mechanism: Mechanism
    q: np.ndarray
    names: tuple[str, ...]
    complete: str
    complex_count: int | None
    infinite: int
    multiplicity: np.ndarray
    certified: np.ndarray
    radius: np.ndarray
    residual: np.ndarray
    branch: np.ndarray
    beyond_limits: tuple[tuple[str, ...], ...]
    families: tuple[Family, ...]
    hits: np.ndarray
    starts: int
    unseen: float
    held: str
    pinned: Mapping[str, float] = field(default_factory=dict)
    target_pose: tuple[float, ...] = ()
    outputs: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())

    @property
    def count(self) -> int:
        """Number of postures."""
        return len(self.q)

    def __len__(self) -> int:
        """Number of postures."""
        return len(self.q)

    def __iter__(self) -> Iterator[Solution]:
        """Each as a ``Solution``."""
        return (self[i] for i in range(len(self)))

    def __getitem__(self, which: int | str) -> Solution:
        """One of them, by number or name, as a ``Solution`` that ``guess=`` accepts.

        Raises
        ------
        IndexError, KeyError
            There is none.
        """
        if isinstance(which, str):
            if which not in self.names:
                raise KeyError(f"no posture is called {which!r}; there are {', '.join(self.names)}")
            which = self.names.index(which)
        i = range(len(self))[which]
        beyond = self.beyond_limits[i]
        note = f"; beyond the limits of {', '.join(beyond)}" if beyond else ""
        return Solution(
            q=self.q[i].copy(),
            residual=float(self.residual[i]),
            converged=True,
            iterations=0,
            message=f"closed to {self.residual[i]:.1e}, mode {self.names[i]}{note}",
            branch=int(self.branch[i]) or None,
            beyond_limits=beyond,
        )

    def connections(
        self,
        over: Over,
        *,
        resolution: int | Mapping[str, int] | None = None,
        limits: bool = True,
        progress: Progress | None = None,
    ) -> Connections:
        """Which of these modes are joined without a singularity in a slice, and which meet at one.

        What is held varies in some coordinates. All postures that the modes lead to over a grid
        are followed; a mode that comes back to its coordinates as another one, as round a cusp, is
        joined with it, and the way is kept. Meetings are sought along straight ways.

        Parameters
        ----------
        over : mapping of coordinate to (lowest, highest) [m or rad], or names of coordinates
            One to three of those that are held: inputs, joints, or x y z rx ry rz tilt azimuth of
            the tip. Without ranges (or where one is None) joints that turn without limits make a
            whole turn; other coordinates vary as far as the modes reach on a coarse grid, within
            limits, and at most eight characteristic lengths or half a turn both ways.
        resolution : int or mapping of coordinate to int, optional
            Cells along each coordinate; 400, 60 or 16 for one, two or three of them.
        limits : bool
            Whether joints must stay within their limits.
        progress : callable, optional
            Gets (what, done, total); the total is 0 where it is not known.

        Returns
        -------
        Connections

        Raises
        ------
        ClosureError
            Coordinates that are not held, ranges without the modes' values, postures that are not
            isolated, or none that can be followed.
        """
        model = self.mechanism.model
        driven = {
            int(v): n for v, n in zip(self.mechanism.input_v, self.mechanism.inputs, strict=True)
        }
        held = (model.joints[model.getJointId(name)].idx_v for name in self.pinned)
        joints = zip(held, self.pinned, strict=True)
        modes = Modes(
            mechanism=self.mechanism,
            q=self.q,
            names=self.names,
            held=self.held,
            coordinates=tuple(driven.get(v, name) for v, name in joints),
            outputs=self.outputs,
            beyond_limits=self.beyond_limits,
        )
        return connections_of(modes, over, resolution=resolution, limits=limits, progress=progress)

    def certificate(self, mechanism: Mechanism) -> dict[str, Any]:
        """What is proved, for a checker that shares nothing with us: plain numbers and names.

        Of each proved posture: q (lengths in m), and half the side of the box of steps, in units of
        ``length`` for slides and places and in rad for angles. What is held stands beside.
        """
        return {
            "format": "closedchain certificate 1",
            "mechanism": mechanism.name,
            "parameters": dict(mechanism.parameters),
            "length": mechanism.length,
            "held": self.held,
            "pinned": dict(self.pinned),
            "pose": list(self.target_pose),
            "outputs": list(self.outputs),
            "count": self.count,
            "complete": self.complete,
            "complex_count": self.complex_count,
            "postures": [
                {
                    "name": self.names[i],
                    "joints": by_joint(mechanism, self.q[i]),
                    "radius": float(self.radius[i]),
                }
                for i in np.flatnonzero(self.certified)
            ],
        }

    def _evidence(self) -> str:
        """How sure the number of postures is."""
        if self.complete == "counted":
            real = f"of which {'these are' if self.count > 1 else 'this is'} real"
            if not self.count:
                real = "none of them real"
            if self.complex_count == 1:
                return f"Counted: 1 complex solution, {'which is real' if self.count else real}."
            return f"Counted: {self.complex_count} complex solutions, {real}."
        if not self.count:
            return (
                f"Searched: none of {self.starts} starts led to one. That proves nothing: there "
                "may be some."
            )
        least = int(self.hits.min())
        hits = "once" if least == 1 else f"{least} times"
        unseen = (
            f"at least {self.unseen:.1f} more are unseen"
            if self.unseen >= 0.05
            else "there is no sign of others"
        )
        return (
            f"Searched: {self.starts} starts, each posture hit at least {hits}; by the hits "
            f"{unseen}. That none is missing is not proved."
        )

    @property
    def text(self) -> str:
        """What was found and how sure that is, in sentences."""
        what = "posture" if self.count == 1 else "postures"
        lines = [f"{self.count} {what} with {self.held}."]
        lines.append(self._evidence())
        if self.infinite:
            one = self.infinite == 1
            lines.append(
                f"{self.infinite} generic solution{'' if one else 's'} {'is' if one else 'are'} at "
                "infinity here."
            )
        if self.count and self.certified.all():
            lines.append(
                f"Each is proved to exist, alone within {self.radius.max():.0e} (Krawczyk's test)."
            )
        elif self.count and not self.families:
            left = int((~self.certified).sum())
            lines.append(
                f"Of {left} it is not proved that {'it is' if left == 1 else 'they are'} alone."
            )
        for i in np.flatnonzero(self.multiplicity > 1):
            lines.append(f"{self.names[i]} counts {self.multiplicity[i]} times: it is singular.")
        for dimension in sorted({f.dimension for f in self.families}):
            n = sum(f.dimension == dimension for f in self.families)
            lines.append(
                f"{n} of them {'stands' if n == 1 else 'stand'} for a family of postures, of "
                f"dimension {dimension}."
            )
        beyond = sum(bool(b) for b in self.beyond_limits)
        if beyond:
            lines.append(f"{beyond} of them have joints beyond their limits.")
        return " ".join([*lines, *self.notes])


def by_joint(mechanism: Mechanism, q: np.ndarray) -> dict[str, list[float]]:
    """Numbers of a posture (nq,) under the names of the joints that they belong to."""
    model = mechanism.model
    return {
        str(model.names[j]): q[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]].tolist()
        for j in range(1, model.njoints)
    }
