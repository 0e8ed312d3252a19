"""The programs of examples/, run as their heads say."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import closedchain as cc

BESIDE = Path(sys.executable).parent
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
CC = shutil.which("cc")


@pytest.mark.skipif(CC is None, reason="no C compiler here")
def test_a_delta_moves_along_a_circle(tmp_path: Path) -> None:
    m = cc.load("linear_delta")
    for name, text in cc.export_code(m, "c").items():
        (tmp_path / name).write_text(text)
    strict = "-std=c99 -pedantic -Wall -Wextra -Werror -O1"
    sources = [str(EXAMPLES / "delta_circle.c"), "linear_delta.c"]
    command = [str(CC), *strict.split(), f"-I{tmp_path}", *sources, "-lm", "-o", "circle"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120)
    done = subprocess.run([tmp_path / "circle"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    lines = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    assert lines.shape == (501, 7)
    t, sliders, speeds = lines[:, 0], lines[:, 1:4], lines[:, 4:]
    assert np.array_equal(sliders[0], sliders[-1])
    for k in range(0, 501, 50):
        at = m.pose(m.home).translation + 0.1 * np.array([np.cos(np.pi * t[k]),
                                                          np.sin(np.pi * t[k]), 0.0])  # fmt: skip
        known = cc.inverse(m, pin.SE3(np.eye(3), at)).raise_if_failed()
        assert np.abs(m.input_values(known.q) - sliders[k]).max() < 1e-6
    slopes = (sliders[2:] - sliders[:-2]) / (t[2:] - t[:-2])[:, None]
    assert np.abs(slopes - speeds[1:-1]).max() < 3e-3 * np.abs(speeds).max()


def test_joints_come_through_a_pipe() -> None:
    m = cc.load("linear_delta")
    search = f"{BESIDE}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [sys.executable, EXAMPLES / "pipe_joints.py", "linear_delta"],
        env=os.environ | {"PATH": search},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    lines = [dict(w.split("=") for w in line.split() if "=" in w)
             for line in done.stdout.splitlines()]  # fmt: skip
    assert len(lines) == 100
    home, first = m.input_values(m.home), np.array([1.0, 0.0, 0.0])
    assert lines[0] == lines[50]
    for k in (0, 25, 60):
        q = cc.direct(m, home + 0.1 * np.sin(2 * np.pi * k / 100) * first).raise_if_failed().q
        told = np.array([float(lines[k][name]) for name in list(m.model.names)[1:]])
        assert np.abs(told - q).max() < 1e-4
