"""Layers of a page that are shown on demand: ground, axes, names, ellipsoids at the tip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from closedchain.closure import Closure, Mechanism
from closedchain.closure.rows import by_columns
from closedchain.robots._player import rounded
from closedchain.robots._scene import Scene

_AXIS, _DRIVEN = 0x5A5E66, 0x222222
_SPEED, _FORCE = 0x56B4E9, 0xE69F00
_FRAME = (0xB03A2E, 0x2E7D32, 0x1F4E9E)  # x, y and z of the world and of the tip
TITLES = {
    "names": "joint names",
    "axes": "joint axes, inputs' thicker, and the frames of world and tip",
    "ground": "ground",
}


@dataclass(frozen=True)
class Reach:
    """What a tip's ellipsoids are of: its place, or the rotations of a tip that only turns.

    ``first`` is the row of the twist that it begins with, ``count`` how many of it are outputs.
    """

    first: int
    count: int

    @staticmethod
    def of(outputs: tuple[str, ...]) -> Reach:
        """That of a task."""
        places = sum(name in "xyz" for name in outputs)
        return Reach(0, places) if places else Reach(3, len(outputs))

    @property
    def titles(self) -> dict[str, str]:
        """What the two ellipsoids are called, with their units."""
        speed, load = ("speeds", "forces") if self.first == 0 else ("angular speeds", "moments")
        units = ("m/s", "N") if self.first == 0 else ("rad/s", "N m")
        return {
            "velocity": f"{speed} of the tip for input rates of norm 1 [{units[0]}]",
            "force": f"{load} at the tip held by efforts of norm 1 [{units[1]}]",
        }

    @property
    def load(self) -> str:
        """Unit load of the half."""
        return "1 N" if self.first == 0 else "1 N m"


@dataclass(frozen=True, eq=False)
class Layers:
    """Data of what was drawn, and the moving parts: path, joint, placement (4, 4)."""

    data: dict[str, dict[str, Any]]
    moved: tuple[tuple[str, int, np.ndarray], ...]
    cell: float

    def parts(self, used: list[int]) -> list[dict[str, Any]]:
        """The moving parts, for the page; joints that carry them are added to ``used``."""
        found = []
        for path, joint, placement in self.moved:
            if joint not in used:
                used.append(joint)
            matrix = rounded(placement.T.ravel())
            found.append({"path": path, "body": used.index(joint), "matrix": matrix})
        return found


def draw_layers(scene: Scene, mechanism: Mechanism, *, measured: bool) -> Layers:
    """Draw the layers; the page shows them when they are asked for."""
    import meshcat.geometry as shapes

    size, layers = scene.bodies.size, scene.view["layers"]
    data: dict[str, dict[str, Any]] = {}
    data["ground"] = {"path": scene.view["ground"].path.lower()}
    moved = tuple(_draw_axes(layers["axes"], mechanism, size))
    layers["axes"].set_property("visible", False)
    data["axes"] = {"path": layers["axes"].path.lower()}
    if measured:
        for name, colour in (("velocity", _SPEED), ("force", _FORCE)):
            node = layers[name]
            look = {"color": colour, "opacity": 0.4, "transparent": True, "depthWrite": False}
            node.set_object(shapes.Sphere(1.0), shapes.MeshLambertMaterial(**look))
            node.set_property("visible", False)
            data[name] = {"path": node.path.lower(), "size": 0.35 * size}
    return Layers(data, moved, scene.cell)


def _draw_axes(
    node: Any, mechanism: Mechanism, size: float
) -> Iterator[tuple[str, int, np.ndarray]]:
    """Draw the axes of joints with one freedom, and the frames of the world and of the tip."""
    import meshcat.geometry as shapes

    model = mechanism.model
    driven = set(mechanism.input_v.tolist())
    for i in range(1, model.njoints):
        if model.nvs[i] != 1:
            continue
        drives = int(model.idx_vs[i]) in driven
        width, colour = (0.012, _DRIVEN) if drives else (0.006, _AXIS)
        one, place = node[f"joint{i}"], pin.SE3(_towards(_axis(model, i)), np.zeros(3)).homogeneous
        one.set_object(
            shapes.Cylinder(0.3 * size, width * size), shapes.MeshLambertMaterial(color=colour)
        )
        yield one.path.lower(), i, place
    frames = [("world", 0, pin.SE3.Identity())]
    if mechanism.task is not None:
        frame = model.frames[mechanism.frame_id(mechanism.task.tip)]
        frames.append(("tip", int(frame.parentJoint), frame.placement))
    for name, joint, placement in frames:
        for axis, colour in zip(np.eye(3), _FRAME, strict=True):
            one = node[name]["xyz"[int(axis.argmax())]]
            length = 0.25 * size
            one.set_object(
                shapes.Cylinder(length, 0.008 * size), shapes.MeshLambertMaterial(color=colour)
            )
            arm = pin.SE3(_towards(axis), 0.5 * length * axis)
            yield one.path.lower(), joint, (placement * arm).homogeneous


def _axis(model: pin.Model, joint: int) -> np.ndarray:
    """Direction of a joint with one freedom, in its own frame."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    jacobian = by_columns(pin.getJointJacobian(model, data, joint, pin.LOCAL))
    column = jacobian[:, model.idx_vs[joint]]
    turning = bool(np.linalg.norm(column[3:]) > 0.5)
    return np.asarray(column[3:] if turning else column[:3])


def _towards(axis: np.ndarray) -> np.ndarray:
    """A rotation that takes y, a cylinder's axis, to a direction."""
    up = np.array([0.0, 1.0, 0.0])
    if axis[1] < -1.0 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    return np.asarray(pin.Quaternion.FromTwoVectors(up, axis).matrix())


def joint_names(mechanism: Mechanism) -> Iterator[dict[str, Any]]:
    """Joints by name, and where they are: a body (0 for the base) and a point on it [m]."""
    model = mechanism.model
    driven = dict(zip(mechanism.input_v.tolist(), mechanism.inputs, strict=True))
    for i in range(1, model.njoints):
        if model.nvs[i] == 1:
            own = str(model.names[i])
            given = driven.get(int(model.idx_vs[i]), own)
            text = own if given == own else f"{own} ({given})"
            driving = int(model.idx_vs[i]) in driven
            yield {"text": text, "body": i, "at": [0.0, 0.0, 0.0], "driven": driving}
    for closure in mechanism.closures:
        if isinstance(closure, Closure):
            at = [float(x) for x in closure.placement1.translation]
            yield {"text": closure.name, "body": int(closure.joint1), "at": at, "driven": False}


def layer_switches(layers: Layers, reach: Reach | None) -> str:
    """Switches of the layers; ``reach`` where there are ellipsoids."""
    rows = []
    for name, title in (TITLES | (reach.titles if reach else {})).items():
        on = " checked" if name == "ground" else ""
        more = f", squares of {layers.cell:g} m" if name == "ground" else ""
        told = "" if name in TITLES else f'<output id="axes-{name}"></output>'
        switch = f'<input type="checkbox" id="layer-{name}"{on}>'
        rows.append(f"<label>{switch} {title}{more}{told}</label>")
    return f'<h2>in the scene</h2>\n<div class="layers">{"".join(rows)}</div>\n'
