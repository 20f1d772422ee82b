"""NumPy's functions of symbols that its loops over objects do not compute."""

import math
import operator
from collections.abc import Callable
from operator import methodcaller
from typing import Any

import numpy as np

from pyharness.model.numpy_protocol import (
    ELEMENTS,
    FUNCTIONS,
    has_symbol,
    is_symbol,
    of_ufunc,
    symbol_in,
    viewed,
)
from pyharness.model.symbols import METHODS, Symbol, negated, select
from pyharness.model.tape import Table

_MOST_PIECES = 200  # most points of an interpolation in the state


def _by_element(function: Callable[..., Any], count: int) -> Callable[..., Any]:
    loop = np.frompyfunc(function, count, 1)

    def called(*given: Any) -> Any:
        return viewed(loop(*(np.array(x, dtype=object) for x in given)))

    return called


def _largest(x: Any, y: Any) -> Any:
    return select(x > y, x, y)


def _smallest(x: Any, y: Any) -> Any:
    return select(x < y, x, y)


def _limited(x: Any, low: Any, high: Any) -> Any:
    found = x if low is None else _largest(x, low)
    return found if high is None else _smallest(found, high)


def _selected(condlist: Any, choicelist: Any, default: Any = 0) -> Any:
    found = default
    for condition, choice in zip(reversed(condlist), reversed(choicelist), strict=True):
        found = _where(condition, choice, found)
    return found


def _with_sign(x: Any, y: Any) -> Any:
    return select(y < 0.0, -abs(x), abs(x)) if isinstance(y, Symbol) else abs(x) * np.copysign(1, y)


def _remainder(x: Any, y: Any) -> Any:
    return x - y * (x / y).trunc()


def _arctan2(y: Any, x: Any) -> Any:
    return (y if isinstance(y, Symbol) else 0.0 * x + y).arctan2(x)


def _interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None) -> Any:
    places, values = np.asarray(xp, dtype=float), np.asarray(fp, dtype=float)
    np.interp(0.0, places, values)  # raises NumPy's errors
    widths = np.diff(places)
    if not (np.isfinite(places).all() and (widths >= 0.0).all()):
        what = "interp of points that are not finite, or not in ascending order,"
        raise symbol_in([x, left, right]).recorder.refusal(what)
    slopes = np.divide(np.diff(values), widths, out=np.zeros(len(widths)), where=widths > 0.0)

    def piecewise(at: Any) -> Any:
        if not isinstance(at, Symbol):
            return np.interp(at, places, values, left, right)
        if at.is_time() and left is right is None:
            pieces = np.zeros((len(places) + 1, 4))
            pieces[:, 0] = values[0], *values
            pieces[1:-1, 1] = slopes
            return at.of_table(Table([places[0] - 1.0, *places], pieces))
        if len(places) > _MOST_PIECES:
            raise at.recorder.refusal(
                f"interp of {len(places)} points",
                f"at most {_MOST_PIECES} points, torques.table for a function of time",
            )
        # A sum over all pieces would have the rounding errors of the largest piece.
        found, before, place_before = values[0], 0.0, None
        for place, value, slope in zip(places, values, [*slopes, 0.0], strict=True):
            # At a jump NumPy takes the later value.
            is_later = at >= place if place == place_before else at > place
            if slope != before or place == place_before:
                found = select(is_later, value + slope * (at - place), found)
            before, place_before = slope, place
        if left is not None:
            found = select(at < places[0], float(left), found)
        if right is not None:
            found = select(at > places[-1], float(right), found)
        return found

    return _by_element(piecewise, 1)(x)


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    array = np.asarray(x, dtype=object)
    if ord not in (None, 2) or (ord == 2 and array.ndim > 1 and axis is None):
        raise symbol_in(array).recorder.refusal(f"the norm of order {ord}", "the Euclidean norm")
    return np.sum(array * array, axis=axis, keepdims=keepdims) ** 0.5


def _solve(a: Any, b: Any) -> Any:
    return _inverse(a) @ np.asarray(b, dtype=object)


def _inverse(a: Any) -> Any:
    array = np.asarray(a)
    if not has_symbol(array):
        return np.linalg.inv(array.astype(float))
    _check_small(array, "inverse")
    cofactors = np.empty(array.shape, dtype=object)
    for i, j in np.ndindex(array.shape):
        minor = np.delete(np.delete(array, i, 0), j, 1)
        cofactors[i, j] = (-1.0) ** (i + j) * _determinant(minor)
    return cofactors.T / (array[0] @ cofactors[0])


def _determinant_of(a: Any) -> Any:
    array = np.asarray(a)
    _check_small(array, "determinant")
    return _determinant(array)


def _check_small(array: Any, what: str) -> None:
    if array.shape not in ((1, 1), (2, 2), (3, 3)):
        raise symbol_in(array).recorder.refusal(
            f"the {what} of a matrix of shape {array.shape}", "matrices of at most three rows"
        )


def _determinant(matrix: Any) -> Any:
    if len(matrix) == 0:
        return 1.0
    if len(matrix) == 1:
        return matrix[0, 0]
    if len(matrix) == 3:
        return matrix[0] @ np.cross(matrix[1], matrix[2])
    return matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]


_where = _by_element(select, 3)
ELEMENTS.update({name: methodcaller(name) for name in METHODS})
ELEMENTS.update(
    {
        "less": operator.lt, "less_equal": operator.le, "greater": operator.gt,
        "greater_equal": operator.ge, "equal": operator.eq, "not_equal": operator.ne,
        "invert": operator.invert, "logical_not": negated, "logical_and": operator.and_,
        "logical_or": operator.or_, "logical_xor": operator.xor, "maximum": _largest,
        "fmax": _largest, "minimum": _smallest, "fmin": _smallest, "clip": _limited,
        "heaviside": lambda x, at_zero: select(x > 0.0, 1.0, 0.0), "fabs": abs,
        "copysign": _with_sign, "fmod": _remainder, "arctan2": _arctan2,
        "hypot": lambda x, y: (x * x + y * y) ** 0.5, "float_power": operator.pow,
        "deg2rad": methodcaller("radians"), "rad2deg": methodcaller("degrees"),
    }
)  # fmt: skip
FUNCTIONS.update(
    {
        np.where: _where, np.select: _selected, np.interp: _interp, np.linalg.norm: _norm,
        np.linalg.solve: _solve, np.linalg.inv: _inverse, np.linalg.det: _determinant_of,
    }
)  # fmt: skip
# The functions of `math`, by NumPy's.
OF_MATH: dict[str, np.ufunc] = {
    name: getattr(np, name)
    for name in (
        "sqrt", "exp", "sin", "cos", "tan", "sinh", "cosh", "tanh", "log", "log1p", "log2", "log10",
        "exp2", "expm1", "cbrt", "floor", "ceil", "trunc", "radians", "degrees", "copysign", "fabs",
        "fmod", "hypot",
    )
} | {
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "asinh": np.arcsinh,
    "acosh": np.arccosh, "atanh": np.arctanh, "atan2": np.arctan2, "pow": np.power,
}  # fmt: skip


def _of_math(name: str) -> Callable[..., Any]:
    def called(*given: Any) -> Any:
        if any(map(is_symbol, given)):
            return of_ufunc(OF_MATH[name], "__call__", given, {})
        return getattr(math, name)(*given)

    return called


# The functions of scene files, for numbers and symbols.
ELEMENTARY: dict[str, Callable[..., Any]] = {
    name: _of_math(name)
    for name in (
        "sqrt", "cbrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sinh", "cosh",
        "tanh", "floor", "atan2",
    )
} | {
    "abs": abs, "sign": lambda x: (x > 0.0) * 2.0 - 1.0,
    "heaviside": lambda x: select(x > 0.0, 1.0, 0.0), "min": _smallest, "max": _largest,
    "clip": _limited, "where": select,
}  # fmt: skip
