"""Maps of symmetric mechanisms are symmetric: no cell depends on the way that led to it first."""

from __future__ import annotations

import numpy as np
import pytest

import closedchain as cc
from closedchain.analysis.singularity.maps.grid import OK

TILT = np.radians(np.linspace(80.0, 100.0, 5))
AZIMUTH = np.radians(np.linspace(-180.0, 180.0, 73))


@pytest.mark.parametrize("chunk", [None, 16])
def test_the_eclipse_tilts_alike_towards_its_three_columns(chunk: int | None) -> None:
    """Carriages wind round the circle: where one would pass its limit another way leads, too."""
    m = cc.load("eclipse")
    over = {"tilt": np.concatenate([np.radians([0.0, 30.0, 60.0]), TILT]), "azimuth": AZIMUTH}
    found = cc.singularity_map(m, over, progress=False, keep_q=True, chunk=chunk)
    status = found["status"].to_numpy()[:, :-1]  # the last azimuth is the first one again
    third = status.shape[1] // 3
    for image in (np.roll(status, third, axis=1), np.roll(status[:, ::-1], 1, axis=1)):
        assert np.array_equal(status, image)
    # only cells at which the coordinates themselves are singular are left
    tilt, azimuth = np.nonzero(status != OK)
    assert np.degrees(over["tilt"][tilt]) == pytest.approx(90.0)
    sixths = np.degrees(AZIMUTH[azimuth]) / 60.0
    assert sixths == pytest.approx(np.round(sixths), abs=1e-9)
    for name in ("sigma_direct", "sigma_inverse"):
        values = found[name].to_numpy()[:, :-1]
        assert np.nanmax(np.abs(values - np.roll(values, third, axis=1))) < 1e-9
    lower, upper = m.limits
    q = found["q"].to_numpy()[found["status"].to_numpy() == OK]
    assert (q >= lower - 1e-9).all()
    assert (q <= upper + 1e-9).all()
    assert (np.ptp(q[:, m.input_q], axis=0) > 2.0 * np.pi).any()  # some carriage did wind
