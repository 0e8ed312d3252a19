"""Machine code of tapes: right values, the same bits in every width and place, in loops too."""

from __future__ import annotations

import gc
import math
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest
from random_tapes import random_tape, root_tape

from closedchain.closure.tape import drivers, machine, native
from closedchain.closure.tape.expression import Graph, Tape
from closedchain.closure.tape.numbers import evaluate
from closedchain.closure.tape.sincos import RANGE

WIDTHS = (1, 2, 4, 8)


@pytest.fixture(autouse=True)
def nothing_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every test compiles for itself."""
    monkeypatch.setenv("CLOSEDCHAIN_CACHE", str(tmp_path))


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape == b.shape and bool(
        ((a.view(np.int64) == b.view(np.int64)) | (a != a) & (b != b)).all()
    )


def postures(tape: Tape, n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (tape.inputs, n))


def by_numpy(tape: Tape, x: np.ndarray) -> np.ndarray:
    return np.array([np.broadcast_to(v, x.shape[1]) for v in evaluate(tape, list(x))], dtype=float)


@pytest.mark.parametrize("seed", range(6))
def test_values_are_those_of_numpy(seed: int) -> None:
    tape = random_tape(seed)
    x = postures(tape, 50)
    assert np.allclose(machine.compiled(tape).run(x), by_numpy(tape, x), rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_every_width_and_place_gives_the_same_bits(seed: int) -> None:
    tape = random_tape(seed, length=80)
    x = postures(tape, 61, seed)
    made = {w: machine.compiled(tape, w) for w in WIDTHS}
    whole = made[1].run(x)
    for w, code in made.items():
        assert same_bits(code.run(x), whole), w
        assert same_bits(np.hstack([code.run(x[:, k : k + 1]) for k in range(61)]), whole), w
        for first in range(1, 12):
            for end in (first + 1, first + 3, first + 10, 61):
                assert same_bits(code.run(x[:, first:end]), whole[:, first:end]), (w, first, end)


def test_pieces_change_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    tape = random_tape(11, length=60)
    x = postures(tape, 13)
    whole = machine.compiled(tape).run(x)
    for length in (1, 7, 50):
        monkeypatch.setattr(machine, "PIECE", length)
        assert same_bits(machine.compiled(tape).run(x), whole), length


def test_no_operation_no_posture_no_output() -> None:
    g = Graph()
    x, y = g.inputs(0, 2)
    assert machine.compiled(g.tape([y, 3.0, x], 2)).run(np.array([[1.0], [2.0]])).tolist() == [
        [2.0],
        [3.0],
        [1.0],
    ]
    assert machine.compiled(g.tape([x + y], 2)).run(np.empty((2, 0))).shape == (1, 0)
    assert machine.compiled(g.tape([], 2)).run(np.empty((2, 3))).shape == (0, 3)
    assert machine.compiled(g.tape([g.lift(4.0)], 0)).run(np.empty((0, 3))).tolist() == [[4.0] * 3]


def test_arrays_of_other_layouts() -> None:
    tape = random_tape(2, length=40)
    code = machine.compiled(tape)
    x = postures(tape, 30)
    whole = code.run(x)
    assert same_bits(code.run(np.asfortranarray(x)), whole)
    assert same_bits(code.run(x[:, ::3]), np.ascontiguousarray(whole[:, ::3]))
    fixed = x.copy()
    fixed.flags.writeable = False
    assert same_bits(code.run(fixed), whole)
    assert same_bits(code.run(x[:, ::-1]), np.ascontiguousarray(whole[:, ::-1]))
    assert same_bits(code.run(x[::-1][::-1]), whole)
    flipped = np.zeros((2 * code.outputs, 30))[::-2]
    code.run_into(x, flipped)
    assert same_bits(np.ascontiguousarray(flipped), whole)
    out = np.zeros((code.outputs, 40))
    code.run_into(x[:, 5:20], out[:, 10:25])
    assert same_bits(out[:, 10:25].copy(), whole[:, 5:20].copy())
    assert not out[:, :10].any()
    assert not out[:, 25:].any()


def test_arrays_that_do_not_fit_are_refused() -> None:
    code = machine.compiled(random_tape(2, length=10))
    x, out = np.zeros((code.inputs, 4)), np.zeros((code.outputs, 4))
    for bad in (x[1:], x[:, :3], x[0]):
        with pytest.raises(ValueError, match=r"shape|postures"):
            code.run_into(bad, out)
    for wrong in (out[1:], out.astype(np.float32), np.asfortranarray(out), out[:, ::-1]):
        with pytest.raises(ValueError, match="out must be"):
            code.run_into(x, wrong)
    out.flags.writeable = False
    with pytest.raises(ValueError, match="writeable"):
        code.run_into(x, out)


def test_truth_values_and_numbers_do_not_mix() -> None:
    g = Graph()
    x, y = g.inputs(0, 2)
    for bad in ((x < y) + 1.0, x.select(x, y), x & y, (x < y).select(x < y, y), g.node("exp", 0)):
        with pytest.raises(TypeError, match="of the tape"):
            machine.compiled(g.tape([bad], 2))


def ulps(found: np.ndarray, x: np.ndarray, exact: object) -> float:
    """Largest error in units of the last place of the exact result."""
    worst = 0.0
    with mpmath.workprec(160):
        for value, argument in zip(found, x, strict=True):
            true = exact(mpmath.mpf(float(argument)))
            worst = max(worst, float(abs(mpmath.mpf(float(value)) - true)) / math.ulp(float(true)))
    return worst


def test_sine_and_cosine_to_the_last_place() -> None:
    g = Graph()
    a = g.input(0)
    code = machine.compiled(g.tape([a.sin(), a.cos()], 1))
    rng = np.random.default_rng(4)
    quarters = np.round(rng.uniform(-6e4, 6e4, 500)) * (math.pi / 2)
    x = np.concatenate(
        [
            rng.uniform(-4, 4, 2000),
            rng.uniform(-1e5, 1e5, 2000),
            rng.uniform(-RANGE, RANGE, 500),
            quarters,
            np.arange(-20, 20) * (math.pi / 2),
            10.0 ** rng.uniform(-300, 0, 300),
            [0.0, 1e-310, math.pi / 4, -math.pi / 4, RANGE, -RANGE],
        ]
    )
    sine, cosine = code.run(x[None])
    assert ulps(sine, x, mpmath.sin) < 1.0
    assert ulps(cosine, x, mpmath.cos) < 1.0


def test_sine_refuses_what_it_cannot_reduce() -> None:
    g = Graph()
    a = g.input(0)
    code = machine.compiled(g.tape([a.sin(), a.cos()], 1))
    x = np.array([[np.nan, np.inf, -np.inf, 1.0001 * RANGE, -1e300, 1e18]])
    assert np.isnan(code.run(x)).all()


def test_nan_is_never_hidden() -> None:
    g = Graph()
    x, y = g.inputs(0, 2)
    outputs = [x.min(y), y.min(x), x.max(y), y.max(x), abs(x) + y, (x * y).sqrt(), x < y, ~(x < y)]
    code = machine.compiled(g.tape(outputs, 2))
    found = code.run(np.array([[np.nan, 1.0, np.nan], [1.0, np.nan, np.nan]]))
    assert np.isnan(found[:6]).all()
    assert (found[6] == 0).all()
    assert (found[7] == 1).all()


@pytest.mark.parametrize("lanes", WIDTHS)
@pytest.mark.parametrize("n", [0, 1, 2, 8, 9, 21])
def test_loops_run_until_every_lane_is_done(lanes: int, n: int) -> None:
    loop = machine.looped(root_tape(), 2, lanes)
    a = np.random.default_rng(n).uniform(0.5, 1e6, (1, n))
    state = np.vstack([np.ones(n), np.zeros(n)])
    loop.run(state, a, 100)
    assert np.allclose(state[0], np.sqrt(a[0]), rtol=1e-14)
    alone = np.vstack([np.ones(n), np.zeros(n)])
    for k in range(n):
        loop.run(alone[:, k : k + 1], a[:, k : k + 1], 100)
    assert same_bits(alone, state)


def test_loops_stop_in_time() -> None:
    loop = machine.looped(root_tape(), 2)
    for most in (-1, 0, 1, 3):
        state = np.vstack([np.ones(11), np.zeros(11)])
        loop.run(state, np.full((1, 11), 1e6), most)
        assert (state[1] == max(0, most)).all()


def test_loops_without_parameters_or_with_no_end() -> None:
    g = Graph()
    x = g.input(0)
    loop = machine.looped(g.tape([x + 1.0, x < x + 1.0], 1), 1)
    state = np.arange(7.0)[None]
    loop.run(state, np.empty((0, 7)), 1000)
    assert state.tolist() == [[k + 1000.0 for k in range(7)]]


def test_loops_of_another_form_are_refused() -> None:
    g = Graph()
    x, y = g.inputs(0, 2)
    for outputs, state in (([x, y], 1), ([x, x < y], 2), ([x < y], 1)):
        with pytest.raises(ValueError, match="needs"):
            machine.looped(g.tape(outputs, 2), state)
    with pytest.raises(ValueError, match="among"):
        machine.looped(g.tape([x, y, x, x < y], 2), 3)


def test_bound_calls_read_what_the_arrays_hold() -> None:
    tape = random_tape(8, length=60)
    code = machine.compiled(tape)
    for n in (1, 5):
        x, out = np.zeros((code.inputs, n)), np.empty((code.outputs, n))
        call = code.bound(x, out)
        for seed in range(3):
            x[:] = postures(tape, n, seed)
            call()
            assert same_bits(out, code.run(x))
    state, a = np.ones((2, 1)), np.empty((1, 1))
    solve = machine.looped(root_tape(), 2).bound(state, a, 50)
    for value in (4.0, 81.0):
        a[:], state[:] = value, 1.0
        solve()
        assert state[0, 0] == pytest.approx(math.sqrt(value), rel=1e-14)
    with pytest.raises(ValueError, match="x must be"):
        code.bound(np.zeros((code.inputs, 4))[:, ::2], np.zeros((code.outputs, 2)))


def test_code_lives_as_long_as_its_functions() -> None:
    tape, x = random_tape(13, length=30), postures(random_tape(13, length=30), 3)
    whole = machine.compiled(tape).run(x)
    out = np.zeros_like(whole)
    call, ready = machine.compiled(tape).kernel.call, machine.compiled(tape).bound(x, out)
    for seed in range(3):
        machine.compiled(random_tape(60 + seed, length=30))
        gc.collect()
    ready()
    assert same_bits(out, whole)
    out[:] = 0.0
    call(x.ctypes.data, out.ctypes.data, 3, 3, 3)
    assert same_bits(out, whole)


def test_numpy_runs_what_is_too_long_to_compile(monkeypatch: pytest.MonkeyPatch) -> None:
    tape, x = random_tape(9, length=60), np.random.default_rng(1).uniform(-1, 1, (5, 600))
    a = np.random.default_rng(2).uniform(0.5, 1e6, (1, 600))
    fast, quick = machine.compiled(tape), machine.looped(root_tape(), 2)
    monkeypatch.setattr(machine, "LIMIT", 3)
    slow, loop = machine.compiled(tape), machine.looped(root_tape(), 2)
    assert fast.kernel.machine_code
    assert not slow.kernel.machine_code
    assert not loop.kernel.machine_code
    assert np.allclose(slow.run(x), fast.run(x), rtol=1e-9, atol=1e-11)
    assert np.allclose(slow.run(x[:, 5:9]), fast.run(x)[:, 5:9], rtol=1e-9, atol=1e-11)
    states = [np.vstack([np.ones(600), np.zeros(600)]) for _ in range(3)]
    quick.run(states[0], a, 100)
    loop.run(states[1], a, 100)
    loop.bound(states[2], a, 100)()
    assert np.allclose(states[0], states[1], rtol=1e-14)
    assert same_bits(states[1], states[2])
    assert slow.run(np.empty((5, 0))).shape == (slow.outputs, 0)


def test_large_memory_comes_from_the_heap(monkeypatch: pytest.MonkeyPatch) -> None:
    tape, x = random_tape(12, length=40), postures(random_tape(12, length=40), 21)
    on_stack = machine.compiled(tape).run(x)
    roots = np.vstack([np.ones(21), np.zeros(21)])
    a = 1.0 + np.arange(21.0)[None]
    monkeypatch.setattr(drivers, "STACK", 64)
    monkeypatch.setattr(machine, "PIECE", 9)
    assert "@malloc(i64" in machine.text(tape, None, (4, 1)).split("declare")[0]
    assert same_bits(machine.compiled(tape).run(x), on_stack)
    machine.looped(root_tape(), 2).run(roots, a, 50)
    assert np.allclose(roots[0] ** 2, a, rtol=1e-13)


def test_threads_share_the_code() -> None:
    tape = random_tape(5)
    code = machine.compiled(tape)
    x = postures(tape, 4000)
    whole = code.run(x)
    out = np.empty_like(whole)
    with ThreadPoolExecutor(4) as pool:
        parts = [slice(k, k + 37) for k in range(0, 4000, 37)]
        list(pool.map(lambda part: code.run_into(x[:, part], out[:, part]), parts))
    assert same_bits(out, whole)


def test_threads_compile_at_once() -> None:
    tapes = [random_tape(20 + k, length=30) for k in range(6)]
    with ThreadPoolExecutor(6) as pool:
        made = list(pool.map(machine.compiled, tapes))
    for tape, code in zip(tapes, made, strict=True):
        x = postures(tape, 5)
        assert np.allclose(code.run(x), by_numpy(tape, x), rtol=1e-9, atol=1e-11)


def test_code_for_machines_without_fused_multiply_add(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = replace(native.host(), fused=False)
    monkeypatch.setattr(native, "host", lambda: plain)
    tape = random_tape(3, length=60)
    x = postures(tape, 21)
    made = [machine.compiled(tape, w).run(x) for w in WIDTHS]
    assert np.allclose(made[0], by_numpy(tape, x), rtol=1e-9, atol=1e-11)
    assert all(same_bits(made[0], other) for other in made[1:])
    g = Graph()
    a, b, c = g.inputs(0, 3)
    y = np.random.default_rng(1).standard_normal((3, 100))
    assert same_bits(machine.compiled(g.tape([a * b + c], 3)).run(y), (y[0] * y[1] + y[2])[None])


def test_the_compiler_waits_for_the_first_tape() -> None:
    code = "import sys, closedchain.closure.tape.machine; print('llvmlite' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
