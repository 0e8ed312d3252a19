"""Small ranges around D1's home, where singular values are tiny: "everywhere" needs evidence."""

from __future__ import annotations

import numpy as np
import pytest

import closedchain as cc


def around(m: cc.Mechanism, names: tuple[str, str], width: float) -> dict[str, np.ndarray]:
    """21 values to each side of home, home itself not among them."""
    home = dict(zip(m.inputs, m.input_values(m.home), strict=True))
    return {n: np.linspace(home[n] - width, home[n] + width, 21) + width / 997 for n in names}


@pytest.mark.slow
@pytest.mark.parametrize("width", [0.02, 0.002, 0.001, 0.0005])
def test_three_lines_through_home_however_small_the_range(d1: cc.Mechanism, width: float) -> None:
    """q1 = q2, and by symmetry each equal to the input held, but for home itself, where all are."""
    found = cc.singularity_set(d1, "inverse", around(d1, ("q1", "q2"), width), check=False)
    assert found.verdict == "curve"
    assert not found.everywhere
    home = d1.input_values(d1.home)[0]
    off = (found.coordinates - home) / width
    lines = np.abs(np.stack([off[:, 0] - off[:, 1], off[:, 0], off[:, 1]], axis=1))
    assert lines.min(axis=1).max() < 1e-3
    assert (np.bincount(lines.argmin(axis=1), minlength=3) > 10).all()


@pytest.mark.parametrize("width", [1e-4, 1e-5])
def test_a_range_too_small_is_called_so(d1: cc.Mechanism, width: float) -> None:
    """All values lie below 1e-8, beyond the range they do not."""
    found = cc.singularity_set(d1, "inverse", around(d1, ("q1", "q2"), width), check=False)
    assert (found.verdict, len(found.q)) == ("none found", 0)
    assert "the range is too small to trace curves in it" in found.note


@pytest.mark.parametrize("width", [0.02, 1e-4])
def test_a_slice_that_is_singular_everywhere_is_so_in_any_range(
    d1: cc.Mechanism, width: float
) -> None:
    found = cc.singularity_set(d1, "inverse", around(d1, ("q4", "q5"), width), check=False)
    assert found.everywhere
    assert "every posture of the slice is inversely singular" in found.note
