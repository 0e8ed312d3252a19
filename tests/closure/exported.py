"""Programs of mechanisms, compiled or run, beside Python: requests, answers. No tests here."""

from __future__ import annotations

import ctypes
import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import closedchain as cc

CC, NODE = shutil.which("gcc"), shutil.which("node")
STRICT = "-std=c99 -pedantic -Wall -Wextra -Werror"
AGREE = 1e-12


@dataclass(frozen=True, eq=False)
class Asked:
    """Requests around home and Python's answers to them.

    ``targets`` (n, inputs), ``solved`` their solutions; ``postures`` are those that arrived, and
    ``posed`` the inverse solutions for their tips, from the first of them.
    """

    mechanism: cc.Mechanism
    targets: np.ndarray
    solved: list[cc.Solution]
    postures: list[np.ndarray]
    posed: list[cc.Solution]

    @property
    def poses(self) -> list[np.ndarray]:
        return [pin.SE3ToXYZQUAT(self.mechanism.pose(q)) for q in self.postures]


def heavy(m: cc.Mechanism) -> cc.Mechanism:
    """A mechanism whose links got masses beside their frames."""
    text = m.description.text
    for k, link in enumerate(re.findall(r'<link name="(\w+)"/>', text)):
        mass = (
            f'<inertial><origin xyz="0.{k + 1} -0.2 0.1"/><mass value="{k + 1}.5"/>'
            '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
        )
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{mass}</link>')
    found = cc.load_urdf(text, xacro=False)
    assert sum(inertia.mass for inertia in found.model.inertias) > 1.0
    return found


def asked(m: cc.Mechanism, count: int, share: float) -> Asked:
    """Requests up to a share of the length, or of a radian, away from home."""
    rng = np.random.default_rng(5)
    home, units = m.input_values(m.home), np.array(m.input_units)
    span = share * np.where(units == "m", m.length, 1.0)
    targets = home + span * rng.uniform(-1.0, 1.0, (count, len(home)))
    solved = [cc.direct(m, target) for target in targets]
    postures = [one.q for one in solved if one.converged]
    posed = []
    if m.task is not None:
        posed = [cc.inverse(m, m.pose(q), postures[0]) for q in postures]
    return Asked(m, targets, solved, postures, posed)


def compile_c(folder: Path, sources: list[Path], options: str, to: str) -> Path:
    """Compile with all warnings as errors."""
    command = [str(CC), *STRICT.split(), *options.split(), "-o", str(folder / to)]
    subprocess.run([*command, *map(str, sources), "-lm"], check=True, timeout=300, cwd=folder)
    return folder / to


def written(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


@dataclass(frozen=True, eq=False)
class Library:
    """A C program called ``robot``, loaded."""

    code: ctypes.CDLL
    mechanism: cc.Mechanism
    folder: Path

    @classmethod
    def of(cls, m: cc.Mechanism, folder: Path, options: str = "-O1") -> Library:
        written(folder, cc.export_code(m, "c", name="robot"))
        source = folder / "robot.c"
        compiled = compile_c(folder, [source], f"{options} -c -fPIC -fstack-usage", "robot.o")
        path = compile_c(folder, [compiled], "-shared", "robot.so")
        return cls(ctypes.CDLL(str(path)), m, folder)

    def solve(self, way: str, given: Any, guess: np.ndarray | None = None) -> tuple[int, Any]:
        """Code and posture; numbers that were not written are -7."""
        q = np.full(self.mechanism.model.nq, -7.0)
        code = getattr(self.code, f"robot_{way}")(address(given), address(guess), address(q))
        return int(code), q

    def numbers(self, function: str, q: np.ndarray, size: int) -> np.ndarray:
        found = np.full(size, -7.0)
        getattr(self.code, f"robot_{function}")(address(q), address(found))
        return found

    def efforts(self, q: np.ndarray, wrench: Any, fall: Any) -> tuple[int, np.ndarray]:
        found = np.full(len(self.mechanism.inputs), -7.0)
        given = address(q), address(wrench), address(fall), address(found)
        return int(self.code.robot_efforts(*given)), found

    def measured(self, q: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:
        """Code, twist map, and sigma_direct, sigma_inverse, det_direct, det_inverse."""
        m = self.mechanism
        shape = len(m.outputs()), len(m.inputs)
        found = np.full(shape[0] * shape[1] + 4, -7.0)
        code = self.code.robot_measure(address(q), address(found))
        return int(code), found[:-4].reshape(shape), found[-4:]


def address(x: Any) -> ctypes.c_void_p:
    if x is None:
        return ctypes.c_void_p(None)
    array = np.ascontiguousarray(x, dtype=float)
    pointer = ctypes.c_void_p(array.ctypes.data)
    pointer.array = array  # type: ignore[attr-defined]  # kept as long as the pointer
    return pointer


def run_js(folder: Path, m: cc.Mechanism, body: str, given: dict[str, Any]) -> Any:
    """What a script returns that has the module as ``robot`` and ``given``."""
    written(folder, cc.export_code(m, "js", name="robot"))
    main = (
        'import * as robot from "./robot.mjs";\nimport {readFileSync} from "node:fs";\n'
        "const given = JSON.parse(readFileSync(0));\n"
        "const plain = (k, x) => (ArrayBuffer.isView(x) ? Array.from(x) : x);\n"
        f"const made = (() => {{ {body} }})();\nconsole.log(JSON.stringify(made, plain));\n"
    )
    (folder / "main.mjs").write_text(main)
    done = subprocess.run(
        [str(NODE), str(folder / "main.mjs")],
        input=json.dumps(given, default=lambda x: x.tolist()),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
