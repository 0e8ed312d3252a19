"""The survey of a mechanism: maps of slices of its coordinates, singular sets, null space.

This is what ``closedchain singularities`` runs; every part is also there by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.redundancy import Redundancy, redundancy
from closedchain.analysis.singularity.maps.grid import STATUSES, grid_of
from closedchain.analysis.singularity.maps.labels import variable_name
from closedchain.analysis.singularity.maps.mapping import singularity_map
from closedchain.analysis.singularity.measures_table import Function
from closedchain.analysis.singularity.sets.finding import set_of
from closedchain.analysis.singularity.sets.lattice import Lattice, lattice_of
from closedchain.analysis.singularity.sets.meeting import meeting
from closedchain.analysis.singularity.sets.singular_set import KINDS, SingularitySet
from closedchain.analysis.survey.captions import caption
from closedchain.analysis.survey.plan import (
    Names,
    Range,
    Wanted,
    axes_of_slice,
    check_slices,
    default_slices,
)
from closedchain.closure.chart import TILTS
from closedchain.closure.charting import chart_of, coordinate_names
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.progress import Progress
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError, known_names

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Slice:
    """One slice: the map of its cells and its singular sets.

    Attributes
    ----------
    map : xarray.Dataset
        Of ``singularity_map``.
    sets : tuple of SingularitySet
        One for each kind asked for.
    """

    map: xr.Dataset
    sets: tuple[SingularitySet, ...]

    @property
    def over(self) -> Names:
        """Coordinates that vary, in order."""
        return tuple(str(name) for name in self.map["status"].dims)

    @property
    def name(self) -> str:
        """Name of the slice, such as q1_q2."""
        return "_".join(self.over)

    def set_of(self, kind: str) -> SingularitySet:
        """The set of a kind. Raises ``ClosureError`` where it was not asked for."""
        for found in self.sets:
            if found.kind == kind:
                return found
        raise ClosureError(known_names(kind, "kind", [found.kind for found in self.sets]))

    @property
    def direct(self) -> SingularitySet:
        """Direct singularities."""
        return self.set_of("direct")

    @property
    def inverse(self) -> SingularitySet:
        """Inverse singularities."""
        return self.set_of("inverse")

    @property
    def combined(self) -> SingularitySet:
        """Singularities of both kinds at once."""
        return self.set_of("combined")


@dataclass(frozen=True, eq=False)
class Survey:
    """Slices of a mechanism and its null space at home.

    ``notes`` say what was left out, and why; ``measures`` are variables of the maps beyond the
    measures of singularity.
    """

    mechanism: Mechanism
    slices: tuple[Slice, ...]
    redundancy: Redundancy
    notes: tuple[str, ...] = ()
    measures: Names = ()

    @property
    def title(self) -> str:
        """Heading of figures."""
        return f"Singularities of {self.mechanism.name}"

    def summary(self) -> list[dict[str, object]]:
        """Return one row a slice: cells by status, points on each singular set, pieces."""
        rows = []
        for part in self.slices:
            status = part.map["status"].to_numpy()
            row: dict[str, object] = {"slice": " x ".join(part.over), "cells": int(status.size)}
            row |= {name: int((status == i).sum()) for i, name in enumerate(STATUSES)}
            for found in part.sets:
                whole = "everywhere" if found.everywhere else len(found.q)
                row[f"{found.kind} points"] = whole
            row["pieces"] = sum(len(found.pieces) for found in part.sets)
            rows.append(row)
        return rows

    @property
    def text(self) -> str:
        """Notes on slices and sets, and the null space at home."""
        return "\n".join([*self.notes, *self.details, "At home: " + self.redundancy.text])

    @property
    def details(self) -> tuple[str, ...]:
        """How sets were sought where that is not as usual, and what led to nothing."""
        sets = [(" × ".join(part.over), found) for part in self.slices for found in part.sets]
        said: dict[tuple[str, str], list[str]] = {}
        for name, found in sets:
            if found.note:
                said.setdefault((found.kind, found.note), []).append(name)
        notes = [f"{', '.join(names)}, {kind}: {note}" for (kind, note), names in said.items()]
        dropped = sum(found.dropped for _, found in sets)
        if dropped:
            notes.append(f"{dropped} places between cells led to no singular posture")
        return tuple(notes)


def survey(
    mechanism: Mechanism,
    slices: Sequence[Sequence[str]] | None = None,
    *,
    ranges: Mapping[str, Range] | None = None,
    at: Mapping[str, float] | None = None,
    mode: str | None = None,
    kinds: Iterable[str] = KINDS,
    resolution: int | Mapping[str, int] | None = None,
    span: float | None = None,
    outputs: str | None = None,
    workers: Any = None,
    progress: Progress | None = None,
    measures: Mapping[str, Function] | None = None,
) -> Survey:
    """Map slices of a mechanism's coordinates and find the singular sets in them.

    Parameters
    ----------
    slices : sequences of one to three coordinates, optional
        Inputs, joints, and x y z rx ry rz tilt azimuth torsion of the tip, see
        ``closure.chart.Chart``. By default two inputs (and two more), two positions of the tip,
        and its tilt and azimuth, as far as the mechanism has them and its start allows.
    ranges : mapping of coordinate to (lowest, highest) value [m or rad], optional
        Around the start by default.
    at : mapping of coordinate to value [m or rad], optional
        Coordinates held where a slice does not vary them; as at the start by default.
    mode : str, optional
        Named posture to start from; home by default.
    kinds : some of "direct", "inverse", "combined", "constraint"
        Sets to look for; all by default.
    resolution : int or mapping of coordinate to int, optional
        Points along an axis; 401, 101 or 25 for one, two or three coordinates by default.
    span : float, optional
        Half width of ranges not given, in characteristic lengths or radians. By default 1, and
        less where the branch takes up little of that.
    outputs : str, optional
        Those of the task by default.
    workers : int or Dask client, optional
        As for ``singularity_map``.
    progress : callable, optional
        Called with (what, done, total).
    measures : mapping of name to function, optional
        Variables that are added to the maps, as for ``singularity_map``.

    Raises
    ------
    ClosureError
        No inputs; unknown coordinates, kinds or mode, bad ranges or resolution, a coordinate held
        that every slice varies, a start from which a slice asked for cannot be followed.
    """
    kinds = tuple(kinds)
    for kind in kinds:
        if kind not in KINDS:
            raise ClosureError(known_names(str(kind), "kind of singularity", KINDS))
    mechanism.required_inputs()
    names = mechanism.outputs(outputs)
    at, wanted = dict(at or {}), Wanted(dict(ranges or {}), resolution, span)
    for name in (*wanted.ranges, *at):
        if name not in coordinate_names(mechanism):
            raise ClosureError(known_names(name, "coordinate", coordinate_names(mechanism)))

    asked = [tuple(map(str, s)) for s in slices] if slices is not None else []
    check_slices(asked)
    for name in at:
        if asked and all(name in over for over in asked):
            raise ClosureError(f"coordinate {name!r} is held, but every slice varies it")
    _check_names(asked or default_slices(mechanism, names))
    chosen = []
    left_out: dict[str, list[str]] = {}
    for over in asked or default_slices(mechanism, names):
        try:
            held = _held(mechanism, over, at, names, alone=len(asked) == 1)
            axes = axes_of_slice(mechanism, over, held, wanted, outputs=names, mode=mode)
        except ClosureError as error:
            if asked:
                raise
            left_out.setdefault(str(error), []).append(" × ".join(over))
        else:
            chosen.append((axes, held))
    notes = [f"no slice over {', nor '.join(o)}: {why}" for why, o in left_out.items()]
    if not chosen:
        why = "; ".join(notes) or "it has no inputs and no outputs that could vary"
        raise ClosureError(f"{mechanism.name!r} has no slice to show: {why}")
    parts = [
        _slice(
            *(mechanism, axes, held, mode, kinds, dict(measures or {})),
            names=names, workers=workers, progress=progress,
        )
        for axes, held in chosen
    ]  # fmt: skip
    return Survey(
        mechanism,
        tuple(parts),
        redundancy(mechanism, mechanism.home, names),
        tuple(notes),
        tuple(measures or ()),
    )


def _held(
    mechanism: Mechanism, over: Names, at: Mapping[str, float], outputs: Names, *, alone: bool
) -> dict[str, float]:
    """What of ``at`` a slice holds: all of it, or with several slices what is its own to hold."""
    held = {name: value for name, value in at.items() if name not in over}
    if alone or not held:
        return held
    own = chart_of(mechanism, over, outputs=outputs).held
    if set(over) & set(TILTS):  # the other spelling of the rotation would be refused
        held = {n: v for n, v in held.items() if n not in OUTPUTS[3:]}
    return {name: value for name, value in held.items() if name in own}


def _check_names(slices: Sequence[tuple[str, ...]]) -> None:
    """Refuse coordinates whose names files of results would take for paths."""
    for name in dict.fromkeys(name for over in slices for name in over):
        if "/" in name:
            raise ClosureError(
                f"coordinate {name!r} has a '/' in its name, which the files of a survey cannot "
                "hold; give it another name in the description"
            )


def _slice(
    mechanism: Mechanism,
    axes: Mapping[str, np.ndarray],
    at: Mapping[str, float],
    mode: str | None,
    kinds: Names,
    measures: Mapping[str, Function],
    *,
    names: Names,
    workers: Any,
    progress: Progress | None,
) -> Slice:
    """Map a slice once, and look for all sets on the postures of that map."""
    over = " x ".join(axes)

    def report(what: str, done: int, total: int) -> None:
        if progress is not None:
            progress(f"{over}: {what}", done, total)

    found = singularity_map(
        mechanism,
        axes,
        dict(at) or None,
        mode=mode,
        outputs=names,
        progress=report,
        keep_q=True,
        workers=workers,
        measures=measures,
    )
    grid = grid_of(mechanism, axes, dict(at) or None, outputs=names, mode=mode)
    added = set(measures)
    arrays = {str(n): found[n].to_numpy() for n in found.data_vars if n not in added}
    postures = variable_name("q", tuple(axes))
    arrays["q"] = found[postures].to_numpy()
    lattice = lattice_of(grid, arrays, names)
    sets = _sets(lattice, kinds, names, report)
    found = found.drop_vars(postures)
    found.attrs["caption"] = caption(found, sets)
    return Slice(found, sets)


def _sets(
    lattice: Lattice, kinds: Names, outputs: Names, report: Progress
) -> tuple[SingularitySet, ...]:
    """Sets of each kind; combined ones from the direct and the inverse set, traced once."""
    traced: dict[str, SingularitySet] = {}

    def of(kind: str) -> SingularitySet:
        if kind not in traced:
            traced[kind] = (
                replace(
                    meeting([lattice], of("direct"), of("inverse"), outputs),
                    grid=lattice.ok.shape,
                )
                if kind == "combined"
                else set_of(lattice, kind, outputs, report)
            )
        return traced[kind]

    return tuple(of(kind) for kind in kinds)
