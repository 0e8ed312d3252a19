"""What Meshcat draws into instead of a window, and how large a drawing is."""

from __future__ import annotations

import re
import warnings
from typing import Any, Literal

import numpy as np

from closedchain.closure import Mechanism
from closedchain.robots._body import draw_bodies
from closedchain.urdf.extras import require

Up = Literal["x", "y", "z"]

TO_Z = {  # rotation that takes the world axis "up" to Meshcat's z
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
_IDENTIFIER = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")


class Recorder:
    """What Meshcat takes for its window: keeps the commands instead of sending them.

    Meshcat's random identifiers are replaced by numbers, so that equal drawings are equal bytes.
    """

    web_url = ""

    def __init__(self) -> None:
        self.commands: list[bytes] = []
        self._numbers: dict[str, str] = {}

    def send(self, command: Any) -> None:
        """Keep a command as Meshcat packs it."""
        import umsgpack  # type: ignore[import-untyped]

        self.commands.append(umsgpack.packb(self._numbered(command.lower())))

    def _numbered(self, value: Any) -> Any:
        if isinstance(value, dict):
            return {key: self._numbered(item) for key, item in value.items()}
        if isinstance(value, list) and value and isinstance(value[0], dict):
            return [self._numbered(item) for item in value]
        if isinstance(value, str) and _IDENTIFIER.fullmatch(value):
            return self._numbers.setdefault(value, f"id-{len(self._numbers)}")
        return value


def opened(recorder: Recorder) -> Any:
    """Meshcat's view of a recorder."""
    require("a page draws with Meshcat", "view")
    with warnings.catch_warnings():  # meshcat asks pyzmq for a module that pyzmq deprecates
        warnings.simplefilter("ignore", DeprecationWarning)
        import meshcat

    return meshcat.Visualizer(window=recorder)


def extent(mechanism: Mechanism, postures: np.ndarray) -> np.ndarray:
    """Points (n, 3) [m] in the world that bound the drawing of postures (n, nq)."""
    return draw_bodies(opened(Recorder())["robot"], mechanism, postures).extent
