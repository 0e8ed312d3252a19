"""Sets aside what belongs to other programs, so that the readers can be strict about the rest.

Plain URDF has a fixed vocabulary, and so have the elements of our own. Whatever else stands in a
URDF belongs to some other program: it is taken out and noted, never refused. Only what looks like
a slip of the pen is refused, because reading over an ``<orgin>`` would move a joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf._dynamics import MOTOR
from closedchain.urdf.elements import error
from closedchain.urdf.errors import DescriptionError, known_names

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_SHAPES = ("box", "cylinder", "capsule", "sphere", "mesh")
_TEXTS = ("remark", *MOTOR)
_OURS = ("constraint", "task", "group_state", "remark")
_WORDS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = MappingProxyType(
    {
        "robot": (("name", "version"), ("link", "joint", "transmission", "material", *_OURS)),
        "link": (("name", "type"), ("inertial", "visual", "collision")),
        "inertial": ((), ("origin", "mass", "inertia")),
        "origin": (("xyz", "rpy", "quat_xyzw"), ()),
        "mass": (("value",), ()),
        "inertia": (("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), ()),
        "visual": (("name", "group"), ("origin", "geometry", "material")),
        "collision": (("name", "group"), ("origin", "geometry", "material")),
        "geometry": ((), _SHAPES),
        "box": (("size",), ()),
        "cylinder": (("radius", "length"), ()),
        "capsule": (("radius", "length"), ()),
        "sphere": (("radius",), ()),
        "mesh": (("filename", "scale"), ()),
        "joint": (
            ("name", "type"),
            ("parent", "child", "origin", "axis", "limit", "mimic", "dynamics"),
        ),
        "parent": (("link",), ()),
        "child": (("link",), ()),
        "axis": (("xyz",), ()),
        "limit": (("lower", "upper", "effort", "velocity"), ()),
        "mimic": (("joint", "multiplier", "offset"), ()),
        "dynamics": (("damping", "friction", "armature"), ()),
        "transmission": (("name", "type"), ("joint", "actuator", *MOTOR)),
        "actuator": (("name",), MOTOR),
        # a joint that is not right under the root is a reference to a joint
        "transmission/joint": (("name",), ()),
    }
)
"""Attributes and children of the elements of plain URDF that say something here."""


def set_aside(root: Element) -> tuple[str, ...]:
    """Remove foreign elements and attributes from the tree; one note for each.

    Elements in the namespace of the root (``<robot xmlns=...>``) lose it.

    Raises
    ------
    DescriptionError
        Words that are one letter from a known one, xacro that was not expanded, processing
        instructions, text where only elements belong.
    """
    _refuse_instructions(root)
    home = etree.QName(root).namespace
    notes: list[str] = []
    removed: dict[tuple[str, str], list[str]] = {}
    waiting = [(root, "robot")]
    while waiting:
        element, context = waiting.pop()
        element.tag = etree.QName(element).localname
        _attributes(element, context, notes)
        if element.tag not in _TEXTS:
            _refuse_text(element, element.text)
        for child in list(element):
            _refuse_text(element, child.tail, child)
            name = etree.QName(child)
            local = name.localname
            if name.namespace not in (None, home):
                if "xacro" in name.namespace:
                    raise DescriptionError(
                        "xacro is left in the text; was the file not expanded?",
                        line=child.sourceline,
                        element=f"{child.prefix}:{local}" if child.prefix else local,
                        name=child.get("name"),
                    )
                _remove(child, f"{child.prefix}:{local}" if child.prefix else local, removed)
                continue
            known = _WORDS[context][1] if context in _WORDS else None
            if known is None or local in known:
                waiting.append((child, _context(context, local)))
                continue
            child.tag = local
            if local != "material":
                _refuse_slip(child, local, "element", known)
            _remove(child, local, removed)
    for places in removed.values():
        others = f" and {len(places) - 1} more of the kind were" if len(places) > 1 else " was"
        notes.append(f"{places[0]}{others} not read")
    return tuple(notes)


def _context(parent: str, tag: str) -> str:
    """Key of a child in the table of words; elements of our own are strict and have none."""
    if parent not in _WORDS or (parent == "robot" and tag in _OURS):
        return ""
    inner = f"{parent}/{tag}"
    return inner if inner in _WORDS else tag if tag in _WORDS else ""


def _refuse_instructions(root: Element) -> None:
    for node in (*root.itersiblings(preceding=True), *root.itersiblings(), *root.iter()):
        if not isinstance(node.tag, str):
            raise DescriptionError(
                f"processing instruction <?{getattr(node, 'target', '')}?> is not accepted (stock "
                "URDF parsers fail on it); remove it",
                line=node.sourceline,
            )


def _attributes(element: Element, context: str, notes: list[str]) -> None:
    known = _WORDS[context][0] if context in _WORDS else None
    for key in element.keys():  # noqa: SIM118 (an element iterates over its children)
        if key.startswith("{"):
            if "xacro" in key:
                raise error(element, "a xacro attribute is left; was the file not expanded?")
            notes.append(
                f"line {element.sourceline}: attribute {etree.QName(key).localname} of "
                f"<{element.tag}>, of another namespace, was not read"
            )
            del element.attrib[key]
        elif known is not None and key not in known:
            _refuse_slip(element, key, "attribute", known)
            notes.append(f"line {element.sourceline}: {key} of <{element.tag}> was not read")
            del element.attrib[key]


def _refuse_slip(element: Element, word: str, what: str, known: tuple[str, ...]) -> None:
    if any(one_slip(word, name) for name in known):
        message = known_names(word, what, known)
        if what == "element" and element.getparent() is not None:
            message = f"in <{element.getparent().tag}>, {message}"
        raise error(element, message)


def one_slip(word: str, meant: str) -> bool:
    """Whether two words differ by one letter more, less or other, or by two neighbours swapped.

    A digit is no slip: an ``axis2`` is another thing than an ``axis``.
    """
    if len(word) > len(meant) + 1 or len(word) < len(meant) - 1 or len(meant) < 3:
        return False
    start = 0
    while start < min(len(word), len(meant)) and word[start] == meant[start]:
        start += 1
    rest, wanted = word[start:], meant[start:]
    if rest[:1].isdigit():
        return False
    swapped = rest[1:2] + rest[:1] + rest[2:]
    return wanted in (rest[1:], swapped) or rest in (wanted, wanted[1:]) or rest[1:] == wanted[1:]


def _refuse_text(element: Element, text: str | None, after: Element | None = None) -> None:
    if text and text.strip():
        shown = " ".join(text.split())[:40]
        place = "" if after is None else f" (after <{etree.QName(after).localname}>)"
        line = None if after is None else after.sourceline
        raise error(element, f"text {shown!r}{place} where only elements are allowed", line)


def _remove(child: Element, tag: str, removed: dict[tuple[str, str], list[str]]) -> None:
    """Take a foreign element out and keep where it was."""
    parent = child.getparent()
    if tag == "type" and parent.tag == "transmission" and child.text:
        parent.set("type", child.text.strip())  # written as an attribute in older files
    name = parent.get("name")
    owner = parent.tag if name is None else f"{parent.tag} {name!r}"
    inside = "" if parent.getparent() is None else f" in <{owner}>"
    place = f"line {child.sourceline}: <{tag}>{inside}"
    removed.setdefault((tag, parent.tag), []).append(place)
    parent.remove(child)
