"""Mechanisms whose links have masses, and their free bodies. No tests here."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin

import closedchain as cc
from closedchain.closure.closures import Closure


def weighed(m: cc.Mechanism, seed: int = 0, lightest: float = 0.3) -> cc.Mechanism:
    """The same mechanism with random inertias of all links."""
    rng = np.random.default_rng(seed)

    def body(match: re.Match[str]) -> str:
        mass = rng.uniform(lightest, 2.0)
        half = rng.standard_normal((3, 3)) * 0.05
        i = mass * half @ half.T + 1e-3 * np.eye(3)
        i = np.trace(i) * np.eye(3) - i  # moments of a real body: no one above the others' sum
        moments = " ".join(
            f'i{a}{b}="{i["xyz".index(a), "xyz".index(b)]!r}"'.replace("np.float64(", "").replace(
                ")", ""
            )
            for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
        )
        x, y, z = (float(c) for c in 0.1 * rng.standard_normal(3))
        inertial = (
            f'<inertial><origin xyz="{x!r} {y!r} {z!r}"/><mass value="{mass!r}"/>'
            f"<inertia {moments}/></inertial>"
        )
        opening = f'<link name="{match[1]}">{inertial}'
        return f"{opening}</link>" if match[2] else opening

    text = re.sub(r'<link name="([^"]*)"\s*(/?)>', body, m.description.text)
    return cc.load_urdf(text, xacro=False)


def moved(m: cc.Mechanism, step: float = 0.02, seed: int = 1) -> np.ndarray:
    """A closed posture near home that is nothing special."""
    rng = np.random.default_rng(seed)
    inputs = m.input_values(m.home) + step * rng.standard_normal(len(m.inputs))
    return np.array(cc.direct(m, inputs).raise_if_failed().q)


def potential(m: cc.Mechanism, q: np.ndarray, fall: np.ndarray) -> float:
    """Potential energy [J] of all bodies."""
    children = {j.name: j.child for j in m.description.joints}
    names = list(m.model.names)[1:]
    return float(
        sum(
            -i.mass * fall @ m.pose(q, children[name]).act(np.array(i.lever))
            for name, i in zip(names, list(m.model.inertias)[1:], strict=True)
        )
    )


def unbalanced(
    m: cc.Mechanism,
    q: np.ndarray,
    joints: dict[str, np.ndarray],
    applied: dict[str, np.ndarray],
    fall: np.ndarray,
) -> float:
    """Largest force or moment about the world's origin that is left over on any body.

    All joints are cut, and the wrenches that they are said to carry put in their place. Frames
    are placed by ``m.pose``; nothing of the solver's matrices is used.
    """
    model = m.model
    left = np.zeros((model.njoints, 6))
    frames = {model.frames[i].name: i for i in range(len(model.frames))}
    children = {j.name: j.child for j in m.description.joints}

    def act(body: int, force: np.ndarray, moment: np.ndarray, at: np.ndarray) -> None:
        left[body] += np.concatenate([force, moment + np.cross(at, force)])

    def body_pose(body: int) -> pin.SE3:
        return m.pose(q, children[model.names[body]])

    for i in range(1, model.njoints):
        pose = body_pose(i)
        inertia = model.inertias[i]
        act(i, inertia.mass * fall, np.zeros(3), pose.act(np.array(inertia.lever)))
        if model.names[i] in joints:
            w = joints[model.names[i]]
            force, moment = pose.rotation @ w[:3], pose.rotation @ w[3:]
            act(i, force, moment, pose.translation)
            act(model.parents[i], -force, -moment, pose.translation)
    for name, w in applied.items():
        act(model.frames[frames[name]].parentJoint, w[:3], w[3:], m.pose(q, name).translation)
    for closure in m.closures:
        if not isinstance(closure, Closure):
            continue
        w = joints[closure.name]
        one, two = (
            (body_pose(j) * p if j else p)
            for j, p in (
                (closure.joint1, closure.placement1),
                (closure.joint2, closure.placement2),
            )
        )
        force, moment = one.rotation @ w[:3], one.rotation @ w[3:]
        act(closure.joint2, force, moment, two.translation)
        act(closure.joint1, -force, -moment, two.translation)
    return float(np.abs(left[1:]).max())
