"""Singular sets: points of a traced curve, whole surveys, all modes of a planar platform."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator, Sequence

import numpy as np

import closedchain as cc
from benchmarks.robots import three_rrr
from benchmarks.timing import OURS, Row, of_process
from closedchain.analysis.survey.surveying import survey

POINT = "point of a singular set"
MODES = "direct sets of 8 working modes"
SURVEY = "survey, nothing asked for"
COMMAND = "closedchain singularities"
HALF = 0.3  # m, of the slice with the points


def rows(cells: int, robots: Sequence[str]) -> Iterator[Row]:
    """Rows of all works on ``cells`` ** 2 cells; surveys have numbers of their own."""
    yield from point(cells)
    yield modes(cells)
    for robot in robots:
        yield from surveyed(robot)


def point(cells: int) -> Iterator[Row]:
    """One of the points of D1's sets over q1 x q2, the map that finds them taken off."""
    m = cc.load("d1")
    home = dict(zip(m.inputs, m.input_values(m.home), strict=True))
    axes = {n: np.linspace(home[n] - HALF, home[n] + HALF, cells) for n in ("q1", "q2")}
    for kind in ("direct", "inverse"):
        cc.singularity_set(m, kind, axes, check=False)  # to warm up
        begin = time.process_time()
        cc.singularity_map(m, axes, progress=False, workers=1)
        between = time.process_time()
        points = len(cc.singularity_set(m, kind, axes, check=False).q)
        beyond = (time.process_time() - between) - (between - begin)
        note = f"{points} points on {cells} x {cells} cells, beyond the map"
        seconds = beyond / points if points and beyond > 0.0 else None
        yield Row("d1", f"{POINT}, {kind}", OURS, seconds, note=note)


def modes(cells: int) -> Row:
    """Curves over the position of a planar 3-RRR with its platform held level."""
    m, postures = three_rrr()
    axes = {"x": np.linspace(0.1, 0.5, cells), "y": np.linspace(0.0, 0.4, cells)}

    def found() -> int:
        sets = (cc.singularity_set(m, "direct", axes, at=q, check=False) for q in postures.values())
        return sum(len(one.q) for one in sets)

    points = found()
    begin = time.process_time()
    found()
    seconds = time.process_time() - begin
    return Row("3-RRR", MODES, OURS, seconds, note=f"level, {cells} x {cells}: {points} points")


def surveyed(robot: str) -> Iterator[Row]:
    """A survey by itself, once machine code is there, and the command with pictures and page."""
    m = cc.load(robot)
    survey(m, workers=1)
    begin = time.process_time()
    found = survey(m, workers=1)
    seconds = time.process_time() - begin
    points = sum(len(one.q) for part in found.slices for one in part.sets)
    note = f"{len(found.slices)} slices, {points} singular points"
    yield Row(robot, SURVEY, OURS, seconds, note=note)
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "closedchain.cli", "singularities", robot, "--out", folder]
        yield Row(robot, COMMAND, OURS, of_process(command), note="pictures and page included")
