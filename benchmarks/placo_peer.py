"""placo in a process of its own, with another Python where ``PLACO_PYTHON`` names one.

Its wheels need an older Pinocchio than this package does, so both do not fit one environment.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin

import closedchain as cc
from benchmarks.following import BLOCK, DIRECT, OPEN, Course
from benchmarks.mjcf import point_pairs
from benchmarks.timing import Row
from closedchain.urdf.description import Origin

TOOL = "placo"
CHAIN = (
    *((axis, "prismatic") for axis in "xyz"),
    *((f"r{axis}", "revolute") for axis in "xyz"),
)


def interpreter() -> str | None:
    """Python that has placo; None where there is none."""
    named = os.environ.get("PLACO_PYTHON")
    return named or (sys.executable if find_spec("placo") is not None else None)


def installed() -> str:
    """Version of placo, or "not installed"."""
    python = interpreter()
    if python is None:
        return "not installed"
    text = "from importlib.metadata import version; print(version('placo'))"
    found = subprocess.run([python, "-c", text], capture_output=True, text=True, check=False)
    return found.stdout.strip() or "not installed"


def follow_with_placo(m: cc.Mechanism, q: np.ndarray, course: Course) -> Row:
    """Row of a course from a posture (nq,)."""
    about = (course.robot, course.work, TOOL)
    python = interpreter()
    if python is None:
        return Row(*about, note="not installed")
    direct = course.work == DIRECT
    urdf, start, pairs = model(m, q)
    by_name = {spec.name: spec.joint for spec in m.description.inputs}
    problem = {
        "urdf": urdf,
        "start": start,
        "pairs": pairs,
        "inputs": [by_name[name] for name in m.inputs],
        "tip": m.required_task().tip,
        "outputs": list(m.outputs()),
        "direct": direct,
        "block": BLOCK,
        "targets": [(t if direct else t.homogeneous).tolist() for t in course.targets],
    }
    done = subprocess.run(
        [python, str(Path(__file__).with_name("placo_run.py"))],
        input=json.dumps(problem),
        capture_output=True,
        text=True,
        check=False,
        timeout=600.0,
    )
    if done.returncode:
        return Row(*about, note=(done.stderr.strip().splitlines() or ["it crashed"])[-1])
    found = json.loads(done.stdout.splitlines()[-1])
    error = float(np.linalg.norm(np.array(found["tip"]) - course.tips[-1]))
    if not max(found["residual"], error) < OPEN:
        return Row(*about, None, found["residual"], error, "not solved, and no error told")
    return Row(*about, found["seconds"], found["residual"], error, found["note"])


def model(m: cc.Mechanism, q: np.ndarray) -> tuple[str, dict[str, float], list[tuple[str, str]]]:
    """URDF of the tree, values of its joints at a posture (nq,), pairs of frames to be joined.

    A floating joint becomes three slides and three hinges from where it is.
    """
    robot = ET.Element("robot", name=m.description.name)
    links, start = {m.description.root}, {}
    for joint in m.description.joints:
        links.add(joint.child)
        place, below = _place(joint.origin), joint.parent
        at = m.model.joints[m.model.getJointId(joint.name)] if joint.type != "fixed" else None
        if joint.type == "floating":
            assert at is not None
            place = place * pin.XYZQUATToSE3(q[at.idx_q : at.idx_q + 7])
            for axis, kind in CHAIN[:-1]:
                link, direction = f"{joint.name}_{axis}", "xyz".index(axis[-1])
                links.add(link)
                _joint(robot, f"{joint.name}.{axis}", kind, (below, link), place, direction)
                place, below = pin.SE3.Identity(), link
            _joint(robot, f"{joint.name}.rz", "revolute", (below, joint.child), place, 2)
            continue
        if at is not None:
            start[joint.name] = float(q[at.idx_q])
        axis = None if at is None else joint.axis
        kind = "revolute" if joint.type == "continuous" else joint.type
        _joint(robot, joint.name, kind, (below, joint.child), place, axis)
    pairs = []
    for i, pair in enumerate(point_pairs(m.description, 0.1 * m.length)):
        names = (f"pair{i}a", f"pair{i}b")
        ends = ((pair.parent, pair.on_parent), (pair.child, pair.on_child))
        for name, (link, point) in zip(names, ends, strict=True):
            links.add(name)
            _joint(robot, f"{name}_at", "fixed", (link, name), pin.SE3(np.eye(3), point), None)
        pairs.append(names)
    for link in sorted(links):
        inertial = ET.SubElement(ET.SubElement(robot, "link", name=link), "inertial")
        ET.SubElement(inertial, "mass", value="1")
        sides = {side: "1" if side[1] == side[2] else "0" for side in ("ixx", "iyy", "izz")}
        ET.SubElement(inertial, "inertia", **sides, ixy="0", ixz="0", iyz="0")
    return ET.tostring(robot, encoding="unicode"), start, pairs


def _joint(
    robot: ET.Element,
    name: str,
    kind: str,
    ends: tuple[str, str],
    place: pin.SE3,
    axis: object,
) -> None:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=ends[0])
    ET.SubElement(joint, "child", link=ends[1])
    turn = pin.rpy.matrixToRpy(place.rotation)
    ET.SubElement(joint, "origin", xyz=_text(place.translation), rpy=_text(turn))
    if axis is not None:
        along = np.eye(3)[axis] if isinstance(axis, int) else axis
        ET.SubElement(joint, "axis", xyz=_text(along))
        ET.SubElement(joint, "limit", lower="-99", upper="99", effort="1", velocity="99")


def _place(origin: Origin) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*origin.rpy), np.array(origin.xyz))


def _text(values: object) -> str:
    return " ".join(repr(float(v)) for v in np.asarray(values))
