"""Numbers that sentences of the docs state are computed, and compared to the last printed digit."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
from test_docs import blocks

import closedchain as cc
from closedchain.robots import eclipse, rus6
from closedchain.robots import linear_delta as ld

DOCS = Path(__file__).resolve().parents[1] / "docs"
N = r"([-+]?\d+(?:\.\d+)?)"
"""A number in a pattern."""

Case = tuple[str, str, Callable[[], Iterable[float]]]
CASES: dict[str, Case] = {}


def says(name: str, page: str, sentence: str) -> Callable[[Callable[[], Iterable[float]]], None]:
    """A sentence of a page, with ``#`` for its numbers; the function gives them in order.

    Blanks stand for any blanks and line ends.
    """
    pattern = N.join(map(re.escape, sentence.split("#"))).replace(r"\ ", r"\s+")

    def keep(compute: Callable[[], Iterable[float]]) -> None:
        CASES[name] = page, pattern, compute

    return keep


@says(
    "figure 3",
    "robots/linear_delta.md",
    "Its circle has the radius amax T²/(4π²) = # m. The reach is # m across",
)
def _printed_circle() -> Iterable[float]:
    """The largest distance of two points that all three rods reach."""
    g = ld.Geometry()
    angles = np.radians([0, 120, 240])
    centres = (g.a - g.c) * np.column_stack([np.cos(angles), np.sin(angles)])
    directions = np.linspace(0, 2 * np.pi, 3601)[:-1]
    u = np.column_stack([np.cos(directions), np.sin(directions)])
    along = u @ centres.T  # where a ray from the axis leaves each disc
    edge = (along + np.sqrt(along**2 + g.b**2 - (g.a - g.c) ** 2)).min(axis=1)[:, None] * u
    width = max(np.linalg.norm(edge[i:] - edge[: len(edge) - i], axis=1).max() for i in range(1800))
    return ld.PRINTED.radius, width


@says("reach", "robots/linear_delta.md", "radius b - d = # m; its corners, in the directions of "
      "the rails, are # m from the axis")  # fmt: skip
def _corners() -> Iterable[float]:
    g = ld.Geometry()
    d = g.a - g.c
    return g.b - d, np.sqrt(g.b**2 - 0.75 * d**2) - 0.5 * d  # |x - d r_2| = b on the axis of r_1


@says("determinant", "robots/linear_delta.md", "stays above its value on the axis, #.")
def _on_the_axis() -> Iterable[float]:
    g = ld.Geometry()
    p = np.array([0.0, 0.0, -0.6])
    return (abs(np.linalg.det(ld.rods(p, ld.sliders(p, g, [1, 1, 1]), g))),)


@says("V1 printed", "robots/linear_delta.md", "On variant V1 below that is up to # m/s²")
def _missing_term() -> Iterable[float]:
    g = ld.Geometry()
    off = 0.0
    for t in np.linspace(0.0, 2.0, 201):
        p, v, a = (
            f(np.array([t]))[0] for f in (ld.V1.position, ld.V1.velocity, ld.V1.acceleration)
        )
        bhat = ld.rods(p, ld.sliders(p, g, [1, 1, 1]), g)
        state = np.r_[v, np.zeros(3)], np.r_[a, np.zeros(3)]
        true = ld.inverse_acceleration(bhat, g, *state)[:3]
        printed = ld.inverse_acceleration(bhat, g, *state, printed=True)[:3]
        off = max(off, float(np.abs(true - printed).max()))
    return (off,)


def _variant(variant: ld.Trajectory, until: float) -> Iterable[float]:
    q = ld.history(variant, np.linspace(0.0, until, 2001), ld.Geometry()).q
    return variant.radius, q.min(), q.max()


@says("V1", "robots/linear_delta.md", "| 1 m/s² | 2 s | 1 m/s | # m | # to # m |")
def _v1() -> Iterable[float]:
    return _variant(ld.V1, 2.0)


@says("V2", "robots/linear_delta.md", "| 0.25 m/s² | 5 s | 0.05 m/s | # m | # to # m |")
def _v2() -> Iterable[float]:
    return _variant(ld.V2, 5.0)


@says("tilts", "robots/eclipse.md", "| 0, ±120 (an S goes down) | #° | S_a lies in the leg planes "
      "of b and c | | ±30, ±90, ±150 | #° | | | ±60, 180 (an S goes up) | #° = acos")  # fmt: skip
def _tilts() -> Iterable[float]:
    g = eclipse.Geometry()
    return [np.degrees(eclipse.first_direct_tilt(np.radians(psi), g)) for psi in (0, 30, 60)]


@says("last tilt", "robots/eclipse.md", "#° = acos(r_g/(r + a))")
def _last_tilt() -> Iterable[float]:
    g = eclipse.Geometry()
    return (np.degrees(np.arccos(g.r_g / (g.r + g.a))),)


@says("stretched", "robots/rus6.md", "| P_y = # | inverse: M2 stretched (in the leg's planes; arm "
      "and rod are # degrees apart) | | beta = # degrees, P_y = # | inverse: M1")  # fmt: skip
def _stretched() -> Iterable[float]:
    g = rus6.geometry()
    low = rus6.stretched_heights(g, 3)[0]
    legs = rus6.inverse(rus6.Pose(np.eye(3), np.array([0.0, low, 0.0])), 0.0, g)
    arm = (legs.B[3] - legs.A[3]) / g.LA
    apart = np.degrees(np.arccos(arm @ legs.w[3]))
    return low, apart, 60.0, rus6.stretched_heights(g, 0, np.radians(60.0))[0]


@says("margins", "robots/rus6.md", "With the default sizes (margins # and # m)")
def _margins() -> Iterable[float]:
    return rus6.pencil_margin(rus6.geometry(), 0.0)


@says("sets", "sets.md", "by # of a cell at most in the example above")
def _apart() -> Iterable[float]:
    names: dict[str, object] = {}
    exec(blocks(DOCS / "sets.md", "python")[0], names)
    found, over = names["found"], names["over"]
    assert isinstance(found, cc.SingularitySet)
    assert isinstance(over, dict)
    cell = np.array([np.diff(values).max() for values in over.values()])
    columns = [found.over.index(name) for name in over]
    lines = [found.coordinates[piece][:, columns] for piece in found.pieces]
    return (max(float(np.abs(np.diff(line, axis=0) / cell).max()) for line in lines),)


@pytest.mark.parametrize("name", CASES)
def test_a_number_is_what_is_computed(name: str) -> None:
    page, pattern, compute = CASES[name]
    found = re.findall(pattern, (DOCS / page).read_text())
    assert len(found) == 1, f"{page} does not say, once: {pattern}"
    printed = [found[0]] if isinstance(found[0], str) else list(found[0])
    computed = list(compute())
    assert len(computed) == len(printed)
    for text, value in zip(printed, computed, strict=True):
        digits = len(text.partition(".")[2])
        assert abs(float(text) - value) < 0.5001 * 10.0**-digits, (text, value)
