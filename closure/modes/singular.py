"""Singular postures among all: where two modes have met, and families at special values.

Newton's method refuses them, so random starts end short of them. Descent by LAPACK goes on from
there, and the place of a double root is found by its Jacobian.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from closedchain.closure.constraints import flipped_axes
from closedchain.closure.modes.dimension import dimensions
from closedchain.closure.modes.result import Family
from closedchain.closure.modes.seeking import Sought, unwound
from closedchain.closure.modes.shapes import shapes_of
from closedchain.closure.solve.alone import system_at
from closedchain.closure.solve.descend import descend
from closedchain.closure.solve.double_roots import at_fold
from closedchain.closure.solve.problem import Problem

CLOSED = 1e-10  # m or rad
OPEN = 1e-6  # m or rad: beside a double root rows are far smaller than that
SAME = 1e-4  # dimensionless: shapes that differ by less are one, at a double root
MOST = 12  # singular postures, or families
THOROUGH = 400  # evaluations from a start: at a double root errors shrink by half at best
QUICK = (12, 60)  # starts, and evaluations of each, to a family


def with_singular(
    problem: Problem, targets: np.ndarray, found: Sought, *, settled: bool
) -> tuple[Sought, tuple[Family, ...]]:
    """What was sought, with the singular postures that its starts came near to; and families.

    Where a count is ``settled``, all its solutions are regular, and single postures that are
    singular would be among them. Only families may be left, which starts come to quickly.
    """
    m = problem.mechanism
    shapes = shapes_of(m)
    known = list(shapes.of(found.q)) if len(found.q) else []
    alone: list[np.ndarray] = []
    families: list[Family] = []
    looks, steps = QUICK if settled else (len(found.unsettled), THOROUGH)
    for start in found.unsettled[:looks]:
        if len(alone) + len(families) >= MOST:
            break
        system, moved = system_at(problem, targets, start)
        descended = descend(system, moved, evaluations=steps)
        if descended.residual > OPEN:
            continue
        near = at_fold(system, descended)
        if near.residual > CLOSED or flipped_axes(m, near.q):
            continue
        q = unwound(m, near.q[None])
        shape = shapes.of(q)[0]
        if any(np.abs(shape - other).max(initial=0.0) < SAME for other in known):
            continue
        known.append(shape)
        dimension = dimensions(system, q[0])[0]
        if dimension == 0:
            alone.append(q[0])
        elif all(f.dimension != dimension for f in families):
            families.append(Family(dimension, q[0]))
    every = [*alone, *(f.q for f in families)]
    if not every:
        return found, ()
    q = np.concatenate([found.q, np.array(every)])
    hits = np.concatenate([found.hits, np.ones(len(every), dtype=int)])
    return replace(found, q=q, hits=hits), tuple(families)
