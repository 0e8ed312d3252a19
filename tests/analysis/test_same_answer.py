"""The same question has the same answer to the last bit, whatever was asked before, and where."""

from __future__ import annotations

import pickle
import random
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import closedchain as cc
from closedchain.closure.solve.samples import closed_samples

Question = Callable[[cc.Mechanism], tuple[Any, ...]]


def questions(robot: str) -> dict[str, Question]:
    """What is asked of a robot, in neutral postures and wide ones, alone and many at once."""
    m = cc.load(robot)
    rng = np.random.default_rng(2)
    samples = closed_samples(m)[:4]
    guesses = [
        pin.integrate(m.model, q, 0.2 * rng.standard_normal(m.model.nv) * m.column_scale)
        for q in samples
    ]
    home, unit = m.input_values(m.home), m.column_scale[m.input_v]
    inputs = [m.input_values(q) for q in samples[1:]]
    inputs += [home + 0.3 * unit * rng.standard_normal(home.size) for _ in range(3)]
    poses = [m.pose(q) for q in samples[1:]]
    poses += [
        pin.SE3(
            pin.exp3(0.3 * rng.standard_normal(3)), p.translation + 0.1 * rng.standard_normal(3)
        )
        for p in poses[:1]
    ]
    over = {
        name: np.linspace(home[i] - 0.1 * unit[i], home[i] + 0.1 * unit[i], 6)
        for i, name in enumerate(m.inputs[:2])
    }
    asked: dict[str, Question] = {"map": lambda m: _map(m, over), "mobility": _mobility}
    for i, x in enumerate(inputs):
        asked[f"direct {i}"] = lambda m, x=x: _solution(cc.direct(m, x))
        asked[f"direct {i} from a list"] = lambda m, x=x: _solution(cc.direct(m, x.tolist()))
    asked["direct, many"] = lambda m: _solutions(cc.direct(m, np.array(inputs)))
    for i, pose in enumerate(poses):
        asked[f"inverse {i}"] = lambda m, p=pose: _solution(cc.inverse(m, p))
    asked["inverse from elsewhere"] = lambda m: _solution(cc.inverse(m, poses[2], samples[2]))
    asked["inverse, many"] = lambda m: _solutions(cc.inverse(m, poses))
    for i, (q, guess) in enumerate(zip(samples, guesses, strict=True)):
        near = pin.integrate(m.model, q, np.full(m.model.nv, 1e-9))
        asked[f"classify {i}"] = lambda m, q=q: _classified(m, q)
        asked[f"classify {i}, two outputs"] = lambda m, q=q: _classified(m, q, "x y")
        asked[f"classify beside {i}"] = lambda m, q=near: _classified(m, q)
        asked[f"rates {i}"] = lambda m, q=q: _rates(m, q)
        asked[f"close {i}"] = lambda m, g=guess: _solution(cc.close(m, g))
        asked[f"close {i}, held"] = lambda m, g=guess, x=inputs[i]: _solution(
            cc.close(m, g, fixed=dict(zip(m.inputs, x, strict=True)))
        )
    return asked


def _solution(s: cc.Solution) -> tuple[Any, ...]:
    return s.q, s.residual, s.converged, s.message, s.iterations, s.branch, s.ending.word


def _solutions(s: cc.Solutions) -> tuple[Any, ...]:
    return s.q, s.residual, s.codes, s.reached, s.branch, s.within


def _classified(m: cc.Mechanism, q: np.ndarray, outputs: str | None = None) -> tuple[Any, ...]:
    c = cc.classify(m, q, outputs)
    sigmas = c.sigma_direct, c.sigma_inverse, c.sigma_constraint, c.distance, c.accuracy
    return (c.text, *sigmas, c.det_direct, c.det_inverse, c.free_twists, c.lost_twists)


def _rates(m: cc.Mechanism, q: np.ndarray) -> tuple[Any, ...]:
    v, r = cc.velocity(m, q), cc.redundancy(m, q)
    return v.Jx, v.Jq, v.twist_map, r.joints, r.text, cc.residual(m, q)


def _map(m: cc.Mechanism, over: dict[str, np.ndarray]) -> tuple[Any, ...]:
    found = cc.singularity_map(m, over, progress=False, keep_q=True)
    return tuple(found[name].to_numpy() for name in sorted(found.data_vars))


def _mobility(m: cc.Mechanism) -> tuple[Any, ...]:
    return (cc.mobility(m).text,)


def bits(answer: Any) -> bytes:
    """Every number of an answer to the last bit."""
    if isinstance(answer, tuple):
        return b"|".join(bits(part) for part in answer)
    if isinstance(answer, np.ndarray):
        return f"{answer.dtype}{answer.shape}".encode() + answer.tobytes()
    if isinstance(answer, float):
        return np.float64(answer).tobytes()
    return repr(answer).encode()


def ask(m: cc.Mechanism, asked: dict[str, Question], seed: int) -> dict[str, bytes]:
    """All questions, in an order of their own."""
    order = list(asked)
    random.Random(seed).shuffle(order)
    return {name: bits(asked[name](m)) for name in order}


@pytest.mark.slow
@pytest.mark.parametrize("robot", cc.robots("papers"))
def test_answers_do_not_depend_on_what_was_asked_before_nor_on_the_thread(robot: str) -> None:
    """Twice here, in other orders, and in two threads that share a mechanism new to them."""
    asked, m = questions(robot), cc.load(robot)
    here = ask(m, asked, 0)
    other = pickle.loads(pickle.dumps(m))
    found: dict[int, dict[str, bytes]] = {}

    def work(seed: int) -> None:
        found[seed] = ask(other, asked, seed)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in (1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found[3] = ask(m, asked, 3)
    assert sorted(found) == [1, 2, 3], "no thread failed"
    for seed, there in found.items():
        assert [name for name in asked if there[name] != here[name]] == [], seed
    for name in asked:
        if name.endswith("from a list"):
            assert here[name] == here[name.removesuffix(" from a list")], name


def test_a_difference_in_the_last_bit_is_seen() -> None:
    assert bits((1.0, np.ones(2))) != bits((1.0, np.array([1.0, np.nextafter(1.0, 2.0)])))
    assert bits((1.0,)) != bits((np.nextafter(1.0, 2.0).item(),))
