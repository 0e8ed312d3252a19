"""Maps of measures that a user chooses, or brings along."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from delta_maps import Stopped, ask, delta, stop_after, whole

import closedchain as cc


def largest_angle(mechanism: cc.Mechanism, postures: np.ndarray) -> np.ndarray:
    """Largest joint angle."""
    turning = ~mechanism.translational
    return np.abs(postures[:, turning]).max(axis=1)


def test_measures_of_the_user_are_variables(tmp_path: Path) -> None:
    own = {"largest_angle": largest_angle}
    found = ask(measures=own)
    xr.testing.assert_identical(found.drop_vars("largest_angle"), whole())
    ok = found["status"].to_numpy() == 0
    values = found["largest_angle"]
    assert values.attrs == {"units": "1", "long_name": "Largest joint angle"}
    expected = largest_angle(delta(), found["q"].to_numpy()[ok])
    assert np.array_equal(values.to_numpy()[ok], expected)
    assert np.isnan(values.to_numpy()[~ok]).all()
    stored = ask(measures=own, save=tmp_path / "map.zarr")
    xr.testing.assert_identical(stored.load(), found)
    xr.testing.assert_identical(ask(measures=own, save=tmp_path / "map.zarr").load(), found)
    with pytest.raises(cc.ClosureError, match="another map: functions differs"):
        ask(save=tmp_path / "map.zarr")


def test_stopped_runs_go_on_with_measures_of_the_user(tmp_path: Path) -> None:
    wanted = ["condition", {"largest_angle": largest_angle}]
    expected = ask(measures=wanted)
    assert set(expected.data_vars) == {"status", "condition", "largest_angle", "q"}
    with pytest.raises(Stopped):
        ask(measures=wanted, save=tmp_path / "map.zarr", progress=stop_after(7), workers=1)
    resumed = ask(measures=wanted, save=tmp_path / "map.zarr")
    xr.testing.assert_identical(resumed.load(), expected)


def test_a_measure_with_other_numbers_is_another_one(tmp_path: Path) -> None:
    soft, stiff = ({"k": cc.least_stiffness(drives)} for drives in (1e5, 2e5))
    found = ask(measures=soft, save=tmp_path / "map.zarr").load()
    xr.testing.assert_identical(ask(measures=soft, save=tmp_path / "map.zarr").load(), found)
    with pytest.raises(cc.ClosureError, match="another map: functions differs"):
        ask(measures=stiff, save=tmp_path / "map.zarr")


@pytest.mark.slow
def test_measures_of_the_user_on_dask() -> None:
    distributed = pytest.importorskip("distributed")
    quiet = {"processes": False, "n_workers": 2, "threads_per_worker": 1}
    with distributed.Client(**quiet, dashboard_address=None) as client:
        found = ask(client=client, measures={"largest_angle": largest_angle})
        xr.testing.assert_identical(found, ask(measures={"largest_angle": largest_angle}))


def test_names_leave_out_other_measures() -> None:
    for name in ("det_inverse", "sigma_direct"):
        found = ask(measures=[name], keep_q=False)
        assert set(found.data_vars) == {"status", name}
        xr.testing.assert_allclose(found[name], whole()[name], rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize(
    ("measures", "more", "message"),
    [
        (["speed"], {}, "unknown measure of 'linear_delta' 'speed'.*sigma_direct"),
        ({"condition": largest_angle}, {}, "'condition' needs another name"),
        ({"q1": largest_angle}, {}, "'q1' needs another name"),
        ({"own": 3.0}, {}, "'own' must be a function of a mechanism and postures"),
        ({"own": lambda m, q: q[:, 0]}, {"save": "map.zarr"}, "'own' cannot be pickled"),
        ({"own": lambda m, q: q}, {}, r"'own' must give one number for each of \d+ postures"),
    ],
)
def test_bad_measures_are_refused(
    tmp_path: Path,
    measures: Any,
    more: dict[str, Any],
    message: str,
) -> None:
    with pytest.raises(cc.ClosureError, match=message):
        ask(measures=measures, **{k: tmp_path / v for k, v in more.items()})
