"""Tapes printed as C and JavaScript: compiled or run, and compared with numpy."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from random_tapes import random_tape, root_tape

from closedchain.closure.tape.c_text import c_function, c_loop
from closedchain.closure.tape.expression import Graph, Tape
from closedchain.closure.tape.js_text import js_function, js_loop
from closedchain.closure.tape.numbers import evaluate

CC, NODE = shutil.which("cc"), shutil.which("node")
needs_cc = pytest.mark.skipif(CC is None, reason="no C compiler here")
needs_node = pytest.mark.skipif(NODE is None, reason="no node here")
TAPES = [0, 1, 2]
NAN = float("nan")


def expected(tape: Tape, x: np.ndarray) -> np.ndarray:
    return np.array([evaluate(tape, list(column)) for column in x.T], dtype=float).T


def postures(tape: Tape) -> np.ndarray:
    return np.random.default_rng(9).uniform(-1.5, 1.5, (tape.inputs, 6))


def edges() -> Tape:
    """What is easily printed wrongly: signs, constants, swaps in place, NaN."""
    g = Graph()
    x, y = g.inputs(0, 2)
    return g.tape([y, x, x - (-0.5), -(x * -1e-7), x.min(y), y.max(x), (x - y) * 1e300, -3.0], 2)


def built(folder: Path, text: str) -> ctypes.CDLL:
    source, library = folder / "tape.c", folder / "tape.so"
    source.write_text(text)
    command = f"{CC} -std=c99 -pedantic -Wall -Wextra -Werror -O1 -shared -fPIC -o"
    subprocess.run([*command.split(), str(library), str(source), "-lm"], check=True, timeout=120)
    return ctypes.CDLL(str(library))


def address(x: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(x.ctypes.data)


@needs_cc
@pytest.mark.parametrize("seed", TAPES)
def test_c_computes_the_same(seed: int, tmp_path: Path) -> None:
    tape = random_tape(seed)
    function = built(tmp_path, c_function(tape, "closure")).closure
    x = postures(tape)
    for given, wanted in zip(x.T.copy(), expected(tape, x).T, strict=True):
        y = np.empty(len(tape.outputs))
        function(address(given), address(y))
        assert np.allclose(y, wanted, rtol=1e-12, atol=1e-13)


@needs_cc
def test_c_of_edges(tmp_path: Path) -> None:
    function = built(tmp_path, c_function(edges(), "f")).f
    for given in ([1.5, -2.5], [NAN, 1.0], [1.0, NAN]):
        buffer = np.zeros(8)
        buffer[:2] = given
        function(address(buffer), address(buffer))
        with np.errstate(all="ignore"):
            wanted = np.array(evaluate(edges(), given), dtype=float)
        assert np.array_equal(buffer, wanted, equal_nan=True)


@needs_cc
def test_c_of_nothing_used(tmp_path: Path) -> None:
    g = Graph()
    function = built(tmp_path, c_function(g.tape([g.lift(2.0)], 3), "f")).f
    y = np.empty(1)
    function(None, address(y))
    assert y[0] == 2.0
    assert "void f" in c_function(g.tape([], 0), "f")


@needs_cc
def test_c_loops(tmp_path: Path) -> None:
    function = built(tmp_path, c_loop(root_tape(), 2, "root")).root
    for a in (2.0, 1e6, 0.3):
        state, given = np.array([1.0, 0.0]), np.array([a])
        function(address(state), address(given), 100)
        assert state[0] == pytest.approx(a**0.5, rel=1e-13)
        steps = state[1]
        state[:] = 1.0, 0.0
        function(address(state), address(given), 2)
        assert state[1] == 2.0 < steps


MAIN = """
import { NAME as f } from "./tape.mjs";
const read = (v) => (v === null ? NaN : v);
const found = CALLS.map(([result, ...given]) => {
  const arrays = given.map((a) => (Array.isArray(a) ? Float64Array.from(a, read) : a));
  f(...arrays);
  return Array.from(arrays[result]);
});
console.log(JSON.stringify(found));
"""


def run_js(folder: Path, text: str, name: str, calls: list[list[object]]) -> list[np.ndarray]:
    """Results of calls, each given as the number of the array that holds it and the arguments."""
    (folder / "tape.mjs").write_text(text)
    given = json.dumps(calls).replace("NaN", "null")
    (folder / "main.mjs").write_text(MAIN.replace("NAME", name).replace("CALLS", given))
    command = [str(NODE), str(folder / "main.mjs")]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)
    return [np.array(found, dtype=float) for found in json.loads(done.stdout)]


@needs_node
def test_javascript_computes_the_same(tmp_path: Path) -> None:
    for seed in TAPES:
        tape = random_tape(seed)
        x = postures(tape)
        empty = [0.0] * len(tape.outputs)
        calls: list[list[object]] = [[1, list(column), empty] for column in x.T]
        found = run_js(tmp_path, js_function(tape, "closure"), "closure", calls)
        assert np.allclose(np.array(found).T, expected(tape, x), rtol=1e-12, atol=1e-13)


@needs_node
def test_javascript_of_edges(tmp_path: Path) -> None:
    cases = ([1.5, -2.5], [NAN, 1.0], [1.0, NAN])
    calls: list[list[object]] = []
    for given in cases:
        buffer = [*given, *[0.0] * 6]
        calls.append([0, buffer, buffer])
    text = js_function(edges(), "f").replace("(x, y) {", "(x) {\n    const y = x;")
    for given, found in zip(cases, run_js(tmp_path, text, "f", calls), strict=True):
        with np.errstate(all="ignore"):
            wanted = np.array(evaluate(edges(), given), dtype=float)
        assert np.array_equal(found, wanted, equal_nan=True)


@needs_node
def test_javascript_loops(tmp_path: Path) -> None:
    calls: list[list[object]] = [
        [0, [1.0, 0.0], [a], most] for a in (2.0, 1e6, 0.3) for most in (100, 2)
    ]
    found = run_js(tmp_path, js_loop(root_tape(), 2, "root"), "root", calls)
    for (whole, cut), a in zip(
        zip(found[::2], found[1::2], strict=True), (2.0, 1e6, 0.3), strict=True
    ):
        assert whole[0] == pytest.approx(a**0.5, rel=1e-13)
        assert cut[1] == 2.0 < whole[1]


@pytest.mark.parametrize("write", [c_function, js_function])
def test_names_and_forms_are_checked(write: Callable[[Tape, str], str]) -> None:
    with pytest.raises(ValueError, match="no name of a function"):
        write(root_tape(), "two words")
    for loop in (c_loop, js_loop):
        with pytest.raises(ValueError, match="needs 1 outputs"):
            loop(root_tape(), 1, "f")
    g = Graph()
    x = g.input(0)
    with pytest.raises(TypeError, match="mixes"):
        write(g.tape([(x < 0.0) * 2.0], 1), "f")
