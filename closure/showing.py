"""How a mechanism shows itself: what draws it lies beyond ``closure``, and says so here.

Imports run one way, from what draws to what is drawn. So the package registers its drawing when it
is imported, and ``Mechanism.show`` finds it here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

_SHOWING: dict[str, Callable[..., Any]] = {}


def register(show: Callable[..., Any]) -> None:
    """Say what ``Mechanism.show`` calls, with the mechanism and its arguments."""
    _SHOWING["show"] = show


def registered() -> Callable[..., Any]:
    """What was registered."""
    return _SHOWING["show"]
