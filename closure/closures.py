"""Closures of a mechanism: cut joints between bodies, and couplings of joint values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pinocchio as pin

from closedchain.closure.joint_kinds import JOINT_KINDS, JointKind
from closedchain.closure.tape.vectors import Scalar
from closedchain.urdf.description import ClosureType

CouplingKind = Literal["coupling", "linear", "polynomial"]


@dataclass(frozen=True, eq=False)
class Closure:
    """A cut joint of a given kind between two bodies of the spanning tree.

    Attributes
    ----------
    name : str
    kind : str
        The joint that was cut; its rows stand in ``closedchain.closure.joint_kinds``.
    joint1, joint2 : int
        Pinocchio joint ids that carry frame 1 and frame 2; 0 is the base.
    placement1, placement2 : pin.SE3
        Frame 1 in joint 1, frame 2 in joint 2; z is the axis of the cut joint.
    parent, child : str
        Names of the two links, for messages.
    sizes : mapping of str to float
        Sizes [m] that a joint of this kind has, such as the length of a rod.

    Examples
    --------
    >>> ball = cc.load("d1").closures[0]
    >>> ball.kind, ball.rows, ball.parent, ball.child
    ('spherical', 3, 'leg1_rod', 'S1')
    """

    name: str
    kind: ClosureType
    joint1: int
    placement1: pin.SE3
    joint2: int
    placement2: pin.SE3
    parent: str
    child: str
    sizes: Mapping[str, float] = field(default_factory=dict)

    @property
    def joint_kind(self) -> JointKind:
        """Entry of the table of joint kinds."""
        return JOINT_KINDS[self.kind]

    @property
    def rows(self) -> int:
        """Number of rows: six less the freedoms of the cut joint."""
        return self.joint_kind.rows

    @property
    def translational(self) -> np.ndarray:
        """Which rows are lengths [m], shape (rows,) of bool; the others are angles [rad]."""
        return np.array(self.joint_kind.translational)

    def describe(self) -> str:
        """Name, kind and the two links, for messages."""
        return f"{self.name!r} ({self.kind}, {self.parent} to {self.child})"


@dataclass(frozen=True)
class CoupledJoint:
    """A joint's part in a coupling: the polynomial c0 + c1 x + c2 x^2 + ... of its value x.

    ``q`` and ``v`` are the joint's index in the configuration and in the velocity; x is in the
    joint's own unit, m or rad.
    """

    joint: str
    q: int
    v: int
    coefficients: tuple[float, ...]

    def value(self, x: Scalar) -> Scalar:
        """Value at x, over any kind of number."""
        return _horner(self.coefficients, x)

    def slope(self, x: Scalar) -> Scalar:
        """First derivative at x."""
        return _horner(_derived(self.coefficients), x)

    def curvature(self, x: Scalar) -> Scalar:
        """Second derivative at x."""
        return _horner(_derived(_derived(self.coefficients)), x)


@dataclass(frozen=True, eq=False)
class Coupling:
    """Joint values that depend on each other: the sum of polynomials of single joints is zero.

    One row. A URDF mimic is one (Pinocchio's own mimic joints get constraint Jacobians wrong; this
    row is exact), and so are linear combinations of joint values and polynomial followers.

    Attributes
    ----------
    name : str
    kind : str
        "coupling" of a mimic, else "linear" or "polynomial".
    joints : tuple of CoupledJoint
        The first is the follower of a mimic or polynomial; it gives the row its unit.
    length_row : bool
        Whether the row is a length: its first joint slides.

    Examples
    --------
    >>> m = cc.load("rus6")
    >>> [(c.name, c.kind, c.rows) for c in m.closures if c.kind in ("coupling", "linear")][:1]
    [('leg2_F_mimic', 'coupling', 1)]
    """

    name: str
    kind: CouplingKind
    joints: tuple[CoupledJoint, ...]
    length_row: bool

    @property
    def rows(self) -> int:
        """One row."""
        return 1

    @property
    def translational(self) -> np.ndarray:
        """Whether the row is a length, shape (1,) of bool."""
        return np.array([self.length_row])

    @property
    def follower(self) -> str:
        """Name of the first joint."""
        return self.joints[0].joint

    @property
    def leaders(self) -> tuple[str, ...]:
        """Names of the other joints."""
        return tuple(part.joint for part in self.joints[1:])

    def value(self, q: Sequence[Scalar] | np.ndarray) -> Scalar:
        """Row at a configuration (nq), over any kind of number."""
        total: Scalar = 0.0
        for part in self.joints:
            total = total + part.value(q[part.q])
        return total

    def gradient(self, q: Sequence[Scalar] | np.ndarray) -> list[tuple[int, Scalar]]:
        """Derivative of the row: (index in v, entry) for each joint, to be added up."""
        return [(part.v, part.slope(q[part.q])) for part in self.joints]

    def curvature(self, q: Sequence[Scalar] | np.ndarray) -> list[tuple[int, Scalar]]:
        """Second derivatives: (index in v, entry) for each joint; there are no mixed ones."""
        return [(part.v, part.curvature(q[part.q])) for part in self.joints]

    def describe(self) -> str:
        """Name, kind and joints, for messages."""
        if self.kind == "linear":
            names = ", ".join((self.follower, *self.leaders))
            return f"{self.name!r} (linear coupling of joints {names})"
        of = "polynomial coupling" if self.kind == "polynomial" else "coupling"
        return f"{self.name!r} ({of} of joint {self.follower} to {self.leaders[0]})"


def slices_of(closures: Sequence[Closure | Coupling]) -> tuple[slice, ...]:
    """Rows of each closure among those of all."""
    ends = np.cumsum([closure.rows for closure in closures])
    return tuple(slice(int(end) - c.rows, int(end)) for end, c in zip(ends, closures, strict=True))


def lengths_among(closures: Sequence[Closure | Coupling]) -> np.ndarray:
    """Which rows of all closures are lengths, (rows,) of bool; the others are angles."""
    return np.array([one for closure in closures for one in closure.translational], dtype=bool)


def _horner(coefficients: Sequence[float], x: Scalar) -> Scalar:
    total: Scalar = coefficients[-1] if coefficients else 0.0
    for c in reversed(coefficients[:-1]):
        total = total * x + c
    return total


def _derived(coefficients: Sequence[float]) -> tuple[float, ...]:
    return tuple(k * c for k, c in enumerate(coefficients) if k)
