"""Checked access to XML elements: every refusal says line, element, name and what is accepted."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from lxml import etree

from closedchain.urdf._parameters import NUMBER
from closedchain.urdf._scan import scan
from closedchain.urdf.description import Origin, Vector3
from closedchain.urdf.errors import DescriptionError, known_names

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_HINTS = {"quat_xyzw": "; write the rotation as rpy (fixed-axis roll, pitch, yaw in radians)"}


_MARKS = (
    *(("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;")),
    *(("\n", "&#10;"), ("\r", "&#13;"), ("\t", "&#9;")),
)


def attribute(text: str) -> str:
    """Value of an attribute as it is written, quotes included."""
    # the function of xml.sax brings half of the standard library along
    for mark, name in _MARKS:
        text = text.replace(mark, name)
    return f'"{text}"'


def error(element: Element, message: str, line: int | None = None) -> DescriptionError:
    """Error at ``element``; named after the nearest enclosing element that has a name.

    ``<limit>`` has no name of its own, so an error in it is reported for its joint.
    ``line`` is given where the element's own line would mislead.
    """
    owner = element
    while not owner.get("name") and owner.getparent() is not None:
        if owner.getparent().getparent() is None:
            break  # an element right under the root speaks for itself
        owner = owner.getparent()
    prefix = "" if owner is element else f"<{element.tag}>: "
    return DescriptionError(
        prefix + message,
        line=line or element.sourceline,
        element=owner.tag,
        name=owner.get("name"),
    )


def allow(element: Element, attributes: Iterable[str], children: Iterable[str] = ()) -> None:
    """Refuse attributes and child elements of other names than these."""
    attributes, children = tuple(attributes), tuple(children)
    for key in element.keys():  # noqa: SIM118 (an element iterates over its children)
        if key not in attributes:
            hint = _HINTS.get(key, "")
            raise error(element, known_names(key, "attribute", attributes) + hint)
    for child in element:
        if child.tag not in children:
            unknown = known_names(child.tag, "element", children)
            raise error(child, f"in <{element.tag}>, {unknown}")


def only_child(element: Element, tag: str) -> Element | None:
    """The child of that tag, or None.

    Raises
    ------
    DescriptionError
        More than one.
    """
    found = element.findall(tag)
    if len(found) > 1:
        raise error(found[1], f"only one <{tag}> is allowed here")
    return found[0] if found else None


def required_child(element: Element, tag: str) -> Element:
    """The child of that tag; it must be there, once."""
    found = only_child(element, tag)
    if found is None:
        raise error(element, f"the element <{tag}> is missing")
    return found


def text(element: Element, attribute: str) -> str:
    """A required attribute that is not blank and has no blanks around it."""
    value = element.get(attribute)
    if value is None:
        raise error(element, f"the attribute {attribute} is missing")
    if not value.strip():
        raise error(element, f"the attribute {attribute} is empty")
    if value != value.strip():
        raise error(element, f"{attribute}={value!r} has blanks around it; remove them")
    return str(value)


LARGEST = 1e9
"""Largest size of a number [m, rad, kg, kg m^2]: squares and products of such numbers are finite,
and nothing that is built is larger."""

LARGEST_ANGLE = 1e6
"""Largest value of a hinge [rad]: beyond, the sine of a rounded number says little."""

SHORTEST = 1e-9
"""Least length [m] of what must have one: what is written in light years has other faults."""


def numbers(
    element: Element, attribute: str, counts: Iterable[int], largest: float = LARGEST
) -> tuple[float, ...]:
    """A required attribute that holds numbers, as many as one of ``counts`` says.

    Raises
    ------
    DescriptionError
        No number, another count of them, or one whose size is beyond ``largest``.
    """
    raw = element.get(attribute)
    if raw is None:
        raise error(element, f"the attribute {attribute} is missing")
    words = raw.split()
    values = []
    for word in words:
        if not NUMBER.fullmatch(word) or not math.isfinite(value := float(word)):
            raise error(element, f"{attribute}={raw!r}: {_why_no_number(word)}")
        if abs(value) > largest:
            shown = word if len(word) < 60 else word[:60] + "..."
            raise error(element, f"{attribute}={shown!r} is too large; numbers here are at most "
                                 f"{largest:g} in size (SI units)")  # fmt: skip
        values.append(value)
    counts = tuple(counts)
    if len(values) not in counts:
        wanted = " or ".join(map(str, counts))
        plural = "number" if counts == (1,) else "numbers"
        raise error(element, f"{attribute}={raw!r} has {len(values)} numbers; expected {wanted} "
                             f"{plural}, separated by blanks")  # fmt: skip
    return tuple(values)


def _why_no_number(word: str) -> str:
    shown = repr(word if len(word) < 60 else word[:60] + "...")
    if word.lower().lstrip("+-") in ("nan", "inf", "infinity") or NUMBER.fullmatch(word):
        return f"{shown} is not finite"
    if "$" in word:
        return f"{shown} is not a number; was the file not run through xacro?"
    if "," in word:
        return f"{shown} is not a number; write a decimal point, and blanks between numbers"
    return f"{shown} is not a number"


def number(
    element: Element, attribute: str, default: float | None = None, largest: float = LARGEST
) -> float:
    """A number, at most ``largest`` in size; required when there is no default."""
    if default is not None and element.get(attribute) is None:
        return default
    return numbers(element, attribute, (1,), largest)[0]


def positive(element: Element, attribute: str) -> float:
    """A required length [m], greater than zero."""
    value = number(element, attribute)
    if value <= 0.0:
        raise error(element, f"{attribute}={value:g} must be greater than zero")
    if value < SHORTEST:
        raise error(element, f"{attribute}={value:g} is too short; lengths are {SHORTEST:g} m or "
                             "more")  # fmt: skip
    return value


def vector(element: Element, attribute: str, default: Vector3 | None = None) -> Vector3:
    """Three finite numbers; required when there is no default."""
    if default is not None and element.get(attribute) is None:
        return default
    x, y, z = numbers(element, attribute, (3,))
    return x, y, z


def origin(element: Element | None) -> Origin:
    """Pose written as ``xyz`` [m] and ``rpy`` [rad]; identity where nothing is written."""
    if element is None:
        return Origin()
    allow(element, ("xyz", "rpy"))
    zero = (0.0, 0.0, 0.0)
    return Origin(vector(element, "xyz", zero), vector(element, "rpy", zero))


def unit_vector(element: Element, attribute: str = "xyz") -> Vector3:
    """Direction of length one.

    Raises
    ------
    DescriptionError
        A vector of zero length, or one too short to give a direction.
    """
    allow(element, (attribute,))
    x, y, z = vector(element, attribute)
    length = math.hypot(x, y, z)
    if length < 1e-12:
        raise error(element, f"{attribute}={element.get(attribute)!r} has zero length; an axis "
                             "needs a direction")  # fmt: skip
    if abs(length - 1.0) < 1e-15:  # dividing again would change the last digit of what we wrote
        return x, y, z
    return x / length, y / length, z / length


def written(values: Iterable[float]) -> str:
    """Numbers as an attribute that reads back to the same ones."""
    return " ".join(repr(float(value)) for value in values)


def origin_element(origin: Origin, tag: str = "origin") -> Element:
    """Element of an origin; what is zero is left out."""
    element = etree.Element(tag)
    for name, values in (("xyz", origin.xyz), ("rpy", origin.rpy)):
        if any(values):
            element.set(name, written(values))
    return element


def document(text: str) -> Element:
    """Parse a text without entities, network or DTD.

    Raises
    ------
    DescriptionError
        An empty text, one that is not well-formed or has a DOCTYPE.
    """
    if not text.strip():
        raise DescriptionError("the text is empty")
    scan(text)
    parser = etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,
    )
    try:
        return etree.fromstring(text.encode("utf-8"), parser)
    except etree.XMLSyntaxError as error:
        raise DescriptionError(f"not well-formed XML: {error.msg}", line=error.lineno) from None
