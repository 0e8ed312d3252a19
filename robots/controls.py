"""What the controls of a page offer beside sliders: postures to go to and through, and planes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from closedchain.robots.overlays import PALETTE, numbers, spots
from closedchain.urdf.errors import ClosureError, known_names


@dataclass(frozen=True, eq=False)
class PostureSeries:
    """Closed postures that a page with controls goes through: by a slider, or by a click.

    Attributes
    ----------
    q : (n, nq) array, n >= 1
        Postures.
    points : (n, 3) array
        World coordinates [m] at which a click on the page goes to each.
    label : str
        What they are.

    Raises
    ------
    ClosureError
        Wrong shapes, numbers that are not finite.
    """

    q: np.ndarray
    points: np.ndarray
    label: str

    def __post_init__(self) -> None:
        what = f"series {self.label!r}"
        postures = numbers(self.q, f"{what}: q")
        places = spots(self.points, f"{what}: points", 1)
        if postures.ndim != 2 or len(postures) != len(places):
            raise ClosureError(
                f"{what}: q must be one posture for each of {len(places)} points, got an array "
                f"{postures.shape}"
            )
        object.__setattr__(self, "q", postures)
        object.__setattr__(self, "points", places)


@dataclass(frozen=True, eq=False)
class Plane:
    """Singular curves over two coordinates, drawn as a small map that shows where the robot is.

    Two inputs, or two of the tip's x y z. A click on the map leads there.

    Attributes
    ----------
    over : pair of str
        The coordinates across and up.
    ranges : (2, 2) array
        Least and greatest of each [m or rad].
    curves : sequence of (kind, (n, 2) array)
        Kind of singularity, and its points.

    Raises
    ------
    ClosureError
        Wrong shapes, numbers that are not finite, ranges that do not rise, unknown kinds.
    """

    over: tuple[str, str]
    ranges: np.ndarray
    curves: Sequence[tuple[str, np.ndarray]] = ()

    def __post_init__(self) -> None:
        what = f"plane {' x '.join(self.over)}"
        ranges = numbers(self.ranges, f"{what}: ranges")
        if ranges.shape != (2, 2) or not (ranges[:, 0] < ranges[:, 1]).all():
            raise ClosureError(f"{what}: ranges must be two rising pairs, got {ranges.tolist()}")
        curves = []
        for kind, points in self.curves:
            if kind not in PALETTE:
                raise ClosureError(known_names(str(kind), "kind", PALETTE))
            line = numbers(points, f"{what}: curve")
            if line.ndim != 2 or line.shape[1] != 2:
                raise ClosureError(f"{what}: a curve must be (n, 2), got {line.shape}")
            curves.append((kind, line))
        object.__setattr__(self, "ranges", ranges)
        object.__setattr__(self, "curves", tuple(curves))


@dataclass(frozen=True, eq=False)
class Controls:
    """What a page offers beside sliders.

    Attributes
    ----------
    places : mapping of str to (nq,) array
        Closed postures to go to, beside the mechanism's named ones.
    modes : mapping of str to (nq,) array
        Postures of other assembly modes. The page goes to a mode at the inputs that it has then,
        by the mode's own branch; where that ends before, to the posture given here.
    series : sequence of PostureSeries
        Closed postures to go through.
    planes : sequence of Plane
        Maps of two coordinates.
    """

    places: Mapping[str, ArrayLike] = field(default_factory=dict)
    modes: Mapping[str, ArrayLike] = field(default_factory=dict)
    series: Sequence[PostureSeries] = ()
    planes: Sequence[Plane] = ()
