"""Mechanisms exported as C: compiled without a warning, run, and compared with Python."""

from __future__ import annotations

import html
import re
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from conftest import assert_close
from exported import AGREE, CC, Asked, Library, asked, compile_c, heavy, written
from small_linkages import build, joint, loop

import closedchain as cc
from closedchain.closure.code.program import ENDINGS
from closedchain.closure.solve.outcome import Ending
from closedchain.robots.viewer import static_page

needs_cc = pytest.mark.skipif(CC is None, reason="no gcc here")
ROBOTS = ("d1", "rpa3t")  # all rows independent; redundant ones


@pytest.fixture(scope="module", params=ROBOTS)
def case(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Library, Asked]:
    if CC is None:
        pytest.skip("no gcc here")
    m = cc.load(request.param)
    return Library.of(m, tmp_path_factory.mktemp("c")), asked(m, 30, 0.1)


def test_direct_agrees(case: tuple[Library, Asked]) -> None:
    robot, wanted = case
    for target, known in zip(wanted.targets, wanted.solved, strict=True):
        code, q = robot.solve("direct", target)
        assert (code == Ending.ARRIVED.code) == known.converged
        if known.converged:
            assert_close(q, known.q, AGREE)
        assert np.abs(cc.residual(robot.mechanism, q)).max() < 1e-9
    assert len(wanted.postures) >= 5


def test_inverse_agrees(case: tuple[Library, Asked]) -> None:
    robot, wanted = case
    agreeing = 0
    for pose, known in zip(wanted.poses, wanted.posed, strict=True):
        code, q = robot.solve("inverse", pose, wanted.postures[0])
        if code == Ending.ARRIVED.code:
            assert_close(q, known.q, AGREE)
            agreeing += 1
    assert agreeing >= 0.9 * sum(known.converged for known in wanted.posed) > 4


def test_postures_are_told_alike(case: tuple[Library, Asked]) -> None:
    robot, wanted = case
    m = robot.mechanism
    for q, pose in zip(wanted.postures, wanted.poses, strict=True):
        found = robot.numbers("tip", q, 7)
        sign = np.sign(found[3:] @ pose[3:])
        assert_close(found, pose * [1, 1, 1, *[sign] * 4], AGREE)
        assert np.array_equal(robot.numbers("inputs_of", q, len(m.inputs)), m.input_values(q))


def test_measures_agree(case: tuple[Library, Asked]) -> None:
    robot, wanted = case
    for q in wanted.postures[:8]:
        code, twist_map, (direct, inverse, det_direct, det_inverse) = robot.measured(q)
        assert code == Ending.ARRIVED.code
        known, velocity = cc.classify(robot.mechanism, q), cc.velocity(robot.mechanism, q)
        assert_close(twist_map, velocity.twist_map, AGREE)
        assert_close([direct, inverse], [known.sigma_direct, known.sigma_inverse], AGREE)
        for one, other in ((det_direct, known.det_direct), (det_inverse, known.det_inverse)):
            assert one == pytest.approx(0.0 if other is None else other, rel=1e-11)


def test_efforts_agree(case: tuple[Library, Asked]) -> None:
    robot, wanted = case
    m, rng = robot.mechanism, np.random.default_rng(3)
    for q in wanted.postures[:6]:
        wrench, fall = rng.standard_normal(6), rng.standard_normal(3)
        known = cc.statics(m, q, wrench, gravity=fall)
        code, found = robot.efforts(q, wrench, fall)
        assert code == (Ending.ARRIVED.code if known.carried else Ending.SINGULAR.code)
        assert_close(found, known.inputs if known.carried else 0.0 * known.inputs, 1e-11)
        known = cc.statics(m, q)
        assert_close(robot.efforts(q, None, None)[1], known.inputs, 1e-11)


def test_an_inverse_singularity_is_measured(case: tuple[Library, Asked]) -> None:
    robot, _ = case
    m = robot.mechanism
    known = cc.classify(m, m.home)
    code, _, (direct, inverse, *_) = robot.measured(m.home)
    assert code == Ending.ARRIVED.code
    assert_close([direct, inverse], [known.sigma_direct, known.sigma_inverse], AGREE)
    if "inverse" in known.kinds:  # D1's home
        assert inverse < 1e-12
        code, q = robot.solve("inverse", np.array([0, 0, 0, 0, 0, 0, 1.0]))
        assert code == Ending.SINGULAR_START.code
        assert_close(q, m.home, AGREE)


def test_numbers_that_are_none_are_refused(case: tuple[Library, Asked]) -> None:
    robot, wanted = case
    good, target = wanted.postures[0], wanted.targets[0]
    for bad in (np.nan, np.inf, 1e300):
        broken = [x.copy() for x in (target, good, wanted.poses[0])]
        for x in broken:
            x[0] = bad
        for answer in (
            robot.solve("direct", broken[0]),
            robot.solve("direct", target, broken[1]),
            robot.solve("inverse", broken[2], good),
        ):
            assert answer[0] == Ending.UNTRIED.code
            assert (answer[1] == -7.0).all()
        assert robot.measured(broken[1])[0] == Ending.UNTRIED.code
    open_ = good + 0.01
    assert robot.measured(open_)[0] == Ending.OPEN.code
    assert robot.solve("direct", target, good + 0.5)[0] != Ending.ARRIVED.code


def test_stack_is_bounded_and_nothing_is_called_but_mathematics(
    case: tuple[Library, Asked],
) -> None:
    robot, _ = case
    lines = (robot.folder / "robot.su").read_text().splitlines()
    usage = [line.split("\t") for line in lines]
    assert {kind for *_, kind in usage} == {"static"}  # no arrays of unknown size, no alloca
    assert max(int(size) for _, size, _ in usage) < 64_000
    symbols = subprocess.run(
        ["nm", "-u", robot.folder / "robot.o"], capture_output=True, text=True, check=True
    ).stdout
    needed = set(re.findall(r"U (\w+)", symbols)) - {"_GLOBAL_OFFSET_TABLE_"}
    assert needed <= {"sin", "cos", "sincos", "sqrt", "memset", "memcpy", "memmove"}


# -- a small linkage, in all that a compiler can say of it --------------------------------------


def four_bar() -> cc.Mechanism:
    """Crank 1, coupler 2.5, rocker 2 on a ground of 2: the crank turns, but not all around."""
    parts = [
        joint("crank", "base", "a"),
        joint("elbow", "a", "b", "1 0 0"),
        joint("rocker", "base", "c", "2 0 0"),
    ]
    parts.append(loop("revolute", "b", "2.5 0 0", "c", "2 0 0"))
    home = {"crank": 1.0, "elbow": -1.0, "rocker": 1.5}
    task = '<task base="base" tip="b" outputs="rz"/>'
    return cc.load_urdf(
        build("base a b c", parts, home, inputs="crank", task=task).description.text, xacro=False
    )


@needs_cc
def test_weights_are_held(tmp_path: Path) -> None:
    m = heavy(four_bar())
    robot = Library.of(m, tmp_path)
    fall = np.array([1.0, -9.0, 0.5])
    for angle in np.linspace(0.6, 1.6, 6):
        _, q = robot.solve("direct", np.array([angle]))
        code, found = robot.efforts(q, None, fall)
        assert code == Ending.ARRIVED.code
        assert_close(found, cc.statics(m, q, gravity=fall).inputs, AGREE * 10)
        work = [lifted(m, robot.solve("direct", np.array([angle + d]))[1], fall) for d in STEPS]
        assert found[0] == pytest.approx((work[1] - work[0]) / (STEPS[1] - STEPS[0]), rel=1e-7)
        assert abs(found[0]) > 0.1


STEPS = (-1e-4, 1e-4)


def lifted(m: cc.Mechanism, q: np.ndarray, fall: np.ndarray) -> float:
    """Potential energy [J] in a free fall."""
    data = m.model.createData()
    mass = sum(inertia.mass for inertia in m.model.inertias)
    own = m.model.inertias[0].mass  # of the base, which Pinocchio leaves out
    return -(mass - own) * float(fall @ pin.centerOfMass(m.model, data, q))


@needs_cc
def test_sanitizers_find_nothing(tmp_path: Path) -> None:
    m = four_bar()
    written(tmp_path, cc.export_code(m, "c", name="bar"))
    main = tmp_path / "main.c"
    main.write_text(
        '#include "bar.h"\n#include <stdio.h>\nint main(void) {\n'
        "    double q[BAR_Q] = {0}, next[BAR_Q], pose[BAR_POSE], u[BAR_INPUTS];\n"
        "    bar_measures found;\n    int codes[BAR_ENDINGS + 32] = {0};\n"
        "    for (int k = -400; k < 400; ++k) {\n        u[0] = 0.05 * k;\n"
        "        ++codes[bar_direct(u, k % 2 ? q : 0, next)];\n"
        "        for (int i = 0; i < BAR_Q; ++i) q[i] = next[i];\n"
        "        bar_tip(q, pose);\n        ++codes[bar_inverse(pose, q, q)];\n"
        "        ++codes[bar_efforts(q, pose, 0, u)];\n"
        "        ++codes[bar_measure(q, &found)];\n        bar_inputs_of(q, u);\n"
        "        if (!bar_sentence(k) || !(bar_residual(q) < 1e-9)) return 1;\n"
        "        if (!(bar_within_limits(q) < 1.1)) return 2;\n    }\n"
        '    printf("%d %d", codes[BAR_ARRIVED], codes[BAR_SINGULAR]);\n    return 0;\n}\n'
    )
    checked = "-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
    source = tmp_path / "bar.c"
    for sources, to in (([source, main], "main"), ([source, tmp_path / "bar_test.c"], "test")):
        program = compile_c(tmp_path, sources, checked, to)
        done = subprocess.run([program], capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stdout + done.stderr
        assert done.stderr == ""
    assert "0 failed" in done.stdout


@needs_cc
@pytest.mark.slow
@pytest.mark.parametrize("name", ["gough_stewart", "three_rrr"])  # without and with redundant rows
def test_a_robot_tests_itself_under_sanitizers(name: str, tmp_path: Path) -> None:
    written(tmp_path, cc.export_code(cc.load(name), "c", name="robot"))
    checked = "-O0 -fsanitize=address,undefined -fno-sanitize-recover=all"
    both = [tmp_path / "robot.c", tmp_path / "robot_test.c"]
    program = compile_c(tmp_path, both, checked, "test")
    done = subprocess.run([program], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    told = re.fullmatch(r"robot: 0 failed, largest difference (\S+)\n", done.stdout)
    assert told is not None
    assert float(told[1]) < AGREE


@needs_cc
def test_other_bounds_of_the_work_may_be_compiled_in(tmp_path: Path) -> None:
    robot = Library.of(four_bar(), tmp_path, "-O1 -DROBOT_MOST_STEPS=2")
    assert robot.solve("direct", np.array([1.6]))[0] == Ending.BUDGET.code


@needs_cc
@pytest.mark.parametrize("name", ["d1", "rpa3t"])
def test_single_precision(name: str, tmp_path: Path) -> None:
    files = cc.export_code(cc.load(name), "c", name="robot", number="float")
    assert "double" not in files["robot.c"]
    written(tmp_path, files)
    both = [tmp_path / "robot.c", tmp_path / "robot_test.c"]
    program = compile_c(tmp_path, both, "-O1 -Wdouble-promotion", "test")
    done = subprocess.run([program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout


@needs_cc
def test_the_self_test_can_fail(tmp_path: Path) -> None:
    files = cc.export_code(four_bar(), "c", name="bar")
    known = re.search(r"known_0\[\] = \{\s*(\S+),", files["bar_test.c"])
    assert known is not None
    broken = files["bar_test.c"].replace(known[1], repr(float(known[1]) + 1e-6))
    written(tmp_path, files | {"bar_test.c": broken})
    program = compile_c(tmp_path, [tmp_path / "bar.c", tmp_path / "bar_test.c"], "-O0", "test")
    assert subprocess.run([program], capture_output=True, timeout=60).returncode == 1


@needs_cc
def test_names_of_strangers_are_comments(tmp_path: Path) -> None:
    evil = html.escape('*/ "evil" /* ??/ \\', quote=True)
    m = cc.load_urdf(four_bar().description.text.replace("crank", evil), xacro=False)
    written(tmp_path, cc.export_code(m, "c", name="bar"))
    compile_c(tmp_path, [tmp_path / "bar.c"], "-O0 -c", "bar.o")


@needs_cc
@pytest.mark.parametrize("inputs", ["a b", "a b c", "a", ""])
def test_open_chains_with_more_or_less_driven(inputs: str, tmp_path: Path) -> None:
    parts = [joint("a", "base", "one"), joint("b", "one", "two", "1 0 0")]
    parts.append(joint("c", "two", "three", "1 0 0"))
    task = '<task base="base" tip="three" outputs="x y"/>'
    m = build("base one two three", parts, {"b": 0.5}, inputs=inputs, task=task)
    robot = Library.of(m, tmp_path)
    pose = pin.SE3ToXYZQUAT(m.pose(np.array([0.2, 0.7, 0.0])))
    code, q = robot.solve("inverse", pose)
    assert code == Ending.ARRIVED.code
    assert_close(m.pose(q).translation[:2], pose[:2], AGREE)
    if inputs:
        code, _, (direct, inverse, *dets) = robot.measured(m.home)
        known = cc.classify(m, m.home)
        assert code == (Ending.SINGULAR if inputs == "a" else Ending.ARRIVED).code
        assert_close([direct, inverse], [known.sigma_direct, known.sigma_inverse], AGREE)
        assert_close(dets, [known.det_direct or 0.0, known.det_inverse or 0.0], AGREE)


@needs_cc
def test_without_a_task_only_the_direct_problem(tmp_path: Path) -> None:
    parts = [joint("a", "base", "one"), joint("b", "one", "two", "1 0 0")]
    m = build("base one two", parts, {}, inputs="a b")
    robot = Library.of(m, tmp_path)
    code, q = robot.solve("direct", np.array([0.3, -0.2]))
    assert code == 0
    assert_close(q, [0.3, -0.2], AGREE)
    header = (tmp_path / "robot.h").read_text()
    assert "robot_inverse" not in header
    assert "robot_measure" not in header


def test_requests_that_make_no_sense() -> None:
    m = four_bar()
    with pytest.raises(cc.ClosureError, match="not in 'fortran'"):
        cc.export_code(m, "fortran")
    with pytest.raises(cc.ClosureError, match="double or float"):
        cc.export_code(m, "c", number="half")
    with pytest.raises(cc.ClosureError, match="are double"):
        cc.export_code(m, "js", number="float")
    with pytest.raises(cc.ClosureError, match="cannot be called"):
        cc.export_code(m, "c", name="two words")
    with pytest.raises(cc.ClosureError, match="neither inputs"):
        cc.export_code(build("base one", [joint("a", "base", "one")], {}), "c")


def test_open_homes_are_refused() -> None:
    text = four_bar().description.text.replace('xyz="2.5 0 0"', 'xyz="25 0 0"')
    m = cc.load_urdf(text, xacro=False)
    assert m.home_open
    with pytest.raises(cc.ClosureError, match="needs a closed home"):
        cc.export_code(m, "c")
    page = static_page(m, controls=True)
    assert "nothing can be moved here: the loops are open at home" in page


def test_codes_are_documented() -> None:
    header = cc.export_code(four_bar(), "c", name="bar")["bar.h"]
    for ending in ENDINGS:
        assert f"BAR_{ending.name} = {ending.code}, /* {ending.sentence} */" in header
