"""Colours, hatches and words of the figures of singularity maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.singularity.kinds import COMBINED, KINDS
from closedchain.urdf.errors import ClosureError, known_names

if TYPE_CHECKING:
    import xarray as xr

_DRAWN = (KINDS["direct"], KINDS["inverse"], COMBINED, KINDS["constraint"])
COLOURS = {kind.name: kind.colour for kind in _DRAWN}
DASHES = {kind.name: (0, kind.dashes) if kind.dashes else "-" for kind in _DRAWN}
HATCHES = {"direct": "||", "inverse": "--", "combined": "**", "constraint": "\\\\"}
"""Of a map that is singular of a kind everywhere."""
MARKERS = {"direct": "o", "inverse": "s", "combined": "D", "constraint": "^"}
EDGES = {"direct": 0.0, "inverse": 0.35, "combined": 0.0, "constraint": 0.7}
"""Width of the edges of triangles: surfaces differ by them without their colours."""
KIND_LABELS = {kind.name: kind.label for kind in _DRAWN}
GREY = "#888888"


@dataclass(frozen=True)
class Scheme:
    """Colours of a figure: lines and faces of kinds, and colour maps by the scale of a measure.

    ``blanks``: whether cells without a posture have colours beside their hatches.
    """

    kinds: Mapping[str, str]
    faces: Mapping[str, str]
    maps: Mapping[str, str]
    blanks: bool


COLOURED = Scheme(
    COLOURS, COLOURS, {"zero": "cividis", "signed": "PRGn", "log": "viridis_r"}, blanks=True
)
"""All maps even in lightness or safe for the colour-blind."""
PRINTED = Scheme(
    dict.fromkeys(COLOURS, "#000000") | {"constraint": "#444444"},
    {"direct": "#909090", "inverse": "#FFFFFF", "combined": "#404040", "constraint": "#D0D0D0"},
    {"zero": "Greys", "signed": "Greys", "log": "Greys_r"},  # light where it is singular
    blanks=False,
)
"""For print without colours: kinds differ by dashes and markers, cells by hatches."""


@dataclass(frozen=True)
class Blank:
    """How cells without a posture are shown."""

    label: str
    colour: str
    hatch: str


BLANKS = {
    "none found": Blank("no closed posture found", "#FFFFFF", "xxx"),
    "other branch": Blank("closes on another branch only", "#DDDDDD", "//"),
    "joint limit": Blank("beyond a joint limit", "#F0E4B0", ".."),
    "behind a limit": Blank("behind a joint limit", "#F7EFD6", "oo"),
    "not converged": Blank("not converged", "#EBDCEB", "++"),
}


@dataclass(frozen=True)
class Measure:
    """A variable of a map: what to write beside its colours, and how to spread them.

    ``kind`` is the kind of singularity that it watches, None where it watches none. ``scale`` is
    "zero" (from zero upwards), "signed" or "log".
    """

    label: str
    kind: str | None
    scale: str


MEASURES = {
    "sigma_direct": Measure(r"$\sigma_{\mathrm{direct}}$", "direct", "zero"),
    "sigma_inverse": Measure(r"$\sigma_{\mathrm{inverse}}$", "inverse", "zero"),
    "sigma_constraint": Measure(r"$\sigma_{\min}(K)$", "constraint", "zero"),
    "det_direct": Measure(r"$\det K_p$", "direct", "signed"),
    "det_inverse": Measure(r"$\det\,[K; J]$", "inverse", "signed"),
    "condition": Measure("condition number of the twist map", None, "log"),
    "residual": Measure("largest closure row", None, "log"),
}


KEPT_BESIDE = ("status", "joined", "ends", "q")
"""Variables of a map that are no measures."""


def measure_of(data: xr.Dataset, name: str) -> Measure:
    """The measure of that name, which the map must have.

    Raises
    ------
    ClosureError
        Unknown measure, or one that this map has not.
    """
    others = [str(n) for n in data.data_vars if n not in MEASURES and n not in KEPT_BESIDE]
    if name in others and data[name].dims == data["status"].dims:
        return _other(data, name)
    if name not in MEASURES:
        raise ClosureError(known_names(name, "measure", [*MEASURES, *others]))
    if name not in data:
        there = [m for m in (*MEASURES, *others) if m in data]
        raise ClosureError(
            f"the map over {' x '.join(map(str, data['status'].dims))} has no {name!r} (its matrix "
            f"is not square there); it has {', '.join(there)}"
        )
    return MEASURES[name]


def _other(data: xr.Dataset, name: str) -> Measure:
    """How a measure that is not of the table is drawn: by its own words and the sign it takes."""
    words, unit = data[name].attrs.get("long_name", name), data[name].attrs.get("units", "")
    label = f"{words} [{unit}]" if unit and unit != "1" else str(words)
    return Measure(label, None, "signed" if float(data[name].min(skipna=True)) < 0.0 else "zero")


def colour_range(values: np.ndarray, scale: str) -> tuple[np.ndarray, dict[str, Any], str]:
    """Values fit to be drawn, arguments of ``pcolormesh``, and which end of the bar is open."""
    from matplotlib.colors import LogNorm

    finite = values[np.isfinite(values)]
    if scale == "zero":
        return values, {"vmin": 0.0, "vmax": float(finite.max(initial=0.0)) or 1.0}, "neither"
    if scale == "signed":
        most = float(np.abs(finite).max(initial=0.0)) or 1.0
        return values, {"vmin": -most, "vmax": most}, "neither"
    positive = finite[finite > 0.0]
    if not positive.size:
        return values, {"norm": LogNorm(1.0, 10.0)}, "both"
    low, high = float(positive.min()), float(np.quantile(positive, 0.98))
    high = max(high, 1.01 * low)
    shown = np.where(np.isposinf(values), 2.0 * max(high, float(positive.max())), values)
    shown = np.where(shown <= 0.0, low, shown)
    open_end = "max" if np.nanmax(shown) > high else "neither"
    return shown, {"norm": LogNorm(low, high)}, open_end


def statuses_of(data: xr.Dataset) -> dict[str, int]:
    """Code of each status of a map, by name.

    Raises
    ------
    ClosureError
        No map: ``status`` is missing or does not say what its numbers mean.
    """
    if "status" not in data:
        raise ClosureError("no singularity map: the variable 'status' is missing")
    attrs = data["status"].attrs
    names = str(attrs.get("flag_meanings", "")).split()
    codes = np.atleast_1d(attrs.get("flag_values", []))
    if not names or len(names) != codes.size or "ok" not in names:
        raise ClosureError("no singularity map: 'status' does not say what its numbers mean")
    return {name.replace("_", " "): int(code) for name, code in zip(names, codes, strict=True)}


def start_of(data: xr.Dataset) -> tuple[str, list[float]] | None:
    """Name and coordinates of the posture that the map starts from, None where it is not known."""
    values = [data.attrs.get(f"start_{name}") for name in data["status"].dims]
    numbers = [float(value) for value in values if value is not None]
    if len(numbers) < len(values):
        return None
    return str(data.attrs.get("start", "start")), numbers


def blank_colour(name: str, scheme: Scheme) -> str:
    """Colour of cells of a status that have no posture; white in print, where hatches tell."""
    return BLANKS[name].colour if scheme.blanks else "#FFFFFF"


def start_within(data: xr.Dataset) -> tuple[str, list[float]] | None:
    """``start_of`` where it lies in the range of the map, else None: it is not drawn then."""
    start = start_of(data)
    if start is None:
        return None
    for name, value in zip(data["status"].dims, start[1], strict=True):
        low, high = float(data[name][0]), float(data[name][-1])
        if not low - 1e-9 <= value <= high + 1e-9:
            return None
    return start


def axis_label(data: xr.Dataset, name: str) -> str:
    """Name and unit of a coordinate."""
    unit = data[name].attrs.get("units", "")
    return f"{name} [{unit}]" if unit else name
