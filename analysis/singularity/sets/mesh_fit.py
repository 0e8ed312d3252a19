"""How well the triangles of a meshed surface lie on it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fit:
    """How well the triangles of a mesh lie on their surface.

    Attributes
    ----------
    tolerance : float
        Largest distance allowed from the middle of a triangle to the surface, in cells of the
        grid, along the coordinate that is most across the triangle.
    largest : float
        Largest one that there is.
    split : int
        Triangles that were split for it.
    left_out : int
        Triangles that were left out, since no splitting helped.
    holes : int
        Places where a sheet could not be followed round a cube of the grid.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> axis = np.linspace(-0.35, 0.35, 5)
    >>> over = {"x": axis, "y": axis, "z": np.linspace(-0.65, -0.45, 3)}
    >>> found = cc.singularity_set(m, "inverse", over)
    >>> found.dimension, found.fit.largest <= found.fit.tolerance
    (2, True)
    """

    tolerance: float
    largest: float
    split: int
    left_out: int
    holes: int

    @property
    def text(self) -> str:
        """What there is to say, in a sentence."""
        found = (
            f"the middle of every triangle is within {self.tolerance:g} cells of the set "
            f"(the farthest {self.largest:.2g})"
        )
        counts = (
            (self.split, "split for it"),
            (self.left_out, "left out, since splitting did not help"),
        )
        said = [f"{n} were {what}" for n, what in counts if n]
        if self.holes:
            said.append(f"in {self.holes} cells a sheet could not be followed round")
        return "; ".join([found, *said])
