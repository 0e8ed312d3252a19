"""The same mechanism written down another way: other joints cut, other order, turned, renamed.

Only links, joints and where they stand are kept. A spanning forest of the joints that may stay in
the tree is drawn at random; every other joint is cut, and a body that no joint of the tree reaches
floats. Joint values are those of the original, less the value at home for a turning joint, whatever
way round a joint is passed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

import closedchain as cc
from closedchain.closure.closures import Coupling
from closedchain.closure.loading import mechanism_from_description
from closedchain.urdf import description as written

ROOT = 0
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Pair:
    """A joint between two bodies, with the places of its two sides and its axis in the world."""

    name: str
    kind: str
    bodies: tuple[int, int]
    places: tuple[np.ndarray, np.ndarray]
    axes: tuple[np.ndarray, np.ndarray]
    value: float = 0.0
    sizes: tuple[tuple[str, float], ...] = ()
    in_tree: bool = False


@dataclass(frozen=True)
class Recut:
    """A mechanism written anew, and the way from postures of the original."""

    old: cc.Mechanism
    new: cc.Mechanism
    turn: pin.SE3
    links: dict[int, str]
    offsets: dict[int, pin.SE3] = field(default_factory=dict)

    def posture(self, q: np.ndarray) -> np.ndarray:
        """Posture of the new mechanism in which all bodies stand as in one of the old."""
        data = self.old.model.createData()
        pin.forwardKinematics(self.old.model, data, q)
        poses = {
            link: self.turn * data.oMi[body] * self.offsets[body]
            for body, link in self.links.items()
        }
        out = pin.neutral(self.new.model)
        for joint in self.new.description.joints:
            if joint.type == "fixed":
                continue
            model = self.new.model.joints[self.new.model.getJointId(joint.name)]
            gap = poses[joint.parent].inverse() * poses[joint.child]
            if joint.type == "floating":
                out[model.idx_q : model.idx_q + 7] = pin.SE3ToXYZQUAT(gap)
            elif joint.type == "prismatic":
                out[model.idx_q] = (gap.translation - joint.origin.xyz) @ joint.axis
            else:
                out[model.idx_q] = pin.log3(gap.rotation) @ joint.axis
        return np.asarray(out)


def recut(
    m: cc.Mechanism,
    cut: Collection[str] = (),
    seed: int = 0,
    *,
    turn: pin.SE3 | None = None,
    prefix: str = "",
) -> Recut:
    """Write a mechanism anew with the joints ``cut`` cut, and others where loops need it."""
    rng = np.random.default_rng(seed)
    turn = pin.SE3.Identity() if turn is None else turn
    pairs = list(_pairs(m, turn))
    pairs = [pairs[i] for i in rng.permutation(len(pairs))]
    held = {pair.name for pair in pairs if pair.in_tree}
    assert not held & set(cut), "inputs and coupled joints stay in the tree"
    order, tree = _forest(m, pairs, held, set(cut), rng)
    links = {body: "base" if body == ROOT else f"{prefix}body{body}" for body in order}
    frames = _frames(m, order, tree, turn)
    joints, home = [], {}
    for body in order[1:]:
        joint, values = _tree_joint(body, tree.get(body), links, frames, prefix)
        joints.append(joint)
        home[joint.name] = values
    left = [p for p in pairs if p.name not in {pair.name for pair, _ in tree.values()}]
    closures = [_closure(pair, links, frames, prefix) for pair in left]
    description = written.Description(
        name=m.name,
        root="base",
        links=tuple(written.Link(name) for name in [*links.values(), f"{prefix}tip"]),
        joints=(*joints, _tip(m, links, frames, turn, prefix)),
        closures=tuple(closures),
        couplings=tuple(_coupling(m, c, prefix) for c in m.description.couplings),
        inputs=tuple(replace(i, joint=prefix + i.joint) for i in m.description.inputs),
        task=written.Task("base", f"{prefix}tip", m.task.outputs, m.description.task.length),
        home=home,
    )
    data = m.model.createData()
    pin.forwardKinematics(m.model, data, m.home)
    offsets = {b: (turn * data.oMi[b]).inverse() * frames[b] for b in order}
    return Recut(m, mechanism_from_description(description), turn, links, offsets)


def every_cut(m: cc.Mechanism) -> Iterator[tuple[str, ...]]:
    """Each joint that may be cut by itself, and all of them at once."""
    single = [p.name for p in _pairs(m, pin.SE3.Identity()) if not p.in_tree and _may_stay(p)]
    yield from ((name,) for name in single)
    yield tuple(single)


def _may_stay(pair: Pair) -> bool:
    return pair.kind in {"revolute", "prismatic"}


def _pairs(m: cc.Mechanism, turn: pin.SE3) -> Iterator[Pair]:
    """All joints of a mechanism but floating ones, at home, in the turned world."""
    data, model = m.model.createData(), m.model
    pin.forwardKinematics(model, data, m.home)
    place = [turn * data.oMi[i] for i in range(model.njoints)]
    driven = {spec.joint for spec in m.description.inputs}
    driven |= {j for c in m.description.couplings for j in (c.joint, c.leader)}
    for joint in m.description.joints:
        if joint.type in {"fixed", "floating"}:
            continue
        i = model.getJointId(joint.name)
        parent = model.parents[i]
        slides = joint.type == "prismatic"
        axis = place[i].rotation @ joint.axis
        yield Pair(
            name=joint.name,
            kind="prismatic" if slides else "revolute",
            bodies=(parent, i),
            places=((place[parent] * model.jointPlacements[i]).translation, place[i].translation),
            axes=(axis, axis),
            value=float(m.home[model.joints[i].idx_q]) if slides else 0.0,
            in_tree=joint.name in driven,
        )
    for c in m.closures:
        if isinstance(c, Coupling):
            continue
        one, two = place[c.joint1] * c.placement1, place[c.joint2] * c.placement2
        yield Pair(
            name=c.name,
            kind=c.kind,
            bodies=(c.joint1, c.joint2),
            places=(one.translation, two.translation),
            axes=(one.rotation[:, 2], two.rotation[:, 2]),
            value=float((two.translation - one.translation) @ one.rotation[:, 2]),
            sizes=tuple(c.sizes.items()),
        )


def _forest(
    m: cc.Mechanism,
    pairs: list[Pair],
    held: set[str],
    cut: set[str],
    rng: np.random.Generator,
) -> tuple[list[int], dict[int, tuple[Pair, bool]]]:
    """Bodies in the order of the tree, and for each the joint it hangs on, and whether reversed."""
    group = list(range(m.model.njoints))

    def root(body: int) -> int:
        while group[body] != body:
            body = group[body]
        return body

    staying = []
    usable = [p for p in pairs if _may_stay(p) and p.name not in cut]
    for pair in sorted(usable, key=lambda p: p.name not in held):  # inputs first
        one, two = (root(body) for body in pair.bodies)
        if one != two:
            group[one] = two
            staying.append(pair)
        else:
            assert pair.name not in held, "inputs form a loop"
    order: list[int] = []
    tree: dict[int, tuple[Pair, bool]] = {}
    starts = [ROOT, *(rng.permutation(m.model.njoints - 1) + 1).tolist()]
    for start in starts:
        if start in order:
            continue
        pending = [start]
        order.append(start)
        while pending:
            body = pending.pop()
            for pair in staying:
                if body not in pair.bodies:
                    continue
                reverse = pair.bodies[1] == body
                other = pair.bodies[0] if reverse else pair.bodies[1]
                if other not in order:
                    order.append(other)
                    tree[other] = (pair, reverse)
                    pending.append(other)
    return order, tree


def _frames(
    m: cc.Mechanism, order: list[int], tree: dict[int, tuple[Pair, bool]], turn: pin.SE3
) -> dict[int, pin.SE3]:
    """Frame of each body at home: along the world's axes, at its own side of its joint."""
    data = m.model.createData()
    pin.forwardKinematics(m.model, data, m.home)
    frames = {ROOT: pin.SE3.Identity()}
    for body in order[1:]:
        at = (turn * data.oMi[body]).translation
        if body in tree:
            pair, reverse = tree[body]
            at = pair.places[0 if reverse else 1]
        frames[body] = pin.SE3(np.eye(3), at)
    return frames


def _tree_joint(
    body: int,
    hanging: tuple[Pair, bool] | None,
    links: dict[int, str],
    frames: dict[int, pin.SE3],
    prefix: str,
) -> tuple[written.Joint, tuple[float, ...]]:
    if hanging is None:
        name = f"{prefix}float{body}"
        pose = tuple(float(x) for x in pin.SE3ToXYZQUAT(frames[body]))
        return written.Joint(name, "floating", "base", links[body]), pose
    pair, reverse = hanging
    parent, at = pair.bodies[1 if reverse else 0], pair.places[1 if reverse else 0]
    axis = -pair.axes[0] if reverse else pair.axes[0]
    kind = "prismatic" if pair.kind == "prismatic" else "continuous"
    origin = _origin(at - frames[parent].translation)
    joint = written.Joint(
        prefix + pair.name, kind, links[parent], links[body], origin, _vector(axis)
    )
    return joint, (pair.value if kind == "prismatic" else 0.0,)


def _closure(
    pair: Pair, links: dict[int, str], frames: dict[int, pin.SE3], prefix: str
) -> written.LoopClosure:
    one, two = pair.bodies
    return written.LoopClosure(
        name=prefix + pair.name,
        type=pair.kind,
        parent=links[one],
        child=links[two],
        parent_origin=_origin(pair.places[0] - frames[one].translation),
        child_origin=_origin(pair.places[1] - frames[two].translation),
        parent_axis=_vector(pair.axes[0]),
        child_axis=_vector(pair.axes[1]),
        sizes=pair.sizes,
    )


def _tip(
    m: cc.Mechanism,
    links: dict[int, str],
    frames: dict[int, pin.SE3],
    turn: pin.SE3,
    prefix: str,
) -> written.Joint:
    frame = m.model.frames[m.frame_id(m.task.tip)]
    body = frame.parentJoint
    gap = frames[body].inverse() * turn * m.pose(m.home)
    origin = written.Origin(_vector(gap.translation), _vector(pin.rpy.matrixToRpy(gap.rotation)))
    return written.Joint(f"{prefix}tip_place", "fixed", links[body], f"{prefix}tip", origin)


def _coupling(m: cc.Mechanism, spec: written.Coupling, prefix: str) -> written.Coupling:
    """The same coupling for values counted from home where joints turn."""
    slides = {j.name for j in m.description.joints if j.type == "prismatic"}
    at_home = {
        name: 0.0
        if name in slides
        else float(m.home[m.model.joints[m.model.getJointId(name)].idx_q])
        for name in (spec.joint, spec.leader)
    }
    offset = spec.offset + spec.multiplier * at_home[spec.leader] - at_home[spec.joint]
    return replace(spec, joint=prefix + spec.joint, leader=prefix + spec.leader, offset=offset)


def _origin(xyz: np.ndarray) -> written.Origin:
    return written.Origin(_vector(xyz))


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z
