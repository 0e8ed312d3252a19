"""What ``closedchain follow`` prints: how a run went, and the comparison, as text or JSON."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from closedchain._terminal import pairs, print_json, say, table, tell

if TYPE_CHECKING:
    from closedchain.analysis.motion.follow import Comparison, Follow, TaskPath

_SIGMAS = ("sigma_direct", "sigma_driven", "sigma_inverse")


def report(
    run: Follow,
    task: TaskPath,
    comparison: Comparison | None,
    files: Mapping[str, Path],
    json: bool,
) -> None:
    """Print what came out, as text or JSON."""
    data = _data(run, task)
    if json:
        more = {} if comparison is None else {"comparison": _comparison_data(comparison)}
        print_json({**data, **more, "files": {name: str(path) for name, path in files.items()}})
        return
    shown = ("robot", "task", "outputs", "objective", "method")
    facts = {key: data[key] for key in shown}
    if run.locked:
        m = run.problem.mechanism
        units = dict(zip(m.inputs, m.input_units, strict=True))
        facts["locked"] = ", ".join(f"{n} = {v:.6g} {units[n]}" for n, v in run.locked.items())
    facts["samples reached"] = f"{run.reached} of {data['samples']}"
    if run.reached:
        facts["least distance to a singularity"] = data["smallest"]
        facts["largest closure row, task error [m, rad]"] = [data["residual"], data["task_error"]]
    pairs(facts)
    say("")
    if comparison is not None:
        _print_comparison(comparison)
    elif run.reached:
        columns = data["inputs"]
        table(
            ("input", "unit", "lowest", "highest", "largest speed"),
            [list(row) for row in zip(*columns.values(), strict=True)],
        )
        say("")
    for path in files.values():
        say(str(path))
    if run.converged:
        tell(run.message)


def _data(run: Follow, task: TaskPath) -> dict[str, Any]:
    m = run.problem.mechanism
    there = run.reached > 0
    return {
        "robot": m.name,
        "task": task.name,
        "outputs": list(run.problem.outputs),
        "objective": run.objective,
        "method": run.method,
        "locked": dict(run.locked),
        "converged": run.converged,
        "stopped": run.stopped,
        "message": run.message,
        "samples": len(task.times),
        "reached": run.reached,
        "smallest": run.smallest if there else None,
        **{key: float(getattr(run, key).min()) if there else None for key in (*_SIGMAS, "measure")},
        **{
            key: float(getattr(run, key).max()) if there else None
            for key in ("residual", "task_error")
        },
        "inputs": {
            "name": list(m.inputs),
            "unit": list(m.input_units),
            "lowest": run.inputs.min(axis=0).tolist() if there else None,
            "highest": run.inputs.max(axis=0).tolist() if there else None,
            "fastest": abs(run.input_speeds).max(axis=0).tolist() if there else None,
        },
    }


def _comparison_data(found: Comparison) -> dict[str, Any]:
    return {
        "rows": [
            vars(row) if run.reached else {**vars(row), **dict.fromkeys(_SIGMAS)}
            for row, run in zip(found.rows, found.follows, strict=True)
        ],
        "best_locked": found.best_locked,
        "best_free": found.best_free,
        "gain": found.gain,
    }


def _print_comparison(found: Comparison) -> None:
    """The rows as a table, and what stopped those that did not get through."""
    data = _comparison_data(found)["rows"]
    table(
        ("", "done", "smallest", "direct", "driven", "inverse", "largest speed", "until [s]"),
        [
            (
                *(r["name"], "yes" if r["converged"] else "stopped", r["smallest"]),
                *(r[key] for key in _SIGMAS),
                *(r["fastest"], r["reached"]),
            )
            for r in data
        ],
    )
    say("")
    for row in found.rows:
        if not row.converged:
            tell(f"{row.name}: {row.message}")
    tell(found.text.splitlines()[-1])
    say("")
