"""Naming the arrays of a map: coordinates, units, and what it is a map of."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.singularity.maps.cells import STARTS
from closedchain.analysis.singularity.maps.choice import Choice
from closedchain.analysis.singularity.maps.grid import STATUSES, Grid
from closedchain.analysis.singularity.maps.rounds import lattice_of
from closedchain.closure.chart import TILTS, Chart
from closedchain.closure.mechanism import Mechanism
from closedchain.urdf.description import OUTPUTS

if TYPE_CHECKING:
    import xarray as xr

STATUS_LABELS = {
    "flag_values": list(range(len(STATUSES))),
    "flag_meanings": " ".join(s.replace(" ", "_") for s in STATUSES),
    "random_starts": STARTS,
}
"""``random_starts``: at each searched cell that the branch does not reach."""


def labelled(grid: Grid, arrays: Mapping[str, np.ndarray], measures: Choice) -> xr.Dataset:
    """Label the arrays of a map: "status", "q" and the measures, each with the grid's shape.

    What a coordinate is called like has an underscore behind its name.
    """
    import xarray as xr

    variables = {}
    for name in variables_of(measures):
        if name not in arrays:
            continue
        values = arrays[name]
        more = ("nq",) if name == "q" else ()
        label = variable_name(name, grid.names)
        variables[label] = ((*grid.names, *more), values, array_labels(name, measures, grid))
    coordinates = {
        name: (name, values, coordinate_labels(grid.chart, name))
        for name, values in zip(grid.names, grid.values, strict=True)
    }
    return xr.Dataset(variables, coords=coordinates, attrs=map_labels(grid, measures.outputs))


def variable_name(name: str, coordinates: Sequence[str]) -> str:
    """What an array of a map is called beside these coordinates."""
    while name in coordinates:
        name += "_"
    return name


def variables_of(measures: Choice) -> tuple[str, ...]:
    """Variables of a map in order: "joined" only beside all measures of the table."""
    return ("status", *(("joined",) if measures.whole else ()), *measures.every, "q")


def array_labels(name: str, measures: Choice, grid: Grid) -> dict[str, Any]:
    """Attributes of an array of a map."""
    if name == "status":
        searched = math.prod(len(axis) for axis in lattice_of(grid.shape))
        return STATUS_LABELS | {"searched_cells": searched}
    if name == "joined":
        return {
            "long_name": "the branch leads to the next cell",
            "flag_masks": [1 << i for i in range(len(grid.names))],
            "flag_meanings": " ".join(f"along_{axis}" for axis in grid.names),
        }
    if name == "q":
        return {"long_name": "configuration", "units": "m or rad"}
    entry = measures.entries[name]
    return {"units": entry.unit or "1", "long_name": entry.long_name}


def coordinate_labels(chart: Chart, name: str) -> dict[str, Any]:
    """Attributes of a coordinate."""
    if name in chart.joints:
        kind = "input" if name in chart.mechanism.inputs else "joint"
        return {"units": chart.unit(name), "long_name": f"{kind} {name}"}
    return {"units": chart.unit(name), "long_name": f"tip {name}"}


def _mode_at(mechanism: Mechanism, q: np.ndarray) -> str:
    """ "mode NAME" of the named posture that this one is; empty where it is none."""
    for name, posture in mechanism.postures.items():
        if np.allclose(q, posture, rtol=0.0, atol=1e-9):
            return f"mode {name}"
    return ""


def map_labels(grid: Grid, outputs: tuple[str, ...]) -> dict[str, Any]:
    """Attributes of a map: mechanism, outputs, what is held, parameters, versions."""
    import pinocchio as pin

    import closedchain

    chart, mechanism = grid.chart, grid.chart.mechanism
    order = (*mechanism.inputs, *OUTPUTS, *TILTS, *chart.joints)
    at_home = np.allclose(chart.start, mechanism.home, rtol=0.0, atol=1e-9)
    start = dict(zip(chart.names, chart.values(chart.start).tolist(), strict=True))
    return {
        "mechanism": mechanism.name,
        "outputs": " ".join(outputs),
        "characteristic_length": mechanism.length,
        "characteristic_length_units": "m",
        **{f"parameter_{k}": v for k, v in mechanism.parameters.items()},
        **{f"held_{n}": chart.held[n] for n in sorted(chart.held, key=order.index)},
        **{f"held_{n}_units": chart.unit(n) for n in sorted(chart.held, key=order.index)},
        **{f"start_{name}": value for name, value in start.items()},
        "start": "home" if at_home else _mode_at(mechanism, chart.start) or "start",
        "mode": grid.mode,
        "closedchain_version": closedchain.__version__,
        "pinocchio_version": pin.__version__,
        "numpy_version": np.__version__,
    }
