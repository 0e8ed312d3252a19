"""Joint rates along a followed task: those that the task demands, and those of the null motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin

from closedchain.analysis.motion.follow.postures import Posture
from closedchain.analysis.motion.follow.problem import Problem
from closedchain.analysis.motion.track.demands import TipDemand

_SINGULAR = 1e-9  # share of the largest singular value that is none


def joint_rates(problem: Problem, postures: Sequence[Posture]) -> np.ndarray:
    """Rates (n, nv) [m/s, rad/s] of all joints at postures that hold the first n samples.

    [K; J] v = [0; V] gives them, with V the tip's velocity on the spline through the samples, but
    for the null motion. This one is chosen sample by sample: its part is the slope of the parabola
    through neighbouring samples.
    """
    m, n = problem.mechanism, len(postures)
    rates = np.zeros((n, m.model.nv))
    demand = TipDemand(m, problem.free, problem.outputs)
    slopes = _slopes(problem, postures) if problem.freedoms else None
    for i, at in enumerate(postures):
        p = problem.route.between(min(i, problem.route.size - 2), float(problem.times[i]))
        linear = demand.linearise(at.q, p)
        x = np.linalg.lstsq(linear.matrix, linear.rhs, rcond=_SINGULAR)[0]
        if slopes is not None:
            x = x + at.basis @ (at.basis.T @ (slopes[i] - x))
        rates[i, problem.free] = x * problem.unit
    return rates


def _slopes(problem: Problem, postures: Sequence[Posture]) -> np.ndarray:
    """Dimensionless slopes (n, free) of the unlocked joints over the samples' times."""
    model, n = problem.mechanism.model, len(postures)
    if n < 2:
        return np.zeros((n, problem.free.size))
    way = np.zeros((n, problem.free.size))
    for i, (one, two) in enumerate(pairwise(postures)):
        step = pin.difference(model, one.q, two.q)[problem.free] / problem.unit
        way[i + 1] = way[i] + step
    times = np.asarray(problem.times[:n])
    return np.asarray(np.gradient(way, times, axis=0, edge_order=2 if n > 2 else 1))
