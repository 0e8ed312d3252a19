"""Dual numbers over numpy arrays: a value and its derivatives, carried through any arithmetic.

For derivatives of a tape at given postures without writing them down; ``derivative`` writes them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Union

import numpy as np
from numpy.typing import NDArray

from closedchain.closure.tape.expression import Tape
from closedchain.closure.tape.numbers import Functions, evaluate

Array = NDArray[np.float64]
Operand = Union["Dual", float, Array]


@dataclass(frozen=True)
class Dual:
    """A number and its derivatives.

    Attributes
    ----------
    value : array, shape (...)
        The number.
    slope : array, shape (k, ...)
        Its derivative in each of k directions.
    """

    value: Array
    slope: Array

    FUNCTIONS: ClassVar[Functions]
    __array_ufunc__ = None  # so that an array on the left leaves the work to us

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __add__(self, other: Operand) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.slope + other.slope)
        return Dual(self.value + other, self.slope)

    __radd__ = __add__

    def __sub__(self, other: Operand) -> Dual:
        return self + (-other)

    def __rsub__(self, other: Operand) -> Dual:
        return -self + other

    def __mul__(self, other: Operand) -> Dual:
        if isinstance(other, Dual):
            slope = self.value * other.slope + other.value * self.slope
            return Dual(self.value * other.value, slope)
        return Dual(self.value * other, self.slope * other)

    __rmul__ = __mul__

    def inverse(self) -> Dual:
        """Return 1 / self."""
        value = 1.0 / self.value
        return Dual(value, -(value * value) * self.slope)

    def __truediv__(self, other: Operand) -> Dual:
        return self * (other.inverse() if isinstance(other, Dual) else 1.0 / other)

    def __rtruediv__(self, other: Operand) -> Dual:
        return self.inverse() * other

    def __lt__(self, other: Operand) -> Any:
        return self.value < value_of(other)

    def __gt__(self, other: Operand) -> Any:
        return self.value > value_of(other)


def variables(x: Array) -> list[Dual]:
    """Duals of independent numbers ``x`` (k, ...): each changes by itself."""
    x = np.asarray(x, dtype=float)
    unit = np.eye(len(x)).reshape(len(x), len(x), *[1] * (x.ndim - 1))
    return [
        Dual(value, np.broadcast_to(one, (len(x), *value.shape)))
        for value, one in zip(x, unit, strict=True)
    ]


def jacobian(tape: Tape, x: Array) -> tuple[Array, Array]:
    """Outputs of a tape and their derivatives by its inputs.

    Parameters
    ----------
    tape : Tape
        Its outputs are numbers.
    x : array, shape (inputs, ...)
        Where to evaluate.

    Returns
    -------
    array (outputs, ...) and array (outputs, inputs, ...). Where min, max, abs and select have a
    kink, the derivatives are those of the branch taken.
    """
    x = np.asarray(x, dtype=float)
    values = np.zeros((len(tape.outputs), *x.shape[1:]))
    slopes = np.zeros((len(tape.outputs), *x.shape))
    for k, found in enumerate(evaluate(tape, variables(x), FUNCTIONS)):
        values[k] = value_of(found)
        slopes[k] = slope_of(found)
    return values, slopes


def value_of(x: Operand) -> Any:
    """Value of a dual or a plain number."""
    return x.value if isinstance(x, Dual) else x


def slope_of(x: Operand) -> Any:
    """Derivatives of a dual; 0 of a plain number."""
    return x.slope if isinstance(x, Dual) else 0.0


def smooth(
    value: Callable[[Any], Any], slope: Callable[[Any, Any], Any]
) -> Callable[[Operand], Operand]:
    """Function of one number, from its value and its derivative (of x and the value there)."""

    def function(x: Operand) -> Operand:
        found = value(value_of(x))
        return Dual(found, slope(x.value, found) * x.slope) if isinstance(x, Dual) else found

    return function


def select(holds: Any, a: Operand, b: Operand) -> Operand:
    """Return a where ``holds``, else b."""
    value = np.where(holds, value_of(a), value_of(b))
    if not isinstance(a, Dual) and not isinstance(b, Dual):
        return value
    return Dual(value, np.where(holds, slope_of(a), slope_of(b)))


def smaller(a: Operand, b: Operand) -> Operand:
    """Return the smaller; NaN where either is NaN."""
    first = value_of(a)
    return select((first < value_of(b)) | np.isnan(first), a, b)


def larger(a: Operand, b: Operand) -> Operand:
    """Return the larger; NaN where either is NaN."""
    first = value_of(a)
    return select((first > value_of(b)) | np.isnan(first), a, b)


FUNCTIONS = Functions(
    sin=smooth(np.sin, lambda x, _: np.cos(x)),
    cos=smooth(np.cos, lambda x, _: -np.sin(x)),
    sqrt=smooth(np.sqrt, lambda _, root: 0.5 / root),
    abs=smooth(np.abs, lambda x, _: np.where(x < 0.0, -1.0, 1.0)),
    min=smaller,
    max=larger,
    less=lambda a, b: value_of(a) < value_of(b),
    select=select,
)
Dual.FUNCTIONS = FUNCTIONS
