"""The question whether loops are missing: files that lost theirs look like trees."""

from __future__ import annotations

from collections.abc import Sequence

from closedchain.urdf.description import Coupling, Joint, Link

_ANSWER = 'A loop is written as <constraint type="revolute"> or the like.'
_LISTED = 4


def are_loops_missing(
    links: Sequence[Link],
    joints: Sequence[Joint],
    couplings: Sequence[Coupling],
    closed: bool,
) -> list[str]:
    """Ask whether loops are missing, where nothing closes one but something suggests it.

    Mimic joints often stand for a loop, and a tree in which several branches end may have lost
    what joined them. A question, not a refusal: hands and humanoids are such trees.
    """
    if closed:
        return []
    if couplings:
        names = _listed([coupling.joint for coupling in couplings])
        return [
            f"no loop is closed, but joints follow others (<mimic>: {names}): do they stand for "
            f"loops that are missing? {_ANSWER}"
        ]
    ends = _ends(links, joints)
    if len(ends) < 2:
        return []
    return [
        f"no loop is closed, and {len(ends)} branches end freely ({_listed(ends)}): are loops "
        f"missing? {_ANSWER}"
    ]


def _ends(links: Sequence[Link], joints: Sequence[Joint]) -> list[str]:
    """Links at the end of moving branches, each with all that is fixed to it counted as one."""
    body = {link.name: link.name for link in links}

    def find(link: str) -> str:
        while body[link] != link:
            link = body[link]
        return link

    for joint in joints:
        if joint.type == "fixed":
            body[find(joint.child)] = find(joint.parent)
    moving = [joint for joint in joints if joint.type != "fixed"]
    inner = {find(joint.parent) for joint in moving}
    return [end for end in dict.fromkeys(find(j.child) for j in moving) if end not in inner]


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more
