"""The answers of the commands, as tables or JSON."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from closedchain._terminal import pairs, print_json, say, table, tell

if TYPE_CHECKING:
    import numpy as np

    from closedchain.analysis.singularity.classify import Classification
    from closedchain.analysis.structure.mobility import Mobility
    from closedchain.analysis.structure.relaxation import Relaxation
    from closedchain.analysis.survey.surveying import Survey
    from closedchain.closure import Mechanism, Solution

_HEADINGS = {
    "papers": "Robots of papers, with closed forms of their own (--json names the papers):",
    "classics": "Classics, each with numbers that are settled (docs/robots/classics.md):",
}


def catalogue(json: bool) -> None:
    """Robots of the catalogue, group by group."""
    from closedchain.robots import groups, robot, robots

    entries = {group: [robot(name) for name in robots(group)] for group in groups()}
    if json:
        print_json(
            [
                {
                    "name": entry.name,
                    "group": group,
                    "title": entry.title,
                    "source": entry.source,
                    "variants": list(entry.variants),
                }
                for group, found in entries.items()
                for entry in found
            ]
        )
        return
    for i, (group, found) in enumerate(entries.items()):
        say(("\n" if i else "") + _HEADINGS[group])
        table(
            ("robot", "what it is", "variants"),
            [(e.name, e.title, " ".join(e.variants)) for e in found],
        )


def members(name: str, json: bool) -> None:
    """Members of a family: their choices, as ``--set`` takes them."""
    from closedchain.robots import family

    found = family(name)
    if json:
        entries = [
            {"name": found.name, "choices": dict(choices), "source": found.source}
            for choices in found.members()
        ]
        print_json(entries)
        return
    table(
        ("family", *found.choices),
        [(found.name, *choices.values()) for choices in found.members()],
    )


def info(mechanism: Mechanism, json: bool, source: str = "") -> None:
    """Inputs, task, closures, parameters and mobility; ``source`` is where it was published."""
    import closedchain as cc

    counted = None if mechanism.home_open else cc.mobility(mechanism)
    around = () if counted is None else counted.finite_at(mechanism.home)
    relaxed = cc.relaxation(mechanism) if counted and counted.redundant_rows else None
    data = _info_data(mechanism)
    if json:
        print_json(
            {
                **data,
                "mobility": _mobility_data(counted, around),
                "relaxation": _relaxation_data(relaxed),
            }
        )
        return
    task = mechanism.task
    sizes = f"{mechanism.model.nq}, {mechanism.model.nv}, {mechanism.rows}"
    facts: dict[str, object] = {
        "robot": mechanism.name,
        "nq, nv, closure rows": sizes,
        "characteristic length [m]": mechanism.length,
        "task": "none" if task is None else f"{task.tip} against {task.base}",
        "outputs": "none" if task is None else task.outputs,
        "mass that moves [kg]": data["mass"] or "none is stated",
    }
    if data["tip"]:
        facts["tip at home, xyz [m]"] = _tidy(data["tip"]["xyz"])
        facts["tip at home, rpy [rad]"] = _tidy(data["tip"]["rpy"])
    pairs(facts)
    if source:
        tell(f"source: {source}")
    say("")
    table(
        ("input", "joint", "home", "lower", "upper", "unit"),
        [
            [i[key] for key in ("name", "joint", "home", "lower", "upper", "unit")]
            for i in data["inputs"]
        ],
    )
    say("")
    table(
        ("closure", "kind", "rows", "between", "and"),
        [[c[key] for key in ("name", "kind", "rows", "parent", "child")] for c in data["closures"]],
    )
    if mechanism.parameters:
        say("")
        table(("parameter", "value"), list(mechanism.parameters.items()))
    if counted is None:
        tell(
            f"\n{mechanism.name}: home is open by {mechanism.open_by:.3g}, the mobility is unknown."
        )
    else:
        say(f"\n{counted.text}")
        if max(around) < counted.mobility:
            tell(_fewer(around))
    if relaxed is not None:
        tell(relaxed.text)
    for note in mechanism.notes:
        tell(f"note: {note}")


def _fewer(around: tuple[int, ...]) -> str:
    """What to say of postures that form a smaller set than the rank promises."""
    branches = " and of ".join(f"dimension {dimension}" for dimension in around)
    return (
        "Not all of that is motion: the rank knows the first order only. The postures around home "
        f"form {'sets' if len(around) > 1 else 'a set'} of {branches}."
    )


def _mobility_data(counted: Mobility | None, around: tuple[int, ...]) -> dict[str, Any] | None:
    if counted is None:
        return None
    numbers = {key: value for key, value in vars(counted).items() if key != "rank"}
    return {
        **numbers,
        "finite": around,
        "rank": {"value": counted.rank.value, **_gap(counted.rank)},
    }


def _relaxation_data(found: Relaxation | None) -> dict[str, Any] | None:
    if found is None:
        return None
    single, together = ([vars(one) for one in some] for some in (found.single, found.together))
    return {"redundant": found.redundant, "single": single, "together": together}


def _rounding_data(mechanism: Mechanism) -> dict[str, Any] | None:
    found = mechanism.rounding
    if found is None:
        return None
    rank = {"value": found.rank.value, **_gap(found.rank)}
    changed = [vars(change) for change in found.changed]
    return {**vars(found), "rank": rank, "changed": changed}


def _info_data(mechanism: Mechanism) -> dict[str, Any]:
    from closedchain.closure import Closure

    joints = {joint.name: joint for joint in mechanism.description.joints}
    driven = {spec.name: joints[spec.joint] for spec in mechanism.description.inputs}
    home = mechanism.input_values(mechanism.home)
    task = mechanism.task
    return {
        "name": mechanism.name,
        "nq": mechanism.model.nq,
        "nv": mechanism.model.nv,
        "rows": mechanism.rows,
        "length": mechanism.length,
        "mass": float(sum(inertia.mass for inertia in list(mechanism.model.inertias)[1:])),
        "task": None if task is None else vars(task),
        "tip": tip(mechanism, mechanism.home),
        "inputs": [
            {
                "name": name,
                "joint": driven[name].name,
                "home": value,
                "lower": driven[name].lower,
                "upper": driven[name].upper,
                "unit": unit,
            }
            for name, value, unit in zip(
                mechanism.inputs, home.tolist(), mechanism.input_units, strict=True
            )
        ],
        "closures": [
            {
                "name": c.name,
                "kind": c.kind,
                "rows": c.rows,
                "parent": c.parent if isinstance(c, Closure) else " ".join(c.leaders),
                "child": c.child if isinstance(c, Closure) else c.follower,
            }
            for c in mechanism.closures
        ],
        "parameters": mechanism.parameters,
        "notes": mechanism.notes,
        "misfit": mechanism.misfit,
        "open_by": mechanism.open_by,
        "rounding": _rounding_data(mechanism),
    }


def undrawn(mechanism: Mechanism) -> tuple[str, ...]:
    """Sentences on what a drawing lacks: meshes that are not found, a closed home."""
    from closedchain.urdf.meshes import with_mesh_paths

    missing = with_mesh_paths(mechanism.description)[1]
    if mechanism.home_open:
        return (*missing, f"home is open by {mechanism.open_by:.3g}")
    return missing


def tip(mechanism: Mechanism, q: np.ndarray) -> dict[str, Any] | None:
    """Pose of the tip, None without a task."""
    import pinocchio as pin

    if mechanism.task is None:
        return None
    pose = mechanism.pose(q)
    return {
        "frame": mechanism.task.tip,
        "xyz": [float(x) + 0.0 for x in pose.translation],
        "rpy": [float(x) + 0.0 for x in pin.rpy.matrixToRpy(pose.rotation)],
    }


def solution_data(mechanism: Mechanism, found: Solution) -> dict[str, Any]:
    """Everything that a position solver says."""
    model = mechanism.model
    joints = {
        model.names[i]: found.q[model.idx_qs[i] : model.idx_qs[i] + model.nqs[i]]
        for i in range(1, model.njoints)
    }
    inputs = found.q[mechanism.input_q].tolist()
    return {
        "robot": mechanism.name,
        "converged": found.converged,
        "message": found.message,
        "residual": found.residual,
        "iterations": found.iterations,
        "rank": {"value": found.rank, **_gap(found.rank_decision)},
        "beyond_limits": found.beyond_limits,
        "inputs": dict(zip(mechanism.inputs, inputs, strict=True)),
        "tip": tip(mechanism, found.q),
        "joints": joints,
        "q": found.q,
    }


def solution(mechanism: Mechanism, found: Solution, more: Mapping[str, list[str]]) -> None:
    """Inputs and tip pose of a posture."""
    data = solution_data(mechanism, found)
    units = mechanism.input_units
    at_home = more.get("at_home", ())
    table(
        ("input", "value", "unit", ""),
        [
            (name, value, unit, "home value, not given" if name in at_home else "")
            for (name, value), unit in zip(data["inputs"].items(), units, strict=True)
        ],
    )
    say("")
    passive = {
        name: " ".join(f"{x + 0.0:.6g}" for x in _tidy(values.tolist()))
        for name, values in data["joints"].items()
        if mechanism.model.idx_vs[mechanism.model.getJointId(name)] not in set(mechanism.input_v)
    }
    table(("passive joint", "value [m or rad]"), list(passive.items()))
    say("")
    facts: dict[str, object] = {}
    if data["tip"]:
        facts[f"tip {data['tip']['frame']}, xyz [m]"] = _tidy(data["tip"]["xyz"])
        facts[f"tip {data['tip']['frame']}, rpy [rad]"] = _tidy(data["tip"]["rpy"])
    if "outputs" in more:
        facts["outputs prescribed"] = more["outputs"]
    facts |= {"residual [m, rad]": found.residual, "solved equations": str(found.rank_decision)}
    pairs(facts)
    tell(found.message)


def classification(mechanism: Mechanism, q: np.ndarray, found: Classification, json: bool) -> None:
    """Kinds of singularity of a posture, with the evidence."""
    if json:
        inputs = mechanism.input_values(q).tolist()
        data = {
            "robot": mechanism.name,
            "inputs": dict(zip(mechanism.inputs, inputs, strict=True)),
            **vars(found),
            "kinds": sorted(found.kinds),
            "types": sorted(found.types),
            "ranks": {k: {"value": r.value, **_gap(r)} for k, r in found.ranks.items()},
            "nearest": {k: vars(one) for k, one in found.nearest.items()},
            "distance": found.distance,
            "accuracy": found.accuracy,
            "free_twists": found.free_twists.T,  # one twist an entry
            "lost_twists": found.lost_twists.T,
            "combined": found.combined,
        }
        print_json(data)
        return
    table(
        ("kind", "singular", "sigma", "determinant"),
        [
            ("direct", _yes("direct", found), found.sigma_direct, found.det_direct),
            ("inverse", _yes("inverse", found), found.sigma_inverse, found.det_inverse),
            ("constraint", _yes("constraint", found), found.sigma_constraint, None),
        ],
    )
    tell(f"\n{found.text}")


def survey(found: Survey, written: Mapping[str, Path], json: bool, *, details: bool) -> None:
    """Summary of a survey and where its results lie; columns that are all zero are left out."""
    rows = found.summary()
    if json:
        print_json({"summary": rows, "files": {k: str(p) for k, p in written.items()}})
        return
    if rows:
        shown = [name for name in rows[0] if any(row[name] != 0 for row in rows)]
        table(shown, [[row[name] for name in shown] for row in rows])
        say("")
    if details:
        tell(found.text)
    else:
        for note in found.notes:
            tell(note)
        if found.details:
            remarks = "1 remark" if len(found.details) == 1 else f"{len(found.details)} remarks"
            say(f"{remarks} on how sets were sought: --details says more.")
        tell("At home: " + found.redundancy.text)
    for path in written.values():
        say(str(path))


def _yes(kind: str, found: Classification) -> str:
    return "yes" if kind in found.kinds else "no"


def _gap(rank: Any) -> dict[str, float]:
    return {"above": rank.above, "below": rank.below}


def _tidy(numbers: list[float]) -> list[float]:
    """Rounding errors as zeros, for a reader."""
    return [0.0 if abs(x) < 1e-12 else x for x in numbers]
