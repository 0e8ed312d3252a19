"""Counts at generic values: Newton's steps as a tape, paths, loops, slices and their trace."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from conftest import Tolerances
from small_linkages import GRASHOF, four_bar

import closedchain as cc
from closedchain.closure.modes import monodromy, path_tapes
from closedchain.closure.modes.blocks import Block, blocks_of
from closedchain.closure.modes.complex_equations import equations_of
from closedchain.closure.modes.complex_tape import complex_tape
from closedchain.closure.modes.loops import closed_under, merged
from closedchain.closure.modes.monodromy import generic_solutions
from closedchain.closure.modes.paths import Paths
from closedchain.closure.modes.places import random_place
from closedchain.closure.modes.random_solutions import random_solutions
from closedchain.closure.modes.shapes import shapes_of
from closedchain.closure.modes.slices import Slices
from closedchain.closure.position import driven, posed
from closedchain.closure.tape.expression import Graph


def block_of(m: cc.Mechanism) -> Block:
    (found,) = blocks_of(equations_of(driven(m)))
    return found


@pytest.fixture(scope="module")
def bar() -> cc.Mechanism:
    return four_bar(GRASHOF, 0.3)


def test_square_roots_keep_the_digits_of_their_smaller_part(tol: Tolerances) -> None:
    g = Graph()
    root = complex_tape(g.tape([g.input(0).sqrt()], 1))
    for x in (1.0 + 1e-9j, 1.0 - 1e-12j, -1.0 + 1e-9j, -2.0 - 1e-11j, 3.0j, -0.5 + 0.2j):
        found = root.run(np.array([[x]]))[0, 0]
        assert abs(found.real / np.sqrt(x).real - 1.0) < tol.algebra
        assert abs(found.imag / np.sqrt(x).imag - 1.0) < tol.algebra


@pytest.mark.parametrize("tip", [False, True])
def test_newtons_steps_are_those_of_lapack(tip: bool) -> None:
    m = cc.load("eclipse")
    for block in blocks_of(equations_of(posed(m) if tip else driven(m))):
        rng, problem = np.random.default_rng(4), block.equations.problem
        place = random_place(problem, rng)
        q = random_solutions(block, place, rng, 1)[:20]
        targets = np.repeat(place.targets[None], len(q), axis=0)
        q[:, block.own] += 1e-3 * rng.standard_normal((len(q), len(block.own)))
        block.numbers.settle(q, targets)
        found = complex_tape(block.system.tape).run(np.hstack([q, targets]).T).T
        fast, step = found[:, : len(block.own)], found[:, len(block.own) : -2]
        slow, expected = block.newton_by_lapack(q, targets)
        assert np.abs(step - expected).max() < 1e-9 * np.abs(expected).max()
        assert np.abs(fast - slow[:, block.own]).max() < 1e-9 * np.abs(slow).max()


def test_paths_there_and_back_end_where_they_began(bar: cc.Mechanism, tol: Tolerances) -> None:
    block, rng = block_of(bar), np.random.default_rng(0)
    here, there = (random_place(block.equations.problem, rng) for _ in range(2))
    q = merged(shapes_of(bar).of, *([random_solutions(block, here, rng, 1)] * 2))
    assert len(q) == 2
    away = block.paths.track(here, there, q)
    back = block.paths.track(there, here, away.q)
    assert away.good.all()
    assert back.good.all()
    assert np.abs(shapes_of(bar).of(back.q) - shapes_of(bar).of(q)).max() < tol.algebra


def test_a_trace_is_straight_only_over_all_points(bar: cc.Mechanism) -> None:
    block, rng = block_of(bar), np.random.default_rng(0)
    found = generic_solutions(block, shapes_of(bar))
    assert (len(found.q), found.points, found.known) == (2, 6, True)
    slices = Slices(block, found.place, found.q)
    start = slices.through(found.q[0], rng)
    here = slices.at(start, 1.0)
    begin = np.hstack([found.q, np.full((2, 1), start.given[-1])])
    points = slices.paths.track(start, here, begin).q
    ways = [(here, slices.random(rng), slices.random(rng), here) for _ in range(6)]

    def telling(p: np.ndarray) -> np.ndarray:
        return np.hstack([shapes_of(bar).of(p[:, :-1]), p[:, -1:]])

    points = closed_under(slices.paths, telling, ways, points, 100, lambda count: None)
    assert len(points) == 6
    assert monodromy.straight(slices, here, points)
    for left_out in range(6):
        assert not monodromy.straight(slices, here, np.delete(points, left_out, axis=0))


def test_slices_have_the_derivatives_that_differences_give(bar: cc.Mechanism) -> None:
    """A step from beside a point of the curve leads back, with an error that is quadratic."""
    eclipse = cc.load("eclipse")
    cases = [block_of(bar), *blocks_of(equations_of(posed(eclipse)))]
    for block in cases:
        rng = np.random.default_rng(3)
        place = random_place(block.equations.problem, rng)
        q = random_solutions(block, place, rng, 1)[:1]
        slices = Slices(block, place, q)
        start = slices.through(q[0], rng)
        point = np.append(q[0], start.given[-1])[None]
        errors, direction = [], rng.standard_normal(len(slices.own)) + 0.5j
        for size in (1e-3, 1e-4):
            off = point.copy()
            off[:, slices.own] += size * direction
            slices.system.numbers.settle(off, start.targets[None])
            found = complex_tape(slices.system.tape).run(np.hstack([off, start.targets[None]]).T).T
            moved = found[:, : len(slices.own)]
            errors.append(np.abs(moved - point[:, slices.own]).max())
        assert errors[1] < 0.05 * errors[0]


def test_without_a_straight_trace_nothing_is_counted(
    bar: cc.Mechanism, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in (("straight", lambda *_: False), ("MOST_PLACES", 1), ("TRIALS", 1)):
        monkeypatch.setattr(monodromy, name, value)
    found = generic_solutions(block_of(bar), shapes_of(bar))
    assert not found.known
    assert len(found.q) == 2


def test_where_slices_are_too_large_loops_alone_decide_and_that_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(monodromy, "POINTS", (0, 1))
    m = four_bar((0.32, 0.9, 0.8, 1.0), 0.3)
    assert generic_solutions(block_of(m), shapes_of(m)).points == 0
    found = cc.postures(m, inputs=[0.3])
    assert (found.complete, found.complex_count) == ("counted", 2)
    assert "trace test could not be had" in found.text


def test_paths_that_end_alike_are_not_two_solutions(
    bar: cc.Mechanism, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a jump from path to path would do: a solution twice, another one never."""
    from closedchain.closure.modes import counting

    m = four_bar(GRASHOF, 0.3)
    generic = counting.generic_solutions

    def doubled(*given: object, **more: object) -> monodromy.Generic:
        found = generic(*given, **more)  # type: ignore[arg-type]
        return dataclasses.replace(found, q=found.q[[0, 0]])

    monkeypatch.setattr(counting, "generic_solutions", doubled)
    monkeypatch.setattr(counting, "FORMAT", "generic solutions of a test")
    found = cc.postures(m, inputs=[0.3])
    assert found.complete == "searched"
    assert len(found) == 2


def test_paths_by_lapack_end_where_those_of_machine_code_do(
    bar: cc.Mechanism, monkeypatch: pytest.MonkeyPatch, tol: Tolerances
) -> None:
    block, rng = block_of(bar), np.random.default_rng(0)
    here, there = (random_place(block.equations.problem, rng) for _ in range(2))
    q = random_solutions(block, here, rng, 1)
    known = block.paths.track(here, there, q)
    monkeypatch.setattr(path_tapes, "LEFT", 0.0)  # every step asks that leaves anything
    monkeypatch.setattr(path_tapes, "ROUNDING", 1e-150)
    asked, system = [], block.system

    def slow(x: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked.append(len(x))
        return block.newton_by_lapack(x, targets)

    again = Paths(dataclasses.replace(system, slow=slow)).track(here, there, q)
    assert len(asked) > 10
    assert known.good.all()
    assert again.good.all()
    assert np.abs(again.q - known.q).max() < tol.algebra


def test_cosine_and_sine_of_complex_angles_are_those_of_numpy(tol: Tolerances) -> None:
    g = Graph()
    both = complex_tape(g.tape([g.input(0).cos(), g.input(0).sin()], 1))
    rng = np.random.default_rng(0)
    x = rng.uniform(-9.0, 9.0, 200) + 1j * rng.uniform(-20.0, 20.0, 200)
    for found, known in zip(both.run(x[None]), (np.cos(x), np.sin(x)), strict=True):
        assert (np.abs(found - known) < tol.algebra * np.abs(known)).all()
