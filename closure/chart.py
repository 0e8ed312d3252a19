"""Charts: coordinates whose values fix a posture on a branch.

A chart prescribes as many coordinates as the mechanism has freedoms: joints (the inputs, or any
other) and components of the tip's pose. Some of them vary, the others are held. Maps and singular
sets live in the space of those that vary.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.solve.problem import Problem, problem_of
from closedchain.closure.solve.system import System
from closedchain.closure.task import Goal, goal
from closedchain.urdf.description import OUTPUTS

TILTS = ("tilt", "azimuth", "torsion")
"""Rotation of the tip from home: its tool axis leans by ``tilt`` towards ``azimuth``, after a turn
by ``torsion`` about itself. Torsion exists where the task prescribes all three rotations."""


@dataclass(frozen=True, eq=False)
class Chart:
    """Coordinates that fix a posture, with the values of those that are held.

    Names are those of inputs, of joints with one freedom, and of the tip: x y z [m] are its
    origin in the world; rx ry rz [rad] are the rotation vector from its orientation at home, along
    its axes there (components that are no outputs are zero); tilt and azimuth [rad] in their place
    say where the tool axis points. The tool axis is the tip axis that the two rotations of a task
    leave alone, z for tasks with three rotations. Azimuth counts about the tool axis at home, from
    the tip axis that follows it in the cycle x y z.

    Attributes
    ----------
    names : tuple of str
        Coordinates that vary, in order.
    joints : tuple of str
        Joint coordinates that are prescribed, varying or held.
    outputs : tuple of str
        Tip components that are prescribed; none where the chart has joints only.
    tilting : bool
        Whether the tip's rotation is spelled as tilt, azimuth (and torsion).
    held : mapping of coordinate to value
        Every prescribed coordinate that does not vary.
    start : (nq,) array
        Closed posture with the held values, on the branch that is meant.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> home, step = m.input_values(m.home), np.linspace(-0.1, 0.1, 7)
    >>> found = cc.singularity_set(m, "direct", {"q1": home[0] + step, "q4": home[3] + step})
    >>> found.chart.names
    ('q1', 'q4')
    """

    mechanism: Mechanism
    names: tuple[str, ...]
    joints: tuple[str, ...]
    outputs: tuple[str, ...]
    tilting: bool
    held: Mapping[str, float]
    start: np.ndarray = field(repr=False)

    # -- which unknowns, which rows --------------------------------------------------------------

    @cached_property
    def pinned_q(self) -> np.ndarray:
        """Index in q of each joint of ``joints``."""
        return np.array([joint_index(self.mechanism, n)[0] for n in self.joints], dtype=int)

    @cached_property
    def pinned_v(self) -> np.ndarray:
        """Index in v of each joint of ``joints``."""
        return np.array([joint_index(self.mechanism, n)[1] for n in self.joints], dtype=int)

    @cached_property
    def free(self) -> np.ndarray:
        """Indices in v of the unknowns: all that is not pinned."""
        return np.setdiff1d(np.arange(self.mechanism.model.nv), self.pinned_v)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each varying coordinate, "m" or "rad"."""
        return tuple(self.unit(name) for name in self.names)

    def unit(self, name: str) -> str:
        """Unit of a coordinate, "m" or "rad"."""
        if name in ("x", "y", "z") and self.outputs:
            return "m"
        if name in self.joints:
            index = joint_index(self.mechanism, name)[1]
            return "m" if self.mechanism.translational[index] else "rad"
        return "rad"

    @cached_property
    def scale(self) -> np.ndarray:
        """Unit length of each varying coordinate, (k,): ``length`` for lengths, 1 for angles."""
        return np.array([self.mechanism.length if u == "m" else 1.0 for u in self.units])

    @cached_property
    def folds(self) -> str | None:
        """Kind of singularity at which a branch of the chart ends, where that is one.

        With all inputs prescribed, and nothing else, the chart ends at direct singularities; with
        all outputs and nothing else at inverse ones. Any other chart ends where its coordinates
        fail, which need be no singularity of the mechanism.
        """
        if not self.outputs and set(self.joints) == set(self.mechanism.inputs):
            return "direct"
        return "inverse" if self.outputs and not self.joints else None

    # -- values to poses and back ----------------------------------------------------------------

    def prescribed(self, values: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Joint values (n, joints), tip rotations (n, 3, 3) and positions (n, 3) for coordinates.

        Parameters
        ----------
        values : (n, k) array
            Of the varying coordinates [m or rad].
        """
        values = np.atleast_2d(np.asarray(values, dtype=float))
        held, varying, columns = self._pins
        pins = np.tile(held, (len(values), 1))
        pins[:, varying] = values[:, columns]
        if not self.outputs:
            return pins, np.tile(np.eye(3), (len(values), 1, 1)), np.zeros((len(values), 3))
        everything = dict(self.held) | dict(zip(self.names, values.T, strict=True))

        def column(name: str, default: float = 0.0) -> np.ndarray:
            return np.broadcast_to(everything.get(name, default), len(values))

        home = self.home_pose
        places = np.stack([column(n, home.translation[i]) for i, n in enumerate("xyz")], axis=1)
        if self.tilting:
            turns = self._tilts(*(column(name) for name in TILTS))
        else:
            turns = rotations(np.stack([column(n) for n in OUTPUTS[3:]], axis=1))
        return pins, home.rotation @ turns, places

    def targets(self, values: ArrayLike) -> np.ndarray:
        """Targets (n, prescribed) of ``problem`` for coordinates (n, k): pins, then the tip's pose.

        Pins in m or rad; the pose as ``pin.SE3ToXYZQUAT``, only where outputs are prescribed. A
        row depends on its own coordinates alone, to the last bit.
        """
        pins, turns, places = self.prescribed(values)
        if not self.outputs:
            return pins
        return np.ascontiguousarray(np.hstack([pins, places, quaternions(turns)]))

    @property
    def problem(self) -> Problem:
        """Closures with the joints of the chart pinned and its outputs prescribed."""
        if not self.outputs:
            return problem_of(self.mechanism, self.pinned_v.tolist())
        tip = self.mechanism.required_task().tip
        return problem_of(self.mechanism, self.pinned_v.tolist(), ((tip, self.outputs),))

    @cached_property
    def _pins(self) -> tuple[np.ndarray, list[int], list[int]]:
        """Values of the held joints (joints,), which joints vary, and with which coordinates."""
        held = np.array([self.held.get(name, 0.0) for name in self.joints], dtype=float)
        varying = [i for i, name in enumerate(self.joints) if name in self.names]
        return held, varying, [self.names.index(self.joints[i]) for i in varying]

    def _tilts(self, tilt: np.ndarray, azimuth: np.ndarray, torsion: np.ndarray) -> np.ndarray:
        first, second, tool = self.tip_axes
        lean = np.cos(azimuth)[:, None] * first + np.sin(azimuth)[:, None] * second
        turned = rotations(torsion[:, None] * tool)
        return rotations(tilt[:, None] * np.cross(tool, lean)) @ turned

    def values(self, q: ArrayLike) -> np.ndarray:
        """Varying coordinates (..., k) of postures (..., nq)."""
        q = np.asarray(q, dtype=float)
        found = self.every_value(q)
        return np.stack([found[name] for name in self.names], axis=-1)

    def every_value(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """All prescribed coordinates (...) of postures (..., nq), by name."""
        found = dict(zip(self.joints, np.moveaxis(q[..., self.pinned_q], -1, 0), strict=True))
        if not self.outputs:
            return found
        flat = q.reshape(-1, q.shape[-1])
        poses = [self.mechanism.pose(one) for one in flat]
        places = np.array([pose.translation for pose in poses]).reshape(*q.shape[:-1], 3)
        found |= {n: places[..., i] for i, n in enumerate("xyz") if n in self.outputs}
        turns = [self.home_pose.rotation.T @ pose.rotation for pose in poses]
        angles = np.array([self._angles(turn) for turn in turns]).reshape(*q.shape[:-1], 3)
        names = TILTS if self.tilting else OUTPUTS[3:]
        kept = self.tip_rotations
        return found | {n: angles[..., i] for i, n in enumerate(names) if n in kept}

    @property
    def tip_rotations(self) -> tuple[str, ...]:
        """Names of the rotation coordinates that the chart prescribes."""
        angular = tuple(n for n in self.outputs if n in OUTPUTS[3:])
        return TILTS[: len(angular)] if self.tilting else angular

    def _angles(self, turn: np.ndarray) -> np.ndarray:
        """Rotation coordinates (3,) of a turn (3, 3) from home's axes, in the chart's spelling."""
        angular = [OUTPUTS.index(n) - 3 for n in self.outputs if n in OUTPUTS[3:]]
        if len(angular) != 2 and not self.tilting:
            return np.asarray(pin.log3(turn))
        first, second, tool = self.tip_axes
        axis = turn @ tool
        sideways = np.array([axis @ first, axis @ second])
        tilt = float(np.arctan2(np.linalg.norm(sideways), axis @ tool))
        azimuth = float(np.arctan2(sideways[1], sideways[0])) if tilt > 0.0 else 0.0
        if self.tilting:
            upright = self._tilts(*(np.array([a]) for a in (tilt, azimuth, 0.0)))[0]
            torsion = pin.log3(upright.T @ turn) @ tool
            return np.array([tilt, azimuth, torsion])
        lean = np.cos(azimuth) * first + np.sin(azimuth) * second
        return tilt * np.cross(tool, lean)

    @cached_property
    def home_pose(self) -> pin.SE3:
        """Pose of the tip at home, from which rotations count; the identity without outputs."""
        if not self.outputs:
            return pin.SE3.Identity()
        return self.mechanism.pose(self.mechanism.home)

    @cached_property
    def tip_axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """In tip axes: that from which azimuth counts, the next one, and the tool axis."""
        angular = [OUTPUTS.index(n) - 3 for n in self.outputs if n in OUTPUTS[3:]]
        k = ({0, 1, 2} - set(angular)).pop() if len(angular) == 2 else 2
        return np.eye(3)[(k + 1) % 3], np.eye(3)[(k + 2) % 3], np.eye(3)[k]

    # -- equations -------------------------------------------------------------------------------

    @cached_property
    def _goal(self) -> Goal | None:
        if not self.outputs:
            return None
        tip = self.mechanism.required_task().tip
        return goal(self.mechanism, tip, pin.SE3.Identity(), self.outputs)

    def equations(self, values: ArrayLike) -> System:
        """Closures and tip goal at coordinates (k,), in the unknowns ``free``."""
        if self._goal is None:
            return System(self.mechanism, self.free)
        _, turns, places = self.prescribed(values)
        target = pin.SE3(turns[0], places[0])
        g = Goal(self._goal.frame, self._goal.joint, self._goal.placement, target, self.outputs)
        return System(self.mechanism, self.free, (g,))

    def pinned(self, q: np.ndarray, values: ArrayLike) -> np.ndarray:
        """Copy of a posture (nq,) with the joints of the chart set to coordinates (k,)."""
        q = np.array(q, dtype=float)
        q[self.pinned_q] = self.prescribed(values)[0][0]
        return q


def joint_index(mechanism: Mechanism, name: str) -> tuple[int, int]:
    """Index in q and in v of an input, or of a joint with one freedom. Raises ``KeyError``."""
    if name in mechanism.inputs:
        i = mechanism.inputs.index(name)
        return int(mechanism.input_q[i]), int(mechanism.input_v[i])
    model = mechanism.model
    if not model.existJointName(name):
        raise KeyError(name)
    j = model.getJointId(name)
    if model.nqs[j] != 1 or model.nvs[j] != 1:
        raise KeyError(name)
    return int(model.idx_qs[j]), int(model.idx_vs[j])


def joint_names(mechanism: Mechanism) -> Sequence[str]:
    """Names that ``joint_index`` knows: the inputs, then the other joints with one freedom."""
    model = mechanism.model
    driven = set(mechanism.input_v.tolist())
    others = [
        model.names[j]
        for j in range(1, model.njoints)
        if model.nqs[j] == 1 and model.nvs[j] == 1 and model.idx_vs[j] not in driven
    ]
    return (*mechanism.inputs, *others)


def rotations(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3) [rad]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def quaternions(turns: np.ndarray) -> np.ndarray:
    """Unit quaternions x y z w (n, 4), w not negative, of rotation matrices (n, 3, 3).

    Each from the column of q q^T with the largest diagonal entry, which loses no digits [Shepperd
    1978]; the first of equal ones.
    """
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(turns, 0, -1)
    columns = np.array(
        [
            [1.0 + a - e - i, b + d, c + g, h - f],
            [b + d, 1.0 - a + e - i, f + h, c - g],
            [c + g, f + h, 1.0 - a - e + i, d - b],
            [h - f, c - g, d - b, 1.0 + a + e + i],
        ]
    )
    best = np.argmax(columns[range(4), range(4)], axis=0)
    x, y, z, w = np.moveaxis(columns, -1, 0)[np.arange(len(turns)), best].T
    size = np.sqrt((x * x + y * y) + (z * z + w * w))
    return np.stack([x, y, z, w], axis=1) / np.where(w < 0.0, -size, size)[:, None]
