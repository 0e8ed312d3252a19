"""The command ``closedchain joints``: lines of driven joints in, lines of all joints out."""

from __future__ import annotations

import json
import math
import sys
from typing import TYPE_CHECKING, Any

from closedchain import _arguments as arguments
from closedchain._options import Mode, NoXacro, Robot, Settings, Values, Variant
from closedchain._terminal import plain, remark, say
from closedchain.urdf.errors import ClosedChainError, ClosureError

if TYPE_CHECKING:
    import numpy as np

    from closedchain.analysis.motion.joint_positions import JointPositions
    from closedchain.closure import Mechanism

_READ_OVER = ("header", "velocity", "effort")  # of a sensor_msgs/JointState


def joints(
    robot: Robot,
    values: Values = None,
    mode: Mode = None,
    settings: Settings = None,
    variant: Variant = None,
    no_xacro: NoXacro = False,
) -> None:
    """Read driven joints and write all joints, line by line.

    Lines are JSON, an answer for each. A line is {"q1": 0.5} or {"name": ["q1"], "position":
    [0.5]}; joints that it leaves out stay.
    The branch is kept from line to line. Where the way meets a singularity nothing moves, and the
    answer says which kind; the next line goes on from there. Ends with its input.
    """
    import closedchain as cc

    mechanism = arguments.load_robot(robot, settings or (), variant, xacro=not no_xacro)
    mechanism.required_inputs()
    q = mechanism.closed_home() if mode is None else arguments.start_posture(mechanism, mode)
    if values:
        given = arguments.all_inputs(mechanism, arguments.input_values(mechanism, values), mode)
        q = cc.direct(mechanism, given, q).raise_if_failed().q
    accepted = _accepted(mechanism)
    if sys.stdin.isatty():
        remark(f"{accepted}; Ctrl-D ends")
    for number, line in enumerate(sys.stdin.buffer, start=1):
        if not line.strip():
            continue
        try:
            found = cc.joint_positions(mechanism, _read(line), q)
        except ClosedChainError as error:
            say(json.dumps({"error": f"line {number}: {error}; {accepted}"}))
            continue
        q = found.q
        say(json.dumps(plain(_answer(found))))


def _accepted(mechanism: Mechanism) -> str:
    """Sentence on what a line may hold."""
    from closedchain.analysis.motion.joint_positions import driven_joints

    first, at = mechanism.inputs[0], round(float(mechanism.home[mechanism.input_q[0]]), 3)
    other = driven_joints(mechanism)
    called = f" (or {', '.join(other)})" if other != mechanism.inputs else ""
    return (
        f'a line is {{"{first}": {at}}} or {{"name": ["{first}"], "position": [{at}]}} '
        f"with some of {', '.join(mechanism.inputs)}{called}, in m or rad"
    )


def _read(line: bytes) -> dict[str, float]:
    """Values by name of one line. Raises ``ClosureError``."""
    try:
        told = json.loads(line.decode(), object_pairs_hook=_once)
    except RecursionError:
        raise ClosureError("brackets are nested too deep") from None
    except UnicodeDecodeError:
        raise ClosureError("this is not UTF-8") from None
    except json.JSONDecodeError as error:
        raise ClosureError(f"this is not JSON ({error.msg} at column {error.colno})") from None
    except ValueError as error:  # integers with thousands of digits
        raise ClosureError(f"this is no number ({error})") from None
    if not isinstance(told, dict):
        raise ClosureError(f"this is {_called(told)}, not an object in braces")
    if not isinstance(told.get("name"), list):
        return {name: _number(name, value) for name, value in told.items()}
    return _paired(told)


def _paired(told: dict[str, Any]) -> dict[str, float]:
    """Values by name of a line in the form of a sensor_msgs/JointState."""
    for key in told:
        if key not in ("name", "position", *_READ_OVER):
            raise ClosureError(f'"{key}" has no place beside "name" and "position"')
    names, positions = told["name"], told.get("position")
    if not isinstance(positions, list) or len(positions) != len(names):
        count = f"{len(positions)}" if isinstance(positions, list) else "no"
        raise ClosureError(f'"name" has {len(names)} entries and "position" {count}')
    found: dict[str, float] = {}
    for name, value in zip(names, positions, strict=True):
        if not isinstance(name, str):
            raise ClosureError(f'"name" holds {_called(name)}')
        if name in found:
            raise ClosureError(f"{name} is given twice")
        found[name] = _number(name, value)
    return found


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise ClosureError(f"{name} is given twice")
        found[name] = value
    return found


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ClosureError(f"the value of {name} is {_called(value)}, not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ClosureError(f"the value of {name} is not finite")
    return number


def _called(value: object) -> str:
    """Words for a JSON value."""
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    kinds = {str: "a text", list: "a list", dict: "an object", int: "a number", float: "a number"}
    return kinds[type(value)]


def _answer(found: JointPositions) -> dict[str, Any]:
    floating: dict[str, dict[str, np.ndarray]] = (
        {"floating": dict(found.floating)} if found.floating else {}
    )
    return {
        "name": found.names,
        "position": found.values,
        **floating,
        "residual": found.residual,
        "branch": found.branch,
        "arrived": found.arrived,
        "kinds": found.kinds,
        "beyond_limits": found.beyond_limits,
        "message": found.message,
    }
