"""Colours and dashes of lines that are told apart by name: seven of each, both differ."""

from __future__ import annotations

from typing import Any

# Okabe and Ito's palette, told apart with any colour vision; without its yellow, faint on white
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)), (0, (3, 1)))


def stroke(k: int) -> dict[str, Any]:
    """Arguments of ``plot`` for the line number ``k``."""
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)]}
