"""Figures of followed tasks show the numbers of the runs, with units and legends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import assert_close
from d1_follows import AXIS_TASK, d1_robot, d1_task

import closedchain as cc
from closedchain.analysis.motion.follow.figures import draw_follow, draw_inputs

COARSE = ("hexagon", 2)


@pytest.fixture(scope="module")
def runs() -> dict[str, cc.Follow]:
    m, task = d1_robot(), d1_task(*COARSE)
    return {
        "q3 locked": cc.follow(m, task, outputs=AXIS_TASK, lock="q3"),
        "gradient": cc.follow(m, task, outputs=AXIS_TASK),
        "q4 locked": cc.follow(m, task, outputs=AXIS_TASK, lock="q4"),
    }


def titled(figure, title):  # type: ignore[no-untyped-def]
    (ax,) = (ax for ax in figure.axes if ax.get_title() == title)
    return ax


def lines(ax):  # type: ignore[no-untyped-def]
    return {line.get_label(): line for line in ax.lines}


def test_the_six_plots_of_a_task(runs: dict[str, cc.Follow], tmp_path: Path) -> None:
    run, path = runs["q3 locked"], tmp_path / "six.png"
    figure = draw_inputs(run, {"gradient": runs["gradient"]}, title="hexagon", path=path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert len(figure.axes) == 6
    assert figure.get_suptitle() == "hexagon: q3 locked"
    spans = []
    for i, name in enumerate(run.problem.mechanism.inputs):
        ax = titled(figure, f"{name} (locked)" if name == "q3" else name)
        assert ax.get_ylabel() == "[m]"
        assert ax.get_xlabel() == "t [s]"
        assert_close(lines(ax)["q3 locked"].get_ydata(), run.inputs[:, i], 0.0)
        assert_close(lines(ax)["gradient"].get_ydata(), runs["gradient"].inputs[:, i], 0.0)
        low, high = ax.get_ylim()
        spans.append(high - low)
        for one in (run, runs["gradient"]):
            assert (low < one.inputs[:, i]).all()
            assert (one.inputs[:, i] < high).all()
    assert np.ptp(spans) < 1e-12  # one scale: motions can be compared
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["q3 locked", "gradient"]


def test_inputs_speeds_and_measures(runs: dict[str, cc.Follow], tmp_path: Path) -> None:
    run = runs["gradient"]
    others = {name: one for name, one in runs.items() if one is not run}
    figure = draw_follow(run, others, path=tmp_path / "run.svg")
    assert (tmp_path / "run.svg").read_text().startswith("<?xml")
    drawn = lines(titled(figure, "input lengths"))
    assert list(drawn) == list(run.problem.mechanism.inputs)
    assert_close(drawn["q5"].get_ydata(), run.inputs[:, 4], 0.0)
    speeds = titled(figure, "speeds of lengths")
    assert speeds.get_ylabel() == "[m/s]"
    assert_close(lines(speeds)["q2"].get_ydata(), run.input_speeds[:, 1], 0.0)
    drawn = lines(titled(figure, "singular values, 0 at a singularity"))
    assert_close(drawn["direct"].get_ydata(), run.sigma_direct, 0.0)
    assert_close(drawn["inverse"].get_ydata(), run.sigma_inverse, 0.0)
    ax = titled(figure, "distance to the nearest singularity")
    assert list(lines(ax)) == ["gradient", "q3 locked"]  # q4 locked never began
    assert_close(lines(ax)["q3 locked"].get_ydata(), runs["q3 locked"].distance, 0.0)
    assert ax.get_ylim()[0] == 0.0
    colours = [line.get_color() for line in ax.lines]
    dashes = [line.get_linestyle() for line in ax.lines]
    assert len(set(colours)) == len(set(dashes)) == 2


def test_a_lock_shows_both_inverse_values(runs: dict[str, cc.Follow]) -> None:
    run = runs["q3 locked"]
    drawn = lines(titled(draw_follow(run), "singular values, 0 at a singularity"))
    assert_close(drawn["inverse, as locked"].get_ydata(), run.sigma_driven, 0.0)
    assert_close(drawn["inverse, all inputs"].get_ydata(), run.sigma_inverse, 0.0)


def test_another_objective_has_a_panel(runs: dict[str, cc.Follow]) -> None:
    run = cc.follow(d1_robot(), d1_task(*COARSE), outputs=AXIS_TASK, objective="speed")
    figure = draw_follow(run, runs)
    drawn = lines(titled(figure, "objective: speed"))
    assert list(drawn) == ["gradient"]  # runs with other objectives have other measures
    assert_close(drawn["gradient"].get_ydata(), run.measure, 0.0)


def test_runs_that_stop(runs: dict[str, cc.Follow], tmp_path: Path) -> None:
    m = d1_robot()
    stuck = cc.follow(m, d1_task("step", 2), outputs=AXIS_TASK, lock="q3")
    figure = draw_follow(stuck, path=tmp_path / "stuck.png")
    assert "stops at 2." in figure.get_suptitle()
    assert "q3 locked (stops)" in lines(titled(figure, "distance to the nearest singularity"))
    for ax in figure.axes:
        assert ax.get_xlim() == (0.0, 12.0)  # of the whole task
    for draw in (draw_follow, draw_inputs):  # nothing reached: empty panels, no crash
        assert "stops at 0 s" in draw(runs["q4 locked"], path=tmp_path / "none.png").get_suptitle()


def test_angles_and_lengths_have_panels_of_their_own() -> None:
    m = cc.load("eclipse")
    home = m.pose(m.home)
    run = cc.follow(m, [home, home], times=[0.0, 1.0])
    figure = draw_follow(run)
    assert lines(titled(figure, "input angles")).keys() == {"th_a", "th_b", "th_c"}
    assert titled(figure, "speeds of angles").get_ylabel() == "[rad/s]"
    assert lines(titled(figure, "input lengths")).keys() == {"d_a", "d_b", "d_c"}
    # what rests is drawn as resting, not as noise
    low, high = titled(draw_inputs(run), "d_a").get_ylim()
    assert high - low > 0.01
    with pytest.raises(cc.ClosureError, match="has other inputs"):
        draw_follow(
            run, {"other": cc.follow(d1_robot(), d1_task(*COARSE), lock="q3", outputs=AXIS_TASK)}
        )
