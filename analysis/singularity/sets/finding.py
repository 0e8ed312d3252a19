"""Singular sets of a slice of chart coordinates: the entry point and its checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from closedchain.analysis.singularity.maps.grid import grid_of
from closedchain.analysis.singularity.sets.curves import curves_on, is_everywhere
from closedchain.analysis.singularity.sets.cusps import cusps_of
from closedchain.analysis.singularity.sets.lattice import Lattice, finer, lattice_on
from closedchain.analysis.singularity.sets.meeting import meeting
from closedchain.analysis.singularity.sets.singular_set import KINDS, SingularitySet
from closedchain.analysis.singularity.sets.surfaces import surface_set
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.progress import Progress
from closedchain.urdf.errors import ClosureError, known_names

BOTH = ("direct", "inverse")
MOST_CHECKED = 200_000  # cells of a grid twice as fine that is walked without being asked for


def singularity_set(
    mechanism: Mechanism,
    kind: str,
    over: Mapping[str, ArrayLike],
    at: Mapping[str, float] | ArrayLike | None = None,
    *,
    mode: str | int | None = None,
    outputs: str | Sequence[str] | None = None,
    check: bool | None = None,
    cusps: bool = False,
    progress: bool | Progress = False,
) -> SingularitySet:
    """Find the singular postures of one kind over a range of two or three coordinates.

    The branch of the start is followed over a grid. Where the kind's matrix is square, its sets
    are curves over two coordinates, traced by continuation with steps of half a cell, and
    surfaces over three. Where it is not, with more inputs or fewer outputs than freedoms, the set
    has a higher codimension: it is sought from the least singular values of the grid.

    Parameters
    ----------
    kind : "direct", "inverse", "combined" or "constraint"
    over : mapping of two or three coordinates to rising values [m or rad]
        As for ``singularity_map``. Curves are found if they pass between two neighbours, or bound
        the branch; what lies between grid lines altogether can be missed.
    at : mapping of coordinate to value, or (nq,) array, optional
        Held coordinates, or a posture whose branch is followed; home by default.
    mode : str or int, optional
        Named posture of the mechanism, or mode by name or number, to start from.
    outputs : str, optional
        Outputs of the task; those of the description by default.
    check : bool, optional
        Look for what was missed on a grid twice as fine, which has four or eight times as many
        cells. By default where these are no more than ``MOST_CHECKED``.
    cusps : bool
        Also find the cusps of curves at which the coordinates fold, see ``SingularitySet.cusps``.
    progress : bool or callable
        True shows a bar on a terminal; a callable gets (what, done, total).

    Returns
    -------
    SingularitySet

    Raises
    ------
    ClosureError
        Unknown kind, coordinates, mode or outputs, not two or three coordinates, values that do
        not rise or that no posture can have, a start that cannot be reached.

    Examples
    --------
    >>> m = cc.load("d1")
    >>> home, step = m.input_values(m.home), np.linspace(-0.1, 0.1, 7)
    >>> over = {"q1": home[0] + step, "q4": home[3] + step}
    >>> found = cc.singularity_set(m, "direct", over)
    >>> found.dimension, bool(found.sigmas[:, 0].max() < 1e-10)
    (1, True)
    """
    from closedchain.analysis.progress import reporting

    if kind not in KINDS:
        raise ClosureError(known_names(str(kind), "kind of singularity", KINDS))
    if len(over) not in (2, 3):
        raise ClosureError(
            "a singular set needs two coordinates to vary (curves) or three (surfaces), got "
            f"{' '.join(map(str, over)) or 'none'}"
        )
    names = mechanism.outputs(
        outputs if outputs is None or isinstance(outputs, str) else tuple(outputs)
    )
    grid = grid_of(mechanism, over, at, outputs=names, mode=mode)
    with reporting(progress) as report:
        lattice = lattice_on(grid, names, report)
        if check is None:
            check = lattice.ok.size * 2 ** len(grid.values) <= MOST_CHECKED
        found = set_of(lattice, kind, names, report, check=check)
        if not cusps:
            return found
        places = cusps_of(found, names)
        nq = mechanism.model.nq
        return replace(found, cusps=places[:, nq:], cusps_q=places[:, :nq])


def set_of(
    lattice: Lattice,
    kind: str,
    outputs: tuple[str, ...],
    progress: Progress | None = None,
    *,
    check: bool = False,
) -> SingularitySet:
    """Singular set of a kind on a lattice; ``check`` it against a grid twice as fine."""
    found = _sought(lattice, kind, outputs, progress, check=check)
    return replace(found, grid=lattice.ok.shape)


def _sought(
    lattice: Lattice,
    kind: str,
    outputs: tuple[str, ...],
    progress: Progress | None,
    *,
    check: bool,
) -> SingularitySet:
    if kind == "combined":
        one, two = (set_of(lattice, k, outputs, progress, check=check) for k in BOTH)
        branch = [lattice, finer(lattice, progress)] if check else [lattice]
        return meeting(branch, one, two, outputs)
    square = kind in lattice.det or kind == lattice.chart.folds
    if len(lattice.values) == 3 and square and not is_everywhere(lattice, kind):
        return surface_set(lattice, kind, outputs, progress, check=check)
    return curves_on(lattice, kind, outputs, progress, check=check)


__all__ = ["SingularitySet", "set_of", "singularity_set"]
