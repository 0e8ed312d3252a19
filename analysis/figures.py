"""Figures of singularity maps: filled measures, curves by kind, cells without a posture hatched."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closedchain.analysis.curves import SingularitySet
from closedchain.analysis.survey import Slice, Survey
from closedchain.analysis.walk import JOINT_LIMIT, OTHER_BRANCH, UNREACHABLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's palette: told apart with any colour vision
COLOURS = {"direct": "#D55E00", "inverse": "#0072B2", "combined": "#000000", "home": "#FFFFFF"}
_BLANKS = {
    UNREACHABLE: ("unreachable: no closed posture found", "#FFFFFF", "xxx"),
    OTHER_BRANCH: ("closes on another branch only", "#DDDDDD", "//"),
    JOINT_LIMIT: ("beyond a joint limit", "#F0E4B0", ".."),
}
_COLUMNS = (("sigma_direct", "direct"), ("sigma_inverse", "inverse"))


def draw_survey(result: Survey, path: Path) -> None:
    """Draw a survey: a row for each slice, a column for each measure; write an image file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = len(result.slices)
    figure = Figure(figsize=(12.0, 5.0 * rows + 1.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, 2, squeeze=False)
    for part, pair in zip(result.slices, axes, strict=True):
        for (measure, kind), ax in zip(_COLUMNS, pair, strict=True):
            _draw_slice(result, part, ax, measure, kind)
    figure.legend(
        handles=_legend(result), loc="outside lower center", ncols=3, frameon=False, fontsize=9
    )
    figure.suptitle(f"Singularities of {result.mechanism.name} in input space, around home")
    figure.savefig(path, dpi=130)


def _draw_slice(result: Survey, part: Slice, ax: Axes, measure: str, kind: str) -> None:
    from matplotlib.colors import ListedColormap

    first, second = part.inputs
    x, y = part.map[first].to_numpy(), part.map[second].to_numpy()
    status = part.map["status"].to_numpy()
    for code, (_, colour, hatch) in _BLANKS.items():
        if (status == code).any():
            where = np.where(status == code, 1.0, np.nan).T
            ax.pcolormesh(x, y, where, cmap=ListedColormap([colour]), rasterized=True)
            _hatch(ax, x, y, status == code, hatch)
    values = part.map[measure].to_numpy()
    found = part.direct if kind == "direct" else part.inverse
    if found.everywhere:
        ax.pcolormesh(
            x,
            y,
            np.where(np.isfinite(values), 1.0, np.nan).T,
            cmap=ListedColormap([COLOURS[kind]]),
            alpha=0.35,
            rasterized=True,
        )
        other = "inverse" if kind == "direct" else "direct"
        ax.set_title(f"{kind}ly singular everywhere: the {other} curve is combined", fontsize=10)
    else:
        mesh = ax.pcolormesh(x, y, values.T, cmap="cividis", vmin=0.0, rasterized=True)
        ax.figure.colorbar(mesh, ax=ax, label=f"{_SYMBOLS[measure]} (dimensionless)")
        ax.set_title(f"{kind} measure, zero on the {kind} curve", fontsize=10)
    for curve in (part.direct, part.inverse):
        _draw_curve(ax, curve)
    if not (part.direct.everywhere or part.inverse.everywhere):
        ax.plot(*part.combined.coordinates.T, "D", ms=6, mfc=COLOURS["combined"], mec="white")
    home = result.mechanism.input_values(result.mechanism.home)
    place = [home[result.mechanism.inputs.index(name)] for name in part.inputs]
    ax.plot(*place, "*", ms=13, mfc=COLOURS["home"], mec="black")
    ax.set(
        xlabel=f"{first} [{part.map[first].attrs['units']}]",
        ylabel=f"{second} [{part.map[second].attrs['units']}]",
        xlim=(x[0], x[-1]),
        ylim=(y[0], y[-1]),
    )
    ax.set_aspect("equal" if part.map[first].attrs == part.map[second].attrs else "auto")


_SYMBOLS = {
    "sigma_direct": r"$\sigma_{\min}(K_p)$",
    "sigma_inverse": r"$\sigma_{\min}([K; J])$",
}


def _hatch(ax: Axes, x: np.ndarray, y: np.ndarray, where: np.ndarray, hatch: str) -> None:
    filled = ax.contourf(
        x, y, where.T.astype(float), levels=[0.5, 1.5], colors="none", hatches=[hatch]
    )
    filled.set_edgecolor("#999999")
    filled.set_linewidth(0.0)


def _draw_curve(ax: Axes, curve: SingularitySet) -> None:
    for piece in curve.pieces:
        style = {"marker": "."} if len(piece) == 1 else {"lw": 2.2}
        ax.plot(*curve.coordinates[piece].T, color=COLOURS[curve.kind], **style)


def _legend(result: Survey) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Line2D([], [], color=COLOURS["direct"], lw=2.2, label="direct singularities (type 2)"),
        Line2D([], [], color=COLOURS["inverse"], lw=2.2, label="inverse singularities (type 1)"),
        Line2D(
            [],
            [],
            ls="",
            marker="D",
            mfc=COLOURS["combined"],
            mec="white",
            label="combined (type 3)",
        ),
        Line2D([], [], ls="", marker="*", ms=11, mfc="white", mec="black", label="home"),
    ]
    for code, (label, colour, hatch) in _BLANKS.items():
        if any((part.map["status"] == code).any() for part in result.slices):
            handles.append(Patch(fc=colour, ec="#999999", hatch=hatch, label=label))
    return handles
