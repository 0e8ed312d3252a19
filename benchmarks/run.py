"""Benchmarks: median times on one core beside a named peer in the same run, with versions.

Run by ``make bench``. Ratios carry over between machines; times do not.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table
from scipy.optimize import least_squares

import closedchain as cc

PACKAGES = ("closedchain", "pin", "numpy", "scipy")


def median_seconds(work: Callable[[int], object], repeats: int) -> float:
    """Median time of ``work(i)`` over ``repeats`` calls, after a tenth as many to warm up."""
    for i in range(max(1, repeats // 10)):
        work(i)
    times = []
    for i in range(repeats):
        begin = time.perf_counter()
        work(i)
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def scipy_direct(m: cc.Mechanism, target: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Close the loops with scipy's least squares on the same residual and Jacobian."""
    base = start.copy()
    base[m.input_q] = target
    p = m.passive_v

    def posture(x: np.ndarray) -> np.ndarray:
        v = np.zeros(m.model.nv)
        v[p] = x
        return np.asarray(pin.integrate(m.model, base, v))

    def gaps(x: np.ndarray) -> np.ndarray:
        return m.workspace.residual(posture(x))

    def jacobian(x: np.ndarray) -> np.ndarray:
        # the tangent is taken at the moving posture: steps here are small enough for that
        return m.workspace.evaluate(posture(x))[1][:, p]

    found = least_squares(gaps, np.zeros(p.size), jac=jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return posture(found.x)


def _signs(rng: np.random.Generator, n: int) -> np.ndarray:
    """Steps (n, 6) of -1 or 1 that take turns with their opposites, so that a path stays near."""
    steps = rng.choice([-1.0, 1.0], (n, 6))
    steps[1::2] = -steps[: len(steps[1::2]) * 2 : 2]
    return np.asarray(steps)


def measure(repeats: int) -> list[dict[str, object]]:
    """Rows of the table: what, seconds, peer, its seconds, ratio."""
    m = cc.load("d1")
    rng = np.random.default_rng(0)
    home = m.input_values(m.home)
    q = cc.direct(m, home + np.array([0.03, -0.015, 0.0, 0.02, 0.01, -0.02])).raise_if_failed().q
    here = m.input_values(q)
    few = max(20, repeats // 10)

    def row(
        what: str, ours: float, peer: str = "", theirs: float | None = None
    ) -> dict[str, object]:
        ratio = None if theirs is None else theirs / ours
        return {"what": what, "seconds": ours, "peer": peer, "peer_seconds": theirs, "ratio": ratio}

    targets = here + np.cumsum(2e-3 * _signs(rng, repeats), axis=0)
    state = {"q": q}

    def track(i: int) -> None:
        solution = cc.direct(m, targets[i % repeats], guess=state["q"])
        if not solution.converged:
            raise SystemExit(f"a benchmarked step failed: {solution.message}")
        state["q"] = solution.q

    direct = median_seconds(track, repeats)
    near = here + 2e-4
    scipy_time = median_seconds(lambda _: scipy_direct(m, here + 2e-3, q), few)
    pose = m.pose(cc.direct(m, near, guess=q).q)
    cc.inverse(m, pose, q).raise_if_failed()
    return [
        row(
            "D1 direct, warm, steps of 2 mm an input",
            direct,
            "scipy least_squares, same rows",
            scipy_time,
        ),
        row("D1 direct from home", median_seconds(lambda _: cc.direct(m, here), repeats)),
        row("D1 inverse, warm, six outputs", median_seconds(lambda _: cc.inverse(m, pose, q), few)),
        row("D1 residual + Jacobian", median_seconds(lambda _: m.workspace.evaluate(q), repeats)),
        row("D1 classify", median_seconds(lambda _: cc.classify(m, q), few)),
        row("D1 velocity equation", median_seconds(lambda _: cc.velocity(m, q), few)),
    ]


def map_rate(cells: int) -> dict[str, object]:
    """Seconds for a cell of D1's map q1 x q2, positions, singular values and labels included."""
    m = cc.load("d1")
    h = m.input_values(m.home)
    axes = {n: np.linspace(h[i] - 0.06, h[i] + 0.06, cells) for i, n in enumerate(("q1", "q2"))}
    begin = time.perf_counter()
    cc.singularity_map(m, axes, progress=False)
    seconds = (time.perf_counter() - begin) / cells**2
    return {
        "what": f"D1 map cell ({cells} x {cells})",
        "seconds": seconds,
        "peer": "",
        "peer_seconds": None,
        "ratio": None,
    }


def main() -> None:
    """Measure, print the table, and write it as JSON where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=2000)
    parser.add_argument("--json", type=Path, help="also write the rows to this file")
    options = parser.parse_args()
    rows = [*measure(options.repeats), map_rate(60)]
    table = Table(title="Median of one call, one thread")
    for column in ("what", "time [us]", "peer", "peer [us]", "peer / ours"):
        table.add_column(column, justify="left" if column in ("what", "peer") else "right")
    for r in rows:
        numbers = [
            "" if r[k] is None else f"{float(r[k]) * scale:.{digits}f}"  # type: ignore[arg-type]
            for k, scale, digits in (("seconds", 1e6, 1), ("peer_seconds", 1e6, 1), ("ratio", 1, 1))
        ]
        table.add_row(str(r["what"]), numbers[0], str(r["peer"]), numbers[1], numbers[2])
    versions = {name: version(name) for name in PACKAGES} | {"python": platform.python_version()}
    console = Console(width=120)
    console.print(table)
    console.print(", ".join(f"{k} {v}" for k, v in versions.items()))
    if options.json is not None:
        options.json.write_text(json.dumps({"versions": versions, "rows": rows}, indent=2))


if __name__ == "__main__":
    main()
