"""``cc.postures``: all assembly modes, all working modes, or whatever joints are held."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from closedchain.closure.chart import joint_index, joint_names
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.modes.certificates import certified
from closedchain.closure.modes.counting import Counted, counted, kept_on_disk
from closedchain.closure.modes.result import Family, Postures
from closedchain.closure.modes.seeking import (
    LEAST,
    MOST,
    Sought,
    Starts,
    chosen,
    closed_postures,
    sought,
    unwound,
)
from closedchain.closure.modes.shapes import SAME, Shapes, groups, shapes_of, turns_that_count
from closedchain.closure.modes.singular import with_singular
from closedchain.closure.nearest import beyond_limits
from closedchain.closure.position import driven, posed
from closedchain.closure.ranks import null_space
from closedchain.closure.solve.path import follower_of
from closedchain.closure.solve.problem import Problem, problem_of
from closedchain.closure.solve.search import search
from closedchain.closure.solve.ways import follow
from closedchain.closure.turns import tied, turning, without_turns
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError, known_names

LOOKED_AT = 8
"""Postures at which it is seen what the motions that remain change."""

OPEN = 1e-9  # m or rad: what is left open is no posture
SINGULAR = 1e-6  # share of the largest singular value
NEAR = 0.05  # dimensionless: from the end of a path that is lost to the singular posture it meant

REAL = 1e-6
"""Largest imaginary part, of shapes, dimensionless, of a real solution."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class Question:
    """What is held: a problem, its targets (prescribed,), and how to say it."""

    problem: Problem
    targets: np.ndarray
    held: str


class OutOfTime(Exception):
    """The time that was allowed is used up."""


@dataclass(frozen=True, eq=False)
class Search(Starts):
    """Random starts, until when, and who is told."""

    until: float | None = None
    progress: Progress | None = None

    def report(self, what: str, done: int) -> None:
        """Tell how far it is. Raises ``OutOfTime``."""
        if self.until is not None and time.monotonic() > self.until:
            raise OutOfTime
        if self.progress is not None:
            self.progress(what, done, 0)


def postures(
    mechanism: Mechanism,
    inputs: ArrayLike | Mapping[str, float] | None = None,
    pose: pin.SE3 | None = None,
    fixed: Mapping[str, float] | None = None,
    *,
    outputs: str | tuple[str, ...] | None = None,
    count: bool = True,
    starts: int = MOST,
    seconds: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Postures:
    """All postures of a mechanism with something held.

    They are searched from many random starts and, unless told otherwise, counted: all complex
    solutions are found at generic values by loops of what is held, and followed to the values that
    are asked for. The first time that takes seconds to minutes for a mechanism; what was found is
    kept on disk.

    Parameters
    ----------
    inputs : (n_inputs,) array or mapping of input to value, optional
        [m or rad]. All inputs: their assembly modes.
    pose : pin.SE3, optional
        Of the tip in the world: the working modes. Components that are no outputs are not used.
    fixed : mapping of joint to value, optional
        [m or rad]. Any joints with one freedom; with none, the whole set of postures.
    outputs : str, optional
        Outputs that ``pose`` prescribes; those of the task by default.
    count : bool
        Whether complex solutions are counted; else postures are only searched.
    starts : int
        Random starts at most.
    seconds : float, optional
        Time after which counting is given up: what was found until then is returned as searched.
    seed : int
        Of the random starts.
    progress : callable, optional
        Gets (what, done, total); the total is 0 where it is not known.

    Returns
    -------
    Postures

    Raises
    ------
    ClosureError
        More than one thing held; inputs, joints or outputs that are unknown or missing.

    Examples
    --------
    >>> m = cc.load("linear_delta")
    >>> modes = cc.postures(m, inputs=m.input_values(m.home), count=False)
    >>> [round(float(m.point(q, "P")[2]), 3) for q in modes.q]  # the platform hangs, or stands [m]
    [-0.6, 0.317]
    """
    question = _question(mechanism, inputs, pose, fixed, outputs)
    asked = Search(starts, seed, None if seconds is None else time.monotonic() + seconds, progress)
    if not question.problem.square:
        return _families(question, asked)
    shapes, notes = shapes_of(mechanism), list[str]()
    whole, in_time = None, True
    if count and turns_that_count(mechanism):
        notes.append("Relations of its joints count whole turns: its solutions are only searched.")
        count = False
    early = count and kept_on_disk(question.problem)
    if early:
        whole = _counted(question, asked, notes)
        # what was counted is all there is: a few starts then check it
        asked = replace(asked, most=min(starts, LEAST)) if _settled(whole) else asked
    found, in_time = _searched(question, shapes, asked)
    if not in_time:
        notes.append("The time allowed was used up while searching.")
    found, families = with_singular(question.problem, question.targets, found)
    if count and in_time and not early:
        whole = _counted(question, asked, notes)
    if whole is not None:
        found = _together(question, shapes, found, whole)
    return _result(question, found, whole, families, notes)


def _joint(mechanism: Mechanism, name: str) -> tuple[int, int]:
    """Index in q and v of a joint that can be held."""
    try:
        return joint_index(mechanism, name)
    except KeyError:
        known = tuple(joint_names(mechanism))
        raise ClosureError(known_names(name, "joint with one freedom", known)) from None


def _counted(question: Question, asked: Search, notes: list[str]) -> Counted | None:
    """Complex solutions, with whole turns of what is held left out; a note where there are none."""
    problem = question.problem
    m, targets = problem.mechanism, question.targets.copy()
    turns = (turning(m) & ~tied(m))[list(problem.pinned)]
    held = targets[: len(problem.pinned)]
    targets[: len(problem.pinned)] = without_turns(held, turns)
    try:
        return counted(problem, shapes_of(m), targets, asked.report)
    except OutOfTime:
        notes.append("The time allowed was used up before the solutions were counted.")
    except TypeError as error:  # what complex numbers do not have
        notes.append(f"The solutions cannot be counted: {error}.")
    return None


def _settled(whole: Counted | None) -> bool:
    """Whether a count leaves nothing open."""
    return whole is not None and whole.known and not whole.lost


def _searched(question: Question, shapes: Shapes, asked: Search) -> tuple[Sought, bool]:
    """What random starts lead to, and whether the time sufficed."""
    problem, targets = question.problem, question.targets
    try:
        return sought(problem, shapes, targets, starts=asked, report=asked.report), True
    except OutOfTime:
        return sought(problem, shapes, targets, starts=replace(asked, most=LEAST)), False


def _families(question: Question, asked: Search) -> Postures:
    """Postures that are not isolated: one of each family that idle motions do not join."""
    problem, targets = question.problem, question.targets
    shapes = shapes_of(problem.mechanism)
    for q in closed_postures(problem, targets, asked, LOOKED_AT):
        basis, _ = null_space(problem.jacobian_at(q))
        motions = np.zeros((problem.mechanism.model.nv, basis.shape[1]))
        motions[list(problem.free)] = basis
        shapes = shapes.without(q, motions * problem.mechanism.column_scale[:, None])
    found = sought(problem, shapes, targets, starts=asked)
    dimension = len(problem.free) - len(problem.kept)
    families = tuple(Family(dimension, q) for q in found.q)
    note = "Postures that the remaining motions may join are told apart by what these leave alone."
    return _result(question, found, None, families, [note] if families else [])


def _question(
    mechanism: Mechanism,
    inputs: ArrayLike | Mapping[str, float] | None,
    pose: pin.SE3 | None,
    fixed: Mapping[str, float] | None,
    outputs: str | tuple[str, ...] | None,
) -> Question:
    """Problem and targets of what is held."""
    held = [
        name for name, x in (("inputs", inputs), ("pose", pose), ("fixed", fixed)) if x is not None
    ]
    if len(held) > 1:
        raise ClosureError(f"hold one of inputs, pose and fixed, got {' and '.join(held)}")
    if inputs is not None:
        if not mechanism.inputs:
            raise ClosureError(
                f"{mechanism.name!r} has no inputs (<transmission> elements); hold joints with "
                "fixed={joint: value, ...} (--fixed JOINT=VALUE)"
            )
        values = mechanism.input_vector(inputs, "input values")
        said = ", ".join(f"{n} = {x:.6g}" for n, x in zip(mechanism.inputs, values, strict=True))
        return Question(driven(mechanism), np.array(values, dtype=float), said)
    if pose is not None:
        if not isinstance(pose, pin.SE3):
            raise ClosureError(f"pose must be a pin.SE3, got {pose!r}")
        problem = posed(mechanism, outputs)
        names = " ".join(mechanism.outputs(outputs))
        return Question(problem, pin.SE3ToXYZQUAT(pose), f"the tip's {names} held")
    values_of = dict(fixed or {})
    joints = {str(name): _joint(mechanism, str(name)) for name in values_of}
    for name, value in values_of.items():
        if not np.isfinite(float(value)):
            raise ClosureError(f"the value of {name!r} must be a finite number, got {value!r}")
    ordered = sorted(joints, key=lambda name: joints[name][1])
    problem = problem_of(mechanism, [joints[name][1] for name in ordered])
    said = ", ".join(f"{n} = {values_of[n]:.6g}" for n in ordered) or "nothing held"
    return Question(problem, np.array([float(values_of[n]) for n in ordered]), said)


def _together(question: Question, shapes: Shapes, found: Sought, whole: Counted) -> Sought:
    """What was searched and the real solutions among those that were counted."""
    if not len(whole.q):
        return found
    imaginary = np.abs(shapes.of(whole.q).imag).max(axis=1, initial=0.0)
    real = unwound(shapes.mechanism, whole.q[imaginary < REAL].real)
    if not len(real):
        return found
    every = np.repeat(question.targets[None], len(real), axis=0)
    closed = search(question.problem, every, real[:, None])
    q = np.concatenate([found.q, closed.q])
    group = groups(shapes.of(q))
    hits = np.concatenate([found.hits, np.zeros(len(closed.q), dtype=int)])
    first = chosen(shapes.mechanism, q, group)
    count = np.bincount(group, weights=hits).astype(int)
    return Sought(q[first], count, found.starts, found.unsettled)


def _result(
    question: Question,
    found: Sought,
    whole: Counted | None,
    families: tuple[Family, ...],
    notes: list[str],
) -> Postures:
    problem, m = question.problem, question.problem.mechanism
    q = unwound(m, found.q)
    closed = [float(np.abs(m.workspace.residual(x)).max(initial=0.0)) < OPEN for x in q]
    q, hits = q[closed], found.hits[closed]
    branch = _branches(question, q)
    order = _order(question, q, branch)
    q, hits, branch, n = q[order], hits[order], branch[order], len(q)
    complex_count, complete, infinite = None, "searched", 0
    multiplicity = np.ones(n, dtype=int)
    if whole is not None:
        infinite = whole.infinite
        multiplicity = _multiplicities(question, q, whole)
        explained = int(multiplicity.sum()) - n + int((multiplicity > 1).sum())
        agree = _all_counted(m, q[multiplicity == 1], whole)
        if families:
            notes.append("Where families stand, solutions cannot be counted.")
        elif whole.known and whole.lost == explained and agree:
            complete, complex_count = "counted", len(whole.q) + whole.lost
            if not whole.traced:
                notes.append(
                    "The trace test could not be had: the number was checked by loops and random "
                    "starts at several places alone."
                )
        else:
            notes.append(_why_not(whole, agree=agree))
    proof = certified(problem, q, question.targets) if problem.square else None
    if problem.redundant and n:
        others = len(problem.units) - len(problem.kept)
        notes.append(
            f"Proofs are of the independent rows; the {others} others hold there by the geometry."
        )
    return Postures(
        mechanism=m,
        q=q,
        names=_names(m, q, branch),
        complete=complete,
        complex_count=complex_count,
        infinite=infinite,
        multiplicity=multiplicity,
        certified=np.zeros(n, dtype=bool) if proof is None else proof.proved,
        radius=np.full(n, np.nan) if proof is None else proof.radius,
        residual=np.array([float(np.abs(m.workspace.residual(x)).max(initial=0.0)) for x in q]),
        branch=branch,
        beyond_limits=tuple(beyond_limits(m, x) for x in q),
        families=tuple(Family(f.dimension, f.q) for f in families),
        hits=hits,
        starts=found.starts,
        unseen=found.unseen,
        held=question.held,
        pinned=_pinned(question),
        target_pose=tuple(question.targets[len(problem.pinned) :].tolist()),
        outputs=tuple(OUTPUTS[k] for _, outputs in problem.goals for k in outputs),
        notes=tuple(notes),
    )


def _pinned(question: Question) -> dict[str, float]:
    """Values that are held, by joint."""
    problem = question.problem
    model = problem.mechanism.model
    at = {model.idx_vs[j]: str(model.names[j]) for j in range(1, model.njoints)}
    return {at[v]: float(x) for v, x in zip(problem.pinned, question.targets, strict=False)}


def _all_counted(mechanism: Mechanism, q: np.ndarray, whole: Counted) -> bool:
    """Whether every posture (n, nq) is among the solutions that were counted."""
    if not len(q):
        return True
    if not len(whole.q):
        return False
    shapes = shapes_of(mechanism)
    known, mine = shapes.of(whole.q), shapes.of(q)
    apart = np.abs(mine[:, None].astype(complex) - known[None]).max(axis=2).min(axis=1)
    return bool((apart < 1e3 * SAME).all())


def _multiplicities(question: Question, q: np.ndarray, whole: Counted) -> np.ndarray:
    """How many paths end in each posture (n, nq): those that are lost end in singular ones."""
    found = np.ones(len(q), dtype=int)
    singular = [i for i, posture in enumerate(q) if _is_singular(question, posture)]
    if not singular or not whole.lost:
        return found
    shapes = shapes_of(question.problem.mechanism)
    ends, mine = shapes.of(whole.singular), shapes.of(q[singular])
    apart = np.abs(ends[:, None] - mine[None].astype(complex)).max(axis=2)
    nearest = np.argmin(apart, axis=1)
    for k, i in enumerate(singular):
        count = int(((nearest == k) & (apart.min(axis=1) < NEAR)).sum())
        found[i] = max(count, 1)
    return found


def _is_singular(question: Question, q: np.ndarray) -> bool:
    """Whether the equations lose rank at a posture (nq,), as well as rounding tells."""
    s = np.linalg.svd(question.problem.jacobian_at(q), compute_uv=False)
    rank = len(question.problem.kept)
    return bool(rank and s[rank - 1] < SINGULAR * s[0])


def _why_not(whole: Counted, *, agree: bool) -> str:
    if not agree:
        return "The search found a posture that the count does not have: the count is not complete."
    if whole.lost:
        return (
            f"{whole.lost} paths ended before the values asked for, at singular solutions: the "
            "count is not complete."
        )
    return "The check of the number of generic solutions did not hold: the count is not complete."


def _branches(question: Question, q: np.ndarray) -> np.ndarray:
    """Signs (n,) of the determinant at postures (n, nq), 0 where there is none."""
    problem = question.problem
    if not problem.square or not len(q):
        return np.zeros(len(q), dtype=int)
    every = np.repeat(question.targets[None], len(q), axis=0)
    return np.sign(follower_of(problem).run(q, every, every).det).astype(int)


def _order(question: Question, q: np.ndarray, branch: np.ndarray) -> np.ndarray:
    """Order of postures (n, nq): that on home's branch first, the others by sign and place.

    Two that are about to meet have different signs, and do not change places.
    """
    if not len(q):
        return np.zeros(0, dtype=int)
    place = _place(question.problem.mechanism, q)
    return np.lexsort((place, -branch, ~_of_home(question, q)))


def _place(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """A number (n,) for where the joints of postures (n, nq) stand."""
    numbers = shapes_of(mechanism).of(q)
    spread = np.sin(np.arange(1, numbers.shape[1] + 1) * 1.7) if numbers.shape[1] else np.zeros(0)
    return np.asarray(numbers @ spread)


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
    return np.asarray((apart < 1e-3) & (apart == apart.min()))


def _names(mechanism: Mechanism, q: np.ndarray, branch: np.ndarray) -> tuple[str, ...]:
    """Names of the description where a posture has one; else a sign and a number."""
    shapes = shapes_of(mechanism)
    own = {}
    if len(q):
        mine = shapes.of(q)
        for name, posture in mechanism.postures.items():
            apart = np.abs(mine - shapes.of(np.asarray(posture)[None])).max(axis=1, initial=0.0)
            near = int(np.argmin(apart))
            if apart[near] < 1e-3 and near not in own:
                own[near] = name
    signs = {1: "+", -1: "-", 0: ""}
    place = _place(mechanism, q) if len(q) else np.zeros(0)
    names = []
    for i, sign in enumerate(branch.tolist()):
        # by their places, whether named or not: a name that a posture gets moves no other's number
        number = 1 + int((place[branch == sign] < place[i]).sum())
        names.append(own.get(i, f"{signs[sign]}{number}"))
    return tuple(names)
