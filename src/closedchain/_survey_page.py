"""The page of a survey: the robot with its singular sets in the scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from closedchain._arguments import Up
from closedchain.analysis.survey.set_tables import polylines
from closedchain.robots.viewer import (
    Controls,
    Markers,
    Overlay,
    Plane,
    Polyline,
    PostureSeries,
    Surface,
    boxed,
    static_page,
)

if TYPE_CHECKING:
    from closedchain.analysis.singularity.sets.singular_set import SingularitySet
    from closedchain.analysis.survey.surveying import Slice, Survey
    from closedchain.closure import Mechanism

SHOWN = 200
"""Postures of one set to go through."""

MOST_POSTURES = 20_000
"""Points of one set in the scene: more make the page slow."""


def survey_page(found: Survey, q: np.ndarray, *, up: Up) -> str:
    """Draw the robot at ``q`` (nq,) with the singular sets of a survey.

    Sets over positions of the tip stand where the tip is. Of other lines and slices the scene
    shows where the tip is at the singular postures; surfaces over other coordinates stand in a box
    beside the robot.
    """
    overlays: list[Overlay] = []
    for part in found.slices:
        if len(part.over) == 3 and not _in_space(found.mechanism, part):
            overlays.extend(_in_box(found.mechanism, part, q, up))
        elif found.mechanism.task is not None:
            overlays.extend(_at_tip(found.mechanism, part))
    series = [one for part in found.slices for one in _series(found.mechanism, part)]
    planes = [one for part in found.slices for one in _planes(found.mechanism, part)]
    offered = Controls(series=series, planes=planes)
    return static_page(found.mechanism, q, up=up, overlays=overlays, controls=offered)


def _planes(mechanism: Mechanism, part: Slice) -> Iterator[Plane]:
    """A small map of a slice over two inputs, or two coordinates of the tip's place."""
    if len(part.over) != 2:
        return
    driven = all(name in mechanism.inputs for name in part.over)
    placed = mechanism.task is not None and set(part.over) <= set(mechanism.outputs())
    if not driven and not (placed and _in_space(mechanism, part)):
        return
    curves = []
    for found in part.sets:
        columns = [found.over.index(name) for name in part.over]
        curves += [
            (found.kind, found.coordinates[line][:, columns])
            for line, on_branch in polylines(found)
            if on_branch and len(line) > 1
        ]
    across, up = (part.map[name].to_numpy() for name in part.over)
    ranges = np.array([[across[0], across[-1]], [up[0], up[-1]]])
    yield Plane((part.over[0], part.over[1]), ranges, curves)


def _series(mechanism: Mechanism, part: Slice) -> Iterator[PostureSeries]:
    """Some postures of each set, as they stand along its pieces, where the tip is."""
    if mechanism.task is None:
        return
    for found in part.sets:
        order = list(dict.fromkeys(int(i) for piece in found.pieces for i in piece.ravel()))
        if not order:
            continue
        some = np.unique(np.linspace(0, len(order) - 1, min(len(order), SHOWN)).round().astype(int))
        q = found.q[np.array(order)[some]]
        points = np.array([mechanism.pose(one).translation for one in q])
        yield PostureSeries(q, points, f"{found.kind} singularities, {' × '.join(part.over)}")


def _in_space(mechanism: Mechanism, part: Slice) -> bool:
    return all(name in ("x", "y", "z") and name not in mechanism.inputs for name in part.over)


def _at_tip(mechanism: Mechanism, part: Slice) -> Iterator[Overlay]:
    place = "" if _in_space(mechanism, part) else "tip at "
    for found in part.sets:
        if len(found.q) > MOST_POSTURES:
            continue
        points = np.array([mechanism.pose(q).translation for q in found.q]).reshape(-1, 3)
        label = f"{place}{found.kind} singularities, {' × '.join(part.over)}"
        yield from _labelled(_shapes(found, points), label)


def _in_box(mechanism: Mechanism, part: Slice, q: np.ndarray, up: Up) -> tuple[Overlay, ...]:
    shapes: list[Polyline | Surface | Markers] = []
    for found in part.sets:
        columns = [found.over.index(name) for name in part.over]
        label = f"{found.kind} singularities"
        shapes.extend(_labelled(_shapes(found, found.coordinates[:, columns]), label))
    axes = [part.map[name].to_numpy() for name in part.over]
    return boxed(
        shapes,
        part.over,
        [str(part.map[name].attrs["units"]) for name in part.over],
        np.array([(axis[0], axis[-1]) for axis in axes]),
        beside=mechanism,
        q=q,
        up=up,
        label=f"box: {' × '.join(part.over)}",
    )


def _shapes(found: SingularitySet, points: np.ndarray) -> Iterator[Polyline | Surface | Markers]:
    """Meshes, and what of the curves and points is on the branch; points (N, 3)."""
    for piece in found.pieces:
        if piece.ndim == 2 and len(piece):
            yield Surface(points, piece, found.kind)
    single = []
    for line, on_branch in polylines(found):
        if on_branch and len(line) > 1:
            yield Polyline(points[line], found.kind)
        elif on_branch:
            single.append(line[0])
    if single:
        yield Markers(points[single], found.kind)


def _labelled(
    shapes: Iterator[Polyline | Surface | Markers], label: str
) -> Iterator[Polyline | Surface | Markers]:
    """The shapes of one set, the first of them with its line of the legend."""
    for i, shape in enumerate(shapes):
        yield replace(shape, label=label) if i == 0 else shape
