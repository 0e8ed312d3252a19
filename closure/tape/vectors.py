"""Vectors, rotations and poses over any kind of number: plain algebra, no loops over entries.

A vector is a list of three numbers, a rotation a list of three rows, a pose a pair (R, p).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Scalar = Any  # float, complex, Expr, interval, ring element: whatever has + - *
Vector = Sequence[Scalar]
Matrix = Sequence[Sequence[Scalar]]
Pose = tuple[Matrix, Vector]


def add(a: Vector, b: Vector) -> list[Scalar]:
    """Return a + b."""
    return [a[0] + b[0], a[1] + b[1], a[2] + b[2]]


def sub(a: Vector, b: Vector) -> list[Scalar]:
    """Return a - b."""
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def scale(s: Scalar, a: Vector) -> list[Scalar]:
    """Return s a."""
    return [s * a[0], s * a[1], s * a[2]]


def neg(a: Vector) -> list[Scalar]:
    """Return -a."""
    return [-a[0], -a[1], -a[2]]


def dot(a: Vector, b: Vector) -> Scalar:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> list[Scalar]:
    """Return a x b."""
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def column(r: Matrix, k: int) -> list[Scalar]:
    """Column k of a rotation: axis k of its frame."""
    return [r[0][k], r[1][k], r[2][k]]


def transposed(r: Matrix) -> list[list[Scalar]]:
    """Return R^T."""
    return [column(r, 0), column(r, 1), column(r, 2)]


def matvec(r: Matrix, a: Vector) -> list[Scalar]:
    """Return R a."""
    return [dot(r[0], a), dot(r[1], a), dot(r[2], a)]


def matmul(a: Matrix, b: Matrix) -> list[list[Scalar]]:
    """Return A B."""
    columns = transposed(b)
    return [[dot(row, c) for c in columns] for row in a]


def compose(a: Pose, b: Pose) -> Pose:
    """Pose b seen through pose a."""
    return matmul(a[0], b[0]), add(matvec(a[0], b[1]), a[1])


def rotation(quaternion: Sequence[Scalar]) -> list[list[Scalar]]:
    """Rotation of a unit quaternion x y z w."""
    x, y, z, w = quaternion
    x2, y2, z2 = x + x, y + y, z + z
    return [
        [1.0 - (y * y2 + z * z2), x * y2 - w * z2, x * z2 + w * y2],
        [x * y2 + w * z2, 1.0 - (x * x2 + z * z2), y * z2 - w * x2],
        [x * z2 - w * y2, y * z2 + w * x2, 1.0 - (x * x2 + y * y2)],
    ]


def turned_quaternion(q: Sequence[Scalar], by: Sequence[Scalar]) -> list[Scalar]:
    """Quaternion x y z w turned by a small rotation vector along the axes outside.

    Times (r/2, 1), as Cayley's map has it: longer than q, and not normalised.
    """
    x, y, z, w = q
    a, b, c = (0.5 * r for r in by)
    return [
        x + a * w + b * z - c * y,
        y + b * w + c * x - a * z,
        z + c * w + a * y - b * x,
        w - a * x - b * y - c * z,
    ]


def quaternion(r: Matrix) -> list[Scalar]:
    """Unit quaternion x y z w of a rotation, over numbers with ``select`` and ``sqrt``.

    Of four formulas that which divides by the largest number [Shepperd 1978].
    """
    (a, b, c), (d, e, f), (g, h, k) = r
    sizes = [1.0 + a - e - k, 1.0 + e - a - k, 1.0 + k - a - e, 1.0 + a + e + k]
    x, y, z, w = h - f, c - g, d - b, sizes[3]
    found = [x, y, z, w]
    largest = sizes[3]
    choices = (
        [sizes[0], b + d, c + g, x],
        [b + d, sizes[1], f + h, y],
        [c + g, f + h, sizes[2], z],
    )
    for size, choice in zip(sizes, choices, strict=False):
        larger = size > largest
        largest = larger.select(size, largest)
        found = [larger.select(new, old) for new, old in zip(choice, found, strict=True)]
    inverse = (2.0 * largest.sqrt()).recip()
    return [inverse * n for n in found]
