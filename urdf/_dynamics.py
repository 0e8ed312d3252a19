"""Readers of what only dynamics asks for: ``<dynamics>`` of joints, motors of transmissions."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from closedchain.urdf import elements
from closedchain.urdf.description import Input, Joint

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

MOTOR = ("mechanicalReduction", "rotorInertia")
"""Elements of a transmission, or of its actuator, that hold a number."""

_DYNAMICS = ("damping", "friction", "armature")


def read_dynamics(element: Element, one_freedom: bool, notes: list[str]) -> dict[str, float]:
    """Damping, friction and armature of a ``<joint>``; only joints of one freedom have them."""
    found = elements.only_child(element, "dynamics")
    if found is None:
        return {}
    elements.allow(found, _DYNAMICS)
    values = {name: elements.number(found, name, 0.0) for name in _DYNAMICS}
    for name, value in values.items():
        if value < 0.0:
            raise elements.error(found, f"{name}={value:g} must not be negative")
    if not one_freedom and any(values.values()):
        notes.append(
            f"line {found.sourceline}: <dynamics> in <joint {element.get('name')!r}> was not "
            "read: the joint has not one freedom"
        )
        return {}
    return values


def read_motor(element: Element) -> tuple[float, float]:
    """Reduction and rotor inertia of a ``<transmission>`` over one joint; 1 and 0 without."""
    reduction, rotor = (_value(element, tag) for tag in MOTOR)
    if reduction == 0.0:
        raise elements.error(element, "its mechanicalReduction is zero: the motor would not turn")
    if rotor is not None and rotor < 0.0:
        raise elements.error(element, f"its rotorInertia={rotor:g} must not be negative")
    return 1.0 if reduction is None else reduction, rotor or 0.0


def _value(element: Element, tag: str) -> float | None:
    found = [*element.findall(f"actuator/{tag}"), *element.findall(tag)]
    if not found:
        return None
    found[0].set(tag, " ".join((found[0].text or "").split()))
    return elements.number(found[0], tag)


def what_dynamics_read(joints: Iterable[Joint], inputs: Iterable[Input]) -> list[str]:
    """Note on what was read for dynamics alone; none where nothing was."""
    moved = [j for j in joints if j.damping or j.friction or j.armature]
    geared = [i for i in inputs if i.reduction != 1.0 or i.rotor_inertia]
    said = [f"<dynamics> of {_names([j.name for j in moved])}"] if moved else []
    said += [f"the motors of {_names([i.name for i in geared])}"] if geared else []
    at = [*(j.line for j in moved), *(i.line for i in geared)]
    lines = [line for line in at if line is not None]
    if not said:
        return []
    where = f"line {min(lines)}: " if lines else ""
    return [f"{where}{' and '.join(said)} count in forces and motions under them, and nowhere else"]


def _names(names: list[str]) -> str:
    shown = ", ".join(map(repr, names[:3]))
    return f"{shown} and {len(names) - 3} more" if len(names) > 4 else ", ".join(map(repr, names))
