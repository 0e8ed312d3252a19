"""``closedchain simulate``: states, a page, and words that are refused."""

import json
from functools import partial
from pathlib import Path

import commands
import xarray as xr
from conftest import assert_close

import closedchain as cc

run = partial(commands.run, "simulate")


def test_a_delta_falls(tmp_path: Path) -> None:
    words = ["linear_delta", "--density", "2700", "--until", "0.1", "--out", str(tmp_path)]
    done = run(*words, "--json")
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["ending"] == "arrived"
    assert told["residual"] < 1e-12
    m = cc.with_inertias(cc.load("linear_delta"))
    expected = cc.simulate(m, m.home, None, None, 0.1)
    found = xr.open_dataset(tmp_path / "motion.nc", engine="h5netcdf")
    assert_close(found["q"].values, expected.q, 1e-12)
    page = (tmp_path / "linear_delta.html").read_text()
    assert "<html" in page[:2000]
    assert "postures shown" not in page  # none is left out, so that slow motion has them all
    assert found["q"].values[-1][m.input_q[0]] < m.home[m.input_q[0]] - 0.01


def test_held_it_stays_where_it_is(tmp_path: Path) -> None:
    words = ["linear_delta", "--density", "2700", "--until", "0.1", "--out", str(tmp_path)]
    done = run(*words, "--hold", "--payload", "P=2", "--wrench", "3 -2 0 0 0 0")
    assert done.exit_code == 0, done.stderr
    found = xr.open_dataset(tmp_path / "motion.nc", engine="h5netcdf")
    assert_close(found["q"].values[-1], found["q"].values[0], 1e-9)
    assert "moved for 0.1 s" in done.stdout


def test_the_limit_that_ends_it_is_said_once(tmp_path: Path) -> None:
    words = ["linear_delta", "--density", "1000", "--until", "0.5", "--out", str(tmp_path)]
    done = run(*words)
    assert done.exit_code == 0, done.stderr
    assert done.stdout.count("a joint meets its limit: leg1_P") == 1


def test_wrong_words_are_one_line(tmp_path: Path) -> None:
    out = ["--out", str(tmp_path)]
    for words in (
        ["linear_delta", "--set", "density=0", *out],  # no masses
        ["linear_delta", "--density", "0", *out],
        ["linear_delta", "--density", "2700", "--until", "0", *out],
        ["linear_delta", "--density", "2700", "--effort", "nobody=1", *out],
        ["linear_delta", "--density", "2700", "--every", "9", *out],
        ["linear_delta", "--payload", "nobody=1", *out],
        ["linear_delta", "--wrench", "1 2", *out],
    ):
        done = run(*words)
        assert done.exit_code == 1, words
        assert len(done.stderr.strip().splitlines()) == 1
