"""A problem: the closures of a mechanism and poses wanted of its frames, in the joints left free.

Some joints are pinned: their values are prescribed. What is prescribed in a batch of problems
stands in a ``Targets``. Everything that solvers need of a problem is written on tapes from here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from closedchain.closure.closures import Closure
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.ranks import NOISE, independent_rows
from closedchain.closure.solve.samples import closed_samples
from closedchain.closure.tape.eliminated import EliminatedClosures
from closedchain.closure.tape.elimination import Elimination, eliminate
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.rows import Kinematics, Rows
from closedchain.closure.tape.vectors import Pose, rotation
from closedchain.closure.task import goal, goal_rows
from closedchain.urdf.description import OUTPUTS

POSE = 7
"""Numbers of a target pose: origin [m], quaternion x y z w, as ``pin.SE3ToXYZQUAT``."""

DEPENDENT = 1e-8
"""Share of the largest singular value below which rows depend on each other."""

WELL_AWAY = 1e-3
"""Share of the largest singular value that the smallest has at a sample fit to choose pivots."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Equations of a mechanism with joints pinned and frames placed.

    Attributes
    ----------
    pinned : tuple of int
        Tangent coordinates of the joints with prescribed values, one-freedom joints only.
    goals : tuple of (frame, components)
        Frames with a wanted pose, and which of its components 0 to 5 for x y z rx ry rz count.
    """

    mechanism: Mechanism
    pinned: tuple[int, ...] = ()
    goals: tuple[tuple[str, tuple[int, ...]], ...] = ()

    @cached_property
    def free(self) -> tuple[int, ...]:
        """Tangent coordinates that are unknown."""
        held = set(self.pinned)
        return tuple(v for v in range(self.mechanism.model.nv) if v not in held)

    @cached_property
    def pinned_q(self) -> np.ndarray:
        """Index in q of each pinned joint."""
        model = self.mechanism.model
        at = {model.idx_vs[j]: model.idx_qs[j] for j in range(1, model.njoints)}
        return np.array([at[v] for v in self.pinned], dtype=int)

    @property
    def prescribed(self) -> int:
        """How many numbers a target has: pins, then a pose for every goal."""
        return len(self.pinned) + POSE * len(self.goals)

    @cached_property
    def units(self) -> np.ndarray:
        """Unit of each row: ``length`` for lengths, 1 for angles."""
        length = self.mechanism.length
        goals = [length if k < 3 else 1.0 for _, outputs in self.goals for k in outputs]
        return np.concatenate([self.mechanism.row_scale, goals])

    def targets_at(self, q: np.ndarray) -> np.ndarray:
        """Targets (n, prescribed) that postures (n, nq) meet."""
        q = np.atleast_2d(q)
        parts = [q[:, self.pinned_q]]
        for frame, _ in self.goals:
            parts.append(flat_poses([self.mechanism.pose(one, frame) for one in q]))
        return np.hstack(parts)

    # -- on a graph --------------------------------------------------------------------------------

    def pinned_at(self, q: Sequence[Expr], target: Sequence[Expr]) -> list[Expr]:
        """Numbers of q with the pinned joints at the values of a target (prescribed,)."""
        found = list(q)
        for index, value in zip(self.pinned_q, target, strict=False):
            found[int(index)] = value
        return found

    def rows(self, k: Kinematics, target: Sequence[Expr]) -> Rows:
        """All rows with targets given as expressions (prescribed,), origins in m."""
        rows, length = k.closures, self.mechanism.length
        begin = len(self.pinned)
        for i, (frame, outputs) in enumerate(self.goals):
            pose = pose_of(target[begin + POSE * i : begin + POSE * (i + 1)], length)
            rows = rows + k.goal(frame, outputs, pose)
        return rows

    def kinematics(self, graph: Graph, q: Sequence[Expr]) -> Kinematics:
        """Expressions of the mechanism in which the kept rows are what they were chosen as."""
        return Kinematics(self.mechanism, graph, list(q), self.upright)

    @cached_property
    def upright(self) -> frozenset[str]:
        """Closures of which all rows that hold a point are kept: any axes suit these.

        Single ones of them are independent along the axes in which they were chosen.
        """
        kept, first, found = set(self.kept), 0, []
        for closure in self.mechanism.closures:
            if isinstance(closure, Closure) and set(range(first, first + 3)) <= kept:
                found.append(closure.name)
            first += closure.rows
        return frozenset(found)

    def rows_met(self, k: Kinematics) -> Rows:
        """All rows where the goals are met as they are: what the Jacobian is on the way."""
        rows = k.closures
        for frame, outputs in self.goals:
            rows = rows + k.goal(frame, outputs, k.named(frame)[0])
        return rows

    @cached_property
    def samples(self) -> np.ndarray:
        """Closed postures (n, nq) at which independence is judged and pivots are chosen."""
        return closed_samples(self.mechanism)

    @cached_property
    def regular(self) -> np.ndarray:
        """Samples (n, nq) at which the Jacobian has its largest rank, well away from losing it."""
        return np.asarray(self.samples[self._regular])

    @cached_property
    def _regular(self) -> np.ndarray:
        """Which samples those are, (n,) of bool; the best where none is well away."""
        values = np.linalg.svd(self.sampled_jacobians, compute_uv=False)
        if not values.size:
            return np.ones(len(self.samples), dtype=bool)
        shares = values / np.maximum(values[:, :1], NOISE / DEPENDENT)
        rank = int((shares > DEPENDENT).sum(axis=1).max())
        if rank == 0:
            return np.ones(len(self.samples), dtype=bool)
        least = shares[:, rank - 1]
        return np.asarray(least > min(WELL_AWAY, 0.5 * float(least.max())))

    @cached_property
    def kept(self) -> tuple[int, ...]:
        """Independent rows: as many as the rank of the Jacobian over the samples.

        The others vanish where these do, near the samples; solvers check them, they do not solve
        them.
        """
        matrices = self.sampled_jacobians[self._regular]
        rows = matrices.shape[1]
        if 0 in matrices.shape:
            return ()
        values = np.linalg.svd(matrices, compute_uv=False)
        rank = int((values > np.maximum(DEPENDENT * values[:, :1], NOISE)).sum(axis=1).max())
        return tuple(range(rows)) if rank == rows else independent_rows(matrices, rank)

    @cached_property
    def sampled_jacobians(self) -> np.ndarray:
        """Dimensionless Jacobians (n, rows, free) of all rows at the samples."""
        return np.array([self.jacobian_at(q) for q in self.samples])

    def jacobian_at(self, q: np.ndarray) -> np.ndarray:
        """Dimensionless Jacobian (rows, free) where the targets are met, by Pinocchio."""
        m = self.mechanism
        _, jacobian = m.workspace.evaluate(q)
        parts = [np.array(jacobian)]
        for frame, outputs in self.goals:
            names = tuple(OUTPUTS[i] for i in outputs)
            g = goal(m, frame, m.pose(q, frame), names)
            m.workspace.evaluate(q)
            parts.append(goal_rows(m, g)[1])
        whole = np.vstack(parts) * m.column_scale / self.units[:, None]
        return np.asarray(whole[:, list(self.free)])

    def determinant_at(self, q: np.ndarray) -> float:
        """Determinant of the kept rows of ``jacobian_at(q)``, which have to be square."""
        return float(np.linalg.det(self.jacobian_at(q)[list(self.kept)]))

    def elimination(self, graph: Graph, rows: Rows, samples: np.ndarray) -> Elimination:
        """Elimination of the kept rows in the free coordinates; inputs of the graph as sampled."""
        entries = [rows.entries[r] for r in self.kept]
        return eliminate(graph, entries, self.free, samples)

    def eliminated(self, graph: Graph) -> EliminatedClosures:
        """The kept closure rows, without goals, eliminated in the free coordinates.

        q are the first inputs of the graph.
        """
        k = self.kinematics(graph, graph.inputs(0, self.mechanism.model.nq))
        return EliminatedClosures(k, self.kept, self.free, (), self.regular)

    @property
    def square(self) -> bool:
        """Whether the kept rows are as many as the unknowns."""
        return len(self.kept) == len(self.free)

    @property
    def redundant(self) -> bool:
        """Whether there are rows beside the kept ones."""
        return len(self.kept) < self.units.size

    @cached_property
    def sided(self) -> bool:
        """Whether a determinant's sign tells sides apart: all rows kept, as many as unknowns."""
        return self.square and not self.redundant

    @cached_property
    def signed(self) -> bool:
        """Whether the sign of the kept rows' determinant can only change at a singularity.

        It can where all rows are kept, or the others are the same combinations of these everywhere,
        as those of planar loops out of their plane: then all samples beside each other have no more
        rank than one.
        """
        if self.sided or not self.square:
            return self.sided
        every = np.hstack(list(self.sampled_jacobians))
        values = np.linalg.svd(every, compute_uv=False)
        return int((values > DEPENDENT * values[0]).sum()) == len(self.kept)


def problem_of(
    mechanism: Mechanism,
    pinned: Sequence[int] = (),
    goals: Sequence[tuple[str, Sequence[str]]] = (),
) -> Problem:
    """Problem with these pins and goals (outputs by name), made once for each mechanism."""
    wanted = tuple((frame, tuple(OUTPUTS.index(n) for n in names)) for frame, names in goals)
    key = (tuple(int(v) for v in pinned), wanted)
    found: Problem = mechanism.known.setdefault(key, Problem(mechanism, *key))
    return found


def flat_poses(poses: Sequence[pin.SE3]) -> np.ndarray:
    """Poses as rows of numbers (n, POSE)."""
    return np.array([pin.SE3ToXYZQUAT(pose) for pose in poses]).reshape(-1, POSE)


def pose_of(numbers: Sequence[Expr], length: float) -> Pose:
    """Pose with its origin in lengths, from its POSE numbers."""
    return rotation(numbers[3:7]), [(1.0 / length) * x for x in numbers[:3]]
