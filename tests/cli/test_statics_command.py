"""``closedchain statics``: tables, JSON, and loads that are refused or not carried."""

import json
from functools import partial

import commands
import numpy as np
from conftest import assert_close

import closedchain as cc

run = partial(commands.run, "statics")


def test_numbers_are_those_of_python() -> None:
    m = cc.load("linear_delta")
    load = np.array([1.0, 2.0, -20.0, 0.0, 0.0, 0.5])
    done = run("linear_delta", "--wrench", "1 2 -20 0 0 0.5", "--json")
    assert done.exit_code == 0, done.stderr
    found, s = json.loads(done.stdout), cc.statics(m, m.home, load)
    assert_close(found["inputs"], s.inputs, 0.0)
    assert_close(found["joints"]["leg1_B"], s.joints["leg1_B"], 0.0)
    assert found["carried"] is True
    table = run("linear_delta", f"--wrench={m.task.tip}=1,2,-20,0,0,0.5").stdout
    assert f"{s.inputs[0]:.6g}" in table
    assert "12 internal forces are possible" in table


def test_payload_and_other_postures() -> None:
    m = cc.load("linear_delta")
    words = ["linear_delta", "q1=0.02", "--payload", f"{m.task.tip}=2", "--json"]
    found = json.loads(run(*words).stdout)
    q = cc.direct(m, m.input_values(m.home) * [0, 1, 1] + [0.02, 0, 0]).q
    assert_close(found["inputs"], cc.statics(m, q, payload={m.task.tip: 2.0}).inputs, 1e-9)


def test_weights_pull_against_the_robots_up_axis() -> None:
    """D1 stands with y up; other directions, or none, are asked for."""
    m = cc.load("d1")
    for words, fall in (([], [0, -9.81, 0]), (["--gravity", "0 0 -1.62"], [0, 0, -1.62]),
                        (["--no-gravity"], [0, 0, 0])):  # fmt: skip
        found = json.loads(run("d1", *words, "--json").stdout)
        assert_close(found["inputs"], cc.statics(m, m.home, gravity=fall).inputs, 0.0)
    assert "weights: 0 -9.81 0 m/s^2" in run("d1").stdout


def test_wrong_words_are_one_line() -> None:
    for words in (
        ["d1", "--gravity", "9.81"],
        ["d1", "--gravity", "0 0 down"],
        ["d1", "--wrench", "1 2 3"],
        ["d1", "--wrench", "nobody=0 0 0 0 0 0"],
        ["d1", "--wrench", "1 2 3 4 5 six"],
        ["d1", "--payload", "T"],
        ["d1", "--payload", "T=-1"],
    ):
        done = run(*words)
        assert done.exit_code == 1, words
        assert len(done.stderr.strip().splitlines()) == 1
        assert done.stderr.startswith("closedchain: ")
