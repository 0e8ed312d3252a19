"""The folder of a survey: its files, and how they are read again.

``map.nc`` holds the maps, a group for each slice; ``sets.nc`` the singular sets, a group for each
slice and kind; ``singularities.csv`` the points of the sets, one a row; ``map.png`` the figure,
with pages ``map-2.png`` and so on where it needs them, and ``map.alt.txt`` what it shows in words.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.figures.drawing import MEASURES_DRAWN, draw_survey
from closedchain.analysis.figures.saving import alt_file
from closedchain.analysis.singularity.sets.singular_set import SingularitySet
from closedchain.analysis.survey.set_tables import SavedSet, read_table, table
from closedchain.analysis.survey.surveying import Survey
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import xarray as xr

MAPS, SETS, POINTS, FIGURE = "map.nc", "sets.nc", "singularities.csv", "map.png"


@dataclass(frozen=True, eq=False)
class SavedSlice:
    """A slice read from a folder."""

    name: str
    map: xr.Dataset
    sets: tuple[SavedSet, ...]


@dataclass(frozen=True, eq=False)
class Results:
    """Slices read from a folder, and their heading."""

    title: str
    slices: tuple[SavedSlice, ...]


def write_survey(result: Survey, folder: Path) -> dict[str, Path]:
    """Write a survey into a folder, which is made if need be.

    Returns
    -------
    mapping of file name to path

    Raises
    ------
    OSError
        The folder cannot be written.
    """
    require("results are written as datasets of xarray", "maps")
    import xarray as xr

    folder.mkdir(parents=True, exist_ok=True)
    paths = {name: folder / name for name in (MAPS, SETS, POINTS, FIGURE)}
    groups = {_group(part.name): part for part in result.slices}
    attributes = {"title": result.title, "text": result.text}
    maps = {name: part.map for name, part in groups.items()}
    root = xr.Dataset(attrs=attributes)
    xr.DataTree.from_dict({"/": root, **maps}).to_netcdf(paths[MAPS], engine="h5netcdf")
    sets = {f"{name}/{s.kind}": table(s) for name, part in groups.items() for s in part.sets}
    xr.DataTree.from_dict({"/": root, **sets}).to_netcdf(paths[SETS], engine="h5netcdf")
    _write_points(result, paths[POINTS])
    shown = (*MEASURES_DRAWN, *result.measures)
    images = draw_survey(result, paths.pop(FIGURE), measures=shown)
    _drop_pages(paths[MAPS].parent, len(images))
    for image in images:
        paths |= {image.name: image, alt_file(image).name: alt_file(image)}
    return paths


def _drop_pages(folder: Path, kept: int) -> None:
    """Delete pages that an earlier survey had and this one has not."""
    stem, ending = FIGURE.split(".")
    i = kept + 1 if kept > 1 else 2
    while (old := folder / f"{stem}-{i}.{ending}").is_file():
        old.unlink()
        alt_file(old).unlink(missing_ok=True)
        i += 1


def read_results(folder: Path) -> Results:
    """Read the maps and sets of a folder, or the Zarr store of one map.

    Raises
    ------
    ClosureError
        No such folder, no results in it, or files that hold something else.
    """
    if not folder.is_dir():
        raise ClosureError(f"there is no folder {folder}")
    if (folder / "zarr.json").is_file():
        return _stored_map(folder)
    maps = _tree(folder / MAPS)
    sets = _tree(folder / SETS)
    slices = []
    for name, node in maps.children.items():
        data = node.to_dataset()
        kinds = sets.children[name].children if name in sets.children else {}
        try:
            found = tuple(read_table(kind.to_dataset()) for kind in kinds.values())
        except ClosureError as error:
            raise ClosureError(f"{folder / SETS}: {name}: {error}") from None
        if "status" not in data:
            raise ClosureError(f"{folder / MAPS}: {name} is no singularity map")
        slices.append(SavedSlice(name, data, found))
    if not slices:
        raise ClosureError(f"{folder / MAPS} holds no maps")
    return Results(str(maps.attrs.get("title", folder.name)), tuple(slices))


def _stored_map(folder: Path) -> Results:
    """Map that ``singularity_map`` saved."""
    from closedchain.analysis.singularity.maps.saving import opened

    try:
        labels = json.loads((folder / "zarr.json").read_text(encoding="utf-8"))
        if not labels["attributes"]["complete"]:
            raise ClosureError(
                f"{folder} holds a map that was stopped: ask for the same map again to finish it"
            )
        data = opened(folder)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ClosureError(f"{folder} holds no singularity map: {_first_line(error)}") from None
    if "status" not in data:
        raise ClosureError(f"{folder} holds no singularity map")
    title = f"Singularities of {data.attrs.get('mechanism', folder.name)}"
    return Results(title, (SavedSlice(folder.name, data, ()),))


def _tree(path: Path) -> xr.DataTree:
    """Contents of a netCDF file, read as a whole."""
    require("results are read as datasets of xarray", "maps")
    import xarray as xr

    if not path.is_file():
        raise ClosureError(
            f"{path.parent} holds no {path.name}; 'closedchain singularities ROBOT --out "
            f"{path.parent}' writes it"
        )
    try:
        with xr.open_datatree(path, engine="h5netcdf") as tree:
            return tree.load()
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise ClosureError(f"{path} cannot be read as netCDF: {_first_line(error)}") from None


def _first_line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)


def _group(name: str) -> str:
    """Name of a group: netCDF takes no slashes."""
    return re.sub(r"[^\w.+-]", "-", name)


def _write_points(result: Survey, path: Path) -> None:
    """One row for each point; q columns in Pinocchio's order."""
    mechanism = result.mechanism
    more = {
        name: unit
        for part in result.slices
        for found in part.sets
        for name, unit in zip(found.over, found.units, strict=True)
        if name not in mechanism.inputs
    }
    header = [
        *("slice", "set", "piece", "kinds", "on branch"),
        *(f"{n} [{u}]" for n, u in zip(mechanism.inputs, mechanism.input_units, strict=True)),
        *(f"{n} [{u}]" for n, u in more.items()),
        *("sigma_direct", "sigma_inverse", "sigma_constraint"),
        *(f"q[{i}]" for i in range(mechanism.model.nq)),
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        for part in result.slices:
            for found in part.sets:
                for number, i in _pieces(found):
                    writer.writerow(
                        [
                            *(part.name, found.kind, number, "+".join(sorted(found.kinds[i]))),
                            "yes" if found.on_branch[i] else "no",
                            *(float(x) for x in found.q[i][mechanism.input_q]),
                            *_coordinates(found, i, more),
                            *(float(s) for s in found.sigmas[i]),
                            *(float(x) for x in found.q[i]),
                        ]
                    )


def _coordinates(found: SingularitySet, i: int, names: Mapping[str, Any]) -> list[float | str]:
    """Values of coordinates that are no inputs, empty where the slice does not vary them."""
    here = dict(zip(found.over, found.coordinates[i].tolist(), strict=True))
    return [here.get(name, "") for name in names]


def _pieces(found: SingularitySet) -> Iterator[tuple[int, int]]:
    """Number of the piece and index of each point, along the pieces, every point once."""
    seen = np.zeros(len(found.q), dtype=bool)
    for number, piece in enumerate(found.pieces):
        for i in piece.ravel():
            if not seen[i]:
                seen[i] = True
                yield number, int(i)
