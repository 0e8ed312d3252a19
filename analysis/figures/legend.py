"""The legend of a figure of maps: kinds by line, marker and face, cells by hatch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from closedchain.analysis.figures.palette import (
    BLANKS,
    DASHES,
    EDGES,
    HATCHES,
    KIND_LABELS,
    MARKERS,
    Scheme,
    blank_colour,
    start_within,
    statuses_of,
)
from closedchain.analysis.survey.set_tables import DrawableSet, polylines

if TYPE_CHECKING:
    import xarray as xr

Shown = tuple["xr.Dataset", Sequence[DrawableSet]]


def legend_of(parts: Sequence[Shown], scheme: Scheme) -> list[Any]:
    """Handles for what maps and their sets show."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = []
    everything = [found for _, sets in parts for found in sets]
    for kind in KIND_LABELS:
        handles += _kind_handles(
            kind, [found for found in everything if found.kind == kind], scheme
        )
    if any(not on for found in everything for _, on in polylines(found)):
        label = "thin: the same, not reached by the branch"
        handles.append(Line2D([], [], color="#777777", lw=0.8, label=label))
    starts = {start[0] for data, _ in parts if (start := start_within(data)) is not None}
    if starts:
        label = ", ".join(sorted(starts))
        handles.append(Line2D([], [], ls="", marker="*", ms=11, mfc="w", mec="k", label=label))
    for name, blank in BLANKS.items():
        if any(_shows(data, name) for data, _ in parts):
            colour = blank_colour(name, scheme)
            handles.append(Patch(fc=colour, ec="#999999", hatch=blank.hatch, label=blank.label))
    return handles


def _kind_handles(kind: str, sets: Sequence[DrawableSet], scheme: Scheme) -> list[Any]:
    """What stands for a kind: the line, marker, face or hatch that its sets show."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colour, label = scheme.kinds[kind], KIND_LABELS[kind]
    pieces = [piece for found in sets for piece in found.pieces if piece.size]
    handles: list[Any] = []
    points = any(piece.ndim == 1 and piece.size == 1 for piece in pieces)
    lines = any(piece.size > 1 for piece in pieces)  # of surfaces, where planes cut them
    if points or lines:
        upright = all(len(found.over) == 1 for found in sets)
        handles.append(
            Line2D(
                [], [], color=colour, label=label, mec="white",
                lw=2.0 if lines or upright else 0.0,
                ls=DASHES[kind] if lines or upright else "",
                marker=MARKERS[kind] if points and not upright else None,
            )
        )  # fmt: skip
    if any(piece.ndim == 2 for piece in pieces):
        rim = colour if EDGES[kind] else "none"
        words = f"{label}, in space"
        handles.append(
            Patch(fc=scheme.faces[kind], alpha=0.45, ec=rim, lw=EDGES[kind], label=words)
        )
    if any(found.everywhere for found in sets):
        whole = f"{label}, everywhere"
        handles.append(
            Patch(fc=scheme.faces[kind], alpha=0.35, hatch=HATCHES[kind], ec="#999999", label=whole)
        )
    return handles


def _shows(data: xr.Dataset, status: str) -> bool:
    codes = statuses_of(data)
    return status in codes and bool((data["status"] == codes[status]).any())
