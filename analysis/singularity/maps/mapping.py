"""Maps of the singularity measures over coordinates of a mechanism, as labelled arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from closedchain.analysis.singularity.maps.grid import grid_of
from closedchain.analysis.singularity.maps.labels import labelled
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.progress import Progress
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import os

    import xarray as xr

    from closedchain.analysis.singularity.maps.choice import Wanted
    from closedchain.analysis.singularity.maps.spreading import Job


def singularity_map(
    mechanism: Mechanism,
    over: Mapping[str, ArrayLike],
    at: Mapping[str, float] | ArrayLike | None = None,
    *,
    mode: str | int | None = None,
    outputs: str | Sequence[str] | None = None,
    progress: bool | Progress = True,
    keep_q: bool = False,
    save: str | os.PathLike[str] | None = None,
    workers: Any = None,
    client: Any = None,
    chunk: int | Mapping[str, int] | None = None,
    measures: Wanted = None,
) -> xr.Dataset:
    """Evaluate the singularity measures over a grid of coordinates, on one branch.

    Parameters
    ----------
    over : mapping of coordinate to rising values [m or rad]
        One to six coordinates: inputs, other joints, or components x y z rx ry rz, tilt azimuth
        torsion of the tip's pose, see ``closure.chart.Chart``. The branch is followed from the
        cell nearest to the start outwards.
    at : mapping of coordinate to value, or (nq,) array, optional
        Values of coordinates that are held, or a posture whose branch is followed; home by
        default.
    mode : str or int, optional
        Name of a posture of the description, see ``Mechanism.postures``, to start from.
    outputs : str, optional
        Outputs of the task; those of the description by default.
    progress : bool or callable
        True shows a bar on a terminal; a callable gets (what, done, total).
    keep_q : bool
        Also return the posture of every cell.
    save : path, optional
        Zarr store, written chunk by chunk; what is in it need not fit into memory. A run that was
        stopped goes on where it stopped when it is asked for again.
    workers : int or Dask client, optional
        Threads; one for each core by default. The result does not depend on it.
    client : dask.distributed.Client, optional
        Workers elsewhere (extra ``closedchain[distributed]``).
    chunk : int, or mapping of coordinate to int, optional
        Cells along each axis of the tiles into which the work is cut.
    measures : sequence of str, or mapping of name to function, optional
        All measures by default. Names leave out the others; efforts, speeds and the like of the
        tip are asked for by name alone. A mapping adds variables: functions of the mechanism and
        postures (n, nq) that give a number for each, (n,). A sequence of names and mappings gives
        these alone. Of a map that is saved, or made by Dask, functions must
        pickle.

    Returns
    -------
    xarray.Dataset
        Per cell: ``status`` (an index into its ``flag_meanings``), ``joined`` (a bit for each axis
        along which the branch leads to the next cell), the three singular values, the two
        determinants (where the matrices are square), the condition number of the twist map and the
        residual, all missing (NaN) where the status is not ok. Opened from the store, and read
        from it as it is used, where there is one.

    Raises
    ------
    ClosureError
        Unknown coordinates, modes or outputs, values that do not rise or that no posture can have,
        a start or cells that cannot be reached, a map that does not fit into memory, a store that
        holds another map; measures that are none, or do not pickle where they have to.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> axis = np.linspace(-0.1, 0.1, 5)
    >>> cells = cc.singularity_map(m, {"x": axis, "y": axis}, progress=False)
    >>> dict(cells.sizes), bool((cells["status"] == 0).all())
    ({'x': 5, 'y': 5}, True)
    """
    require("a map is an xarray dataset, stored by zarr", "maps")
    # not above: threads, JSON and the like would take a fifth of the time of ``import closedchain``
    from closedchain.analysis.progress import reporting
    from closedchain.analysis.singularity.maps.anchor import anchor_of
    from closedchain.analysis.singularity.maps.choice import check_portable, chosen
    from closedchain.analysis.singularity.maps.journal import InMemory
    from closedchain.analysis.singularity.maps.rounds import fill
    from closedchain.analysis.singularity.maps.saving import opened, saved_run
    from closedchain.analysis.singularity.maps.scheduling import crew
    from closedchain.analysis.singularity.maps.spreading import Job
    from closedchain.analysis.singularity.maps.storage import in_memory
    from closedchain.analysis.singularity.maps.tiles import tiles_of

    names = mechanism.outputs(
        outputs if outputs is None or isinstance(outputs, str) else tuple(outputs)
    )
    grid = grid_of(mechanism, over, at, outputs=outputs, mode=mode)
    tiles = tiles_of(grid.shape, chunk, grid.names)
    choice = chosen(mechanism, names, grid.names, measures)
    if save is not None or client is not None or hasattr(workers, "get_executor"):
        check_portable(choice.functions)
    job = Job(grid, tiles, choice, keep_q=keep_q)
    anchor = anchor_of(grid)
    with reporting(progress) as report, crew(job, workers, client) as people:
        if save is None:
            store = in_memory(tiles, choice.every, mechanism.model.nq, keep_q=keep_q)
            warm(job, report)
            fill(job, anchor, store, InMemory(), people, report)
            arrays = {name: array for name, array in store.arrays.items() if name != "ends"}
            return labelled(grid, arrays, choice)
        with saved_run(Path(save), job) as run:
            if run is not None:
                warm(job, report)
                fill(job, anchor, run.store, run.journal, people, report)
    return opened(Path(save))


def warm(job: Job, report: Progress | None) -> None:
    """Make the machine code of a map before others need it, and say so."""
    if report is not None and not job.cells.ready():
        report(f"compiling {job.grid.chart.mechanism.name}", 0, 0)
    job.cells.warm()
