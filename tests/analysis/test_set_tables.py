"""Tables of singular sets: what is written is read again, and broken tables are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from drawn_maps import made_set, sphere

import closedchain as cc
from closedchain.analysis.survey.set_tables import SavedSet, read_table, table

SETS = {
    "curves": made_set(
        "inverse",
        ("x", "alpha"),
        np.random.default_rng(0).normal(size=(5, 2)),
        ([0, 1, 2], [3, 4]),
        ends=(("closed", "closed"), ("limit of joint a b", "edge of the range")),
        on_branch=[True, False, True, True, True],
    ),
    "points": made_set("combined", ("x", "y"), [(0.0, 1.0), (2.0, 3.0)], ([0], [1])),
    "mesh": made_set("direct", ("x", "y", "z"), sphere(1.0, 5)[0], (sphere(1.0, 5)[1],)),
    "nothing": made_set("constraint", ("x", "y"), []),
    "everywhere": made_set("inverse", ("x", "y"), [], everywhere=True),
}


@pytest.mark.parametrize("what", SETS)
def test_a_set_comes_back_from_a_file(what: str, tmp_path: Path) -> None:
    before = SETS[what]
    table(before).to_netcdf(tmp_path / "set.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "set.nc", engine="h5netcdf") as data:
        after = read_table(data.load())
    assert isinstance(after, SavedSet)
    for name, value in vars(before).items():
        if name == "pieces":
            assert len(after.pieces) == len(value)
            assert all(map(np.array_equal, after.pieces, value))
        elif isinstance(value, np.ndarray):
            assert np.array_equal(getattr(after, name), value)
            assert getattr(after, name).shape == value.shape
        else:
            assert getattr(after, name) == value


@pytest.mark.parametrize("missing", ["piece_vertices", "kinds", "q", "value_x", "piece_size"])
def test_a_table_without_a_column_is_refused(missing: str) -> None:
    with pytest.raises(cc.ClosureError, match="no table of a singular set"):
        read_table(table(SETS["curves"]).drop_vars(missing))


def test_a_table_that_names_points_that_are_not_there_is_refused() -> None:
    data = table(SETS["curves"])
    data["piece_vertices"][0] = 5
    with pytest.raises(cc.ClosureError, match="points that are not there"):
        read_table(data)
    data = table(SETS["curves"])
    del data.attrs["kind"]
    with pytest.raises(cc.ClosureError, match="kind"):
        read_table(data)
