"""URDF text of small linkages: joints of the tree, cut joints, relations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import closedchain as cc
from closedchain.urdf import ClosureType, JointRelation, RelationType, constraint_xml
from closedchain.urdf.constraint_element import SPELLINGS

Z = "0 0 1"


@dataclass(frozen=True)
class J:
    """A joint of the tree."""

    name: str
    parent: str
    child: str
    xyz: str = "0 0 0"
    axis: str = Z
    type: str = "revolute"
    rpy: str = "0 0 0"
    mimic: str = ""

    def text(self) -> str:
        axis = "" if self.type in {"fixed", "floating"} else f'<axis xyz="{self.axis}"/>'
        limited = self.type in {"revolute", "prismatic"}
        limit = '<limit lower="-9" upper="9" effort="1" velocity="1"/>' if limited else ""
        mimic = f'<mimic joint="{self.mimic}" multiplier="-1" offset="3.1"/>' if self.mimic else ""
        return (
            f'<joint name="{self.name}" type="{self.type}"><parent link="{self.parent}"/>'
            f'<child link="{self.child}"/><origin xyz="{self.xyz}" rpy="{self.rpy}"/>'
            f"{axis}{limit}{mimic}</joint>"
        )


@dataclass(frozen=True)
class Cut:
    """A cut joint."""

    name: str
    parent: str
    child: str
    parent_xyz: str = "0 0 0"
    child_xyz: str = "0 0 0"
    type: ClosureType = "revolute"
    axis: str = Z
    child_axis: str = Z
    length: float | None = None

    def text(self) -> str:
        spelling = SPELLINGS[self.type]
        one = f'<parent_axis xyz="{self.axis}"/>' if spelling.parent_axis else ""
        two = f'<child_axis xyz="{self.child_axis}"/>' if spelling.child_axis != "none" else ""
        length = "" if self.length is None else f' length="{self.length!r}"'
        return (
            f'<constraint name="{self.name}" type="{self.type}"{length}>'
            f'<parent link="{self.parent}"/><parent_origin xyz="{self.parent_xyz}" rpy="0 0 0"/>'
            f'{one}<child link="{self.child}"/>'
            f'<child_origin xyz="{self.child_xyz}" rpy="0 0 0"/>{two}</constraint>'
        )


@dataclass(frozen=True)
class Tie:
    """A relation of joint values."""

    name: str
    type: RelationType
    joints: tuple[str, ...]
    coefficients: tuple[float, ...]
    offset: float = 0.0

    def text(self) -> str:
        return constraint_xml(
            JointRelation(self.name, self.type, self.joints, self.coefficients, self.offset)
        )


def urdf(
    name: str,
    joints: Iterable[J],
    cuts: Iterable[Cut | Tie] = (),
    *,
    inputs: Mapping[str, str] | None = None,
    home: Mapping[str, object] | None = None,
    tip: str = "",
    outputs: str = "x y z rx ry rz",
) -> str:
    joints, cuts = list(joints), list(cuts)
    links = dict.fromkeys(link for j in joints for link in (j.parent, j.child))
    parts = [f'<link name="{link}"/>' for link in links]
    parts += [part.text() for part in (*joints, *cuts)]
    parts += [
        f'<transmission name="{q}"><joint name="{j}"/></transmission>'
        for q, j in (inputs or {}).items()
    ]
    if tip:
        parts.append(f'<task base="base" tip="{tip}" outputs="{outputs}"/>')
    values = "".join(f'<joint name="{j}" value="{v}"/>' for j, v in (home or {}).items())
    parts.append(f'<group_state name="home" group="{name}">{values}</group_state>')
    return f'<robot name="{name}">' + "\n".join(parts) + "</robot>"


def load(*args: object, **kwargs: object) -> cc.Mechanism:
    return cc.load_urdf(urdf(*args, **kwargs), xacro=False)  # type: ignore[arg-type]
