"""Measures by name: a five-bar by hand, ellipsoids, stiffness, singular postures, maps."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import assert_close
from heavy import moved

import closedchain as cc
from closedchain.analysis.forces.tip_measures import NAMED, tip_measure

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))

from linkage_text import Cut, J, load
from linkages import four_bar

CRANK, ROD, APART = 0.3, 0.4, 0.4


@pytest.fixture(scope="module")
def five_bar() -> cc.Mechanism:
    """Cranks at both ends of the base, two rods that meet in P."""
    return load(
        "five_bar",
        [
            J("A", "base", "left"),
            J("B", "left", "left_rod", f"{CRANK} 0 0"),
            J("D", "base", "right", f"{APART} 0 0"),
            J("C", "right", "right_rod", f"{CRANK} 0 0"),
            J("tip", "left_rod", "P", f"{ROD} 0 0", type="fixed"),
        ],
        [Cut("P_hinge", "P", "right_rod", child_xyz=f"{ROD} 0 0")],
        inputs={"q1": "A", "q2": "D"},
        home={"A": 2.2, "B": -1.2, "D": 0.9, "C": 1.0},
        tip="P",
        outputs="x y",
    )


def angles(q: np.ndarray) -> tuple[float, float]:
    """Of both rods."""
    return q[0] + q[1], q[2] + q[3]


def test_output_transmission_of_a_five_bar(five_bar: cc.Mechanism) -> None:
    """With one crank locked P turns about the end of it; the other pushes along its own rod."""
    q = cc.resets(five_bar, 20, seed=1).q
    found = cc.output_transmission(five_bar, q)
    expected = [abs(np.sin(np.subtract(*angles(one)))) for one in q]
    assert_close(found, expected, 1e-9)


def test_shortest_axes_of_the_ellipsoids(five_bar: cc.Mechanism) -> None:
    delta = cc.load("linear_delta")
    for m, size in ((five_bar, 2), (delta, 3)):
        q = moved(m)
        can = cc.capabilities(m, q)
        assert_close(cc.least_speed(m, q[None]), can.velocity.radii[[size - 1]], 1e-9)
        assert_close(cc.least_force(m, q[None]), can.force.radii[[2]], 1e-9)
        assert_close(cc.isotropy(m, q[None]), can.velocity.radii[[size - 1]]
                     / can.velocity.radii[[0]], 1e-9)  # fmt: skip
    k = [1e5, 2e5, 3e5]
    softest = np.linalg.eigvalsh(cc.stiffness(delta, q, k))[0]
    assert_close(cc.least_stiffness(k)(delta, q[None]) / softest, [1.0], 1e-9)
    assert_close(cc.largest_compliance(1e5)(delta, q[None]),
                 cc.largest_compliance([1e5] * 3)(delta, q[None]), 0.0)  # fmt: skip


def test_singular_postures(five_bar: cc.Mechanism) -> None:
    """Rods in line: no effort holds a push across them. A crank in line with its rod: no speed."""
    a = np.arccos((APART - 2 * ROD) / (2 * CRANK))  # elbows as far apart as both rods are long
    flat = np.array([a, -a, np.pi - a, a])
    assert np.abs(cc.residual(five_bar, flat)).max() < 1e-12
    for name in ("least_force", "isotropy", "output_transmission"):
        assert_close(NAMED[name](five_bar, flat[None]), [0.0], 1e-9, name)
    assert np.isinf(cc.effort_per_force(five_bar, flat[None])).all()
    assert_close(cc.least_stiffness(1e5)(five_bar, flat[None]), [0.0], 1e-9)
    straight = cc.close(five_bar, five_bar.home, fixed={"B": 0.0}).raise_if_failed().q
    assert_close(cc.least_speed(five_bar, straight[None]), [0.0], 1e-9)
    assert_close(cc.isotropy(five_bar, straight[None]), [0.0], 1e-9)


def test_names_in_a_map(five_bar: cc.Mechanism) -> None:
    axis = np.linspace(-0.05, 0.05, 3)
    over = {"q1": 2.2 + axis, "q2": 0.9 + axis}
    wanted = ["condition", *NAMED]
    found = cc.singularity_map(five_bar, over, measures=wanted, keep_q=True, progress=False)
    q = found["q"].values.reshape(9, -1)
    for name, measure in NAMED.items():
        assert_close(found[name].values.ravel(), measure(five_bar, q), 1e-12, name)
    assert found["least_speed"].attrs["units"] == "m/s"
    assert found["isotropy"].attrs["long_name"].startswith("Slowest by fastest")


def test_what_names_do_not_say(five_bar: cc.Mechanism) -> None:
    for words, match in (
        (("speed",), "unknown measure 'speed'"),
        (("least_stiffness",), "needs the stiffness"),
        (("isotropy", [1.0]), "takes no numbers"),
    ):
        with pytest.raises(cc.ClosureError, match=match):
            tip_measure(*words)
    with pytest.raises(cc.ClosureError, match="output_transmission"):
        cc.singularity_map(five_bar, {"q1": [2.1, 2.2]}, measures=["nothing"])
    # one input and two outputs: some direction has no speed, none has all force
    one = four_bar()
    assert_close(cc.isotropy(one, one.home[None]), [0.0], 0.0)
