"""A second checker of certificates: mpmath's intervals, own kinematics, no code shared.

It takes a description and a certificate, and says of each posture whether exactly one solution lies
in its box. For mechanisms of hinges, slides and floating bodies that are closed by ball joints,
with as many rows as unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import iv

from closedchain.urdf.description import Description, Joint, Origin

iv.dps = 17


@dataclass
class Slope:
    """An interval and its derivatives by the unknowns, those that are not zero."""

    value: Any
    by: dict[int, Any]

    def __add__(self, other: Any) -> Slope:
        b = slope(other)
        by = dict(self.by)
        for k, d in b.by.items():
            by[k] = by[k] + d if k in by else d
        return Slope(self.value + b.value, by)

    def __mul__(self, other: Any) -> Slope:
        b = slope(other)
        by = {k: d * b.value for k, d in self.by.items()}
        for k, d in b.by.items():
            more = d * self.value
            by[k] = by[k] + more if k in by else more
        return Slope(self.value * b.value, by)

    def __neg__(self) -> Slope:
        return self * -1

    def __sub__(self, other: Any) -> Slope:
        return self + -slope(other)

    __radd__, __rmul__ = __add__, __mul__

    def of(self, value: Any, rate: Any) -> Slope:
        return Slope(value, {k: d * rate for k, d in self.by.items()})


def slope(x: Any) -> Slope:
    return x if isinstance(x, Slope) else Slope(iv.mpf(x), {})


def cosine(x: Slope) -> Slope:
    return x.of(iv.cos(x.value), -iv.sin(x.value))


def sine(x: Slope) -> Slope:
    return x.of(iv.sin(x.value), iv.cos(x.value))


Matrix = list[list[Any]]


def times(a: Matrix, b: Matrix) -> Matrix:
    return [
        [sum((a[r][k] * b[k][c] for k in range(3)), slope(0)) for c in range(3)] for r in range(3)
    ]


def onto(a: Matrix, v: list[Any]) -> list[Any]:
    return [sum((a[r][k] * v[k] for k in range(3)), slope(0)) for r in range(3)]


def about(axis: tuple[float, ...], x: Slope) -> Matrix:
    """Rodrigues' formula, about an axis of any length."""
    size = iv.sqrt(sum(iv.mpf(a) ** 2 for a in axis))
    n = [slope(iv.mpf(a) / size) for a in axis]
    c, s = cosine(x), sine(x)
    cross = [[slope(0), -n[2], n[1]], [n[2], slope(0), -n[0]], [-n[1], n[0], slope(0)]]
    one = slope(1)
    return [
        [
            (one if r == k else slope(0)) * c + s * cross[r][k] + (one - c) * (n[r] * n[k])
            for k in range(3)
        ]
        for r in range(3)
    ]


def placed(origin: Origin) -> tuple[Matrix, list[Any]]:
    roll, pitch, yaw = (slope(a) for a in origin.rpy)
    turn = times(about((0, 0, 1), yaw), times(about((0, 1, 0), pitch), about((1, 0, 0), roll)))
    return turn, [slope(x) for x in origin.xyz]


def floating(numbers: list[float], step: list[Slope]) -> tuple[Matrix, list[Any]]:
    x, y, z, w = (slope(n) for n in numbers[3:])
    a, b, c = (s * 0.5 for s in step[3:])
    q = [
        x + a * w + b * z - c * y,
        y + b * w + c * x - a * z,
        z + c * w + a * y - b * x,
        w - a * x - b * y - c * z,
    ]
    size = sum((t * t for t in q), slope(0))
    scale = size.of(1 / size.value, -1 / size.value**2)  # only squares of q are used
    x, y, z, w = q
    square = [[p * r * scale for r in q] for p in q]
    two, one = 2, slope(1)
    turn = [
        [
            one - (square[1][1] + square[2][2]) * two,
            (square[0][1] - square[2][3]) * two,
            (square[0][2] + square[1][3]) * two,
        ],
        [
            (square[0][1] + square[2][3]) * two,
            one - (square[0][0] + square[2][2]) * two,
            (square[1][2] - square[0][3]) * two,
        ],
        [
            (square[0][2] - square[1][3]) * two,
            (square[1][2] + square[0][3]) * two,
            one - (square[0][0] + square[1][1]) * two,
        ],
    ]
    return turn, [slope(n) + s for n, s in zip(numbers[:3], step[:3], strict=True)]


def proves(description: Description, certificate: dict[str, Any], which: int, grow: float) -> bool:
    """Whether the box of a posture, ``grow`` times as large, holds exactly one solution."""
    found = certificate["postures"][which]
    radius, length = found["radius"] * grow, certificate["length"]
    joints = [j for j in description.joints if j.type != "fixed"]
    free = [j for j in joints if j.name not in certificate["pinned"]]
    first, count = {}, 0
    for j in free:
        first[j.name], count = count, count + (6 if j.type == "floating" else 1)

    def rows(half: float) -> list[Slope]:
        def unknown(k: int, unit: float) -> Slope:
            return Slope(iv.mpf([-half, half]) * unit, {k: iv.mpf(unit)})

        poses = {description.root: placed(Origin())}
        pending = list(description.joints)
        while pending:
            j = next(p for p in pending if p.parent in poses)
            pending.remove(j)
            poses[j.child] = _moved(j, poses[j.parent], found["joints"], first, unknown, length)
        out = []
        for closure in description.closures:
            ends = []
            for link, origin in (
                (closure.parent, closure.parent_origin),
                (closure.child, closure.child_origin),
            ):
                turn, place = poses[link]
                ends.append(
                    [a + b for a, b in zip(place, onto(turn, placed(origin)[1]), strict=True)]
                )
            out += [b - a for a, b in zip(*ends, strict=True)]
        return out

    at, wide = rows(0.0), rows(radius)
    if len(at) != count:
        raise ValueError(f"{len(at)} rows and {count} unknowns")
    middle = np.array([[float(iv.mpf(r.by.get(k, 0)).mid) for k in range(count)] for r in at])
    c = np.linalg.inv(middle)
    for i in range(count):
        reach = abs(sum((iv.mpf(c[i, r]) * at[r].value for r in range(count)), iv.mpf(0)))
        for k in range(count):
            entry = sum((iv.mpf(c[i, r]) * wide[r].by.get(k, 0) for r in range(count)), iv.mpf(0))
            reach = reach + abs(iv.mpf(int(i == k)) - entry) * radius
        if not reach.b < radius:
            return False
    return True


def _moved(
    j: Joint,
    parent: tuple[Matrix, list[Any]],
    numbers: dict[str, list[float]],
    first: dict[str, int],
    unknown: Any,
    length: float,
) -> tuple[Matrix, list[Any]]:
    """Pose of the child of a joint."""
    turn, shift = placed(j.origin)
    rotation, place = parent
    place = [a + b for a, b in zip(place, onto(rotation, shift), strict=True)]
    rotation = times(rotation, turn)
    if j.type == "fixed":
        return rotation, place
    if j.type == "floating":
        k = first[j.name]
        units = (length,) * 3 + (1.0,) * 3
        own, moved = floating(numbers[j.name], [unknown(k + i, u) for i, u in enumerate(units)])
        place = [a + b for a, b in zip(place, onto(rotation, moved), strict=True)]
        return times(rotation, own), place
    slides = j.type == "prismatic"
    value = slope(numbers[j.name][0])
    if j.name in first:
        value = value + unknown(first[j.name], length if slides else 1.0)
    if not slides:
        return times(rotation, about(j.axis, value)), place
    size = iv.sqrt(sum(iv.mpf(a) ** 2 for a in j.axis))
    along = onto(rotation, [slope(iv.mpf(a) / size) * value for a in j.axis])
    return rotation, [a + b for a, b in zip(place, along, strict=True)]
