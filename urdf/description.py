"""A mechanism as plain data: what a closed-chain URDF says, checked, without any kinematics.

SI units throughout: metres, radians. Origins follow URDF: translation, then fixed-axis
roll-pitch-yaw (R = Rz(yaw) Ry(pitch) Rx(roll)).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np

Vector3 = tuple[float, float, float]
ParameterValue = str | float | int | bool

JointType = Literal["revolute", "continuous", "prismatic", "floating", "fixed"]
JOINT_TYPES: tuple[JointType, ...] = ("revolute", "continuous", "prismatic", "floating", "fixed")

ClosureType = Literal[
    "fixed",
    "revolute",
    "prismatic",
    "cylindrical",
    "universal",
    "spherical",
    "planar",
    "point_on_line",
    "in_plane",
    "distance",
]
CLOSURE_TYPES: tuple[ClosureType, ...] = get_args(ClosureType)

RelationType = Literal["linear", "polynomial"]
RELATION_TYPES: tuple[RelationType, ...] = get_args(RelationType)

OUTPUTS: tuple[str, ...] = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Origin:
    """Pose of a child frame in its parent frame: ``xyz`` [m], ``rpy`` [rad]."""

    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Inertial:
    """Mass [kg] and inertia [kg m^2] about the centre of mass, in the axes of ``origin``."""

    origin: Origin
    mass: float
    ixx: float
    ixy: float
    ixz: float
    iyy: float
    iyz: float
    izz: float

    @property
    def principal_moments(self) -> tuple[float, float, float]:
        """Moments [kg m^2] about the principal axes, rising; zero where only rounding is below."""
        tensor = np.array(
            [
                [self.ixx, self.ixy, self.ixz],
                [self.ixy, self.iyy, self.iyz],
                [self.ixz, self.iyz, self.izz],
            ]
        )
        moments = np.linalg.eigvalsh(tensor)
        rounding = 1e-9 * abs(moments[2]) + 1e-15
        low, middle, high = (0.0 if -rounding <= x < 0.0 else float(x) for x in moments)
        return low, middle, high


@dataclass(frozen=True)
class Link:
    """A body, or a named point of a body when it hangs on a fixed joint.

    ``solid`` says that its inertia is no statement of the file: it is that of its shapes, by the
    densities of their materials.
    """

    name: str
    inertial: Inertial | None = None
    visuals: int = 0
    line: int | None = None
    solid: bool = False


@dataclass(frozen=True)
class Joint:
    """A joint of the spanning tree. ``axis`` is a unit vector in the joint frame.

    ``damping`` [N s/m or N m s/rad] and ``friction`` [N or N m] oppose its motion; ``armature``
    [kg or kg m^2] is the inertia of what turns with its rate and with nothing else.
    """

    name: str
    type: JointType
    parent: str
    child: str
    origin: Origin = Origin()
    axis: Vector3 = (1.0, 0.0, 0.0)
    lower: float = float("-inf")
    upper: float = float("inf")
    line: int | None = None
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0


@dataclass(frozen=True)
class Coupling:
    """URDF ``<mimic>``: value of ``joint`` = multiplier * value of ``leader`` + offset."""

    joint: str
    leader: str
    multiplier: float = 1.0
    offset: float = 0.0
    line: int | None = None


@dataclass(frozen=True)
class LoopClosure:
    """A cut joint: it leaves free between the two links what a joint of ``type`` leaves free.

    Axes are unit vectors in the frames of the two origins. ``sizes`` are the numbers [m] that a
    joint of this type has, by name: the length of a rod.
    """

    name: str
    type: ClosureType
    parent: str
    child: str
    parent_origin: Origin = Origin()
    child_origin: Origin = Origin()
    parent_axis: Vector3 = (0.0, 0.0, 1.0)
    child_axis: Vector3 = (0.0, 0.0, 1.0)
    sizes: tuple[tuple[str, float], ...] = ()
    line: int | None = None


@dataclass(frozen=True)
class JointRelation:
    """Joint values that depend on each other, each in its joint's own unit.

    * "linear": the values of ``joints`` times ``coefficients`` add up to ``offset``;
    * "polynomial": the first joint's value is the polynomial with ``coefficients``, from the
      constant one upwards, of the second one's.
    """

    name: str
    type: RelationType
    joints: tuple[str, ...]
    coefficients: tuple[float, ...]
    offset: float = 0.0
    line: int | None = None


@dataclass(frozen=True)
class Input:
    """An actuated joint; ``name`` is the paper's symbol.

    The motor turns ``reduction`` times as far as the joint moves [1, or rad/m for a slide], and
    its rotor has the inertia ``rotor_inertia`` [kg m^2].
    """

    name: str
    joint: str
    line: int | None = None
    reduction: float = 1.0
    rotor_inertia: float = 0.0


@dataclass(frozen=True)
class Task:
    """What the mechanism is for: motion of link ``tip`` against link ``base``.

    ``outputs`` are some of x y z (translation of the tip's origin) and rx ry rz (rotation).
    ``length`` [m] is the characteristic length that makes lengths dimensionless, if stated.
    """

    base: str
    tip: str
    outputs: tuple[str, ...]
    length: float | None = None
    line: int | None = None


@dataclass(frozen=True)
class Remark:
    """A sentence of the description that reports repeat: a published claim and its verdict."""

    about: str
    text: str
    source: str = ""


@dataclass(frozen=True)
class Description:
    """Everything that a closed-chain URDF says.

    Attributes
    ----------
    closures, relations : tuples
        The ``<constraint>`` elements: cut joints, and relations of joint values.
    couplings : tuple of Coupling
        The ``<mimic>`` elements.
    home : mapping joint name -> values
        The ``<group_state name="home">``: one value for a revolute or prismatic joint, seven
        (x y z qx qy qz qw) for a floating one. Joints not listed are at zero.
    states : mapping name -> (mapping joint name -> values)
        Every further ``<group_state>``, in document order. Joints not listed are as at home.
    notes : tuple of str
        What was read over (``<gazebo>`` and the like) or assumed, one sentence each.
    parameters : mapping
        xacro arguments and the values in force.
    text : str
        The expanded URDF, without xacro; line numbers in errors refer to it.
    source : str or None
        File or text that it was expanded from, to expand it again with other parameters; None
        where it was read from URDF text without parameters.
    folder : str or None
        Folder of the file, for meshes that are named relative to it.
    package_dirs : tuple of str
        Folders that hold the packages of ``package://`` meshes.
    printed : str
        The file as it is, where ``text`` says the same in other numbers; else empty.

    Examples
    --------
    >>> d = cc.load("linear_delta").description
    >>> d.root, len(d.links), len(d.closures), [given.name for given in d.inputs]
    ('base', 39, 5, ['q1', 'q2', 'q3'])
    """

    name: str
    root: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    closures: tuple[LoopClosure, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    relations: tuple[JointRelation, ...] = ()
    inputs: tuple[Input, ...] = ()
    task: Task | None = None
    home: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    states: Mapping[str, Mapping[str, tuple[float, ...]]] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()
    notes: tuple[str, ...] = ()
    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)
    text: str = field(default="", repr=False)
    source: str | None = field(default=None, repr=False, compare=False)
    folder: str | None = field(default=None, repr=False, compare=False)
    package_dirs: tuple[str, ...] = field(default=(), repr=False, compare=False)
    printed: str = field(default="", repr=False, compare=False)

    def __post_init__(self) -> None:
        """Write-protect the mappings."""
        object.__setattr__(self, "home", MappingProxyType(dict(self.home)))
        states = {name: MappingProxyType(dict(values)) for name, values in self.states.items()}
        object.__setattr__(self, "states", MappingProxyType(states))
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by value: a read-only mapping does not pickle by itself."""
        return (
            Description,
            (
                self.name,
                self.root,
                self.links,
                self.joints,
                self.closures,
                self.couplings,
                self.relations,
                self.inputs,
                self.task,
                dict(self.home),
                {name: dict(values) for name, values in self.states.items()},
                self.remarks,
                self.notes,
                dict(self.parameters),
                self.text,
                self.source,
                self.folder,
                self.package_dirs,
                self.printed,
            ),
        )
