"""How work that takes long tells how far it is; what it calls may raise to end it."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Gets (what, done, total); the total is 0 where it is not known."""

Reached = Callable[[int], None]
"""Gets how many more are done since the last call."""

Count = Callable[[int], None]
"""Gets how many there are by now."""
