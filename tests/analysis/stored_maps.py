"""Maps of 72 cells in 12 tiles, and folders with one that was stopped, or is complete."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from delta_maps import AT, Stopped, delta, stop_after

import closedchain as cc

CELLS = (9, 8)
OVER = {name: np.linspace(-0.9, 0.3, n) for name, n in zip(("q1", "q2"), CELLS, strict=True)}


def ask(**more: Any) -> xr.Dataset:
    """The map; whatever else is asked may differ."""
    given = {"progress": False, "keep_q": True, "chunk": 3, "workers": 1, "measures": ["condition"]}
    return cc.singularity_map(delta(), OVER, AT, **given | more)


@cache
def whole() -> xr.Dataset:
    """The same in one go, in memory."""
    return ask()


def stopped_in(folder: Path) -> Path:
    """A store in a folder that is not complete."""
    store = folder / "map.zarr"
    with pytest.raises(Stopped):
        ask(save=store, progress=stop_after(14))
    assert len(list((store / "journal").glob("*/*.find"))) > 3
    return store


def complete_in(folder: Path) -> Path:
    """A complete store in a folder."""
    ask(save=folder / "map.zarr")
    return folder / "map.zarr"
