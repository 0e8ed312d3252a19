"""Axes that lean by less than the root of rounding: Pinocchio and the tape have the same tilt."""

import sys
from pathlib import Path

import numpy as np
import pytest

import closedchain as cc
from closedchain.closure.tape.verified import verify

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkage_text import Cut, J, urdf


@pytest.mark.parametrize("tilt", [1e-17, 1e-12, 4e-9, 1e-8, 1e-5])
def test_expressions_are_those_of_pinocchio(tilt: float) -> None:
    """Of a unit axis (t, 0, 1) the last entry is 1 to rounding while t is below 1e-8."""
    axis = f"{tilt!r} 0 1"
    text = urdf(
        "leaning",
        [
            J("A", "base", "crank"),
            J("B", "crank", "coupler", "0.15 0 0", axis=axis),
            J("D", "base", "rocker", "0.4 0 0", axis=axis),
            J("E", "rocker", "end", "0.3 0 0", axis="0 1 0"),
        ],
        [Cut("C", "coupler", "end", "0.35 0 0", "0.05 0 0", "spherical")],
        inputs={"q1": "A"},
        home={"A": 1.1, "B": -0.6, "D": 1.6, "E": 0.0},
    )
    m = cc.load_urdf(text, tolerance=0, xacro=False)  # every number as it stands
    verify(m)  # raises where they differ by more than 1e-10
    found = cc.direct(m, [1.15]).raise_if_failed()
    assert np.abs(cc.residual(m, found.q)).max() < 1e-12
