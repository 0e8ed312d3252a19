"""The words of ``closedchain follow``: a task, locks, limits of inputs and of their speeds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from closedchain._arguments import BadArgumentError, number, positive
from closedchain.urdf.errors import known_names

if TYPE_CHECKING:
    from closedchain.analysis.motion.follow import TaskPath
    from closedchain.closure import Mechanism

CSV_HELP = (
    "a CSV file whose first line is t,x,y,z or t,x,y,z,ax,ay,az: rising times [s], positions of "
    "the tip in the world [m], directions of the tool axis"
)


def read_task(mechanism: Mechanism, robot: str, word: str, outputs: tuple[str, ...]) -> TaskPath:
    """Task by its name, or from a file.

    Raises
    ------
    ClosedChainError, OSError
        Neither a name nor a file; unreadable or malformed files.
    """
    import closedchain as cc
    from closedchain.robots.named_tasks import named_task, named_tasks

    known = named_tasks(robot)
    if word in known:
        task = named_task(robot, word)
        return cc.task_path(
            *(mechanism, task.times, task.positions),
            axes=task.axes,
            rotations=task.rotations,
            outputs=outputs,
            name=word,
        )
    path = Path(word)
    if not path.is_file():
        if path.is_dir():
            raise BadArgumentError(f"--task {word} is a folder; expected {CSV_HELP}")
        if path.suffix or path.name != word:
            raise BadArgumentError(f"there is no file {word}; --task takes {CSV_HELP}")
        raise BadArgumentError(f"{known_names(word, f'task of {robot}', known)}; or {CSV_HELP}")
    try:
        return cc.read_task_path(mechanism, path, outputs=outputs)
    except UnicodeDecodeError:
        raise BadArgumentError(f"{word} is no UTF-8 text; expected {CSV_HELP}") from None


def locks(mechanism: Mechanism, words: Sequence[str]) -> dict[str, float] | list[str] | None:
    """Read ``name`` and ``name=value`` words: names alone where there are no values.

    Raises
    ------
    BadArgumentError
        As all readers of this module: unknown or repeated inputs, values that are no numbers.
    """
    home = dict(zip(mechanism.inputs, mechanism.input_values(mechanism.home), strict=True))
    given = {}
    for name, text in _split(mechanism, words, "--lock"):
        value = None if text is None else number(text, f"--lock {name}")
        given[name] = value
    if not any(value is not None for value in given.values()):
        return list(given) or None
    return {name: float(home[name]) if value is None else value for name, value in given.items()}


def limits(mechanism: Mechanism, words: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Read ``name=lo:hi`` words."""
    found = {}
    for name, text in _split(mechanism, words, "--limit"):
        ends = (text or "").split(":")
        if len(ends) != 2:
            raise BadArgumentError(
                f"--limit: expected {name}=LO:HI, got {name}{'' if text is None else f'={text}'}"
            )
        low, high = (number(end, f"--limit {name}") for end in ends)
        if not low < high:
            raise BadArgumentError(f"--limit {name}: {low:g} is not below {high:g}")
        found[name] = (low, high)
    return found


def speed_limits(mechanism: Mechanism, words: Sequence[str]) -> dict[str, float] | None:
    """Read one number for all inputs, and ``name=number`` for single ones."""
    everywhere = [word for word in words if "=" not in word]
    if len(everywhere) > 1:
        raise BadArgumentError(
            "--speed-limit: one number for all inputs, or INPUT=SPEED for one of them"
        )
    found = {}
    for word in everywhere:
        speed = number(word, "--speed-limit")
        positive(speed, "--speed-limit")
        found = dict.fromkeys(mechanism.inputs, speed)
    single = [word for word in words if "=" in word]
    for name, text in _split(mechanism, single, "--speed-limit"):
        found[name] = number(text or "", f"--speed-limit {name}")
        positive(found[name], f"--speed-limit {name}")
    return found or None


def _split(
    mechanism: Mechanism, words: Sequence[str], option: str
) -> Iterator[tuple[str, str | None]]:
    """Names of inputs, each but once, and what follows an equals sign."""
    seen = set()
    for word in words:
        name, equals, text = word.partition("=")
        if name not in mechanism.inputs:
            raise BadArgumentError(f"{option}: {known_names(name, 'input', mechanism.inputs)}")
        if name in seen:
            raise BadArgumentError(f"{option} {name} is given twice")
        seen.add(name)
        yield name, text if equals else None
