"""Maps of a linear delta with a hundred cells in 20 tiles, whole or stopped on the way."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import closedchain as cc

OVER = {"q1": np.linspace(-0.9, 0.3, 13), "q2": np.linspace(-0.9, 0.3, 11)}
AT = {"q3": -0.6}


class Stopped(Exception):
    pass


@cache
def delta() -> cc.Mechanism:
    return cc.load("linear_delta")


def ask(**more: Any) -> xr.Dataset:
    """The map; whatever else is asked may differ."""
    return cc.singularity_map(
        delta(), OVER, AT, **{"progress": False, "keep_q": True, "chunk": 3, **more}
    )


@cache
def whole() -> xr.Dataset:
    """The same in one go, by one worker, in memory."""
    found = ask(workers=1)
    status = found["status"].to_numpy()
    assert (status == 0).sum() > 40
    assert (status == 1).sum() > 10
    return found


def stop_after(calls: int) -> Callable[..., None]:
    """Progress that stops a run."""
    counter = count()

    def stop(*_: object) -> None:
        if next(counter) >= calls:
            raise Stopped

    return stop


def program(folder: Path, pause: float, cells: tuple[int, int] = (13, 11), more: str = "") -> str:
    """A map asked for in a process of its own, which waits whenever it tells how far it is."""
    return (
        "import time, numpy as np, closedchain as cc\n"
        f"q1, q2 = (np.linspace(-0.9, 0.3, n) for n in {cells})\n"
        f"slow = lambda *a: time.sleep({pause})\n"
        f"cc.singularity_map(cc.load('linear_delta'), {{'q1': q1, 'q2': q2}}, {AT!r}, "
        f"progress=slow, keep_q=True, chunk=3, save={str(folder)!r}, {more})\n"
    )
