"""Maps in Zarr stores: begun, gone on with, opened."""

from __future__ import annotations

import hashlib
import shutil
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.singularity.maps.checksums import CHECKSUMS, CheckedArray, pack, verify
from closedchain.analysis.singularity.maps.choice import identity
from closedchain.analysis.singularity.maps.folder import (
    LOCK,
    check_inside,
    damaged,
    held,
    release,
    writing,
)
from closedchain.analysis.singularity.maps.journal_folder import JOURNAL, SUMS, OnDisk
from closedchain.analysis.singularity.maps.labels import array_labels, coordinate_labels, map_labels
from closedchain.analysis.singularity.maps.spreading import Job
from closedchain.analysis.singularity.maps.storage import Store, in_zarr
from closedchain.analysis.singularity.measures_table import MEASURES
from closedchain.urdf.errors import ClosureError

if TYPE_CHECKING:
    import xarray as xr

_REQUEST, _COMPLETE = "request", "complete"
_TAKEN = (JOURNAL, LOCK, CHECKSUMS, "status", "ends", "joined", "q", "nq", "zarr.json", "c")
_SAME_START = 1e-9  # m or rad: held values reached on another machine differ by rounding


@dataclass(frozen=True, eq=False)
class SavedRun:
    """A store that is not complete yet, and the journal of the runs over it."""

    store: Store
    journal: OnDisk


@contextmanager
def saved_run(folder: Path, job: Job) -> Iterator[SavedRun | None]:
    """Run over a store, made if need be; None where it is complete. Left in order, it is complete.

    A complete store is only read, and every chunk of it checked. One that is not is held against
    other processes, and what is in it is checked before any of it is used.

    Raises
    ------
    ClosureError
        The folder holds something else, another map or links; it is damaged, cannot be written
        to, or another process writes to it.
    """
    request = request_of(job)
    _check_names(job)
    if _is_complete(folder, request):
        _check_complete(folder, job)
        yield None
        return
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with held(folder):
        check_inside(folder)
        if _is_complete(folder, request):  # another process has got ready meanwhile
            _check_complete(folder, job)
            yield None
            return
        store, journal = _begun(folder, job, request)
        yield SavedRun(store, journal)
        _complete(folder, job, store)


def _is_complete(folder: Path, request: dict[str, Any]) -> bool:
    """Whether a folder holds the whole map.

    Raises
    ------
    ClosureError
        It holds something else, or another map.
    """
    if not folder.exists():
        return False
    inside = {path.name for path in folder.iterdir()} if folder.is_dir() else {folder.name}
    if inside <= {LOCK}:
        return False
    attributes = _attributes(folder)
    if not attributes and inside == {LOCK, "zarr.json"}:
        return False  # just begun
    if _REQUEST not in attributes or not isinstance(attributes[_REQUEST], dict):
        raise ClosureError(f"{folder} is there already and holds no map; give another name to save")
    _check_same(folder, attributes[_REQUEST], request)
    return attributes.get(_COMPLETE) is True


def _begun(folder: Path, job: Job, request: dict[str, Any]) -> tuple[Store, OnDisk]:
    """Store and journal of a map that is not complete, every chunk checked."""
    import zarr

    with writing(folder):
        try:
            group = zarr.open_group(folder, mode="a")
            group.update_attributes({_REQUEST: request, _COMPLETE: False})
        except (ValueError, TypeError, KeyError):  # what a decoder thinks of damaged bytes
            raise damaged(folder / "zarr.json", "is damaged", folder) from None
        plain = in_zarr(group, folder, job)
    sums = folder / JOURNAL / SUMS
    arrays = {
        name: CheckedArray(array, name, job.tiles, folder, sums / name)
        for name, array in plain.items()
    }
    for array in arrays.values():
        array.check()
    journal = OnDisk(folder, job.tiles)
    if journal.state() is None and any(array.count for array in arrays.values()):
        raise damaged(folder / JOURNAL, "is damaged or missing", folder)
    return Store(job.tiles, arrays), journal


def _check_names(job: Job) -> None:
    """Refuse names of coordinates and measures that would be no plain names in the store."""
    for name in (*job.grid.names, *job.measures.functions):
        if name.startswith((".", "__")) or set(name) & set("/\\\0") or name in _TAKEN:
            raise ClosureError(
                f"a map over {name!r} cannot be saved: {name!r} is no name for a file"
            )


def _check_complete(folder: Path, job: Job) -> None:
    """Check every number of a complete store, and tidy up where a run was killed at its end."""
    import zarr

    check_inside(folder)
    group: Any = zarr.open_group(folder, mode="r")
    verify(group, in_zarr(group, folder, job), job.tiles, folder)
    for name, values in zip(job.grid.names, job.grid.values, strict=True):
        try:
            same = np.array_equal(group[name][:], values)
        except Exception:  # whatever a decoder thinks of damaged bytes
            same = False
        if not same:
            raise damaged(folder / name, "is damaged or missing", folder)
    if (folder / JOURNAL).exists() or "ends" in group:
        with suppress(OSError):  # it may be read-only
            _tidy(folder)


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
        return dict(zarr.open_group(folder, mode="r").attrs)
    except Exception:  # whatever may be wrong with the folder of another, or with a damaged file
        return {}


def _check_same(folder: Path, old: dict[str, Any], new: dict[str, Any]) -> None:
    different = [name for name in new if not _same(name, old.get(name), new[name])]
    if different:
        raise ClosureError(
            f"{folder} holds another map: {', '.join(different)} "
            f"{'differs' if len(different) == 1 else 'differ'}; give another name to save, or "
            "delete it"
        )


def _same(name: str, old: Any, new: Any) -> bool:
    if name not in ("start", "held"):
        return bool(old == new)
    try:
        if name == "held":
            return set(old) == set(new) and all(abs(old[k] - new[k]) <= _SAME_START for k in new)
        close = np.shape(old) == np.shape(new)
        return close and bool(np.abs(np.subtract(old, new)).max(initial=0.0) <= _SAME_START)
    except (TypeError, ValueError):  # it is not what a run of ours writes
        return False


def _complete(folder: Path, job: Job, store: Store) -> None:
    """Label the arrays, add their checksums, say that the store is complete, and tidy up."""
    import zarr

    grid = job.grid
    with writing(folder):
        group = zarr.open_group(folder, mode="a")
        for name, values in zip(grid.names, grid.values, strict=True):
            array = group.create_array(
                name, data=np.array(values), dimension_names=(name,), overwrite=True
            )
            array.update_attributes(coordinate_labels(grid.chart, name))
        kept = {name: array for name, array in store.arrays.items() if name != "ends"}
        for name in kept:
            group[name].update_attributes(array_labels(name, job.measures, grid))
        pack(group, kept, job.tiles)
        group.update_attributes(map_labels(grid, job.measures.outputs))
        group.update_attributes({_COMPLETE: True})
        _tidy(folder)


def _tidy(folder: Path) -> None:
    """Drop what only the run needed; a run may be killed before or amid this."""
    import zarr

    group = zarr.open_group(folder, mode="a")
    if "ends" in group:
        del group["ends"]
    shutil.rmtree(folder / JOURNAL, ignore_errors=True)
    release(folder)
    with warnings.catch_warnings():
        # xarray looks for consolidated metadata, which Zarr's third format has yet to specify
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(folder)
