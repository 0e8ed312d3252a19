"""What the commands are given: a robot, its parameters, values of its inputs, slices."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from closedchain.urdf.errors import ClosedChainError, DescriptionError, known_names

if TYPE_CHECKING:
    import numpy as np

    from closedchain.analysis.forces.tip_measures import TipMeasure
    from closedchain.closure import Mechanism

Up = Literal["x", "y", "z"]


class BadArgumentError(ClosedChainError):
    """An argument of a command that cannot be understood."""


@dataclass(frozen=True)
class Reading:
    """How a file is read: tolerance [m], joint values that replace home's, package folders."""

    tolerance: float | None = None
    home: Mapping[str, float] = field(default_factory=dict)
    package_dirs: tuple[Path, ...] = ()


_AS_IT_IS = Reading()
_READING: ContextVar[Reading] = ContextVar("reading", default=_AS_IT_IS)


@contextmanager
def reading(
    tolerance: float | None, home: Sequence[str], package_dirs: Sequence[Path]
) -> Iterator[None]:
    """Say how files are read within a ``with`` statement. Raises ``BadArgumentError``."""
    values = {}
    for word in home:
        name, text = _split(word, "--home")
        values[name] = number(text, f"--home {name}")
    for folder in package_dirs:
        if not folder.is_dir():
            raise BadArgumentError(f"--package-dir {folder}: there is no such folder")
    token = _READING.set(Reading(tolerance, values, tuple(package_dirs)))
    try:
        yield
    finally:
        _READING.reset(token)


def load_robot(
    name: str, settings: Sequence[str] = (), variant: str | None = None, *, xacro: bool = True
) -> Mechanism:
    """Load a robot of the catalogue, or of a file of any known format.

    Raises
    ------
    ClosedChainError, OSError
        Unknown robot or parameter, unreadable file, wrong description.
    """
    import closedchain as cc
    from closedchain.closure.loading import located, mechanism_from_description
    from closedchain.robots import families
    from closedchain.robots.examples import PREFIX, example_file
    from closedchain.urdf.files import describe_file

    how = _READING.get()
    known = (*cc.robots(), *families())
    parameters = assignments(settings, "--set")
    if name in known:
        for key in ("name", "variant"):  # words of cc.load itself
            if key in parameters:
                raise DescriptionError(f"unknown parameter {key!r} of {name}")
        if how != _AS_IT_IS:
            raise DescriptionError(
                "--tolerance, --home and --package-dir are for files, not for robots of the "
                "catalogue"
            )
        return cc.load(name, variant=variant, **parameters)
    path = example_file(name) if name.startswith(PREFIX) else Path(name)
    if not path.exists() or path.is_dir():
        if path.is_dir():
            raise DescriptionError(f"{name} is a folder, not a file of a robot")
        if path.suffix or path.name != name:
            raise DescriptionError(f"there is no file {name}")
        raise DescriptionError(f"{known_names(name, 'robot', known)}; nor is it a file")
    if variant is not None:
        raise DescriptionError("--variant is for robots of the catalogue, not for files")
    described = located(describe_file(path, parameters, xacro=xacro), path, how.package_dirs)
    return mechanism_from_description(described, how.tolerance, how.home)


def up_axis(name: str, chosen: str | None = None) -> Up:
    """World axis to draw upwards: the one chosen, the catalogue's, else z."""
    from closedchain.robots import families, robot, robots

    axes: dict[str, Up] = {"x": "x", "y": "y", "z": "z"}
    if chosen is not None:
        if chosen not in axes:
            raise BadArgumentError(known_names(chosen, "axis", axes))
        return axes[chosen]
    return robot(name).up if name in (*robots(), *families()) else "z"


def free_fall(robot: str, words: str | None, *, none: bool) -> list[float]:
    """Acceleration of free fall [m/s^2]: as given, none, or against the robot's up axis.

    Raises ``BadArgumentError``.
    """
    if none and words is not None:
        raise BadArgumentError("--gravity and --no-gravity contradict each other: leave one out")
    if none:
        return [0.0, 0.0, 0.0]
    if words is None:
        return [-9.81 if axis == up_axis(robot) else 0.0 for axis in "xyz"]
    numbers = [number(word, "--gravity") for word in words.replace(",", " ").split()]
    if len(numbers) != 3:
        raise BadArgumentError(f"--gravity: expected three numbers, got {words!r}")
    return numbers


def finite(values: Sequence[float], what: str) -> None:
    """Refuse what is not finite. Raises ``BadArgumentError``."""
    if not all(map(math.isfinite, values)):
        raise BadArgumentError(f"{what}: {' '.join(map(str, values))} are not finite numbers")


def number(text: str, what: str) -> float:
    """Read a finite number; angles may be written as ``30deg`` or in terms of pi, as ``-3pi/2``.

    Raises ``BadArgumentError``.
    """
    value = _value(text.strip())
    if not math.isfinite(value):
        raise BadArgumentError(
            f"{what}: {text!r} is not a finite number (such as 0.3, 1e-2, 30deg or pi/2)"
        )
    return value


_PI = re.compile(r"(?P<sign>[+-]?)(?P<times>[0-9.]*)\*?pi(/(?P<over>[0-9.]+))?")


def _value(text: str) -> float:
    """Value of a number, or NaN where it is none."""
    try:
        if text.endswith("deg"):
            return math.radians(float(text.removesuffix("deg")))
        in_pi = _PI.fullmatch(text)
        if in_pi is None:
            return float(text)
        size = float(in_pi["times"] or 1.0) * math.pi / float(in_pi["over"] or 1.0)
        return -size if in_pi["sign"] == "-" else size
    except (ValueError, ZeroDivisionError):
        return math.nan


def measures(words: Iterable[str]) -> dict[str, TipMeasure]:
    """Read ``NAME`` or ``NAME=NUMBER,...`` words about measures. Raises ``ClosedChainError``."""
    from closedchain.analysis.forces.tip_measures import tip_measure

    found: dict[str, TipMeasure] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if name in found:
            raise BadArgumentError(f"--measure: {name} is given twice")
        numbers = [number(one, f"--measure {name}") for one in text.split(",")] if equals else None
        found[name] = tip_measure(name, numbers)
    return found


def input_values(
    mechanism: Mechanism, words: Iterable[str], option: str = "input"
) -> dict[str, float]:
    """Read ``name=value`` words about the inputs of a mechanism. Raises ``BadArgumentError``."""
    values: dict[str, float] = {}
    for word in words:
        name, text = _split(word, option)
        _known_input(mechanism, name, "" if option == "input" else f"{option}: ")
        if name in values:
            raise BadArgumentError(f"{option} {name} is given twice")
        values[name] = number(text, f"{option} {name}")
    return values


@dataclass
class Slices:
    """What ``--over`` asks for: coordinates of each slice, and by name range and points."""

    slices: list[tuple[str, ...]] = field(default_factory=list)
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    points: dict[str, int] = field(default_factory=dict)


def slices(mechanism: Mechanism, words: Sequence[str]) -> Slices:
    """Read ``name``, ``name=lo:hi`` and ``name=lo:hi:n`` words.

    One coordinate is a line, two a slice, three a volume, four or six are slices of two each.

    Raises
    ------
    BadArgumentError
        Unknown coordinates, another number of them, ranges that do not rise or do not agree.
    """
    found, names = Slices(), []
    for word in words:
        name, _, text = word.partition("=")
        _known_coordinate(mechanism, name, "--over")
        names.append(name)
        if "=" in word:
            _read_range(found, name, text)
    if len(names) not in (0, 1, 2, 3, 4, 6):
        raise BadArgumentError(
            f"--over takes one coordinate (a line), two (a slice), three (a volume), or four or "
            f"six (slices of two), got {len(names)}: {' '.join(names)}"
        )
    size = 2 if len(names) in (4, 6) else max(len(names), 1)
    found.slices = [tuple(names[i : i + size]) for i in range(0, len(names), size)]
    for over in found.slices:
        if len(set(over)) < len(over):
            raise BadArgumentError(f"a slice needs different coordinates, got {' '.join(over)}")
    return found


def coordinate_values(mechanism: Mechanism, words: Iterable[str], option: str) -> dict[str, float]:
    """Read ``name=value`` words about coordinates. Raises ``BadArgumentError``."""
    values: dict[str, float] = {}
    for word in words:
        name, text = _split(word, option)
        _known_coordinate(mechanism, name, option)
        if name in values:
            raise BadArgumentError(f"{option} {name} is given twice")
        values[name] = number(text, f"{option} {name}")
    return values


def resolution(wanted: Slices, everywhere: int | None) -> dict[str, int] | int | None:
    """Points along each coordinate: its own number, else the one for all, if there is one."""
    if everywhere is None:
        return wanted.points
    if not wanted.slices:
        return everywhere
    return {name: wanted.points.get(name, everywhere) for over in wanted.slices for name in over}


def kinds(words: Sequence[str]) -> tuple[str, ...]:
    """Kinds of singularity, all of them by default. Raises ``BadArgumentError``."""
    from closedchain.analysis.singularity.sets.singular_set import KINDS

    for word in words:
        if word not in (*KINDS, "all"):
            raise BadArgumentError(known_names(word, "kind of singularity", (*KINDS, "all")))
    chosen = tuple(kind for kind in KINDS if kind in words)
    return KINDS if not words or "all" in words else chosen


def image_file(folder: Path, out: Path | None, image_format: str | None) -> Path:
    """Image to write: its format by the option, or by the ending of its name.

    Raises
    ------
    BadArgumentError
        Unknown format, or one that the name contradicts.
    """
    formats = ("png", "svg", "pdf")
    if image_format is not None and image_format not in formats:
        raise BadArgumentError(known_names(image_format, "format", formats))
    if out is None:
        return folder / f"map.{image_format or 'png'}"
    ending = out.suffix.lstrip(".").lower()
    if ending not in formats:
        raise BadArgumentError(f"--out {out}: the name must end in .png, .svg or .pdf")
    if image_format not in (None, ending):
        raise BadArgumentError(f"--out {out} and --format {image_format} do not agree")
    return out


def _read_range(found: Slices, name: str, text: str) -> None:
    parts = text.split(":")
    if len(parts) not in (2, 3):
        raise BadArgumentError(f"--over {name}={text}: expected {name}=lo:hi or {name}=lo:hi:n")
    low, high = (number(part, f"--over {name}") for part in parts[:2])
    if not low < high:
        raise BadArgumentError(f"--over {name}: {low:g} is not below {high:g}")
    if found.ranges.setdefault(name, (low, high)) != (low, high):
        raise BadArgumentError(f"--over {name} is given with two ranges")
    if len(parts) == 3:
        if not re.fullmatch(r"[0-9]{1,6}", parts[2]):
            raise BadArgumentError(f"--over {name}: {parts[2]!r} is not a number of points")
        points = int(parts[2])
        if found.points.setdefault(name, points) != points:
            raise BadArgumentError(f"--over {name} is given with two numbers of points")


def assignments(words: Iterable[str], option: str) -> dict[str, str]:
    """Texts by name, from words such as name=text."""
    values: dict[str, str] = {}
    for word in words:
        name, text = _split(word, option)
        if name in values:
            raise BadArgumentError(f"{option} {name} is given twice")
        values[name] = text
    return values


def _split(word: str, what: str) -> tuple[str, str]:
    name, equals, text = word.partition("=")
    if not (name and equals and text.strip()):
        raise BadArgumentError(f"{what}: expected name=value, got {word!r}")
    return name, text


def _known_input(mechanism: Mechanism, name: str, where: str) -> None:
    if name not in mechanism.inputs:
        raise BadArgumentError(f"{where}{known_names(name, 'input', mechanism.inputs)}")


def _known_coordinate(mechanism: Mechanism, name: str, option: str) -> None:
    from closedchain.closure.charting import coordinate_names

    known = coordinate_names(mechanism)
    if name not in known:
        raise BadArgumentError(f"{option}: {known_names(name, 'coordinate', known)}")


def all_inputs(
    mechanism: Mechanism, given: Mapping[str, float], mode: str | None = None
) -> dict[str, float]:
    """Values of all inputs: those given, else those of home, or of another named posture."""
    start = start_posture(mechanism, mode)
    home = zip(mechanism.inputs, mechanism.input_values(start), strict=True)
    return {name: given.get(name, float(value)) for name, value in home}


def start_posture(mechanism: Mechanism, mode: str | None, *, working: bool = False) -> np.ndarray:
    """Home, or the posture (nq,) of a mode: a working mode where the tip's pose is prescribed."""
    from closedchain.closure.modes.choosing import mode_posture

    return mechanism.home if mode is None else mode_posture(mechanism, mode, working=working)


def positive(value: float, what: str) -> None:
    """Refuse what is not a finite number above zero. Raises ``BadArgumentError``."""
    if not (math.isfinite(value) and value > 0.0):
        raise BadArgumentError(f"{what}: {value:g} is not above zero")
