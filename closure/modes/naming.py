"""Order and names of postures that do not change with small changes of what is held."""

from __future__ import annotations

import numpy as np

from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.question import Question
from closedchain.closure.modes.shapes import shapes_of
from closedchain.closure.solve.path import follower_of
from closedchain.closure.solve.ways import follow

NAMED = 1e-3  # of shapes, dimensionless: a posture that is nearer to a named one is that one


def branches_of(question: Question, q: np.ndarray) -> np.ndarray:
    """Signs (n,) of the determinant at postures (n, nq), 0 where there is none."""
    problem = question.problem
    if not problem.square or not len(q):
        return np.zeros(len(q), dtype=int)
    every = np.repeat(question.targets[None], len(q), axis=0)
    return np.sign(follower_of(problem).run(q, every, every).det).astype(int)


def order_of(question: Question, q: np.ndarray, branch: np.ndarray) -> np.ndarray:
    """Order of postures (n, nq): that on home's branch first, the others by sign and place.

    Two that are about to meet have different signs, and do not change places.
    """
    if not len(q):
        return np.zeros(0, dtype=int)
    place = _place(question.problem.mechanism, q)
    return np.lexsort((place, -branch, ~_of_home(question, q)))


def names_of(mechanism: Mechanism, q: np.ndarray, branch: np.ndarray) -> tuple[str, ...]:
    """Names of the description where a posture has one; else a sign and a number."""
    shapes = shapes_of(mechanism)
    own = {}
    if len(q):
        mine = shapes.of(q)
        for name, posture in mechanism.postures.items():
            apart = np.abs(mine - shapes.of(np.asarray(posture)[None])).max(axis=1, initial=0.0)
            near = int(np.argmin(apart))
            if apart[near] < NAMED and near not in own:
                own[near] = name
    signs = {1: "+", -1: "-", 0: ""}
    place = _place(mechanism, q) if len(q) else np.zeros(0)
    names = []
    for i, sign in enumerate(branch.tolist()):
        # by their places, whether named or not: a name that a posture gets moves no other's number
        number = 1 + int((place[branch == sign] < place[i]).sum())
        names.append(own.get(i, f"{signs[sign]}{number}"))
    return tuple(names)


def _of_home(question: Question, q: np.ndarray) -> np.ndarray:
    """Which of the postures (n, nq) is home, or what home's branch leads to, (n,) of bool."""
    problem = question.problem
    m, home = problem.mechanism, problem.mechanism.home
    if problem.square and not m.home_open:
        begin = problem.targets_at(home)
        way = follow(problem, home[None], begin, question.targets[None])
        home = way.q[0] if way.reached[0] == 1.0 else home
    shapes = shapes_of(m)
    apart = np.abs(shapes.of(q) - shapes.of(home[None])).max(axis=1, initial=0.0)
    return np.asarray((apart < NAMED) & (apart == apart.min()))


def _place(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """A number (n,) for where the joints of postures (n, nq) stand."""
    numbers = shapes_of(mechanism).of(q)
    spread = np.sin(np.arange(1, numbers.shape[1] + 1) * 1.7) if numbers.shape[1] else np.zeros(0)
    return np.asarray(numbers @ spread)
