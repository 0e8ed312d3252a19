"""Where a factor vanishes, and what the leg looks like there: meanings are read off geometry."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from closedchain.analysis.symbolic.legforms import Driving, LegForms
from closedchain.analysis.symbolic.platform import PlatformForms, rows_rank
from closedchain.analysis.symbolic.ring import PI, Element, Ring, evaluate
from closedchain.analysis.symbolic.spaces import Point

_CLOSE = 1e-7
_GRID = 49


def coordinates_in(ring: Ring, element: Element, parameters: Sequence[str]) -> list[str]:
    """Joints that an element depends on."""
    n, first = len(ring.angles), len(ring.R.gens) - len(ring.variables)
    found: dict[str, None] = {}
    for i, angle in enumerate(ring.angles):
        if any(mono[i] or mono[n + i] for mono in element):
            found |= dict.fromkeys(k for k, _ in angle.terms if k not in (PI, "1"))
    for i, name in enumerate(ring.variables):
        if any(mono[first + i] for mono in element):
            found[name] = None
    return [name for name in found if name not in parameters]


def zero(
    ring: Ring,
    element: Element,
    at: Point,
    parameters: Sequence[str],
    relation: tuple[Element, Sequence[str]] | None = None,
) -> dict[str, float] | None:
    """Values at which the element vanishes, like ``at`` but for one joint; None if none is found.

    Parameters are moved to generic values: sizes that happen to be equal would tell more than the
    factor says. Loops need not be closed there, elements being those of open legs, but for
    ``relation``: an element that has to vanish too, and the joints that may see to it.
    """
    rng = np.random.default_rng(1)
    for spread in (0.15, 0.3, 0.45, 0.6, 0.0):
        base = dict(at)
        for name in parameters:
            base[name] = at[name] * (1.0 + spread * rng.uniform(-1.0, 1.0))
        if relation is None:
            found = _vary(ring, element, base, coordinates_in(ring, element, parameters))
        else:
            found = _both(ring, element, base, parameters, relation)
        if found is not None:
            return found
    return None


def _both(
    ring: Ring,
    element: Element,
    base: Point,
    parameters: Sequence[str],
    relation: tuple[Element, Sequence[str]],
) -> dict[str, float] | None:
    """Zero of the element on a relation."""
    bound, joints = relation
    held = _vary(ring, bound, base, joints)
    if held is None:
        return None
    inside = coordinates_in(ring, bound, parameters)
    names = coordinates_in(ring, element, parameters)
    found = _vary(ring, element, held, [n for n in names if n not in inside])
    if found is not None:
        return found
    found = _vary(ring, element, held, [n for n in names if n not in joints])
    return None if found is None else _vary(ring, bound, found, joints)


def _vary(ring: Ring, element: Element, at: Point, names: Sequence[str]) -> dict[str, float] | None:
    """Zero of the element by moving one of the joints ``names`` over a turn."""
    from scipy.optimize import brentq

    for name in names:

        def value(x: float, name: str = name) -> float:
            return evaluate(ring, element, {**at, name: x})

        grid = at[name] + np.linspace(-np.pi, np.pi, _GRID) + 0.0123
        values = [value(x) for x in grid]
        for i in np.flatnonzero(np.diff(np.sign(values))):
            root = float(brentq(value, grid[i], grid[i + 1], xtol=1e-15))
            return {**at, name: root}
    return None


def lever_meaning(form: LegForms, drive: Driving, joint: str, there: Point, kind: str) -> str:
    """What a vanishing lever means, for the input ``joint`` at a zero of one of its factors."""
    ring = form.ring
    wrench = np.array([evaluate(ring, x, there) for x in drive.wrench])
    screw = np.array([evaluate(ring, x, there) for x in form.screws[joint]])
    f, moment = wrench[:3], wrench[3:]
    size = np.linalg.norm(f)
    if size < _CLOSE * max(1.0, float(np.linalg.norm(moment))):
        return f"the couple of the leg does no work on {kind}"
    if not np.any(screw[:3]):
        return f"the leg's force is at right angles to the slide of {kind}"
    point = np.cross(f, moment) / size**2
    axis, on_axis = screw[:3], np.cross(screw[:3], screw[3:])
    ball = _ball(form, there)
    if ball is not None and np.linalg.norm(np.cross(ball - on_axis, axis)) < _CLOSE:
        return (
            f"the spherical joint {form.hinges[0].rpartition('.')[0]} lies on the axis of {kind}, "
            "which cannot move it"
        )
    for other in form.columns:
        other_screw = np.array([evaluate(ring, x, there) for x in form.screws[other]])
        if other == joint or not np.any(other_screw[:3]) or other in form.hinges:
            continue
        parallel = np.linalg.norm(np.cross(other_screw[:3], axis)) < _CLOSE
        apart = np.cross(other_screw[:3], other_screw[3:]) - on_axis
        apart = apart - (apart @ axis) * axis
        if not parallel or np.linalg.norm(apart) < _CLOSE:
            continue
        normal = np.cross(axis, apart)
        normal /= np.linalg.norm(normal)
        in_plane = abs(f @ normal) < _CLOSE * size and abs((point - on_axis) @ normal) < _CLOSE
        if in_plane and np.linalg.norm(np.cross(f, axis)) > _CLOSE * size:
            return (
                f"leg stretched or folded: its force lies in the plane of the axes of {kind} and "
                f"{other.partition(']')[0] + ']' if ']' in other else other}"
            )
    if np.linalg.norm(np.cross(f, axis)) < _CLOSE * size:
        return f"the leg's force is parallel to the axis of {kind}"
    return f"the leg's force meets the axis of {kind}, or is parallel to it"


def _ball(form: LegForms, there: Point) -> np.ndarray | None:
    if not form.hinges:
        return None
    return np.array([evaluate(form.ring, x, there) for x in form.points[form.hinges[0]]])


def loses_constraint(forms: PlatformForms, generic: Point, there: Point) -> bool:
    """Whether the constraints of all legs have a lower rank there."""
    return rows_rank(forms, forms.constraints, there) < rows_rank(forms, forms.constraints, generic)


def dependent_meaning(forms: PlatformForms, there: Point, names: Sequence[str]) -> str:
    """Which driving wrenches, called ``names``, are dependent, beside the constraints."""
    base = rows_rank(forms, forms.constraints, there)
    for size in range(1, len(names) + 1):
        for chosen in combinations(range(len(names)), size):
            rows = [*forms.constraints, *[forms.driving[i] for i in chosen]]
            if rows_rank(forms, rows, there) < base + size:
                who = ", ".join(names[i] for i in chosen)
                if size == 1:
                    return (
                        f"the force of the leg of {who} does no work on any motion that the "
                        "constraints permit"
                    )
                if size == len(names):
                    return f"the forces of all driven legs ({who}) are dependent"
                return f"the forces of the legs of {who} are dependent on what they hold together"
    return "the forces of the driven legs are dependent"
