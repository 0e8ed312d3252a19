"""The survey of a mechanism: maps of input space around home, singular curves, null space.

This is what ``closedchain singularities`` runs; every part is also there by itself.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from closedchain.analysis.curves import SingularitySet, curves_of, meeting_points
from closedchain.analysis.maps import dataset, evaluate
from closedchain.analysis.redundancy import Redundancy, redundancy
from closedchain.analysis.walk import STATUSES, Progress, grid_of, walk
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.errors import ClosureError, known_names

if TYPE_CHECKING:
    import xarray as xr

RESOLUTION = 101
SPAN = 1.0
"""Half width of a slice, in characteristic lengths or radians, clipped to the joint limits."""


@dataclass(frozen=True, eq=False)
class Slice:
    """One slice: the map of its cells and its singular curves and points."""

    inputs: tuple[str, str]
    map: xr.Dataset
    direct: SingularitySet
    inverse: SingularitySet
    combined: SingularitySet

    @property
    def name(self) -> str:
        """Name of the slice, such as q1_q2."""
        return "_".join(self.inputs)

    @property
    def sets(self) -> tuple[SingularitySet, SingularitySet, SingularitySet]:
        """Direct, inverse, combined."""
        return self.direct, self.inverse, self.combined


@dataclass(frozen=True, eq=False)
class Survey:
    """Slices of a mechanism and its null space at home."""

    mechanism: Mechanism
    slices: tuple[Slice, ...]
    redundancy: Redundancy

    def summary(self) -> list[dict[str, object]]:
        """Return one row a slice: cells by status, ranges, points on each singular set."""
        rows = []
        for part in self.slices:
            status = part.map["status"].to_numpy()
            row: dict[str, object] = {"slice": " x ".join(part.inputs), "cells": int(status.size)}
            row |= {name: int((status == i).sum()) for i, name in enumerate(STATUSES)}
            for found in part.sets:
                whole = "everywhere" if found.everywhere else len(found.q)
                row[f"{found.kind} points"] = whole
            row["curves"] = len(part.direct.pieces) + len(part.inverse.pieces)
            rows.append(row)
        return rows

    @property
    def text(self) -> str:
        """Notes on the sets, and the null space at home."""
        notes = [
            f"{part.name}: {found.note}"
            for part in self.slices
            for found in part.sets
            if found.note
        ]
        dropped = sum(found.dropped for part in self.slices for found in part.sets)
        if dropped:
            notes.append(f"{dropped} contour vertices led to no singular posture and were dropped")
        return "\n".join([*notes, "At home: " + self.redundancy.text])


def survey(
    mechanism: Mechanism,
    slices: Sequence[tuple[str, str]] | None = None,
    *,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    at: Mapping[str, float] | None = None,
    resolution: int | Mapping[str, int] = RESOLUTION,
    span: float | None = None,
    outputs: str | None = None,
    progress: Progress | None = None,
) -> Survey:
    """Map slices of input space around home and find the singular curves in them.

    Parameters
    ----------
    slices : pairs of input names, optional
        By default the first two inputs and, with four or more, the two that begin the second half.
    ranges : mapping of input name to (lowest, highest) value [m or rad], optional
        ``span`` around home by default.
    at : mapping of input name to value [m or rad], optional
        Inputs held where a slice does not vary them; home by default.
    resolution : int or mapping of input name to int
        Cells along an axis.
    span : float, optional
        Half width around home in characteristic lengths or radians.
    outputs : str, optional
        Those of the task by default.
    progress : callable, optional
        Called with (what, done, total).

    Raises
    ------
    ClosureError
        Unknown inputs, bad ranges or resolution, fewer than two inputs, an input held that
        every slice varies, a start that cannot be reached.
    """
    names = mechanism.outputs(outputs)
    pairs = list(slices) if slices is not None else _default_slices(mechanism)
    ranges, at = dict(ranges or {}), dict(at or {})
    _check(mechanism, pairs, ranges, at)
    parts = []
    for pair in pairs:
        axes = {
            name: _axis(mechanism, name, ranges.get(name), _cells(resolution, name), span)
            for name in pair
        }
        held = {name: value for name, value in at.items() if name not in pair}
        walked = walk(mechanism, grid_of(mechanism, axes, held or None), progress)
        found = evaluate(walked, mechanism, names, progress)
        direct = curves_of(mechanism, "direct", walked, found, names, progress)
        inverse = curves_of(mechanism, "inverse", walked, found, names, progress)
        combined = meeting_points(mechanism, direct, inverse, walked, names)
        labelled = dataset(mechanism, walked, found, names)
        parts.append(Slice((pair[0], pair[1]), labelled, direct, inverse, combined))
    return Survey(mechanism, tuple(parts), redundancy(mechanism, mechanism.home, names))


def write_survey(result: Survey, folder: Path) -> dict[str, Path]:
    """Write map.nc (one group a slice), singularities.csv and map.png into a folder.

    Returns
    -------
    mapping of file name to path

    Raises
    ------
    OSError
        The folder cannot be written.
    """
    import xarray as xr

    from closedchain.analysis.figures import draw_survey

    folder.mkdir(parents=True, exist_ok=True)
    paths = {name: folder / name for name in ("map.nc", "singularities.csv", "map.png")}
    tree = xr.DataTree.from_dict({part.name: part.map for part in result.slices})
    tree.to_netcdf(paths["map.nc"], engine="h5netcdf")
    _write_points(result, paths["singularities.csv"])
    draw_survey(result, paths["map.png"])
    return paths


def _write_points(result: Survey, path: Path) -> None:
    """One row for each polished point; q columns in Pinocchio's order."""
    mechanism = result.mechanism
    header = [
        *("slice", "set", "piece", "kinds"),
        *(f"{n} [{u}]" for n, u in zip(mechanism.inputs, mechanism.input_units, strict=True)),
        *("sigma_direct", "sigma_inverse", "sigma_constraint"),
        *(f"q[{i}]" for i in range(mechanism.model.nq)),
    ]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        for part in result.slices:
            for found in part.sets:
                for number, piece in enumerate(found.pieces):
                    for i in piece:
                        q = found.q[i]
                        writer.writerow(
                            [
                                *(part.name, found.kind, number, "+".join(sorted(found.kinds[i]))),
                                *(float(x) for x in q[mechanism.input_q]),
                                *(float(s) for s in found.sigmas[i]),
                                *(float(x) for x in q),
                            ]
                        )


def _default_slices(mechanism: Mechanism) -> list[tuple[str, str]]:
    names = mechanism.inputs
    if len(names) < 2:
        raise ClosureError(
            f"{mechanism.name!r} has {len(names)} input(s); a slice needs two inputs to vary"
        )
    pairs = [(names[0], names[1])]
    if len(names) >= 4:
        half = len(names) // 2
        pairs.append((names[half], names[half + 1]))
    return pairs


def _check(
    mechanism: Mechanism,
    pairs: Sequence[tuple[str, str]],
    ranges: Mapping[str, tuple[float, float]],
    at: Mapping[str, float],
) -> None:
    for name in [*(n for pair in pairs for n in pair), *ranges, *at]:
        if name not in mechanism.inputs:
            raise ClosureError(known_names(name, "input", mechanism.inputs))
    for pair in pairs:
        if len(pair) != 2 or pair[0] == pair[1]:
            raise ClosureError(f"a slice needs two different inputs, got {' '.join(pair)}")
    for name in at:
        if all(name in pair for pair in pairs):
            raise ClosureError(f"input {name!r} is held, but every slice varies it")


def _cells(resolution: int | Mapping[str, int], name: str) -> int:
    n = resolution if isinstance(resolution, int) else resolution.get(name, RESOLUTION)
    if not 3 <= n <= 5000:
        raise ClosureError(f"resolution of {name} must lie between 3 and 5000 cells, got {n}")
    return n


def _axis(
    mechanism: Mechanism,
    name: str,
    given: tuple[float, float] | None,
    n: int,
    span: float | None,
) -> np.ndarray:
    i = mechanism.inputs.index(name)
    index = mechanism.input_q[i]
    if given is not None:
        low, high = map(float, given)
    else:
        half = (SPAN if span is None else span) * mechanism.column_scale[mechanism.input_v[i]]
        low, high = mechanism.home[index] - half, mechanism.home[index] + half
        low = max(low, mechanism.limits[0][index])
        high = min(high, mechanism.limits[1][index])
    if not (np.isfinite([low, high]).all() and low < high):
        raise ClosureError(f"range of {name} must rise and be finite, got {low:g} to {high:g}")
    return np.linspace(low, high, n)
