"""placo on one problem, in a Python of its own: its wheels need an older Pinocchio than ours.

Reads JSON as ``placo_peer`` writes it, and prints JSON. Hard tasks hold the loops and what is
prescribed, soft ones where rows depend on each other, which placo refuses of hard ones. Steps are
repeated until one is so short that what it leaves is rounding.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import placo

SHORT = 1e-7  # m, rad: after a step of this length, errors are its square
MOST = 20


class Run:
    """The model, its loops, and tasks for inputs or for the tip."""

    def __init__(self, problem: dict, priority: str) -> None:
        self.problem, self.priority = problem, priority
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_text(problem["urdf"])
            self.robot = placo.RobotWrapper(str(path), placo.Flags.ignore_collisions)
        for name, value in problem["start"].items():
            self.robot.set_joint(name, value)
        self.robot.update_kinematics()
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.solver.enable_joint_limits(False)
        self.solver.enable_velocity_limits(False)
        self.solver.add_regularization_task(1e-9)
        self.pairs = [tuple(pair) for pair in problem["pairs"]]
        for i, (a, b) in enumerate(self.pairs):
            task = self.solver.add_relative_position_task(a, b, np.zeros(3))
            task.configure(f"loop{i}", self.priority, 1.0)
        self.move = self._inputs() if problem["direct"] else self._pose()

    def _inputs(self):
        task = self.solver.add_joints_task()
        task.configure("inputs", self.priority, 1.0)
        names = self.problem["inputs"]

        def move(target: list[float]) -> None:
            task.set_joints(dict(zip(names, target, strict=True)))
            self._solve()

        return move

    def _pose(self):
        tip, outputs = self.problem["tip"], self.problem["outputs"]
        here = self.robot.get_T_world_frame(tip)
        if outputs == ["x", "y", "z", "rx", "ry", "rz"]:
            frame = self.solver.add_frame_task(tip, here)
            frame.configure("tip", self.priority, 1.0)

            def move(target: np.ndarray) -> None:
                frame.T_world_frame = target
                self._solve()

            return move
        place = self.solver.add_position_task(tip, here[:3, 3])
        place.configure("tip", self.priority, 1.0)
        place.mask.set_axises("".join(n for n in outputs if n in "xyz"))
        turns = [n for n in outputs if n not in "xyz"]
        if turns not in ([], ["rx", "ry"]):
            raise ValueError(f"no task for the outputs {outputs}")
        lean = None
        if turns:
            lean = self.solver.add_axisalign_task(tip, np.array([0.0, 0.0, 1.0]), here[:3, 2])
            lean.configure("lean", self.priority, 1.0)

        def move(target: np.ndarray) -> None:
            place.target_world = target[:3, 3]
            if lean is not None:
                lean.targetAxis_world = target[:3, 2]
            self._solve()

        return move

    def _solve(self) -> None:
        for _ in range(MOST):
            step = self.solver.solve(True)
            self.robot.update_kinematics()
            if np.abs(step).max() < SHORT:
                return

    def residual(self) -> float:
        gaps = [self.robot.get_T_a_b(a, b)[:3, 3] for a, b in self.pairs]
        return float(np.abs(gaps).max())


def main() -> None:
    """Check every posture in one run, then time blocks of steps in another."""
    problem = json.loads(sys.stdin.read())
    targets = problem["targets"]
    if not problem["direct"]:
        targets = [np.array(t) for t in targets]
    priority, note = "hard", ""
    run, worst = Run(problem, priority), 0.0
    try:
        run.move(targets[0])
    except RuntimeError:
        priority, note = "soft", "soft tasks: hard ones must not depend on each other"
    run = Run(problem, priority)
    for target in targets:
        run.move(target)
        worst = max(worst, run.residual())
    tip = run.robot.get_T_world_frame(problem["tip"])[:3, 3].tolist()
    run, times, block = Run(problem, priority), [], problem["block"]
    for a in range(0, len(targets) - block + 1, block):
        begin = time.process_time()
        for target in targets[a : a + block]:
            run.move(target)
        times.append((time.process_time() - begin) / block)
    print(json.dumps({"seconds": min(times), "residual": worst, "tip": tip, "note": note}))


if __name__ == "__main__":
    main()
