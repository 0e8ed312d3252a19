"""A planar linkage gives the same answers in whatever plane it lies."""

from __future__ import annotations

import numpy as np
import pytest
from linkage_text import Cut, J, load

import closedchain as cc

PLANES = {
    "z": ("0 0 1", (0, 1)),
    "y": ("0 -1 0", (0, 2)),  # x and z: the same handedness
    "x": ("1 0 0", (1, 2)),
    "tilted": ("0 0.6 0.8", None),
}


def place(axes: tuple[int, int] | None, along: float) -> str:
    """A point at this distance in the plane; on its first axis."""
    point = [0.0, 0.0, 0.0]
    point[0 if axes is None else axes[0]] = along
    return " ".join(map(repr, point))


def four_bar(plane: str) -> cc.Mechanism:
    axis, axes = PLANES[plane]
    return load(
        "four_bar",
        [
            J("A", "base", "crank", axis=axis),
            J("B", "crank", "rod", place(axes, 0.15), axis=axis),
            J("D", "base", "rocker", place(axes, 0.4), axis=axis),
        ],
        [
            Cut(
                "C",
                "rod",
                "rocker",
                place(axes, 0.35),
                place(axes, 0.3),
                axis=axis,
                child_axis=axis,
            )
        ],
        inputs={"q1": "A"},
        home={"A": 0.7, "B": 0.2, "D": 1.4},
        tip="rod",
        outputs="rz",
    )


@pytest.fixture(scope="module")
def flat() -> cc.Mechanism:
    return four_bar("z")


@pytest.mark.parametrize("plane", [name for name in PLANES if name != "z"])
def test_maps_states_and_postures(plane: str, flat: cc.Mechanism) -> None:
    m = four_bar(plane)
    assert np.abs(m.home - flat.home).max() < 1e-9
    over = {"q1": np.linspace(-3.0, 3.0, 41)}
    one, two = (cc.singularity_map(x, over, progress=False) for x in (m, flat))
    assert np.array_equal(one["status"], two["status"])
    assert np.allclose(
        one["sigma_direct"], two["sigma_direct"], rtol=0.0, atol=1e-9, equal_nan=True
    )
    states = cc.resets(m, 20)
    assert max(np.abs(m.workspace.residual(q)).max() for q in states.q) < 1e-12
    assert len(cc.postures(m, inputs=[0.7], count=False)) == 2
    efforts = cc.input_efforts(m, states.q)
    assert np.isfinite(np.asarray(efforts)).all()
