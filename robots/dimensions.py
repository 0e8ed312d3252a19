"""Checks that the geometries of all robots share."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields
from math import isfinite
from typing import Any, TypeVar

import numpy as np

from closedchain.urdf.errors import DescriptionError, known_names

G = TypeVar("G")


def with_dimensions(kind: type[G], owner: str, values: Mapping[str, Any]) -> G:
    """Geometry of dataclass ``kind`` with single fields replaced.

    Raises
    ------
    DescriptionError
        Unknown field of ``owner`` (lists the known ones), or a value that ``kind`` refuses.
    """
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    for name in values:
        if name not in known:
            raise DescriptionError(known_names(name, f"{owner} field", known))
    return kind(**values)


def check_dimensions(geometry: Any, owner: str, *, positive: Collection[str] | None = None) -> None:
    """Refuse fields that are not finite numbers of the default's count, or not positive.

    Parameters
    ----------
    geometry : dataclass instance
        Fields are numbers or tuples of numbers; None is left alone.
    positive : names, optional
        Fields that must be positive; all of them by default.

    Raises
    ------
    DescriptionError
        Naming ``owner`` and the field.
    """
    for field in fields(geometry):
        value = getattr(geometry, field.name)
        if value is None:
            continue
        count = np.size(field.default) if isinstance(field.default, tuple) else 1
        numbers = tuple(value) if count > 1 else (value,)
        if len(numbers) != count or not all(isfinite(x) for x in numbers):
            what = "a finite number" if count == 1 else f"{count} finite numbers"
            raise DescriptionError(f"{owner} field {field.name!r} must be {what}, not {value!r}")
        if (positive is None or field.name in positive) and min(numbers) <= 0.0:
            raise DescriptionError(f"{owner} field {field.name!r} must be positive, not {value!r}")
