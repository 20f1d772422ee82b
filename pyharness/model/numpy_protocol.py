"""NumPy's protocols by which its functions, under whatever name, accept symbols.

NumPy calls `__array_ufunc__` or `__array_function__` of an argument that has them. Functions that
NumPy's loops over objects do not compute, such as choices, are in `ELEMENTS` and `FUNCTIONS`.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np

# By the name of a ufunc: the same function of symbols and numbers.
ELEMENTS: dict[str, Callable[..., Any]] = {}
# By the function of NumPy.
FUNCTIONS: dict[Any, Callable[..., Any]] = {}
# Types of results with the rounding of symbols, unlike numpy.float32.
_DTYPES = {np.dtype(each) for each in (float, bool, object)}


class Recorded:
    """A base class of symbols, which have a `recorder`, and of arrays of symbols."""

    __slots__ = ()

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any, **named: Any) -> Any:
        return of_ufunc(ufunc, method, given, named)

    def __array_function__(
        self, function: Any, types: Any, given: Sequence[Any], named: dict[str, Any]
    ) -> Any:
        return of_function(function, given, named)


class SymbolArray(Recorded, np.ndarray[Any, Any]):  # type: ignore[misc]
    """An array of symbols and numbers."""


def symbol_array(values: Any) -> Any:
    return np.array(values, dtype=object).view(SymbolArray)


def is_symbol(value: object) -> bool:
    return isinstance(value, Recorded) and not isinstance(value, np.ndarray)


def has_symbol(value: Any) -> bool:
    if isinstance(value, (list, tuple)):
        return any(map(has_symbol, value))
    if isinstance(value, np.ndarray):
        return value.dtype == object and any(map(is_symbol, value.flat))
    return is_symbol(value)


def symbol_in(values: Any) -> Any:
    """Return the first symbol in nested sequences and arrays."""
    if is_symbol(values):
        return values
    if isinstance(values, np.ndarray):
        values = values.ravel().tolist()
    return next(symbol_in(each) for each in values if has_symbol(each))


def viewed(found: Any) -> Any:
    """Return an array of objects as a `SymbolArray`, or as a symbol if it has no dimension."""
    if not isinstance(found, np.ndarray) or found.dtype != object:
        return found
    is_array = found.shape or not is_symbol(found.item())
    return found.view(SymbolArray) if is_array else found.item()


def of_ufunc(ufunc: np.ufunc, method: str, given: Sequence[Any], named: dict[str, Any]) -> Any:
    """Return the result of a ufunc's method for arguments of which one has symbols."""
    function, name = ELEMENTS.get(ufunc.__name__), ufunc.__name__
    results = () if (out := named.get("out")) is None else out if type(out) is tuple else (out,)
    every = (*given, *results)
    dtype = named.get("dtype")
    if dtype is not None and np.dtype(dtype) not in _DTYPES:
        raise symbol_in(every).recorder.refusal(f"the argument dtype={np.dtype(dtype)}")
    # As in math.log(2.0, base).
    if method == "__call__" and any(not isinstance(x, np.ndarray) for x in given[ufunc.nin :]):
        raise symbol_in(every).recorder.refusal(f"{name} with these arguments")
    if function is None and not any("O" in types for types in ufunc.types):
        raise symbol_in(every).recorder.refusal(f"{name} of the state")
    if results and (function or any(each.dtype != object for each in results)):
        # As in f += omega, where f may have been made by numpy.zeros.
        recorder = symbol_in(every).recorder
        recorder.was_converted = True
        raise recorder.refusal("the argument out", "an assignment")
    loop = _loop(ufunc, function) if function else ufunc
    if results:
        named = {**named, "out": tuple(map(_plain, results))}
    try:
        found = getattr(loop, method)(*map(_plain, given), **named)
    except TypeError as error:
        if not has_symbol(every):
            raise
        raise symbol_in(every).recorder.refusal(f"{name} with these arguments") from error
    return results[0] if results else viewed(found)


@cache
def _loop(ufunc: np.ufunc, function: Callable[..., Any]) -> Any:
    def called(*values: Any) -> Any:
        return (function if any(map(is_symbol, values)) else ufunc)(*values)

    return np.frompyfunc(called, ufunc.nin, ufunc.nout)


def _plain(value: Any) -> Any:
    """Return an array of objects that is no `SymbolArray`, unless there is no symbol.

    Arrays share their elements with the result, which may be written.
    """
    if isinstance(value, SymbolArray) or type(value) is np.ndarray:
        return value.view(np.ndarray)
    return np.array(value, dtype=object) if has_symbol(value) else value


def of_function(function: Any, given: Iterable[Any], named: dict[str, Any]) -> Any:
    """Return the result of another function of NumPy for arguments of which one has symbols."""
    own = FUNCTIONS.get(function)
    if own is None:
        arrays = {key: _array(value) for key, value in named.items()}
        return viewed(function._implementation(*map(_array, given), **arrays))
    try:
        return viewed(own(*given, **named))
    except TypeError as error:
        recorder = symbol_in([*given, *named.values()]).recorder
        raise recorder.refusal(f"{function.__name__} with these arguments") from error


def _array(value: Any) -> Any:
    """Return a symbol, or a list of symbols and numbers, as an array."""
    is_list = isinstance(value, (list, tuple)) and not any(map(_has_array, value))
    return symbol_array(value) if (is_list or is_symbol(value)) and has_symbol(value) else value


def _has_array(value: Any) -> bool:
    is_list = isinstance(value, (list, tuple))
    return any(map(_has_array, value)) if is_list else isinstance(value, np.ndarray)
