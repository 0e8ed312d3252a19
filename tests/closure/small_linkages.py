"""Small linkages written as URDF, and their closed forms. No tests here."""

from __future__ import annotations

import math

import numpy as np
from conftest import assert_close

import closedchain as cc
from closedchain.urdf import ClosureType
from closedchain.urdf.constraint_element import SPELLINGS

# -- writing small mechanisms ---------------------------------------------------------------------


def joint(
    name: str, parent: str, child: str, xyz: str = "0 0 0", *, kind: str = "revolute",
    axis: str = "0 0 1", rpy: str = "0 0 0", more: str = "",
) -> str:  # fmt: skip
    limit = '<limit lower="-30" upper="30" effort="1" velocity="1"/>'
    body = "" if kind in ("fixed", "floating") else f'<axis xyz="{axis}"/>{limit}'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{body}{more}</joint>'
    )


def loop(
    kind: ClosureType, parent: str, at1: str, child: str, at2: str,
    axis1: str = "0 0 1", axis2: str = "0 0 1",
) -> str:  # fmt: skip
    spelling = SPELLINGS[kind]
    one = f'<parent_axis xyz="{axis1}"/>' if spelling.parent_axis else ""
    two = f'<child_axis xyz="{axis2}"/>' if spelling.child_axis != "none" else ""
    sizes = "".join(f' {size}="0.7"' for size in spelling.sizes)
    return (
        f'<constraint name="loop" type="{kind}"{sizes}>'
        f'<parent link="{parent}"/><parent_origin xyz="{at1}"/>{one}'
        f'<child link="{child}"/><child_origin xyz="{at2}"/>{two}</constraint>'
    )


def build(
    links: str, parts: list[str], home: dict[str, float], inputs: str = "", task: str = ""
) -> cc.Mechanism:
    bodies = "".join(f'<link name="{name}"/>' for name in links.split())
    drives = "".join(
        f'<transmission name="{n}"><joint name="{n}"/></transmission>' for n in inputs.split()
    )
    values = "".join(f'<joint name="{n}" value="{v!r}"/>' for n, v in home.items())
    text = (
        f'<robot name="small">{bodies}{"".join(parts)}{drives}{task}'
        f'<group_state name="home" group="all">{values}</group_state></robot>'
    )
    return cc.load_urdf(text, xacro=False)


def wedge_and_plunger() -> cc.Mechanism:
    """A wedge "a" that lifts a plunger by 4/3 of its way; the plunger stops at 0.5 both ways."""
    text = '<limit lower="-0.5" upper="0.5" effort="1" velocity="1"/>'
    parts = [
        joint("a", "base", "wedge", axis="1 0 0", kind="prismatic"),
        joint("b", "base", "plunger", axis="0 1 0", kind="prismatic").replace(
            '<limit lower="-30" upper="30" effort="1" velocity="1"/>', text
        ),
        loop("prismatic", "wedge", "0 0 0", "plunger", "0 0 0", "0.6 0.8 0", "0.6 0.8 0"),
    ]
    task = '<task base="base" tip="plunger" outputs="y"/>'
    return build("base wedge plunger", parts, {}, "a", task)


def apex(a: np.ndarray, b: np.ndarray, from_a: float, from_b: float, side: int) -> np.ndarray:
    """Intersection of two circles about ``a`` and ``b``; ``side`` 1 is left of the way a to b."""
    way = b - a
    distance = float(np.hypot(*way))
    along = (from_a**2 - from_b**2 + distance**2) / (2 * distance)
    across = math.sqrt(from_a**2 - along**2)
    return np.asarray(a + (along * way + side * across * np.array([-way[1], way[0]])) / distance)


def direction(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


def angle(vector: np.ndarray) -> float:
    return math.atan2(vector[1], vector[0])


def same_angles(actual: np.ndarray, expected: list[float], atol: float) -> None:
    """Angles agree up to whole turns."""
    off = (np.asarray(actual) - expected + np.pi) % (2 * np.pi) - np.pi
    assert_close(off, np.zeros(len(expected)), atol)


def four_bar_angles(bars: tuple[float, ...], crank: float, side: int = 1) -> list[float]:
    """Crank, rod against crank, rocker [rad]; apex left (1) or right (-1) of the diagonal."""
    a, b, c, d = bars
    tip, foot = a * direction(crank), np.array([d, 0.0])
    top = apex(tip, foot, b, c, side)
    return [crank, angle(top - tip) - crank, angle(top - foot)]


def four_bar(
    bars: tuple[float, ...], crank: float, kind: str = "revolute", axis2: str = "0 0 1",
    task: str = '<task base="base" tip="rod" outputs="rz"/>',
) -> cc.Mechanism:  # fmt: skip
    """Crank a, rod b, rocker c on the ground bar d; the loop is cut between rod and rocker."""
    a, b, c, d = bars
    parts = [
        joint("crank_joint", "base", "crank"),
        joint("rod_joint", "crank", "rod", f"{a} 0 0"),
        joint("rocker_joint", "base", "rocker", f"{d} 0 0"),
        loop(kind, "rod", f"{b} 0 0", "rocker", f"{c} 0 0", "0 0 1", axis2),
    ]
    names = ("crank_joint", "rod_joint", "rocker_joint")
    home = dict(zip(names, four_bar_angles(bars, crank), strict=True))
    return build("base crank rod rocker", parts, home, "crank_joint", task)


GRASHOF = (0.3, 1.0, 0.8, 1.0)
ROCKING = (1.0, 0.5, 0.7, 1.1)
"""Not Grashof: the crank swings between two toggles where rod and rocker are in line."""
PARALLELOGRAM = (0.5, 1.0, 0.5, 1.0)


def toggle(bars: tuple[float, ...]) -> float:
    """Crank angle at which rod and rocker are stretched out."""
    a, b, c, d = bars
    return math.acos((a * a + d * d - (b + c) ** 2) / (2 * a * d))
