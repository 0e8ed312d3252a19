"""Checks that need the whole description: names, the spanning tree, the ends of the closures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from closedchain.urdf.description import (
    Coupling,
    Description,
    Input,
    Joint,
    JointRelation,
    Link,
    LoopClosure,
)
from closedchain.urdf.errors import DescriptionError, known_names


class _Named(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def line(self) -> int | None: ...


def refuse_duplicates(things: Iterable[_Named], element: str) -> None:
    """Refuse two things of one kind with the same name."""
    first: dict[str, int | None] = {}
    for thing in things:
        if thing.name in first:
            raise DescriptionError(
                f"the name is used twice (first at line {first[thing.name]}); names of one kind "
                "must differ",
                line=thing.line,
                element=element,
                name=thing.name,
            )
        first[thing.name] = thing.line


def root_of(robot: str, line: int | None, links: Sequence[Link], joints: Sequence[Joint]) -> str:
    """Name of the only root of the tree; every link must hang on it.

    Raises
    ------
    DescriptionError
        Unknown links, a link with two parents, no root, several roots, links in a cycle.
    """
    if not links:
        raise DescriptionError("there is no <link>", line=line, element="robot", name=robot)
    names = [link.name for link in links]
    lines = {link.name: link.line for link in links}
    parents: dict[str, Joint] = {}
    for joint in joints:
        for side, wanted in (("parent", joint.parent), ("child", joint.child)):
            if wanted not in lines:
                message = f"{side}: {known_names(wanted, 'link', names)}"
                raise DescriptionError(message, line=joint.line, element="joint", name=joint.name)
        if joint.child in parents:
            raise DescriptionError(
                f"the link {joint.child!r} has two parents: it is the child of the joints "
                f"{parents[joint.child].name!r} and {joint.name!r}; cut one of the joints and "
                "write it as <constraint>",
                line=joint.line,
                element="joint",
                name=joint.name,
            )
        parents[joint.child] = joint
    roots = [name for name in names if name not in parents]
    if not roots:
        raise DescriptionError(
            "there is no root: every link is the child of some joint; cut a joint of the cycle "
            "and write it as <constraint>",
            line=line,
            element="robot",
            name=robot,
        )
    if len(roots) > 1:
        raise DescriptionError(
            f"there are {len(roots)} roots: {', '.join(roots)}; all links but one must be the "
            "child of a joint (a platform that only constraints hold hangs on a floating joint)",
            line=lines[roots[1]],
            element="link",
            name=roots[1],
        )
    _refuse_cycles(roots[0], names, lines, joints)
    return roots[0]


def _refuse_cycles(
    root: str, names: Sequence[str], lines: Mapping[str, int | None], joints: Sequence[Joint]
) -> None:
    children: dict[str, list[str]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint.child)
    reached: set[str] = set()
    waiting = [root]
    while waiting:
        link = waiting.pop()
        reached.add(link)
        waiting += children.get(link, [])
    lost = [name for name in names if name not in reached]
    if lost:
        raise DescriptionError(
            f"the links {', '.join(lost)} form a cycle apart from the root {root!r}; cut a joint "
            "of the cycle and write it as <constraint>",
            line=lines[lost[0]],
            element="link",
            name=lost[0],
        )


def check_closures(
    closures: Sequence[LoopClosure], links: Sequence[Link], joints: Sequence[Joint]
) -> None:
    """Refuse closures whose ends are unknown or cannot move against each other."""
    names = [link.name for link in links]
    body = dict(zip(names, names, strict=True))  # link -> a link of the same rigid body

    def find(link: str) -> str:
        while body[link] != link:
            body[link] = body[body[link]]
            link = body[link]
        return link

    for joint in joints:
        if joint.type == "fixed":
            body[find(joint.child)] = find(joint.parent)
    for closure in closures:
        for side, wanted in (("parent", closure.parent), ("child", closure.child)):
            if wanted not in body:
                raise _at(closure, f"{side}: {known_names(wanted, 'link', names)}")
        if closure.parent == closure.child:
            raise _at(closure, f"it connects the link {closure.child!r} with itself")
        if find(closure.parent) == find(closure.child):
            raise _at(
                closure,
                f"the links {closure.parent!r} and {closure.child!r} are rigidly connected: only "
                "fixed joints lie between them",
            )


def _at(closure: LoopClosure, message: str) -> DescriptionError:
    return DescriptionError(message, line=closure.line, element="constraint", name=closure.name)


def known_couplings(
    couplings: Sequence[Coupling],
    joints: Mapping[str, Joint],
    one_dof: Sequence[str],
    notes: list[str],
) -> tuple[Coupling, ...]:
    """Couplings whose leader is there; the others are noted, as stock parsers read over them.

    Raises
    ------
    DescriptionError
        Joints that follow each other in a circle.
    """
    kept: list[Coupling] = []
    for coupling in couplings:
        problem = ""
        if coupling.leader not in joints:
            problem = known_names(coupling.leader, "joint", joints, most=8)
        elif joints[coupling.leader].type not in one_dof:
            kind = joints[coupling.leader].type
            problem = (
                f"the leader {coupling.leader!r} is {kind}; a leader is one of: "
                f"{', '.join(one_dof)}"
            )
        if problem:
            notes.append(
                f"line {coupling.line}: <mimic> in <joint {coupling.joint!r}> was not read, so the "
                f"joint is free: {problem}"
            )
        else:
            kept.append(coupling)
    leaders = {coupling.joint: coupling.leader for coupling in kept}
    for coupling in kept:
        chain = [coupling.joint]
        while chain[-1] in leaders and chain.count(chain[-1]) == 1:
            chain.append(leaders[chain[-1]])
        if chain.count(chain[-1]) == 1:
            continue
        problem = f"joints follow each other in a circle: {' -> '.join(chain)}"
        if coupling.leader == coupling.joint:
            problem = "the joint follows itself"
        raise DescriptionError(
            f"<mimic>: {problem}", line=coupling.line, element="joint", name=coupling.joint
        )
    return tuple(kept)


def check_roles(description: Description, joints: Mapping[str, Joint]) -> None:
    """Refuse inputs, a task and postures of joints and links that do not exist.

    Raises
    ------
    DescriptionError
        Naming what is unknown, and what is known.
    """
    for item in description.inputs:
        problem = ""
        if item.joint not in joints:
            problem = known_names(item.joint, "joint", joints)
        elif joints[item.joint].type not in ("revolute", "continuous", "prismatic"):
            problem = f"the joint {item.joint!r} is {joints[item.joint].type} and has no one value"
        if problem:
            raise DescriptionError(problem, line=item.line, element="transmission", name=item.name)
    task, links = description.task, [link.name for link in description.links]
    if task is not None:
        for end in (task.base, task.tip):
            if end not in links:
                raise DescriptionError(known_names(end, "link", links), element="task")
        if task.base == task.tip:
            raise DescriptionError(f"base and tip are the same link {task.tip!r}", element="task")
    for name, state in (("home", description.home), *description.states.items()):
        for joint in state:
            if joint not in joints:
                message = known_names(joint, "joint", joints)
                raise DescriptionError(message, element="group_state", name=name)


def check_relations(
    relations: Sequence[JointRelation], joints: Mapping[str, Joint], one_dof: Sequence[str]
) -> None:
    """Refuse relations of joints that do not exist or have no single value."""
    for relation in relations:
        for name in relation.joints:
            problem = ""
            if name not in joints:
                problem = known_names(name, "joint", joints)
            elif joints[name].type not in one_dof:
                problem = (
                    f"the joint {name!r} is {joints[name].type}; a joint of a {relation.type} "
                    f"constraint is one of: {', '.join(one_dof)}"
                )
            if problem:
                raise DescriptionError(
                    problem, line=relation.line, element="constraint", name=relation.name
                )


def without_second_drives(inputs: Sequence[Input], notes: list[str]) -> tuple[Input, ...]:
    """Inputs, the first one of each joint; the others are noted."""
    first: dict[str, str] = {}
    kept: list[Input] = []
    for item in inputs:
        if item.joint in first:
            notes.append(
                f"line {item.line}: <transmission {item.name!r}> is not taken as an input: the "
                f"joint {item.joint!r} is already driven by the input {first[item.joint]!r}"
            )
        else:
            first[item.joint] = item.name
            kept.append(item)
    return tuple(kept)
