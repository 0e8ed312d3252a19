"""Choosing the chart that a request for coordinates means, and a posture to start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from closedchain.closure.chart import TILTS, Chart, joint_names
from closedchain.closure.generic import dimensionless_jacobian, dimensionless_task, generic_ranks
from closedchain.closure.mechanism import Mechanism
from closedchain.closure.position import direct
from closedchain.closure.ranks import null_space, numerical_rank
from closedchain.closure.solve.continuation import At as Path
from closedchain.closure.solve.continuation import follow
from closedchain.closure.solve.newton import Rows, correct
from closedchain.closure.solve.system import System
from closedchain.urdf.description import OUTPUTS
from closedchain.urdf.errors import ClosureError, known_names

At = Mapping[str, float] | ArrayLike | None

_TURNED = 0.1  # least share of an idle motion that a joint has which is held


def chart_of(
    mechanism: Mechanism,
    names: Sequence[str],
    at: At = None,
    outputs: str | Sequence[str] | None = None,
    *,
    start: ArrayLike | None = None,
) -> Chart:
    """Chart in which ``names`` vary.

    A request for tip coordinates prescribes all outputs of the task; one for joints only, joints.
    Freedoms that are left are taken by further inputs, in their order, as far as each adds to the
    rank at the start; they are held.

    Parameters
    ----------
    names : coordinates that vary
        Inputs, joints, x y z rx ry rz, or tilt and azimuth (and torsion), see ``Chart``.
    at : mapping of coordinate to value, or (nq,) array, optional
        Values of held coordinates, reached from the start along its branch; or a closed posture
        that gives all of them. As at the start by default.
    outputs : str, optional
        Outputs of the task; those of the description by default.
    start : (nq,) array, optional
        Closed posture whose branch is meant; home by default.

    Raises
    ------
    ClosureError
        Unknown, repeated or too many coordinates; coordinates that do not fix the posture at the
        start; held values that the branch of home does not reach.
    """
    names = tuple(str(n) for n in names)
    given = dict(at) if isinstance(at, Mapping) else {}
    asked = (*names, *(str(n) for n in given))
    _check_names(mechanism, names, asked)
    task: tuple[str, ...] = ()
    tip_names = {n for n in asked if n in OUTPUTS or n in TILTS} - set(mechanism.inputs)
    tilting = bool(tip_names & set(TILTS))
    if tip_names:
        task = mechanism.outputs(
            outputs if outputs is None or isinstance(outputs, str) else tuple(outputs)
        )
        _check_tip(mechanism, task, tip_names)
    if at is not None and not isinstance(at, Mapping):
        start = at
    start = mechanism.home if start is None else _closed(mechanism, start)
    asked_joints = tuple(n for n in asked if n not in tip_names)
    joints = _filled(mechanism, names, asked_joints, task, tilting, start)
    chart = _with_held(Chart(mechanism, names, joints, task, tilting, {}, start), start)
    return _moved(chart, given) if given else chart


def _check_names(mechanism: Mechanism, names: tuple[str, ...], asked: tuple[str, ...]) -> None:
    known = coordinate_names(mechanism)
    if not names:
        raise ClosureError(
            f"at least one coordinate must vary; known coordinates: {', '.join(known)}"
        )
    for name in asked:
        if name not in known:
            raise ClosureError(known_names(name, "coordinate", known))
    for name in names:
        if asked.count(name) > 1:
            what = "varies twice" if names.count(name) > 1 else "both varies and is held"
            raise ClosureError(f"coordinate {name!r} {what}")


def coordinate_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Names that a request may use: inputs, tip coordinates of the task, other joints."""
    tip: tuple[str, ...] = ()
    if mechanism.task is not None:
        tip = (*OUTPUTS, *TILTS)
    inputs = mechanism.inputs
    joints = joint_names(mechanism)[len(inputs) :]
    return tuple(dict.fromkeys((*inputs, *tip, *joints)))


def _check_tip(mechanism: Mechanism, task: tuple[str, ...], tip_names: set[str]) -> None:
    angular = [n for n in task if n in OUTPUTS[3:]]
    tilts = tip_names & set(TILTS)
    if tilts and tip_names & set(OUTPUTS[3:]):
        raise ClosureError(
            "the tip's rotation is given either as rx ry rz or as tilt, azimuth and torsion, "
            f"got {' '.join(sorted(tip_names - set('xyz')))}"
        )
    known = [n for n in task if n in "xyz"]
    known += list(TILTS[: len(angular)] if tilts else angular)
    if tilts and len(angular) < 2:
        raise ClosureError(
            f"tilt and azimuth need a task with two or three rotations; {mechanism.name!r} has "
            f"{' '.join(task)}"
        )
    for name in sorted(tip_names):
        if name not in known:
            raise ClosureError(known_names(name, f"output of the task ({' '.join(task)})", known))


def _closed(mechanism: Mechanism, q: ArrayLike) -> np.ndarray:
    q = mechanism.configuration(q)
    gap = float(np.abs(mechanism.workspace.residual(q)).max(initial=0.0))
    if gap > 1e-6:
        raise ClosureError(
            f"the posture to start from is not closed (largest gap {gap:.3g}); close it first "
            "(cc.close, cc.direct or cc.inverse)"
        )
    # to the last digit, inputs held where that is possible
    closed = correct(System(mechanism, np.arange(mechanism.model.nv)), q)
    return q if closed.refusal is not None else closed.q


def _filled(
    mechanism: Mechanism,
    names: tuple[str, ...],
    asked: tuple[str, ...],
    task: tuple[str, ...],
    tilting: bool,
    start: np.ndarray,
) -> tuple[str, ...]:
    """Joints of the chart: those asked for, then inputs until no freedom is left.

    What idle freedoms leave, such as the spin of a rod between two balls, is held too.
    """

    def rank(joints: tuple[str, ...]) -> int:
        chart = _with_held(Chart(mechanism, names, joints, task, tilting, {}, start), start)
        matrix = chart.equations(chart.values(start)).evaluate(start)[1]
        return numerical_rank(matrix).value + len(joints)

    closures = System(mechanism, np.arange(mechanism.model.nv))
    freedoms = mechanism.model.nv - numerical_rank(closures.evaluate(start)[1]).value
    joints = asked
    if len(joints) + len(task) > freedoms:
        raise ClosureError(
            f"{' '.join((*joints, *task))} are {len(joints) + len(task)} coordinates; "
            f"{mechanism.name!r} has {freedoms} freedoms"
        )
    reached = rank(joints)
    for name in (*mechanism.inputs, *_spinning(mechanism, start)):
        if len(joints) + len(task) == freedoms:
            break
        if name not in joints and rank((*joints, name)) > reached:
            joints = (*joints, name)
            reached = rank(joints)
    if reached < mechanism.model.nv:
        raise ClosureError(
            f"{' '.join((*task, *joints))} do not fix the posture at the start: it is singular "
            "for these coordinates, so no branch can be followed from it. Give a posture elsewhere "
            "(at=, --at), or other coordinates or outputs"
        )
    # in the mechanism's own order, whatever the order of the request
    return tuple(sorted(joints, key=joint_names(mechanism).index))


def _spinning(mechanism: Mechanism, q: np.ndarray) -> tuple[str, ...]:
    """Passive joints that the idle motions at ``q`` (nq,) turn, those that turn most first.

    Motions are idle that leave inputs and tip at rest, if there are as many in every posture.
    """
    outputs = () if mechanism.task is None else mechanism.task.outputs
    if not outputs or not generic_ranks(mechanism, outputs).idle:
        return ()
    held = np.eye(mechanism.model.nv)[mechanism.input_v]
    at_rest = np.vstack(
        [dimensionless_jacobian(mechanism, q), held, dimensionless_task(mechanism, q, outputs)]
    )
    share = np.linalg.norm(null_space(at_rest)[0], axis=1)
    turned = [
        (-float(share[joint.idx_v]), name)
        for name, joint in list(zip(mechanism.model.names, mechanism.model.joints, strict=True))[1:]
        if joint.nv == 1 and share[joint.idx_v] > _TURNED
    ]
    return tuple(name for _, name in sorted(turned))


def _with_held(chart: Chart, q: np.ndarray, given: Mapping[str, float] | None = None) -> Chart:
    """The same chart with every coordinate that does not vary held as given, or as it is at ``q``.

    A posture does not tell all of them: the azimuth of an upright tip can be any.
    """
    every = chart.every_value(q) | dict(given or {})
    held = {n: float(every[n]) for n in every if n not in chart.names}
    return Chart(chart.mechanism, chart.names, chart.joints, chart.outputs, chart.tilting, held, q)


def _moved(chart: Chart, given: Mapping[str, float]) -> Chart:
    """The chart with its held coordinates brought to the given values along the branch."""
    mechanism = chart.mechanism
    for name, value in given.items():
        if not np.isfinite(value):
            raise ClosureError(f"value of {name!r} must be finite, got {value!r}")
    if not chart.outputs and set(chart.joints) == set(mechanism.inputs):
        home = dict(zip(mechanism.inputs, mechanism.input_values(chart.start), strict=True))
        q = direct(mechanism, home | dict(given), guess=chart.start).raise_if_failed().q
        return _with_held(chart, q, given)
    line = Chart(
        mechanism,
        (*given, *chart.names),
        chart.joints,
        chart.outputs,
        chart.tilting,
        {n: v for n, v in chart.held.items() if n not in given},
        chart.start,
    )
    begin = line.values(chart.start)
    target = np.array([*given.values(), *chart.values(chart.start)], dtype=float)
    here = correct(line.equations(begin), chart.start)
    path = follow(straight(line, begin, target), here)
    if path.refusal is not None:
        where = ", ".join(f"{n}={v:g}" for n, v in given.items())
        raise ClosureError(
            f"the held values {where} cannot be reached from the start: the straight way there "
            f"ends after {path.reached:.1%}"
        )
    return _with_held(chart, path.last.q, given)


def straight(chart: Chart, begin: np.ndarray, target: np.ndarray) -> Path:
    """Path of ``continuation.follow`` along a straight line of coordinates."""

    def at(q: np.ndarray, t: float) -> tuple[Rows, np.ndarray]:
        values = target if t == 1.0 else begin + t * (target - begin)
        return chart.equations(values), chart.pinned(q, values)

    return at
