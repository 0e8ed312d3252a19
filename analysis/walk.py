"""Walking a grid of input values along one assembly branch, cell by cell from an anchor.

Each cell is reached from a solved neighbour by continuation; a cell that no neighbour leads to is
labelled, never filled with a guess: on another branch where some closed posture was found for its
inputs, unreachable where none was.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.constraints import flipped_axes
from closedchain.closure.continuation import Followed, follow
from closedchain.closure.equations import Corrected, Equations, correct
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.position import direct
from closedchain.closure.trust_region import descend
from closedchain.urdf.errors import ClosureError, known_names

STATUSES = ("ok", "unreachable", "other branch", "joint limit")
OK, UNREACHABLE, OTHER_BRANCH, JOINT_LIMIT = range(4)
UNSEEN = -1

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much there is."""

_SMALLEST_STEP = 1e-4  # share of a cell; a fold is located better than this when it is polished
_LATTICE = 16  # cells an axis from which other branches are sought
_STARTS = 10  # random starts at each of them
_DESCENT = 60  # evaluations of one start
_SETTLED = 1e-2  # a squared gap that cannot be lowered by more than this share stays open


@dataclass(frozen=True, eq=False)
class Grid:
    """Values of some inputs, the others held.

    Attributes
    ----------
    names : tuple of str
        Inputs that vary, one an axis.
    values : tuple of (n_i,) arrays
        Rising values along each axis.
    base : (n_inputs,) array
        Values of all inputs; those that vary are replaced.
    start : (nq,) array
        Closed posture whose branch is followed.
    """

    names: tuple[str, ...]
    values: tuple[np.ndarray, ...]
    base: np.ndarray
    start: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis."""
        return tuple(v.size for v in self.values)

    def columns(self, mechanism: Mechanism) -> list[int]:
        """Position of each varying input among the inputs."""
        return [mechanism.inputs.index(name) for name in self.names]

    def inputs(self, mechanism: Mechanism, cell: tuple[int, ...]) -> np.ndarray:
        """Input values (n_inputs,) of a cell."""
        target = self.base.copy()
        target[self.columns(mechanism)] = [v[i] for v, i in zip(self.values, cell, strict=True)]
        return target


@dataclass(frozen=True, eq=False)
class Walk:
    """Outcome of a walk: status (shape) of int, and q (shape, nq) valid where the status is OK."""

    grid: Grid
    status: np.ndarray
    q: np.ndarray


def grid_of(
    mechanism: Mechanism,
    over: Mapping[str, ArrayLike],
    at: Mapping[str, float] | ArrayLike | None = None,
) -> Grid:
    """Check the coordinates of a map.

    Parameters
    ----------
    over : mapping of input name to rising values
    at : mapping of input name to value, or (nq,) array, optional
        Held inputs, or a posture that states them and the branch; home by default.

    Raises
    ------
    ClosureError
        Unknown names, values that do not rise, a held input that also varies, or held inputs that
        the branch of home does not reach.
    """
    if not over:
        raise ClosureError("a map needs at least one input to vary, such as over={'q1': values}")
    for name in over:
        if name not in mechanism.inputs:
            raise ClosureError(known_names(str(name), "input", mechanism.inputs))
    values = tuple(_axis(name, v) for name, v in over.items())
    start = mechanism.home
    if isinstance(at, Mapping):
        for name in at:
            if name not in mechanism.inputs:
                raise ClosureError(known_names(str(name), "input", mechanism.inputs))
            if name in over:
                raise ClosureError(f"input {name!r} both varies and is held")
        home = mechanism.input_values(mechanism.home)
        wanted = dict(zip(mechanism.inputs, home, strict=True)) | dict(at)
        start = direct(mechanism, wanted).raise_if_failed().q
    elif at is not None:
        start = mechanism.configuration(at)
    return Grid(tuple(over), values, start[mechanism.input_q], start)


def _axis(name: str, values: ArrayLike) -> np.ndarray:
    axis = np.array(values, dtype=float)
    if axis.ndim != 1 or axis.size < 2 or not np.isfinite(axis).all() or (np.diff(axis) <= 0).any():
        raise ClosureError(f"values of {name!r} must be at least two finite, rising numbers")
    return axis


def walk(mechanism: Mechanism, grid: Grid, progress: Progress | None = None) -> Walk:
    """Follow the branch of the grid's start over all cells.

    Raises
    ------
    ClosureError
        The cell nearest to the start cannot be reached from it.
    """
    status = np.full(grid.shape, UNSEEN, dtype=np.int8)
    postures = np.zeros((*grid.shape, mechanism.model.nq))
    equations = Equations(mechanism, mechanism.passive_v)
    anchor, first = _anchor(mechanism, grid, equations)
    for cell, q in _spread(equations, grid, status, OK, anchor, first, progress):
        postures[cell] = q
    _label(equations, grid, status, progress)
    return Walk(grid, status, postures)


def _spread(
    equations: Equations,
    grid: Grid,
    status: np.ndarray,
    label: int,
    anchor: tuple[int, ...],
    first: Corrected,
    progress: Progress | None,
) -> Iterator[tuple[tuple[int, ...], np.ndarray]]:
    """Reach every unseen cell that the branch of ``first`` reaches; yield its cells and postures.

    Cells with joints beyond their limits are walls: the walk does not go on behind them.
    """
    mechanism = equations.mechanism
    status[anchor] = label
    frontier = deque([(anchor, first)])
    done = int(np.count_nonzero(status != UNSEEN))
    yield anchor, first.q
    while frontier:
        cell, here = frontier.popleft()
        for beside in _neighbours(cell, grid.shape):
            if status[beside] != UNSEEN:
                continue
            path = _follow_inputs(equations, here, grid.inputs(mechanism, beside))
            if path.refusal is not None:
                continue
            within = not beyond_limits(mechanism, path.last.q)
            if within:
                status[beside] = label
                done += 1
                frontier.append((beside, path.last))
                yield beside, path.last.q
            elif label == OK:
                status[beside] = JOINT_LIMIT
        if progress is not None:
            progress("following the branch", done, status.size)


def _anchor(
    mechanism: Mechanism, grid: Grid, equations: Equations
) -> tuple[tuple[int, ...], Corrected]:
    columns = grid.columns(mechanism)
    anchor = tuple(
        int(np.abs(v - grid.base[c]).argmin()) for v, c in zip(grid.values, columns, strict=True)
    )
    target = grid.inputs(mechanism, anchor)
    found = direct(mechanism, target, guess=grid.start)
    first = correct(equations, found.q)
    if not found.converged or first.refusal is not None:
        raise ClosureError(f"the map's first cell cannot be reached: {found.message}")
    return anchor, first


def _follow_inputs(equations: Equations, here: Corrected, target: np.ndarray) -> Followed:
    mechanism = equations.mechanism
    begin = here.q[mechanism.input_q]

    def at(q: np.ndarray, t: float) -> tuple[Equations, np.ndarray]:
        q = q.copy()
        q[mechanism.input_q] = begin + t * (target - begin)
        return equations, q

    return follow(at, here, _SMALLEST_STEP)


def _label(equations: Equations, grid: Grid, status: np.ndarray, progress: Progress | None) -> None:
    """Say of every cell that the branch does not reach whether the loops close there at all.

    Closed postures on other branches are sought from random starts on a lattice of cells and
    followed from there. "unreachable" is therefore a numerical verdict: none was found.
    """
    mechanism = equations.mechanism
    rng = np.random.default_rng(0)
    lattice = [range(n // (2 * _LATTICE), n, max(1, n // _LATTICE)) for n in grid.shape]
    tried = 0
    for cell in product(*lattice):
        tried += 1
        if status[cell] != UNSEEN:
            continue
        for _ in range(_STARTS):
            q = _random_posture(mechanism, rng)
            q[mechanism.input_q] = grid.inputs(mechanism, cell)
            found = descend(equations, q, evaluations=_DESCENT, settle=_SETTLED)
            if not found.closed or beyond_limits(mechanism, found.q):
                continue
            if flipped_axes(mechanism, found.q):
                continue  # the rows vanish, but a cut joint is mirrored: that is no posture
            first = correct(equations, found.q)
            if first.refusal is None:
                for _ in _spread(equations, grid, status, OTHER_BRANCH, cell, first, None):
                    pass
                break
        if progress is not None:
            progress("searching other branches", tried, math.prod(map(len, lattice)))
    status[status == UNSEEN] = UNREACHABLE


def _random_posture(mechanism: Mechanism, rng: np.random.Generator) -> np.ndarray:
    """Posture (nq,) far around home: any angle and attitude, lengths within about ``length``."""
    model = mechanism.model
    v = rng.uniform(-np.pi, np.pi, model.nv)
    slides = mechanism.translational
    v[slides] = mechanism.column_scale[slides] * rng.standard_normal(np.count_nonzero(slides))
    return np.asarray(pin.integrate(model, mechanism.home, v))


def _neighbours(cell: tuple[int, ...], shape: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    for axis, size in enumerate(shape):
        for step in (-1, 1):
            i = cell[axis] + step
            if 0 <= i < size:
                yield (*cell[:axis], i, *cell[axis + 1 :])
