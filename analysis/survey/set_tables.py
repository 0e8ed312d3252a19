"""Singular sets as tables: written to files, read back, and what the figures need of a set."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from closedchain.analysis.singularity.sets.mesh_fit import Fit
from closedchain.urdf.errors import ClosureError

if TYPE_CHECKING:
    import xarray as xr

    from closedchain.analysis.singularity.sets.singular_set import SingularitySet

KIND_FLAGS = {"direct": 1, "inverse": 2, "constraint": 4}
"""Bits of the variable ``kinds`` of a table."""
_SIGMAS = ("direct", "inverse", "constraint")
_FIT = "mesh_"
_TEXTS = ("kind", "verdict", "note")


class DrawableSet(Protocol):
    """What a figure needs of a singular set, see ``SingularitySet``."""

    @property
    def kind(self) -> str:
        """Kind of singularity."""

    @property
    def over(self) -> tuple[str, ...]:
        """Coordinates that vary."""

    @property
    def coordinates(self) -> np.ndarray:
        """Their values (N, k) [m or rad]."""

    @property
    def pieces(self) -> tuple[np.ndarray, ...]:
        """Indices of points: polylines (n,) and meshes (T, 3)."""

    @property
    def ends(self) -> tuple[tuple[str, str], ...]:
        """How each polyline begins and ends."""

    @property
    def on_branch(self) -> np.ndarray:
        """Which points (N,) the branch of the map reaches."""

    @property
    def everywhere(self) -> bool:
        """Whether all of the map is singular of this kind."""

    @property
    def missed(self) -> int | None:
        """Sign changes of a finer grid away from the set; None: not checked."""

    @property
    def grid(self) -> tuple[int, ...]:
        """Cells along each axis of the grid from which it was sought."""

    @property
    def fit(self) -> Fit | None:
        """How well the triangles of a surface lie on it."""

    @property
    def note(self) -> str:
        """What else there is to say."""


@dataclass(frozen=True, eq=False)
class SavedSet:
    """A singular set read from a file; the attributes are those of ``SingularitySet``."""

    kind: str
    over: tuple[str, ...]
    units: tuple[str, ...]
    coordinates: np.ndarray
    q: np.ndarray
    kinds: tuple[frozenset[str], ...]
    sigmas: np.ndarray
    dimension: int
    pieces: tuple[np.ndarray, ...]
    ends: tuple[tuple[str, str], ...]
    on_branch: np.ndarray
    everywhere: bool
    verdict: str
    note: str
    dropped: int = 0
    missed: int | None = None
    fit: Fit | None = None
    grid: tuple[int, ...] = ()


def polylines(found: DrawableSet) -> list[tuple[np.ndarray, bool]]:
    """Indices of points along what is drawn at a stroke, and whether it is on the map's branch.

    Closed curves get their first point again. A curve that leaves the branch is cut there.
    """
    on_branch = found.on_branch
    lines = []
    for i, piece in enumerate(found.pieces):
        if piece.ndim != 1 or not piece.size:
            continue
        closed = i < len(found.ends) and found.ends[i] == ("closed", "closed")
        line = np.append(piece, piece[0]) if closed and piece.size > 2 else piece
        cuts = np.flatnonzero(np.diff(on_branch[line].astype(int))) + 1
        for begin, end in zip([0, *cuts], [*cuts, line.size], strict=True):
            # one point more: the stroke goes on to where the next one begins
            stroke = line[begin : end + 1]
            if stroke.size > 1 or line.size == 1:
                lines.append((stroke, bool(on_branch[line[begin]])))
    return lines


def table(found: SingularitySet | SavedSet) -> xr.Dataset:
    """Table of a set.

    Pieces of different lengths lie one after the other: ``piece_vertices`` (points of polylines)
    and ``triangles``, with the number of them in each piece in ``piece_size``.
    """
    import xarray as xr

    mesh = found.dimension == 2
    sizes = np.array([len(piece) for piece in found.pieces], dtype=np.int64)
    indices = {
        "piece_vertices": ("vertex", _joined(found.pieces if not mesh else (), (0,))),
        "triangles": (("triangle", "corner"), _joined(found.pieces if mesh else (), (0, 3))),
    }
    flags = [sum(KIND_FLAGS[k] for k in kinds) for kinds in found.kinds]
    units = dict(zip(found.over, found.units, strict=True))
    columns = {
        f"value_{name}": ("point", found.coordinates[:, i], {"units": units[name]})
        for i, name in enumerate(found.over)
    }
    data = xr.Dataset(
        {
            **columns,
            "q": (("point", "nq"), found.q, {"long_name": "configuration", "units": "m or rad"}),
            "kinds": (
                "point",
                np.array(flags, dtype=np.int8),
                {
                    "flag_masks": list(KIND_FLAGS.values()),
                    "flag_meanings": " ".join(KIND_FLAGS),
                },
            ),
            "on_branch": ("point", found.on_branch.astype(np.int8)),
            **{
                f"sigma_{kind}": ("point", found.sigmas[:, i], {"units": "1"})
                for i, kind in enumerate(_SIGMAS)
            },
            "piece_size": ("piece", sizes),
            **indices,
        }
    )
    data.attrs = {
        **{name: getattr(found, name) for name in _TEXTS},
        "over": "\t".join(found.over),
        "dimension": found.dimension,
        "everywhere": int(found.everywhere),
        "dropped": found.dropped,
        "grid": "\t".join(map(str, found.grid)),
        "missed": -1 if found.missed is None else found.missed,
        **({} if found.fit is None else _fit_labels(found.fit)),
        # netCDF attributes hold lists of texts badly: a line for each polyline
        "ends": "\n".join("\t".join(pair) for pair in found.ends),
    }
    return data


def read_table(data: xr.Dataset) -> SavedSet:
    """Set of a table.

    Raises
    ------
    ClosureError
        No table of a singular set.
    """
    try:
        return _read(data)
    except (KeyError, ValueError, IndexError, TypeError, AttributeError) as error:
        raise ClosureError(f"no table of a singular set: {error}") from None


def _read(data: xr.Dataset) -> SavedSet:
    over = tuple(data.attrs["over"].split("\t"))
    n = data.sizes["point"]
    dimension = int(data.attrs["dimension"])
    whole = data["triangles" if dimension == 2 else "piece_vertices"].to_numpy()
    sizes = data["piece_size"].to_numpy()
    if sizes.sum() != len(whole) or (whole.size and not 0 <= whole.min() <= whole.max() < n):
        raise ValueError("its pieces name points that are not there")
    pieces = tuple(np.split(whole, np.cumsum(sizes)[:-1])) if sizes.size else ()
    flags = data["kinds"].to_numpy()
    lines = str(data.attrs["ends"]).splitlines()
    return SavedSet(
        kind=str(data.attrs["kind"]),
        over=over,
        units=tuple(str(data[f"value_{name}"].attrs["units"]) for name in over),
        coordinates=np.stack([data[f"value_{name}"].to_numpy() for name in over], axis=1),
        q=data["q"].to_numpy(),
        kinds=tuple(frozenset(k for k, bit in KIND_FLAGS.items() if f & bit) for f in flags),
        sigmas=np.stack([data[f"sigma_{kind}"].to_numpy() for kind in _SIGMAS], axis=1),
        dimension=dimension,
        pieces=pieces,
        ends=tuple((a, b) for a, _, b in (line.partition("\t") for line in lines)),
        on_branch=data["on_branch"].to_numpy().astype(bool),
        everywhere=bool(data.attrs["everywhere"]),
        verdict=str(data.attrs["verdict"]),
        note=str(data.attrs["note"]),
        dropped=int(data.attrs.get("dropped", 0)),
        missed=missed if (missed := int(data.attrs.get("missed", -1))) >= 0 else None,
        fit=_read_fit(data),
        grid=tuple(int(n) for n in str(data.attrs.get("grid", "")).split()),
    )


def _fit_labels(fit: Fit) -> dict[str, float]:
    return {f"{_FIT}{name.name}": getattr(fit, name.name) for name in fields(fit)}


def _read_fit(data: xr.Dataset) -> Fit | None:
    if f"{_FIT}tolerance" not in data.attrs:
        return None
    values = {name.name: data.attrs[f"{_FIT}{name.name}"].item() for name in fields(Fit)}
    return Fit(**values)


def _joined(pieces: tuple[np.ndarray, ...], empty: tuple[int, ...]) -> np.ndarray:
    none: Any = np.zeros(empty, dtype=np.int64)
    return np.concatenate([none, *pieces]).astype(np.int64)
