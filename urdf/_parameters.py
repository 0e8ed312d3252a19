"""Values of xacro arguments: from Python to the text that xacro wants, and back."""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Sequence

from closedchain.urdf.description import ParameterValue
from closedchain.urdf.errors import DescriptionError

INTEGER = re.compile(r"[+-]?[0-9]+")
NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


def argument_text(name: str, value: object) -> str:
    """Text that hands ``value`` to xacro.

    Numbers keep every digit; a sequence of numbers becomes "1 2 3"; NumPy values are welcome.

    Raises
    ------
    DescriptionError
        A value that is not finite or of a type that has no text.
    """
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, str):
        return value
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        if any(isinstance(item, str | Sequence) for item in value):
            raise DescriptionError(f"parameter {name!r}: a sequence must hold numbers only")
        return " ".join(argument_text(name, item) for item in value)
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        number = float(value)
        if not math.isfinite(number):
            raise DescriptionError(f"parameter {name!r} is {number}; it must be finite")
        return repr(number)
    raise DescriptionError(
        f"parameter {name!r} has the type {type(value).__name__}; expected a number, a bool, "
        "a string or a sequence of numbers"
    )


def check_like_default(name: str, text: str, default: str) -> None:
    """Refuse a value that is no number, or another count of numbers, where the default is one.

    Expressions ($) are left to xacro.

    Raises
    ------
    DescriptionError
        Naming the parameter and what its default looks like.
    """
    expected, words = default.split(), text.split()
    if "$" in text or not expected or not all(NUMBER.fullmatch(word) for word in expected):
        return
    if len(words) == len(expected) and all(NUMBER.fullmatch(word) for word in words):
        return
    what = "a number" if len(expected) == 1 else f"{len(expected)} numbers"
    raise DescriptionError(f"parameter {name!r} must be {what} like {default!r}, got {text!r}")


def value_in_force(given: object, text: str) -> ParameterValue:
    """Value that a caller sees: the bool that was given, else a number where the text is one.

    Whole numbers stay ``int``, so that the values can be given back as parameters: xacro wants
    a whole number for a count.
    """
    if hasattr(given, "tolist"):
        given = given.tolist()
    if isinstance(given, bool):
        return given
    plain = text.strip()
    if INTEGER.fullmatch(plain) and len(plain) < 300:
        return int(plain)
    if NUMBER.fullmatch(plain) and math.isfinite(number := float(plain)):
        return number
    return text
