"""Sets aside what belongs to other programs, so that the readers can be strict about the rest.

What is set aside is noted. What other dialects use to say a loop is refused: a mechanism without
its loops would be another mechanism.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf._xml import error
from closedchain.urdf.errors import DescriptionError

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_GAZEBO = frozenset({"gazebo", "sensor", "self_collide", "self_collide_checking", "verbose"})
_FOREIGN: dict[str, frozenset[str]] = {
    "robot": _GAZEBO
    | {"material", "ros2_control", "mujoco", "compiler", "self_collision_checking"}
    | {"group", "end_effector", "virtual_joint", "passive_joint", "disable_collisions"},
    "link": _GAZEBO | {"contact", "self_filter", "collision_checking"},
    "collision": _GAZEBO,
    "joint": _GAZEBO | {"dynamics", "calibration", "safety_controller"},
    "transmission": frozenset(
        {"type", "actuator", "hardwareInterface", "mechanicalReduction", "motorTorqueConstant"}
    ),
}
_FOREIGN_ATTRIBUTES: dict[str, frozenset[str]] = {
    "joint": frozenset({"dont_collapse"}),
    "limit": frozenset({"command_effort", "current"}),
    "geometry": frozenset({"name"}),
}
_LOOPS = frozenset({"loop_joint", "loop", "coupling", "equality", "connect", "weld"})
_SAID_HERE = "closures are written as <constraint> here"


def set_aside(root: Element) -> tuple[str, ...]:
    """Remove foreign elements and attributes from the tree; one note for each.

    Elements in the namespace of the root (``<robot xmlns=...>``) lose it.

    Raises
    ------
    DescriptionError
        Loops in another dialect, xacro that was not expanded, processing instructions, text
        where only elements belong.
    """
    for node in (*root.itersiblings(preceding=True), *root.itersiblings(), *root.iter()):
        if not isinstance(node.tag, str):
            raise DescriptionError(
                f"processing instruction <?{getattr(node, 'target', '')}?> is not accepted (stock "
                "URDF parsers fail on it); remove it",
                line=node.sourceline,
            )
    home = etree.QName(root).namespace
    notes: list[str] = []
    waiting = [root]
    while waiting:
        element = waiting.pop()
        element.tag = etree.QName(element).localname
        _foreign_attributes(element, notes)
        if element.tag != "remark":
            _refuse_text(element, element.text)
        # a joint that is not right under the root is a reference to a joint; in a transmission
        # ROS puts its own elements into it, in a group_state nothing
        outer = "robot" if element is root else element.getparent().tag
        context = "" if element.tag == "joint" and outer != "robot" else element.tag
        for child in list(element):
            _refuse_text(element, child.tail, child)
            name = etree.QName(child)
            if name.namespace not in (None, home):
                _refuse_namespaced(child, name.namespace, name.localname)
                _note(child, f"{child.prefix}:{name.localname}", notes)
            elif context == "robot" and name.localname in _LOOPS:
                child.tag = name.localname
                raise error(child, f"a loop in another dialect; {_SAID_HERE}")
            elif name.localname in _FOREIGN.get(context, ()) or (
                element.tag == "joint" and outer == "transmission"
            ):
                _note(child, name.localname, notes)
            else:
                waiting.append(child)
    return tuple(notes)


def _foreign_attributes(element: Element, notes: list[str]) -> None:
    for key in element.keys():  # noqa: SIM118 (an element iterates over its children)
        if key.startswith("{"):
            if "xacro" in key:
                raise error(element, "a xacro attribute is left; was the file not expanded?")
            notes.append(
                f"line {element.sourceline}: attribute {etree.QName(key).localname} of "
                f"<{element.tag}>, of another namespace, was not read"
            )
            del element.attrib[key]
        elif key in _FOREIGN_ATTRIBUTES.get(element.tag, ()):
            notes.append(f"line {element.sourceline}: {key} of <{element.tag}> was not read")
            del element.attrib[key]


def _refuse_text(element: Element, text: str | None, after: Element | None = None) -> None:
    if text and text.strip():
        shown = " ".join(text.split())[:40]
        place = "" if after is None else f" (after <{etree.QName(after).localname}>)"
        line = None if after is None else after.sourceline
        raise error(element, f"text {shown!r}{place} where only elements are allowed", line)


def _refuse_namespaced(child: Element, namespace: str, local: str) -> None:
    tag = f"{child.prefix}:{local}" if child.prefix else local
    if "xacro" in namespace:
        why = "xacro is left in the text; was the file not expanded?"
    elif "constraint" in local or "bushing" in local or local in _LOOPS:
        why = f"a loop in another dialect; {_SAID_HERE}"
    else:
        return
    raise DescriptionError(why, line=child.sourceline, element=tag, name=child.get("name"))


def _note(child: Element, tag: str, notes: list[str]) -> None:
    """Note a foreign element and take it out."""
    parent = child.getparent()
    if not (tag == "material" and parent.getparent() is None):  # colours: nothing is lost
        inside = "" if parent.getparent() is None else f" in <{parent.tag} {parent.get('name')!r}>"
        notes.append(f"line {child.sourceline}: <{tag}>{inside} was not read")
    parent.remove(child)
