"""The numbers that a mechanism's geometry is written with, and how finely each is printed.

Exporters print a quarter turn as 1.5708. Such a number stands for one that is not known beyond its
last printed digit, and loops that close exactly in the drawing do not with what was printed.

The rule: a number printed with four decimals or more (a component of an axis: three) is *rounded*,
to a unit of its last digit; one with fifteen significant digits or more, or with fewer decimals, is
meant as it stands. An angle that is a printed multiple of 15 degrees is no further off than it is
from that multiple.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from lxml import etree

from closedchain.urdf.description import Description, Joint, LoopClosure, Origin, Vector3

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

Part = Literal["origin", "axis", "parent_origin", "parent_axis", "child_origin", "child_axis"]

FINE = 15
"""Significant digits of a number that is printed in full."""

COARSE, COARSE_AXIS = 4, 3
"""Decimals from which on a number, or a component of an axis, counts as rounded."""

UNITS = 10
"""Units of the last printed digit that make the default tolerance: roundings add up in a loop."""

_STEP = math.pi / 12.0  # 15 degrees
_ANGLE_DECIMALS = 3  # of a multiple of 15 degrees that is recognised
_COMMON = frozenset({"1.57", "3.14", "6.28"})
_WRITTEN = re.compile(r"[+-]?(\d*)\.?(\d*)(?:[eE]([+-]?\d+))?")


@dataclass(frozen=True)
class Number:
    """One number of the geometry.

    Attributes
    ----------
    owner : str
        Name of the joint or constraint.
    part : str
        Where in it: its origin or axis, or those of a constraint's parent or child.
    index : int
        0 to 2 are x y z, 3 to 5 (of an origin) roll pitch yaw.
    value : float
        [m], [rad], or a component of a unit vector.
    unit : float
        Unit of the last printed digit; 0 where the number is meant as it stands, or not printed.
    meant : float
        The multiple of 15 degrees that an angle is printed for, else the value itself.
    """

    owner: str
    part: Part
    index: int
    value: float
    unit: float = 0.0
    meant: float = 0.0

    @property
    def is_length(self) -> bool:
        """Whether it is in m; else an angle or a component of an axis."""
        return self.index < 3 and self.part.endswith("origin")

    @property
    def uncertainty(self) -> float:
        """How far what is meant may be from the value."""
        return abs(self.meant - self.value) if self.meant != self.value else self.unit


def numbers(description: Description) -> tuple[Number, ...]:
    """Every number of origins and axes, in document order, with its printed unit if there is one.

    Axes of joints without one, and origins that are not written, have none either.
    """
    printed = _printed(description.text)
    found: list[Number] = []
    for owner, part, values in _written(description):
        words = printed.get((owner, part), [""] * len(values))
        for index, value in enumerate(values):
            unit = last_digit(words[index], COARSE_AXIS if part.endswith("axis") else COARSE)
            meant = value
            if part.endswith("origin") and index >= 3:
                meant = _multiple(words[index], value)
            found.append(Number(owner, part, index, value, unit, meant))
    return tuple(found)


def last_digit(word: str, coarse: int = COARSE) -> float:
    """Unit of the last digit of a printed number; 0 where it is meant as it stands.

    ``coarse`` is the number of decimals from which on it counts as rounded.
    """
    match = _WRITTEN.fullmatch(word.strip())
    if not word or match is None:
        return 0.0
    whole, decimals, exponent = match.groups()
    after = len(decimals) - int(exponent or 0)
    significant = len((whole + decimals).lstrip("0"))
    if after < coarse or significant >= FINE or after >= FINE:
        return 0.0
    return float(10.0**-after)


def default_tolerance(description: Description, length: float) -> float:
    """Tolerance [m] of a file: ``UNITS`` times what its coarsest number may be off.

    Angles and axes count times the characteristic ``length`` [m]. 0 where nothing is rounded. Of a
    file in another format than URDF all numbers that come in threes or more count, as lengths.
    """
    if description.printed:
        return UNITS * max(map(last_digit, _vectors(description.printed)), default=0.0)
    off = (n.uncertainty * (1.0 if n.is_length else length) for n in numbers(description))
    return UNITS * max(off, default=0.0)


def _vectors(text: str) -> Iterator[str]:
    """The numbers of attributes and texts that hold three or more."""
    for between in re.findall(r"[\"'>]([^\"'<>]*)[\"'<]", text):
        words = between.split()
        if len(words) >= 3 and all(_WRITTEN.fullmatch(word) for word in words):
            yield from words


def with_numbers(
    description: Description, found: Sequence[Number], values: Iterable[float]
) -> Description:
    """The same description with other values of its numbers; axes are made unit vectors."""
    new: dict[tuple[str, Part], dict[int, float]] = {}
    for number, value in zip(found, values, strict=True):
        new.setdefault((number.owner, number.part), {})[number.index] = float(value)
    joints = tuple(_moved_joint(joint, new) for joint in description.joints)
    closures = tuple(_moved_closure(closure, new) for closure in description.closures)
    return replace(description, joints=joints, closures=closures)


def _moved_joint(joint: Joint, new: Mapping[tuple[str, Part], Mapping[int, float]]) -> Joint:
    return replace(
        joint,
        origin=_origin(joint.origin, new.get((joint.name, "origin"))),
        axis=_axis(joint.axis, new.get((joint.name, "axis"))),
    )


def _moved_closure(
    closure: LoopClosure, new: Mapping[tuple[str, Part], Mapping[int, float]]
) -> LoopClosure:
    name = closure.name
    return replace(
        closure,
        parent_origin=_origin(closure.parent_origin, new.get((name, "parent_origin"))),
        child_origin=_origin(closure.child_origin, new.get((name, "child_origin"))),
        parent_axis=_axis(closure.parent_axis, new.get((name, "parent_axis"))),
        child_axis=_axis(closure.child_axis, new.get((name, "child_axis"))),
    )


def _origin(origin: Origin, new: Mapping[int, float] | None) -> Origin:
    if not new:
        return origin
    values = [new.get(i, old) for i, old in enumerate((*origin.xyz, *origin.rpy))]
    return Origin((values[0], values[1], values[2]), (values[3], values[4], values[5]))


def _axis(axis: Vector3, new: Mapping[int, float] | None) -> Vector3:
    if not new:
        return axis
    x, y, z = (new.get(i, old) for i, old in enumerate(axis))
    if (x, y, z) == axis:
        return axis
    norm = math.hypot(x, y, z)
    return x / norm, y / norm, z / norm


def _written(description: Description) -> Iterator[tuple[str, Part, tuple[float, ...]]]:
    for joint in description.joints:
        yield joint.name, "origin", (*joint.origin.xyz, *joint.origin.rpy)
        if joint.type not in {"fixed", "floating"}:
            yield joint.name, "axis", joint.axis
    for closure in description.closures:
        for part, origin in (
            ("parent_origin", closure.parent_origin),
            ("child_origin", closure.child_origin),
        ):
            yield closure.name, part, (*origin.xyz, *origin.rpy)  # type: ignore[misc]
        yield closure.name, "parent_axis", closure.parent_axis
        yield closure.name, "child_axis", closure.child_axis


def _printed(text: str) -> dict[tuple[str, str], list[str]]:
    """The words of every origin (six) and axis (three) of an expanded URDF, by owner and part."""
    if not text.strip():
        return {}
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    root = etree.fromstring(text.encode("utf-8"), parser)
    found: dict[tuple[str, str], list[str]] = {}
    for element in root:
        if not isinstance(element.tag, str):
            continue
        if etree.QName(element).localname not in {"joint", "constraint"}:
            continue
        for child in element:
            if isinstance(child.tag, str):
                part = etree.QName(child).localname
                if part.endswith("origin"):
                    words = [*_words(child, "xyz"), *_words(child, "rpy")]
                    found[str(element.get("name")), part] = words
                elif part.endswith("axis"):
                    found[str(element.get("name")), part] = _words(child, "xyz")
    return found


def _words(element: Element, attribute: str) -> list[str]:
    words = (element.get(attribute) or "").split()
    return words if len(words) == 3 else ["", "", ""]


def _multiple(word: str, value: float) -> float:
    """The multiple of 15 degrees that a word is printed for, else the value."""
    match = _WRITTEN.fullmatch(word.strip())
    if not word or match is None:
        return value
    after = len(match[2]) - int(match[3] or 0)
    if after < _ANGLE_DECIMALS and word.lstrip("+-") not in _COMMON:
        return value
    near = round(value / _STEP) * _STEP
    return near if near and abs(value - near) <= 0.6 * 10.0**-after else value
