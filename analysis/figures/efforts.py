"""Figures of efforts over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from closedchain.analysis.figures.saving import save_figure, words_of
from closedchain.analysis.figures.strokes import stroke
from closedchain.urdf.errors import ClosureError, known_names
from closedchain.urdf.extras import require

if TYPE_CHECKING:
    from closedchain.analysis.forces.effort_history import EffortHistory


def draw_efforts(
    found: EffortHistory, image: Path, joints: Sequence[str] = (), dpi: int = 130
) -> None:
    """Draw efforts and powers of the inputs, and the force and moment of named joints, over time.

    Raises
    ------
    ClosureError
        An unknown joint.
    """
    require("figures are drawn with matplotlib", "figures")
    from matplotlib.figure import Figure

    for name in joints:
        if name not in found.joints:
            raise ClosureError(known_names(name, "joint", found.joints))
    units = dict.fromkeys(found.mechanism.input_units)
    panels = [*units, "power", *(("force", "moment") if joints else ())]
    figure = Figure(figsize=(7.5, 2.6 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False).ravel()
    for ax, panel in zip(axes, panels, strict=True):
        ax.grid(alpha=0.3)
        if panel in ("force", "moment"):
            three = slice(0, 3) if panel == "force" else slice(3, 6)
            for i, name in enumerate(joints):
                sizes = np.linalg.norm(found.joints[name][:, three], axis=1)
                ax.plot(found.times, sizes, label=name, **stroke(i))
            ax.set_ylabel(f"{panel} [{'N' if panel == 'force' else 'N m'}]")
        else:
            for i, name in enumerate(found.mechanism.inputs):
                if panel == "power":
                    ax.plot(found.times, found.powers[:, i], label=name, **stroke(i))
                elif found.mechanism.input_units[i] == panel:
                    ax.plot(found.times, found.inputs[:, i], label=name, **stroke(i))
            unit = "W" if panel == "power" else "N" if panel == "m" else "N m"
            ax.set_ylabel(f"{'power' if panel == 'power' else 'effort'} [{unit}]")
        ax.legend(  # beside the panel: lines may be anywhere in it
            loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8
        )
    axes[-1].set_xlabel("time [s]")
    what = "inputs and joints" if joints else "inputs"
    figure.suptitle(f"{found.mechanism.name}: efforts and powers of {what}")
    save_figure(figure, image, words_of(figure), dpi)
