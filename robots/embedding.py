"""A page of a mechanism inside a notebook, or any other page: a frame that holds it whole."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from closedchain.closure import Mechanism
from closedchain.closure.given import whole_number
from closedchain.robots._overlays import Overlay
from closedchain.robots._recorder import Up
from closedchain.robots.animation import Animation
from closedchain.robots.catalogue import robot
from closedchain.robots.controls import Controls
from closedchain.robots.viewer import static_page
from closedchain.urdf.errors import ClosedChainError, ClosureError

HEIGHT = 600
"""Pixels of a frame, unless others are asked for."""


@dataclass(frozen=True, repr=False)
class Embedded:
    """A page, and the frame that a notebook shows it in.

    Attributes
    ----------
    page : str
        HTML of the whole page.
    height : int
        Of the frame [pixels].
    """

    page: str
    height: int = HEIGHT

    def __post_init__(self) -> None:
        """Raises ``ClosureError`` for a height that is none."""
        if whole_number(self.height, "height", 50) > 10_000:
            raise ClosureError(f"height must be 50 to 10000 pixels, got {self.height!r}")

    def _repr_html_(self) -> str:
        """The frame."""
        held = html.escape(self.page, quote=True)
        return (
            f'<div><iframe srcdoc="{held}" width="100%" height="{self.height}" '
            'style="border: 0" title="a mechanism that moves"></iframe></div>'
        )

    def __repr__(self) -> str:
        """What a console shows: where there are no frames, the page can be written to a file."""
        return f"<page of {len(self.page) // 1000} kB; its .page is HTML for a file>"


def show(
    mechanism: Mechanism,
    q: ArrayLike | None = None,
    *,
    height: int = HEIGHT,
    up: Up | None = None,
    overlays: Sequence[Overlay] = (),
    animation: Animation | None = None,
    title: str | None = None,
    controls: bool | Controls = True,
) -> Embedded:
    """Page of a mechanism as a notebook shows it; ``Mechanism.show`` by another name.

    Parameters
    ----------
    height : int
        Of the frame [pixels].
    up : "x", "y" or "z", optional
        World axis that points up; by default that of the catalogue for its robots, else z.
    q, overlays, animation, title, controls
        As ``viewer.static_page``; an animation is played and has no controls.

    Raises
    ------
    ClosureError
        As ``viewer.static_page``; a height that is none.
    """
    page = static_page(
        mechanism,
        q,
        up=upward(mechanism) if up is None else up,
        overlays=overlays,
        animation=animation,
        title=title,
        controls=controls if animation is None else False,
    )
    return Embedded(page, height)


def upward(mechanism: Mechanism) -> Up:
    """World axis that points up: the catalogue's for its robots, else z."""
    try:
        return robot(mechanism.name).up
    except ClosedChainError:
        return "z"
