"""Robots that are timed beside those of the catalogue, written as URDF text."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

import closedchain as cc

LIMIT = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
ELBOWS = tuple((a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1))
"""Working modes of the planar 3-RRR: on which side each elbow is."""


def three_rps() -> cc.Mechanism:
    """Spatial 3-RPS: hinge, driven slide and ball of three legs; two balls are cut."""
    wide, narrow, height = 0.2, 0.1, 0.45
    lean, size = math.atan2(narrow - wide, height), math.hypot(wide - narrow, height)
    joints, home = [], {}
    for i in range(3):
        angle = 2.0 * math.pi * i / 3.0
        foot = f"{wide * math.cos(angle)!r} {wide * math.sin(angle)!r} 0"
        joints += [
            _joint(f"r{i}", "base", f"lower{i}", foot, "0 1 0", rpy=f"0 0 {angle!r}"),
            _joint(f"p{i}", f"lower{i}", f"upper{i}", axis="0 0 1", kind="prismatic"),
        ]
        home |= {f"r{i}": lean, f"p{i}": size}
    joints += [
        _joint("sy", "upper0", "ball1", axis="0 1 0"),
        _joint("sz", "ball1", "ball2", axis="0 0 1"),
        _joint("sx", "ball2", "platform", axis="1 0 0"),
        _joint("centre", "platform", "P", f"{-narrow!r} 0 0", kind="fixed"),
    ]
    home["sy"] = -lean
    corners = [2.0 * math.pi * i / 3.0 for i in (1, 2)]
    cuts = [
        _ball(i, f"upper{i}", "P", (narrow * math.cos(angle), narrow * math.sin(angle), 0.0))
        for i, angle in enumerate(corners, 1)
    ]
    inputs = {f"q{i + 1}": f"p{i}" for i in range(3)}
    return _load("three_rps", [*joints, *cuts], inputs, home, "P", "z rx ry")


def three_rrr() -> tuple[cc.Mechanism, dict[tuple[int, ...], np.ndarray]]:
    """Planar 3-RRR with its platform level, and a posture (nq,) of each of its working modes."""
    feet, arm = ((0.0, 0.0), (0.6, 0.0), (0.3, 0.52)), 0.2
    corners = [(0.4 * (x - 0.3), 0.4 * (y - 0.17)) for x, y in feet]
    middle = np.array([0.3, 0.17])
    joints = [_joint("pose", "base", "platform", kind="floating")]
    cuts = []
    for i, (foot, corner) in enumerate(zip(feet, corners, strict=True), 1):
        joints += [
            _joint(f"a{i}", "base", f"arm{i}", f"{foot[0]} {foot[1]} 0", "0 0 1"),
            _joint(f"b{i}", f"arm{i}", f"rod{i}", f"{arm} 0 0", "0 0 1"),
        ]
        cuts.append(
            f'<constraint name="c{i}" type="revolute"><parent link="rod{i}"/>'
            f'<parent_origin xyz="{arm} 0 0"/><parent_axis xyz="0 0 1"/><child link="platform"/>'
            f'<child_origin xyz="{corner[0]!r} {corner[1]!r} 0"/><child_axis xyz="0 0 1"/>'
            "</constraint>"
        )

    def angles(sides: tuple[int, ...]) -> dict[str, float]:
        found = {}
        for i, (foot, corner, side) in enumerate(zip(feet, corners, sides, strict=True), 1):
            x, y = middle + corner - foot
            bend = side * math.acos((x * x + y * y) / (2.0 * arm * arm) - 1.0)
            found |= {f"a{i}": math.atan2(y, x) - 0.5 * bend, f"b{i}": bend}
        return found

    home = {"pose": f"{middle[0]} {middle[1]} 0 0 0 0 1", **angles(ELBOWS[0])}
    inputs = {f"q{i}": f"a{i}" for i in (1, 2, 3)}
    m = _load("three_rrr", [*joints, *cuts], inputs, home, "platform", "x y rz")
    postures = {}
    for sides in ELBOWS:
        q = np.array(m.home)
        for name, value in angles(sides).items():
            q[m.model.idx_qs[m.model.getJointId(name)]] = value
        postures[sides] = q
    return m, postures


def stacked(count: int) -> cc.Mechanism:
    """``count`` Gough-Stewart platforms on top of each other, each on six driven legs.

    A leg is a universal joint, a slide and a ball, which is cut. Platforms float; the pose of each
    is counted from the one below.
    """
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.15), np.array([0.03, -0.02, 0.5]))
    numbers = " ".join(repr(x) for x in pin.SE3ToXYZQUAT(pose).tolist())
    feet, tops = _hexagon(0.3, 0.2), _hexagon(0.2, 0.9)
    joints, cuts, home, inputs = [], [], {}, {}
    below = "base"
    for k in range(count):
        above = f"platform{k}"
        joints.append(_joint(f"pose{k}", below, above, kind="floating"))
        home[f"pose{k}"] = numbers
        for i, (foot, top) in enumerate(zip(feet, tops, strict=True)):
            leg, n = pose.act(top) - foot, f"{k}_{i}"
            size = float(np.linalg.norm(leg))
            x, y, z = leg / size
            at = " ".join(repr(v) for v in foot.tolist())
            joints += [
                _joint(f"u{n}", below, f"cross{n}", at, "1 0 0"),
                _joint(f"w{n}", f"cross{n}", f"lower{n}", axis="0 1 0"),
                _joint(f"p{n}", f"lower{n}", f"upper{n}", axis="0 0 1", kind="prismatic"),
            ]
            cuts.append(_ball(n, f"upper{n}", above, top))
            home |= {f"u{n}": math.atan2(-y, z), f"w{n}": math.asin(x), f"p{n}": size}
            inputs[f"q{n}"] = f"p{n}"
        below = above
    return _load(f"stacked{count}", [*joints, *cuts], inputs, home, below, "x y z rx ry rz")


def _hexagon(radius: float, half: float) -> list[np.ndarray]:
    """Three pairs of points on a circle, ``half`` to either side of 0, 120 and 240 degrees."""
    angles = [k * 2.0 * math.pi / 3.0 + s * half for k in range(3) for s in (-1.0, 1.0)]
    return [radius * np.array([math.cos(t), math.sin(t), 0.0]) for t in angles]


def _joint(
    name: str,
    parent: str,
    child: str,
    xyz: str = "0 0 0",
    axis: str = "",
    *,
    kind: str = "revolute",
    rpy: str = "0 0 0",
) -> str:
    """One joint of the tree."""
    along = f'<axis xyz="{axis}"/>{LIMIT}' if axis else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{along}</joint>'
    )


def _ball(name: object, parent: str, child: str, point: object) -> str:
    """Cut ball between the origin of a link and a point of another."""
    at = " ".join(repr(float(x)) for x in np.asarray(point))
    return (
        f'<constraint name="s{name}" type="spherical"><parent link="{parent}"/>'
        f'<parent_origin xyz="0 0 0"/><child link="{child}"/><child_origin xyz="{at}"/>'
        "</constraint>"
    )


def _load(
    name: str,
    parts: list[str],
    inputs: dict[str, str],
    home: dict[str, object],
    tip: str,
    outputs: str,
) -> cc.Mechanism:
    drives = [
        f'<transmission name="{q}"><joint name="{joint}"/></transmission>'
        for q, joint in inputs.items()
    ]
    values = "".join(f'<joint name="{j}" value="{v}"/>' for j, v in home.items())
    text = "\n".join(
        [
            f'<robot name="{name}">',
            *(f'<link name="{link}"/>' for link in _links(parts)),
            *parts,
            *drives,
            f'<task base="base" tip="{tip}" outputs="{outputs}"/>',
            f'<group_state name="home" group="{name}">{values}</group_state>',
            "</robot>",
        ]
    )
    return cc.load_urdf(text, xacro=False)


def _links(parts: list[str]) -> Iterator[str]:
    """Links of the joints, the root first."""
    yield "base"
    for part in parts:
        if part.startswith("<joint"):
            yield part.split('<child link="')[1].split('"')[0]
