"""Hinges in a row that are one pair: universal joints and balls, written joint by joint.

URDF has hinges only, so a universal joint is two of them about a link without anything on it, and a
ball three.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from closedchain.closure.joint_kinds import TREE_KINDS
from closedchain.closure.tree import se3
from closedchain.urdf.description import Description, Joint

_HINGES = ("revolute", "continuous")
SYMBOLS: Mapping[int, str] = {2: "U", 3: "S"}
"""Pairs that hinges in a row make, by their number."""


def pairs_of_tree(description: Description) -> tuple[tuple[Joint, ...], ...]:
    """Joints of the tree that move, each with those that make one pair with it, in order.

    Two or three hinges through one point are a pair where the links between them have no other
    joints and closures, and each axis meets the next at a right angle. Two joints that are both
    inputs are two pairs, and so are three of which any is one: one drive moves a body there.
    """
    driven = {spec.joint for spec in description.inputs}
    by_parent: dict[str, list[Joint]] = {}
    for joint in description.joints:
        by_parent.setdefault(joint.parent, []).append(joint)
    used = {c.parent for c in description.closures} | {c.child for c in description.closures}
    taken: set[str] = set()
    found = []
    for joint in _down_the_tree(description):
        if joint.type in {"fixed", "floating"} or joint.name in taken:
            continue
        row = [joint]
        while len(row) < max(SYMBOLS):
            after = by_parent.get(row[-1].child, [])
            if row[-1].child in used or len(after) != 1 or not _crossed(row[-1], after[0]):
                break
            row.append(after[0])
        if len(row) == 3 and driven & {one.name for one in row}:
            row = row[:1] if row[0].name in driven else row[:2]
        if len(row) == 2 and driven >= {one.name for one in row}:
            row = row[:1]
        taken |= {one.name for one in row}
        found.append(tuple(row))
    order = {joint.name: i for i, joint in enumerate(description.joints)}
    return tuple(sorted(found, key=lambda row: order[row[-1].name]))


def symbol_of(row: tuple[Joint, ...]) -> str:
    """Letter of the pair that joints in a row make."""
    return SYMBOLS.get(len(row), TREE_KINDS[row[0].type].symbol)


def _down_the_tree(description: Description) -> list[Joint]:
    """All joints, each after the one above it."""
    waiting, found = list(description.joints), []
    reached = {description.root}
    while waiting:
        now = [joint for joint in waiting if joint.parent in reached]
        found += now
        reached |= {joint.child for joint in now}
        names = {joint.name for joint in now}
        waiting = [joint for joint in waiting if joint.name not in names]
    return found


def _crossed(first: Joint, second: Joint) -> bool:
    """Whether two hinges meet at a right angle."""
    if first.type not in _HINGES or second.type not in _HINGES:
        return False
    axis = se3(second.origin).rotation @ np.array(second.axis)
    return bool(
        np.allclose(second.origin.xyz, 0.0, atol=1e-12) and abs(axis @ np.array(first.axis)) < 1e-9
    )
