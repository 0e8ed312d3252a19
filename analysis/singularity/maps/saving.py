"""Maps in Zarr stores: begun, gone on with, opened."""

from __future__ import annotations

import hashlib
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.singularity.maps.choice import identity
from closedchain.analysis.singularity.maps.journal import OnDisk
from closedchain.analysis.singularity.maps.labels import array_labels, coordinate_labels, map_labels
from closedchain.analysis.singularity.maps.spreading import Job
from closedchain.analysis.singularity.maps.storage import Store, in_zarr
from closedchain.analysis.singularity.measures_table import MEASURES
from closedchain.urdf.errors import ClosureError

if TYPE_CHECKING:
    import xarray as xr

_REQUEST, _COMPLETE, _JOURNAL = "request", "complete", "journal"
_SAME_START = 1e-9  # m or rad: held values reached on another machine differ by rounding


@dataclass(frozen=True, eq=False)
class SavedRun:
    """A store that is not complete yet, and the journal of the runs over it."""

    store: Store
    journal: OnDisk


@contextmanager
def saved_run(folder: Path, job: Job) -> Iterator[SavedRun | None]:
    """Run over a store, made if need be; None where it is complete. Left in order, it is complete.

    Raises
    ------
    ClosureError
        The folder holds something else, or another map.
    """
    import zarr

    request = request_of(job)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        attributes = _attributes(folder)
        _check_same(folder, attributes[_REQUEST], request)
        if attributes[_COMPLETE]:
            yield None
            return
    else:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ClosureError(f"the map cannot be saved in {folder}: {error}") from None
        group = zarr.open_group(folder, mode="a")
        group.update_attributes({_REQUEST: request, _COMPLETE: False})
    nq = job.grid.start.size
    names, keep = job.grid.names, job.keep_q
    store = in_zarr(folder, job.tiles, names, job.measures.every, nq, keep_q=keep)
    yield SavedRun(store, OnDisk(folder / _JOURNAL))
    _complete(folder, job, store)


def opened(folder: Path) -> xr.Dataset:
    """Map of a complete store, read as it is used."""
    import xarray as xr

    found = xr.open_dataset(folder, engine="zarr", chunks=None)
    request = found.attrs.pop(_REQUEST)
    del found.attrs[_COMPLETE]
    first = ("status", "joined") if request["measures"] == "all" else ("status",)
    every = (*first, *MEASURES, *request["functions"], "q")
    return found[[name for name in every if name in found]]


def request_of(job: Job) -> dict[str, Any]:
    """All that a map depends on, as JSON knows it."""
    import closedchain

    grid, mechanism = job.grid, job.grid.chart.mechanism
    description = repr(mechanism.description).encode()
    return {
        "mechanism": mechanism.name,
        "description": hashlib.sha256(description).hexdigest(),
        "parameters": dict(mechanism.parameters),
        "coordinates": list(grid.names),
        "values": {n: v.tolist() for n, v in zip(grid.names, grid.values, strict=True)},
        "held": dict(grid.chart.held),
        "start": grid.start.tolist(),
        "outputs": list(job.measures.outputs),
        "measures": "all" if job.measures.whole else list(job.measures.names),
        "functions": {name: identity(f) for name, f in job.measures.functions.items()},
        "keep_q": job.keep_q,
        "chunk": list(job.tiles.size),
        "closedchain version": closedchain.__version__,
    }


def _attributes(folder: Path) -> dict[str, Any]:
    import zarr

    try:
        attributes = dict(zarr.open_group(folder, mode="r").attrs)
    except (FileNotFoundError, NotADirectoryError, ValueError):
        attributes = {}
    if _REQUEST not in attributes:
        raise ClosureError(f"{folder} is there already and holds no map; give another name to save")
    return attributes


def _check_same(folder: Path, old: dict[str, Any], new: dict[str, Any]) -> None:
    different = [name for name in new if not _same(name, old.get(name), new[name])]
    if different:
        raise ClosureError(
            f"{folder} holds another map: {', '.join(different)} "
            f"{'differs' if len(different) == 1 else 'differ'}; give another name to save, or "
            "delete it"
        )


def _same(name: str, old: Any, new: Any) -> bool:
    if name == "start":
        close = np.shape(old) == np.shape(new)
        return close and bool(np.abs(np.subtract(old, new)).max(initial=0.0) <= _SAME_START)
    if name == "held":
        return set(old) == set(new) and all(abs(old[k] - new[k]) <= _SAME_START for k in new)
    return bool(old == new)


def _complete(folder: Path, job: Job, store: Store) -> None:
    """Label the arrays, drop what only the run needed, and say that the store is complete."""
    import zarr

    grid = job.grid
    group = zarr.open_group(folder, mode="a")
    for name, values in zip(grid.names, grid.values, strict=True):
        array = group.create_array(
            name, data=np.array(values), dimension_names=(name,), overwrite=True
        )
        array.update_attributes(coordinate_labels(grid.chart, name))
    for name in store.arrays:
        if name == "ends":
            if name in group:
                del group[name]
        else:
            group[name].update_attributes(array_labels(name, job.measures, grid))
    group.update_attributes(map_labels(grid, job.measures.outputs))
    shutil.rmtree(folder / _JOURNAL)
    group.update_attributes({_COMPLETE: True})
    with warnings.catch_warnings():
        # xarray looks for consolidated metadata, which Zarr's third format has yet to specify
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(folder)
