"""How other programs write loops into a URDF: each dialect in turn, into ``<constraint>``.

URDF is a tree, so programs that need loops add elements of their own. None of them excludes
another, and stock parsers read over all of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from closedchain.urdf.formats import (
    closing_frames,
    drake,
    gazebo_joint,
    loop_joint,
    tree_joints,
    urdf_plus,
)

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_READERS = (
    drake.translate,
    tree_joints.translate,
    urdf_plus.translate,
    loop_joint.translate,
    gazebo_joint.translate,
    closing_frames.translate,
)


def translate_dialects(root: Element) -> tuple[str, ...]:
    """Replace loops of all dialects under the root by ``<constraint>`` elements.

    Returns one note for each thing that a dialect leaves open.

    Raises
    ------
    DescriptionError
        A loop that cannot be read: it is never dropped.
    """
    notes: list[str] = []
    for reader in _READERS:
        reader(root, notes)
    return tuple(notes)
