"""``closedchain resets``: files that hold closed states, and words that are refused."""

import json
from functools import partial
from pathlib import Path

import commands
import numpy as np
import pytest
import xarray as xr
from conftest import assert_close

import closedchain as cc

run = partial(commands.run, "resets", "linear_delta")


@pytest.mark.parametrize("ending", ["npz", "zarr", "nc"])
def test_files(ending: str, tmp_path: Path) -> None:
    out = tmp_path / f"states.{ending}"
    done = run("-n", "40", "--seed", "3", "--out", str(out), "--over", "q1=-0.1:0.1",
               "--over", "q2", "--qpos", "all", "--json")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["states"] == 40
    assert told["drawn"] == ["q1", "q2"]
    m = cc.load("linear_delta")
    expected = cc.resets(m, 40, 3, over={"q1": (-0.1, 0.1), "q2": None})
    if ending == "npz":
        found = dict(np.load(out))
    elif ending == "nc":
        found = {n: v.values for n, v in xr.open_dataset(out, engine="h5netcdf").variables.items()}
    else:
        read = xr.open_zarr(out, consolidated=False)
        found = {str(n): v.values for n, v in read.variables.items()}
    assert_close(found["q"], expected.q, 0.0)
    assert_close(found["qvel"], expected.v, 0.0)  # no floating joint
    assert str(found["coordinate"][0]) == m.model.names[1]


def test_wrong_words_are_one_line(tmp_path: Path) -> None:
    good = str(tmp_path / "a.npz")
    for words in (
        ["--out", str(tmp_path / "a.txt")],
        ["--out", good, "--over", "q1=1"],
        ["--out", good, "--over", "nobody"],
        ["--out", good, "--mode", "nobody"],
        ["--out", good, "--qpos", "nobody"],
        ["--out", good, "--qpos", "nofile.xml"],
        ["--out", good, "--speed", "-1"],
    ):
        done = run("-n", "5", *words)
        assert done.exit_code == 1, words
        assert len(done.stderr.strip().splitlines()) == 1
