"""What maps and sets show, in words: for titles, captions, and readers who see no figure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from closedchain.analysis.survey.set_tables import DrawableSet

if TYPE_CHECKING:
    import xarray as xr

STATUS_WORDS = {
    "ok": "on the branch",
    "none found": "without a closed posture that was found",
    "other branch": "closing on another branch only",
    "joint limit": "beyond a joint limit",
    "behind a limit": "behind a joint limit",
    "not converged": "not converged",
}
_FIGURES = 5  # of a held value
_TIMES = " × "


def held_values(data: xr.Dataset) -> str:
    """What a map holds: "q3 = 0.52205 m, q4 = q5 = 0.54593 m"; empty where nothing is held."""
    groups: dict[str, list[str]] = {}
    for key, value in data.attrs.items():
        name = str(key).removeprefix("held_")
        if name == key or key.endswith("_units"):
            continue
        unit = str(data.attrs.get(f"{key}_units", ""))
        number = f"{float(value) + 0.0:.{_FIGURES}g}"
        groups.setdefault(f"{'0' if float(number) == 0.0 else number} {unit}".strip(), []).append(
            name
        )
    return ", ".join(" = ".join([*names, value]) for value, names in groups.items())


def heading(data: xr.Dataset) -> str:
    """Coordinates of a map, what it holds, outputs, and whose branch it is."""
    names = _TIMES.join(str(d) for d in data["status"].dims)
    held = held_values(data)
    start, mode = (str(data.attrs.get(key, "")) for key in ("start", "mode"))
    of = {"": "", "start": "a given start" if not mode else f"mode {mode}"}.get(start, start)
    parts = [
        f"{names}, held: {held}" if held else f"{names}, nothing held",
        f"outputs {data.attrs['outputs']}" if data.attrs.get("outputs") else "",
        f"branch of {of}" if of else "",
    ]
    return "; ".join(part for part in parts if part)


def account(found: DrawableSet, *, notes: bool = True) -> str:
    """What a set is and how it was found, in a sentence without its full stop."""
    over = _TIMES.join(found.over)
    if found.everywhere:
        return f"{found.kind}: every posture over {over} is singular"
    if not len(found.coordinates):
        said = f"{found.kind}: none found"
    else:
        said = f"{found.kind}: {_pieces(found)}"
    if found.missed is not None:
        said += (
            "; a grid twice as fine shows nothing else"
            if not found.missed
            else f"; on a grid twice as fine {found.missed} sign changes lie away from it"
        )
    if found.fit is not None:
        said += f"; {found.fit.text}"
    elif found.note and notes:
        said += f" ({found.note})"
    return said


def _pieces(found: DrawableSet) -> str:
    counts = {
        "triangle": sum(len(p) for p in found.pieces if p.ndim == 2),
        "curve": sum(p.ndim == 1 and p.size > 1 for p in found.pieces),
        "single point": sum(p.ndim == 1 and p.size == 1 for p in found.pieces),
    }
    said = " and ".join(f"{n} {what}{'s' if n > 1 else ''}" for what, n in counts.items() if n)
    if not counts["triangle"] and not counts["curve"]:
        return said
    return f"{said} through {len(found.coordinates)} points"


def method(data: xr.Dataset, sets: Iterable[DrawableSet]) -> str:
    """How the sets of a map were looked for, in a sentence."""
    sets = list(sets)
    cells = _TIMES.join(str(n) for n in data["status"].shape)
    if not sets:
        return f"Map of {cells} cells; no singular sets are drawn."
    grids = sorted({_TIMES.join(str(n) for n in found.grid) for found in sets if found.grid})
    grid = f"a grid of {' or '.join(grids)} cells" if grids else "a grid"
    unchecked = any(found.missed is None and not found.everywhere for found in sets)
    return (
        "Singular points are solved to rounding from sign changes, ends of the branch and least "
        f"values on {grid}; what lies between its lines altogether can be "
        f"missed{', and no finer grid was tried' if unchecked else ''}."
    )


def caption(data: xr.Dataset, sets: Iterable[DrawableSet], *, notes: bool = True) -> str:
    """What is to be said of a map and its sets: what is held, outputs, branch, how found.

    ``notes``: also how each set was sought where that is not as usual.
    """
    sets = list(sets)
    name = str(data.attrs.get("mechanism", "")) or "mechanism"
    accounts = [account(found, notes=notes) for found in sets]
    said = [f"{text[0].upper()}{text[1:]}." for text in accounts]
    return " ".join([f"{name}: {heading(data)}.", *said, method(data, sets)])


def description(data: xr.Dataset, sets: Iterable[DrawableSet], measures: Iterable[str]) -> str:
    """What the panels of a map show, for readers who do not see them."""
    status = data["status"]
    ranges = [
        f"{d} from {float(data[d][0]) + 0.0:.4g} to {float(data[d][-1]) + 0.0:.4g} "
        f"{data[d].attrs.get('units', '')}".rstrip()
        for d in status.dims
    ]
    said = [f"Map over {' and '.join(ranges)}."]
    shares = []
    codes = np.atleast_1d(status.attrs.get("flag_values", []))
    flags = str(status.attrs.get("flag_meanings", "")).split()
    for code, flag in zip(codes, flags, strict=True):
        share = float((status == code).mean())
        if share > 0.0:
            words = STATUS_WORDS.get(flag.replace("_", " "), flag)
            shares.append(f"{_percent(share)} {words}")
    said.append(f"Of its cells {', '.join(shares)}.")
    for name in measures:
        values = data[name].to_numpy()
        finite = values[np.isfinite(values)]
        if finite.size:
            low, high = float(finite.min()), float(finite.max())
            said.append(f"{name.replace('_', ' ')} runs from {low:.3g} to {high:.3g}.")
    return " ".join([caption(data, sets), *said])


def _percent(share: float) -> str:
    percent = 100.0 * share
    if 0.5 < percent < 99.5 or percent == 100.0:
        return f"{percent:.0f} %"
    return f"{percent:.2f} %" if percent > 50.0 else f"{percent:.1g} %"
