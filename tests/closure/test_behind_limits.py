"""What lies behind a joint's limit is told apart from other branches."""

from __future__ import annotations

import numpy as np
from small_linkages import GRASHOF, build, four_bar, joint, loop, wedge_and_plunger

import closedchain as cc
from closedchain.analysis.singularity.maps.grid import BEHIND_LIMIT, JOINT_LIMIT, OK

LIMIT = '<limit lower="-30" upper="30" effort="1" velocity="1"/>'


def test_what_lies_behind_a_limit_is_told_though_within_limits() -> None:
    """A crank that turns twice round takes its rocker beyond a limit and back again."""
    free = four_bar(GRASHOF, 0.3)
    turn = {"crank_joint": np.linspace(-6.1, 6.7, 129)}
    whole = cc.singularity_map(free, turn, progress=False, keep_q=True)
    assert (whole["status"] == OK).all()
    rocker = whole["q"].to_numpy()[:, 2]
    most = 0.5 * (rocker.max() + free.home[2])
    parts = [
        joint("crank_joint", "base", "crank"),
        joint("rod_joint", "crank", "rod", f"{GRASHOF[0]} 0 0"),
        joint("rocker_joint", "base", "rocker", f"{GRASHOF[3]} 0 0").replace(
            LIMIT, LIMIT.replace('upper="30"', f'upper="{most}"')
        ),
        loop("revolute", "rod", f"{GRASHOF[1]} 0 0", "rocker", f"{GRASHOF[2]} 0 0"),
    ]
    names = ("crank_joint", "rod_joint", "rocker_joint")
    home = dict(zip(names, free.home.tolist(), strict=True))
    task = '<task base="base" tip="rod" outputs="rz"/>'
    m = build("base crank rod rocker", parts, home, "crank_joint", task)
    status = cc.singularity_map(m, turn, progress=False)["status"].to_numpy()
    within = rocker <= most
    beyond = np.flatnonzero(~within)
    assert beyond.size > 3
    walls = np.flatnonzero(status == JOINT_LIMIT)
    start = int(np.argmin(np.abs(turn["crank_joint"] - 0.3)))
    assert within[start]
    assert set(walls) <= set(beyond)
    assert walls.size >= 1
    assert (status[within & (status != BEHIND_LIMIT)] == OK).all()
    behind = within & (status == BEHIND_LIMIT)
    assert behind.any()
    # nothing behind can be reached from the start without passing a wall
    for i in np.flatnonzero(behind):
        between = slice(min(i, start), max(i, start) + 1)
        assert not within[between].all()


def test_limits_are_walls_and_what_lies_behind_is_told() -> None:
    m = wedge_and_plunger()
    values = np.linspace(-0.9, 0.9, 19)
    for chunk in (None, 4):
        found = cc.singularity_map(m, {"a": values}, chunk=chunk, progress=False)
        # the plunger moves 4/3 of the wedge: 0.375 is its last place
        expected = np.where(np.abs(values) < 0.375, OK, BEHIND_LIMIT)
        expected[[5, 13]] = JOINT_LIMIT
        assert found["status"].to_numpy().tolist() == expected.tolist()
