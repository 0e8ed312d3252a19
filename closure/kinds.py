"""The kinds of loop closure, and what each one writes as rows.

Every closure joins frame 1 (on the parent's joint) to frame 2 (on the child's joint); the z axis
of both is the axis of the cut joint. All rows but those of the fixed closure come from two
primitives, so that each row has an exact derivative at any residual:

* ``slide(a)``: a1 . (p2 - p1), component along axis a of frame 1 of the gap [m];
* ``dot(a, b)``: a1 . b2, cosine between axis a of frame 1 and axis b of frame 2 [rad].

The three rows slide(x), slide(y), slide(z) are the gap in frame 1: Pinocchio's point anchor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin

from closedchain.urdf.description import ClosureType

X, Y, Z = 0, 1, 2

SLIDES: dict[str, tuple[int, ...]] = {
    "spherical": (X, Y, Z),
    "revolute": (X, Y, Z),
    "universal": (X, Y, Z),
    "prismatic": (X, Y),
    "cylindrical": (X, Y),
    "planar": (Z,),
}
DOTS: dict[str, tuple[tuple[int, int], ...]] = {
    "spherical": (),
    "revolute": ((X, Z), (Y, Z)),
    "universal": ((Z, Z),),
    "prismatic": ((X, Z), (Y, Z), (X, Y)),
    "cylindrical": ((X, Z), (Y, Z)),
    "planar": ((X, Z), (Y, Z)),
}
# Axis pairs that the rows leave mirrored: a closed posture has them parallel, not opposed.
SAME_SENSE: dict[str, tuple[int, ...]] = {
    "revolute": (Z,),
    "cylindrical": (Z,),
    "planar": (Z,),
    "prismatic": (X, Y, Z),
}
FREEDOMS: dict[str, int] = {
    "fixed": 0,
    "revolute": 1,
    "prismatic": 1,
    "cylindrical": 2,
    "universal": 2,
    "spherical": 3,
    "planar": 3,
}


@dataclass(frozen=True, eq=False)
class Closure:
    """A cut joint of a given kind between two bodies of the spanning tree.

    Attributes
    ----------
    name : str
    kind : str
        The joint that was cut.
    joint1, joint2 : int
        Pinocchio joint ids that carry frame 1 and frame 2; 0 is the base.
    placement1, placement2 : pin.SE3
        Frame 1 in joint 1, frame 2 in joint 2; z is the axis of the cut joint.
    parent, child : str
        Names of the two links, for messages.
    """

    name: str
    kind: ClosureType
    joint1: int
    placement1: pin.SE3
    joint2: int
    placement2: pin.SE3
    parent: str
    child: str

    @property
    def rows(self) -> int:
        """Number of rows: six less the freedoms of the cut joint."""
        return 6 - FREEDOMS[self.kind]

    @property
    def translational(self) -> np.ndarray:
        """Which rows are lengths [m], shape (rows,) of bool; the others are angles [rad]."""
        slides = 3 if self.kind == "fixed" else len(SLIDES[self.kind])
        return np.arange(self.rows) < slides

    def describe(self) -> str:
        """Name, kind and the two links, for messages."""
        return f"{self.name!r} ({self.kind}, {self.parent} to {self.child})"


@dataclass(frozen=True, eq=False)
class Coupling:
    """A URDF mimic as a closure: value of ``follower`` - (ratio * leader + offset) = 0, one row.

    Pinocchio's own mimic joints get constraint Jacobians wrong; this row is exact.
    """

    name: str
    follower_q: int
    follower_v: int
    leader_q: int
    leader_v: int
    ratio: float
    offset: float
    length_row: bool
    follower: str
    leader: str
    kind: Literal["coupling"] = "coupling"

    @property
    def rows(self) -> int:
        """One row."""
        return 1

    @property
    def translational(self) -> np.ndarray:
        """Whether the row is a length, shape (1,) of bool."""
        return np.array([self.length_row])

    def describe(self) -> str:
        """Name, kind and the two joints, for messages."""
        return f"{self.name!r} (coupling of joint {self.follower} to {self.leader})"
