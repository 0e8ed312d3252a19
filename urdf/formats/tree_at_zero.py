"""Where the links of a URDF are while all joint values are zero, straight from its elements.

Dialects that write only one side of a loop leave the other side to the zero posture.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from closedchain.urdf import elements
from closedchain.urdf.errors import known_names
from closedchain.urdf.poses import pose_of

if TYPE_CHECKING:
    from lxml.etree import _Element as Element


def parents_of(root: Element) -> dict[str, tuple[Element, str]]:
    """For each child link its joint's element and its parent link."""
    found = {}
    for joint in root:
        if isinstance(joint.tag, str) and etree.QName(joint).localname == "joint":
            parent, child = joint.find("{*}parent"), joint.find("{*}child")
            if parent is not None and child is not None:
                found[str(child.get("link"))] = joint, str(parent.get("link"))
    return found


def zero_pose(root: Element, link: str, asked: Element) -> np.ndarray:
    """Pose (4, 4) of a link in the root link while all joint values are zero.

    Raises
    ------
    DescriptionError
        At ``asked``, the element that needs it: a link that is not there, or in a cycle.
    """
    above = parents_of(root)
    names = [str(e.get("name")) for e in root if isinstance(e.tag, str) and e.tag.endswith("link")]
    if link not in names:
        raise elements.error(asked, known_names(link, "link", names))
    found = np.eye(4)
    seen = {link}
    while link in above:
        joint, link = above[link]
        found = pose_of(elements.origin(joint.find("{*}origin"))) @ found
        if link in seen:
            raise elements.error(asked, f"the link {link!r} hangs on itself")
        seen.add(link)
    return found


def path_up(root: Element, link: str) -> list[str]:
    """Links from a link up to the root of its tree, itself first."""
    above = parents_of(root)
    path = [link]
    while path[-1] in above and path.count(path[-1]) == 1:
        path.append(above[path[-1]][1])
    return path
