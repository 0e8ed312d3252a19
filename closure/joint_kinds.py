"""The table of joint kinds: what a joint writes as rows when cut, and what it leaves free.

A cut joint joins frame 1 (on the parent's joint) to frame 2 (on the child's joint); the z axis of
both is the joint's axis. Its rows are written once, as plain algebra over any kind of number, from
the gap: the origin p of frame 2 in frame 1, and the rotation R of frame 2 in frame 1 (three rows).
A row's *wrench* (f, m) is its derivative, d row = f . v2 + m . w, with v2 the velocity of frame 2's
origin against frame 1 and w the relative angular velocity, both along the axes of frame 1:
dp = v2, dR = [w] R. A wrench is exact at any gap, closed or not.

Lengths may be in metres or in units of the characteristic length: p, the sizes of the joint and
the rows that are lengths scale alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

from closedchain.closure.tape.vectors import Matrix, Scalar, Vector, column, cross, dot
from closedchain.urdf.description import ClosureType, JointType

X, Y, Z = 0, 1, 2
LENGTH = "length"

Sizes = Mapping[str, Scalar]
Wrench = tuple[list[Scalar], list[Scalar]]
Twist = tuple[list[float], list[float]]


class Row(Protocol):
    """One equation of a cut joint."""

    @property
    def is_length(self) -> bool:
        """Whether the row is a length; else an angle."""

    def value(self, p: Vector, r: Matrix, sizes: Sizes) -> Scalar:
        """Value of the row: zero when closed."""

    def wrench(self, p: Vector, r: Matrix, sizes: Sizes) -> Wrench:
        """Derivative (f, m) of the row."""


@dataclass(frozen=True)
class Slide:
    """a1 . (p2 - p1): component of the gap along axis ``a`` of frame 1."""

    a: int
    is_length = True

    def value(self, p: Vector, r: Matrix, sizes: Sizes) -> Scalar:
        """Return p_a."""
        return p[self.a]

    def wrench(self, p: Vector, r: Matrix, sizes: Sizes) -> Wrench:
        """Return a force along the axis."""
        return _axis(self.a), [0.0, 0.0, 0.0]


@dataclass(frozen=True)
class Dot:
    """a1 . b2: cosine between axis ``a`` of frame 1 and axis ``b`` of frame 2."""

    a: int
    b: int
    is_length = False

    def value(self, p: Vector, r: Matrix, sizes: Sizes) -> Scalar:
        """Return R_ab."""
        return r[self.a][self.b]

    def wrench(self, p: Vector, r: Matrix, sizes: Sizes) -> Wrench:
        """Return a moment along b2 x a1: d R_ab = a1 . (w x b2)."""
        return [0.0, 0.0, 0.0], _cross_axis(column(r, self.b), self.a)


@dataclass(frozen=True)
class Turn:
    """Component ``a`` of the Rodrigues vector 2 tan(angle / 2) n of the gap's rotation.

    It vanishes only without rotation, grows with the angle up to half a turn, where it is
    infinite, and is the rotation vector to first order.
    """

    a: int
    is_length = False

    def value(self, p: Vector, r: Matrix, sizes: Sizes) -> Scalar:
        """Return component a of 2 vee(R - R^T) / (1 + tr R)."""
        return rodrigues(r)[self.a]

    def wrench(self, p: Vector, r: Matrix, sizes: Sizes) -> Wrench:
        """Return the moment of dr = w + w x r / 2 + r (r . w) / 4."""
        vector = rodrigues(r)
        across = _cross_axis(vector, self.a)
        along = vector[self.a] * 0.25
        own = _axis(self.a)
        return [0.0, 0.0, 0.0], [own[k] + across[k] * 0.5 + vector[k] * along for k in range(3)]


@dataclass(frozen=True)
class Span:
    """(p . p - l^2) / (2 l): how much longer than l the origins are apart, to first order."""

    size: str = LENGTH
    is_length = True

    def value(self, p: Vector, r: Matrix, sizes: Sizes) -> Scalar:
        """Return (p . p - l^2) / (2 l)."""
        length = sizes[self.size]
        return (dot(p, p) - length * length) / (2.0 * length)

    def wrench(self, p: Vector, r: Matrix, sizes: Sizes) -> Wrench:
        """Return a force along the rod, of size one when closed."""
        length = sizes[self.size]
        return [p[k] / length for k in range(3)], [0.0, 0.0, 0.0]


@dataclass(frozen=True)
class Screw:
    """A motion that a joint leaves free: of frame 2 against frame 1, when closed.

    Attributes
    ----------
    pair : str
        "R" turns about an axis through frame 2's origin, "P" slides along an axis, "N" swings the
        rod from origin to origin about frame 1's origin, with an axis normal to the rod.
    axis : int
        Of x, y, z; for "N" which of two normals.
    frame : int
        Whose axis, 1 or 2.
    """

    pair: str
    axis: int
    frame: int = 1

    @property
    def is_length(self) -> bool:
        """Whether its rate is a length by time; else an angle by time."""
        return self.pair == "P"

    def twist(self, p: Vector, r: Matrix) -> Twist:
        """Twist (v2, w) for unit rate, at a gap of numbers."""
        still = [0.0, 0.0, 0.0]
        if self.pair == "N":
            normal = _normals(p)[self.axis]
            return cross(normal, p), normal
        along = column(r, self.axis) if self.frame == 2 else _axis(self.axis)
        return (still, along) if self.pair == "R" else (along, still)


@dataclass(frozen=True)
class JointKind:
    """A kind of joint: one entry of the table.

    Attributes
    ----------
    name : str
        Its spelling in ``<constraint type="...">``.
    symbol : str
        R, P, C and so on; the chain that stands for it where there is no letter.
    equations : tuple of Row
        Its rows when cut, lengths first.
    screws : tuple of Screw
        Motions that it leaves free when cut, from frame 1 to frame 2: six less its rows.
    parts : tuple of int
        How many of the screws, in order, belong to each part of the joint. The screws of a part
        stand still, or span the same motions always, in what comes before it.
    senses : tuple of int
        Axes that must be parallel when closed; the rows vanish as well where they are opposed.
    sizes : tuple of str
        Numbers [m] that a closure of this kind has.
    spellings : tuple of str
        Types of a URDF ``<joint>`` of this kind; none where it stands only between loops.
    nq, nv : int
        Numbers of its configuration and its velocity as a joint of the tree.
    """

    name: ClosureType | JointType
    symbol: str
    equations: tuple[Row, ...]
    screws: tuple[Screw, ...]
    parts: tuple[int, ...]
    senses: tuple[int, ...] = ()
    sizes: tuple[str, ...] = ()
    spellings: tuple[JointType, ...] = ()
    nq: int = 0
    nv: int = 0

    @property
    def rows(self) -> int:
        """Number of rows when cut."""
        return len(self.equations)

    @property
    def freedoms(self) -> int:
        """Freedoms that it leaves: six less its rows."""
        return 6 - self.rows

    @property
    def holds_point(self) -> bool:
        """Whether its first three rows hold frame 2's origin in frame 1's."""
        return self.equations[:3] == (Slide(X), Slide(Y), Slide(Z))

    @property
    def translational(self) -> tuple[bool, ...]:
        """Which rows are lengths; the others are angles."""
        return tuple(row.is_length for row in self.equations)

    def values(self, p: Vector, r: Matrix, sizes: Sizes) -> list[Scalar]:
        """Rows at a gap, over any kind of number: zero when closed.

        Parameters
        ----------
        p : three numbers
            Origin of frame 2 in frame 1.
        r : three rows of three numbers
            Rotation of frame 2 in frame 1.
        sizes : mapping
            The closure's own sizes, in the unit of p.
        """
        return [row.value(p, r, sizes) for row in self.equations]

    def wrenches(self, p: Vector, r: Matrix, sizes: Sizes) -> list[Wrench]:
        """Derivative (f, m) of each row: d row = f . v2 + m . w. Parameters as for ``values``."""
        return [row.wrench(p, r, sizes) for row in self.equations]

    @property
    def turns_freely(self) -> bool:
        """Whether frame 2 may turn about any axis: a ball."""
        return set(_BALL) <= set(self.screws)

    @property
    def ball_slides(self) -> bool:
        """Whether it is a ball on a line or a plane: the place of frame 1 there means nothing."""
        return self.turns_freely and any(screw.is_length for screw in self.screws)

    @property
    def is_rod(self) -> bool:
        """Whether a rod between the two origins stands for it, which is no body."""
        return any(screw.pair == "N" for screw in self.screws)

    def twists(self, p: Vector, r: Matrix) -> list[Twist]:
        """Twists (v2, w) of the free screws for unit rates, at a closed gap of numbers."""
        return [screw.twist(p, r) for screw in self.screws]


def rodrigues(r: Matrix) -> list[Scalar]:
    """Rodrigues vector 2 tan(angle / 2) n of a rotation."""
    share = 2.0 / (1.0 + r[0][0] + r[1][1] + r[2][2])
    return [
        (r[2][1] - r[1][2]) * share,
        (r[0][2] - r[2][0]) * share,
        (r[1][0] - r[0][1]) * share,
    ]


_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _axis(a: int) -> list[float]:
    return list(_AXES[a])


def _cross_axis(u: Vector, a: int) -> list[Scalar]:
    """Return u x e_a, without products by nothing."""
    b, c = (a + 1) % 3, (a + 2) % 3
    out: list[Scalar] = [0.0, 0.0, 0.0]
    out[b], out[c] = u[c], -u[b]
    return out


def _normals(p: Vector) -> tuple[list[float], list[float]]:
    """Two unit vectors that are normal to p and to each other, for numbers."""
    length = math.sqrt(dot(p, p))
    along = [x / length for x in p]
    first = cross(along, _axis(min(range(3), key=lambda k: abs(along[k]))))
    size = math.sqrt(dot(first, first))
    first = [x / size for x in first]
    return first, cross(along, first)


_POINT = (Slide(X), Slide(Y), Slide(Z))
_SAME_Z = (Dot(X, Z), Dot(Y, Z))
_BALL = (Screw("R", X), Screw("R", Y), Screw("R", Z))

_ENTRIES = (
    JointKind(
        name="fixed",
        symbol="fixed",
        equations=(*_POINT, Turn(X), Turn(Y), Turn(Z)),
        screws=(),
        parts=(),
        spellings=("fixed",),
    ),
    JointKind(
        name="revolute",
        symbol="R",
        equations=(*_POINT, *_SAME_Z),
        screws=(Screw("R", Z),),
        parts=(1,),
        senses=(Z,),
        spellings=("revolute", "continuous"),
        nq=1,
        nv=1,
    ),
    JointKind(
        name="prismatic",
        symbol="P",
        equations=(Slide(X), Slide(Y), *_SAME_Z, Dot(X, Y)),
        screws=(Screw("P", Z),),
        parts=(1,),
        senses=(X, Y, Z),
        spellings=("prismatic",),
        nq=1,
        nv=1,
    ),
    JointKind(
        name="cylindrical",
        symbol="C",
        equations=(Slide(X), Slide(Y), *_SAME_Z),
        screws=(Screw("R", Z), Screw("P", Z)),
        parts=(2,),
        senses=(Z,),
    ),
    JointKind(
        name="universal",
        symbol="U",
        equations=(*_POINT, Dot(Z, Z)),
        screws=(Screw("R", Z), Screw("R", Z, frame=2)),
        parts=(1, 1),
    ),
    JointKind(name="spherical", symbol="S", equations=_POINT, screws=_BALL, parts=(3,)),
    JointKind(
        name="planar",
        symbol="E",
        equations=(Slide(Z), *_SAME_Z),
        screws=(Screw("P", X), Screw("P", Y), Screw("R", Z)),
        parts=(2, 1),
        senses=(Z,),
    ),
    JointKind(  # a ball in a straight slot along z of frame 1
        name="point_on_line",
        symbol="PS",
        equations=(Slide(X), Slide(Y)),
        screws=(Screw("P", Z), *_BALL),
        parts=(1, 3),
    ),
    JointKind(  # a ball on a plane, xy of frame 1
        name="in_plane",
        symbol="PPS",
        equations=(Slide(Z),),
        screws=(Screw("P", X), Screw("P", Y), *_BALL),
        parts=(2, 3),
    ),
    JointKind(  # a rod with a ball at each end: neither its mass nor its own spin is there
        name="distance",
        symbol="SS",
        equations=(Span(),),
        screws=(Screw("N", 0), Screw("N", 1), *_BALL),
        parts=(2, 3),
        sizes=(LENGTH,),
    ),
)

JOINT_KINDS: Mapping[str, JointKind] = MappingProxyType({kind.name: kind for kind in _ENTRIES})
"""Kinds of joints by name: those that a loop can be cut at."""

BY_SYMBOL: Mapping[str, JointKind] = MappingProxyType({kind.symbol: kind for kind in _ENTRIES})
"""The same by symbol."""

FLOATING = JointKind(
    name="floating",
    symbol="floating",
    equations=(),
    screws=(Screw("P", X), Screw("P", Y), Screw("P", Z), *_BALL),
    parts=(3, 3),
    spellings=("floating",),
    nq=7,
    nv=6,
)
"""The joint of a body that only loops hold: a chart of its pose, and no kinematic pair."""

TREE_KINDS: Mapping[str, JointKind] = MappingProxyType(
    {spelling: kind for kind in (*_ENTRIES, FLOATING) for spelling in kind.spellings}
)
"""Kind of each type of URDF ``<joint>``."""
