"""Figures of a transmission: a line for each motor over one joint, coloured maps over two."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.figures.saving import save_figure, words_of
from closedchain.analysis.figures.strokes import stroke
from closedchain.urdf.errors import ClosureError
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    import xarray as xr


def draw_transmission(found: xr.Dataset, image: Path, dpi: int = 130) -> None:
    """Draw a table of ``cc.transmission_table`` over one or two joints.

    Over two joints, grey is where nothing is reached or a motor would be beyond its limits.

    Raises
    ------
    ClosureError
        A table over more joints.
    """
    require("figures are drawn with matplotlib", "figures")
    from matplotlib.figure import Figure

    joints = [str(name) for name in found["joints"].values]
    if len(joints) > 2:
        raise ClosureError(f"a table over {len(joints)} joints is not drawn; one or two are")
    panels = _panels(found, joints)
    polygons = len(joints) == 2 and "effort_corners" in found
    count = len(panels) + polygons
    columns = min(count, 3)
    rows = -(-count // columns)
    figure = Figure(figsize=(4.6 * columns, 3.6 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (label, lines) in zip(axes, panels, strict=False):
        if len(joints) == 1:
            _lines(ax, found, joints[0], label, lines)
        else:
            _map(ax, found, joints, label, next(iter(lines.values())))
    if polygons:
        _polygons(axes[len(panels)], found, joints)
    for ax in axes[count:]:
        ax.set_axis_off()
    shown = (found["reached"] & found["within"]).values.all() or len(joints) < 2
    grey = "" if shown else "; grey: out of reach, or motors beyond their limits"
    figure.suptitle(f"{found.attrs['mechanism']}: {', '.join(joints)}{grey}")
    save_figure(figure, image, words_of(figure), dpi)


def _polygons(ax: Any, found: xr.Dataset, joints: list[str]) -> None:
    """What the motors hold at both joints together: in the middle of the table, and at its ends."""
    from scipy.spatial import ConvexHull

    corners = found["effort_corners"].values
    last = [size - 1 for size in corners.shape[:2]]
    places = [(last[0] // 2, last[1] // 2), *((a * last[0], b * last[1]) for a in (0, 1)
                                             for b in (0, 1))]  # fmt: skip
    for place in dict.fromkeys(places):
        points = corners[place]
        if not np.isfinite(points).all() or np.linalg.matrix_rank(points - points[0]) < 2:
            continue
        ring = points[ConvexHull(points).vertices]
        at = zip(
            joints, (found[n].values[i] for n, i in zip(joints, place, strict=True)), strict=True
        )
        label = ", ".join(f"{name} {value:.3g}" for name, value in at)
        ax.plot(*np.vstack([ring, ring[:1]]).T, label=label, **stroke(len(ax.lines)))
    ax.axhline(0.0, color="black", lw=0.6)
    ax.axvline(0.0, color="black", lw=0.6)
    units = ["N" if found[n].attrs["units"] == "m" else "N m" for n in joints]
    ax.set(
        xlabel=f"effort of {joints[0]} [{units[0]}]", ylabel=f"effort of {joints[1]} [{units[1]}]"
    )
    ax.set_title("both efforts together, at")
    ax.legend(loc="center", fontsize=7)  # inside of the parallelograms


def _panels(found: xr.Dataset, joints: list[str]) -> list[tuple[str, dict[str, np.ndarray]]]:
    """What to draw: a label, and arrays over the joints by name; maps hold one each."""
    motors = [str(name) for name in found["motors"].values]
    units = dict(zip(motors, np.atleast_1d(found.attrs["motor_units"]), strict=True))
    y, j = found["motor"].values, found["jacobian"].values
    panels: list[tuple[str, dict[str, np.ndarray]]] = []
    for i, motor in enumerate(motors):
        panels.append((f"{motor} [{units[motor]}]", {motor: y[..., i]}))
    for i, motor in enumerate(motors):
        panels += [(f"d {motor} / d {n}", {motor: j[..., i, k]}) for k, n in enumerate(joints)]
    panels.append(("distance from a toggle", {"": found["toggle"].values}))
    inertia = found["reflected_inertia"].values
    for k, joint in enumerate(joints):
        if np.nan_to_num(inertia[..., k, k]).any():
            unit = "kg" if found[joint].attrs["units"] == "m" else "kg m²"
            panels.append((f"rotors felt at {joint} [{unit}]", {"": inertia[..., k, k]}))
    for k, joint in enumerate(joints):
        unit = found[joint].attrs["units"]
        if "effort_limits" in found:
            both = found["effort_limits"].values[..., k]
            name = f"largest effort of {joint} [{'N' if unit == 'm' else 'N m'}]"
            panels.append((name, {"largest": both[..., 1], "least": both[..., 0]}))
        if "speed_limits" in found:
            speed = found["speed_limits"].values[..., k]
            panels.append((f"largest speed of {joint} [{unit}/s]", {"": speed}))
    return panels


def _lines(
    ax: Any, found: xr.Dataset, joint: str, label: str, lines: dict[str, np.ndarray]
) -> None:
    at = found[joint]
    for i, (name, values) in enumerate(lines.items()):
        ax.plot(at.values, values, label=name or None, **stroke(i))
    if len(lines) > 1:
        ax.legend()
    ax.set_xlabel(f"{joint} [{at.attrs['units']}]")
    ax.set_ylabel(label)
    ax.grid(alpha=0.3)


def _map(ax: Any, found: xr.Dataset, joints: list[str], label: str, values: np.ndarray) -> None:
    x, y = (found[name] for name in joints)
    there = np.where(found["within"].values, values, np.nan)
    shown = ax.pcolormesh(x.values, y.values, there.T, cmap="cividis", shading="nearest")
    ax.set_facecolor("#DDDDDD")
    ax.figure.colorbar(shown, ax=ax)
    ax.set_title(label)
    ax.set_xlabel(f"{joints[0]} [{x.attrs['units']}]")
    ax.set_ylabel(f"{joints[1]} [{y.attrs['units']}]")
