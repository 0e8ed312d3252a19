"""What a newcomer waits for: the import, and the first map on a machine that never made one."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator

from benchmarks.timing import OURS, Row, of_process

MAP = """
import closedchain as cc, numpy as np
m = cc.load({robot!r})
h = m.input_values(m.home)
names = m.inputs[:2]
axes = {{n: np.linspace(h[i] - 0.02, h[i] + 0.02, 21) for i, n in enumerate(names)}}
cc.singularity_map(m, axes, progress=False, workers=1)
"""
IMPORT = "import closedchain"
FIRST, AGAIN = "first map ever, 21 x 21", "first map of a process, 21 x 21"


def rows(robots: tuple[str, ...], repeats: int) -> Iterator[Row]:
    """Rows of the import, less Python's own start, and of first maps."""
    python = of_process([sys.executable, "-c", "pass"], repeats=repeats)
    whole = of_process([sys.executable, "-c", "import closedchain"], repeats=repeats)
    note = f"median; Python's own start, {1e3 * python:.0f} ms, taken off"
    yield Row("", IMPORT, OURS, whole - python, note=note)
    for robot in robots:
        command = [sys.executable, "-c", MAP.format(robot=robot)]
        with tempfile.TemporaryDirectory() as folder:
            cache = {"CLOSEDCHAIN_CACHE": folder}
            yield Row(robot, FIRST, OURS, of_process(command, cache), note="import included")
            yield Row(robot, AGAIN, OURS, of_process(command, cache), note="import included")
