"""Values that no function about postures, maps, tasks or pages takes are refused in a sentence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import closedchain as cc

M = cc.load("linear_delta")
HOME = M.input_values(M.home)
TIMES, WAY = [0.0, 1.0], np.array([[0.0, 0.0, -0.6], [0.01, 0.0, -0.6]])
AXIS = [-0.2, -0.1]


def modes(**options: Any) -> cc.Postures:
    return cc.postures(M, inputs=HOME, count=False, **options)


CALLS: dict[str, Callable[[Any], object]] = {
    "inputs": lambda x: cc.direct(M, x),
    "tables of inputs": lambda x: cc.direct(M, np.array([[x] * 3], dtype=object)),
    "poses": lambda x: cc.inverse(M, x),
    "tables of poses": lambda x: cc.inverse(M, np.full((2, 7), str(x))),
    "inputs of postures": lambda x: cc.postures(M, inputs=x),
    "pose of postures": lambda x: cc.postures(M, pose=x),
    "joint that is held": lambda x: cc.postures(M, fixed={"q1": x}),
    "seconds": lambda x: modes(seconds=x),
    "starts": lambda x: modes(starts=x),
    "seed": lambda x: modes(seed=x),
    "range": lambda x: modes(starts=1).connections({"q1": x}),
    "cells": lambda x: modes(starts=1).connections("q1", resolution=x),
    "values of a map": lambda x: cc.singularity_map(M, {"q1": x}, progress=False),
    "value that a map holds": lambda x: cc.singularity_map(M, {"q1": AXIS}, {"q2": x}),
    "values of a set": lambda x: cc.singularity_set(M, "direct", {"q1": x}),
    "value that a set holds": lambda x: cc.singularity_set(M, "direct", {"q1": AXIS}, {"q2": x}),
    "values of joints": lambda x: cc.joint_positions(M, x),
    "value of a joint": lambda x: cc.joint_positions(M, {"q1": x}),
    "times": lambda x: cc.task_path(M, x, WAY),
    "places": lambda x: cc.task_path(M, TIMES, x),
    "limits": lambda x: cc.follow(M, WAY, times=TIMES, limits={"q1": x}),
    "speed limits": lambda x: cc.follow(M, WAY, times=TIMES, speed_limits=x),
    "speed limit of an input": lambda x: cc.follow(M, WAY, times=TIMES, speed_limits={"q1": x}),
    "path": lambda x: cc.track(M, x),
    "drives": lambda x: cc.largest_compliance(x)(M, M.home[None]),
    "height": lambda x: M.show(height=x),
}


@pytest.mark.parametrize("what", CALLS)
def test_wrong_values_are_refused(what: str) -> None:
    for wrong in ("x", [[np.nan]], {"nobody": 1.0}, -1.0 + 2.0j):
        with pytest.raises(cc.ClosureError):
            CALLS[what](wrong)


def test_rates_of_free_inputs_are_checked() -> None:
    d1 = cc.load("d1")
    step = np.array([0.02, -0.01, 0.0, 0.02, 0.01, -0.02])
    q = cc.direct(d1, d1.input_values(d1.home) + step).q
    split = cc.redundancy(d1, q, "x y z rx rz").split("q3")
    for wrong in ("x", [1.0, 2.0], np.nan):
        with pytest.raises(cc.ClosureError, match="rates of the free inputs"):
            split.rates(np.zeros(5), wrong)


def test_a_home_that_is_no_number_is_said() -> None:
    text = M.description.text
    with pytest.raises(cc.DescriptionError, match="must be 1 finite number, got 'x'"):
        cc.load_urdf(text, xacro=False, home={"leg1_P": "x"})
