"""How the sizes in a description depend on the parameters that it was expanded with.

The file is expanded again with each parameter moved a little. An origin's coordinate that follows
an affine law c0 + sum c_k p_k, also where all parameters are moved at once, is kept as that law
with exact coefficients; anything else is kept as its number, and said so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import pi

import numpy as np

from closedchain.analysis.symbolic.exact import Exact, exact, exact_or_rounded
from closedchain.urdf.description import Description, ParameterValue
from closedchain.urdf.errors import DescriptionError

Key = tuple[str, str, int]
"""Element (``joint NAME``, ``closure NAME``), what of it, and which coordinate."""

_STEPS = (0.01, -0.01, 0.002, -0.002)  # relative; absolute for a parameter that is zero
_CHECKS = 2
_FIT = 1e-10  # misfit of the law [m, rad]


@dataclass(frozen=True)
class Affine:
    """``constant`` + sum of ``slopes`` times parameters, exactly."""

    constant: Exact
    slopes: Mapping[str, Exact]


@dataclass(frozen=True, eq=False)
class Sizes:
    """Numbers of a description as laws in its parameters.

    Attributes
    ----------
    laws : mapping
        Law of each coordinate of each origin.
    values : mapping
        Parameters that occur in them, and their values in force. A parameter of several numbers
        counts as several, such as ``U1_x``.
    notes : tuple of str
        What could not be told exactly.
    """

    laws: Mapping[Key, Affine]
    values: Mapping[str, float]
    notes: tuple[str, ...]


_KNOWN: dict[object, Sizes] = {}
_KEEP = 16


def sizes(description: Description) -> Sizes:
    """Find the laws, by expanding the description's source anew where it has one."""
    key = (description.text, description.source)
    if key not in _KNOWN:
        while len(_KNOWN) >= _KEEP:
            _KNOWN.pop(next(iter(_KNOWN)), None)
        _KNOWN[key] = _sizes(description)
    return _KNOWN[key]


def _sizes(description: Description) -> Sizes:
    base = _numbers(description)
    keys = list(base)
    home = np.array([base[k] for k in keys])
    slopes: dict[str, np.ndarray] = {}
    notes: list[str] = []
    knobs = _knobs(description) if description.source is not None else {}
    steps: dict[str, float] = {}
    for knob, value in knobs.items():
        for share in _STEPS:
            step = share * (value if value else 1.0)
            moved = _expanded(description, {knob: value + step}, keys)
            if moved is not None:
                slopes[knob], steps[knob] = (moved - home) / step, step
                break
    slopes = {k: np.where(np.abs(v) > _FIT, v, 0.0) for k, v in slopes.items()}
    used = {k: v for k, v in slopes.items() if np.any(v)}
    odd = _misfits(description, keys, home, used, {k: knobs[k] for k in used}, steps)
    for i in sorted(odd):
        element, what, _ = keys[i]
        names = ", ".join(k for k, v in used.items() if v[i])
        notes.append(
            f"{what} of {element} is no affine function of {names or 'the parameters'}: its number "
            "is used, which holds for the parameters in force only"
        )
    laws, rounded = {}, set()
    for i, key in enumerate(keys):
        found: dict[str, Exact] = {}
        rest = home[i]
        if i not in odd:
            for name, values in used.items():
                if values[i]:
                    slope, _ = exact_or_rounded(float(values[i]), 1e-9)
                    found[name] = slope
                    rest -= number(slope) * knobs[name]
        margin = 1e-13 if not found else 1e-11
        constant, known = exact_or_rounded(0.0 if abs(rest) < margin else float(rest), margin)
        if not known and not (key[1].endswith("rpy") and turn(float(rest)) is not None):
            rounded.add(key[0])
        laws[key] = Affine(constant, found)
    if rounded:
        notes.append(f"decimals of {', '.join(sorted(rounded))} are taken as printed")
    return Sizes(laws, {name: knobs[name] for name in used}, tuple(dict.fromkeys(notes)))


def number(value: Exact) -> float:
    """Value of an exact number."""
    total = 0.0
    for radicands, rational in value.items():
        term = float(rational)
        for radicand in radicands:
            term *= radicand**0.5
        total += term
    return total


def turn(value: float) -> Fraction | None:
    """The angle [rad] as a multiple of pi, if it is one of pi / 12."""
    found = Fraction(value / pi * 12).limit_denominator(1)
    return found / 12 if abs(float(found) / 12 * pi - value) < 1e-12 else None


def law_angle(law: Affine) -> dict[str, Fraction]:
    """An angle's law [rad] as terms of ``Angle``: parameters, pi, and "1" for what is neither.

    Raises
    ------
    DescriptionError
        A slope that is not rational.
    """
    out: dict[str, Fraction] = {}
    for name, slope in law.slopes.items():
        if set(slope) - {()}:
            raise DescriptionError(f"an angle goes with an irrational multiple of {name!r}")
        out[name] = slope[()]
    constant = number(law.constant)
    of_pi = turn(constant)
    if of_pi is not None:
        out["pi"] = of_pi
    else:
        found = exact(constant)
        rational = found is not None and set(found) == {()}
        out["1"] = found[()] if found is not None and rational else Fraction(repr(constant))
    return out


def _knobs(description: Description) -> dict[str, float]:
    """Every number among the parameters, by name."""
    out: dict[str, float] = {}
    for name, value in description.parameters.items():
        if isinstance(value, bool):
            continue
        if isinstance(value, int | float):
            out[name] = float(value)
            continue
        numbers = _sequence(value)
        if len(numbers) > 1:
            count = range(1, len(numbers) + 1)
            suffixes = [*"xyz"] if len(numbers) == 3 else [str(k) for k in count]
            out |= {f"{name}_{s}": v for s, v in zip(suffixes, numbers, strict=True)}
    return out


def _sequence(value: str) -> list[float]:
    try:
        return [float(word) for word in value.split()]
    except ValueError:
        return []


def _given(description: Description, moved: Mapping[str, float]) -> dict[str, ParameterValue]:
    """All parameters, with some of their numbers moved."""
    out: dict[str, ParameterValue] = {}
    for name, value in description.parameters.items():
        out[name] = value
        if name in moved:
            out[name] = moved[name]
        elif isinstance(value, str) and len(numbers := _sequence(value)) > 1:
            suffixes = "xyz" if len(numbers) == 3 else [str(i + 1) for i in range(len(numbers))]
            new = [moved.get(f"{name}_{s}", v) for s, v in zip(suffixes, numbers, strict=True)]
            if new != numbers:
                out[name] = " ".join(map(repr, new))
    return out


def _expanded(
    description: Description, moved: Mapping[str, float], keys: Sequence[Key]
) -> np.ndarray | None:
    """Numbers of the description with some parameters moved; None where it is refused."""
    from closedchain.urdf.reader import load_description

    assert description.source is not None
    try:
        found = _numbers(load_description(description.source, _given(description, moved)))
    except DescriptionError:
        return None
    return np.array([found[k] for k in keys]) if list(found) == list(keys) else None


def _misfits(
    description: Description,
    keys: Sequence[Key],
    home: np.ndarray,
    slopes: Mapping[str, np.ndarray],
    values: Mapping[str, float],
    steps: Mapping[str, float],
) -> set[int]:
    """Coordinates that do not follow their law when all parameters move at once."""
    if not slopes:
        return set()
    rng = np.random.default_rng(0)
    worst = np.zeros(len(keys))
    done = tries = 0
    while done < _CHECKS and tries < 10 * _CHECKS:
        tries += 1
        by = {k: steps[k] * rng.uniform(0.2, 0.9) * (0.5 if tries > 10 else 1.0) for k in values}
        moved = _expanded(description, {k: values[k] + by[k] for k in values}, keys)
        if moved is None:
            continue
        done += 1
        law = home + sum(slopes[k] * by[k] for k in values)
        worst = np.maximum(worst, np.abs(moved - law))
    if not done:  # never checked: nothing is claimed
        return {i for i in range(len(keys)) if any(v[i] for v in slopes.values())}
    return {int(i) for i in np.flatnonzero(worst > _FIT)}


def _numbers(description: Description) -> dict[Key, float]:
    """Coordinates of all origins and axes."""
    return {
        (element, what, i): value
        for element, what, values in _vectors(description)
        for i, value in enumerate(values)
    }


def _vectors(description: Description) -> Iterator[tuple[str, str, Sequence[float]]]:
    """Origins and axes: whose they are, what they are called, their coordinates."""
    for joint in description.joints:
        element = f"joint {joint.name}"
        yield element, "xyz", joint.origin.xyz
        yield element, "rpy", joint.origin.rpy
        yield element, "axis", joint.axis
    for closure in description.closures:
        element = f"closure {closure.name}"
        for side, origin in (("parent", closure.parent_origin), ("child", closure.child_origin)):
            yield element, f"{side}_origin_xyz", origin.xyz
            yield element, f"{side}_origin_rpy", origin.rpy
        yield element, "parent_axis", closure.parent_axis
        yield element, "child_axis", closure.child_axis
