"""Replacements of NumPy's functions while a user's function is recorded with symbols.

NumPy's own functions do not support choices (such as where), comparisons of arrays, linear algebra
or assignment to elements of numpy.zeros for symbols. Calls from other threads or without symbols
reach the originals.
"""

import math
import operator
import re
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial, update_wrapper
from typing import Any

import numpy as np

from pyharness.model.errors import InputError, printable
from pyharness.model.symbols import Recorder, Symbol, negated, select
from pyharness.model.tape import Table

_MOST_PIECES = 200  # most points of an interpolation in the state

_lock = threading.Lock()
_installed = 0
_here = threading.local()
_originals: list[tuple[Any, str, Any]] = []


@contextmanager
def replaced_functions(with_targets: bool) -> Iterator[None]:
    """Replace functions of NumPy and math in this thread.

    If `with_targets`, numpy.zeros, empty and ones are replaced too.
    """
    global _installed
    before = getattr(_here, "targets", None)
    with _lock:
        if _installed == 0:
            _install()
        _installed += 1
    _here.targets = with_targets
    try:
        yield
    finally:
        _here.targets = before
        with _lock:
            _installed -= 1
            while _originals and not _installed:
                setattr(*_originals.pop())


def _install() -> None:
    for module, functions in _REPLACEMENTS:
        for name, replaced in functions.items():
            original = getattr(module, name)
            _originals.append((module, name, original))
            setattr(module, name, replaced(original))


class _Replaced:
    def __init__(self, original: Callable[..., Any], function: Callable[..., Any]) -> None:
        self._original, self._function = original, function
        # Modules that are imported meanwhile read the function's name and signature.
        update_wrapper(self, original)

    def __call__(self, *given: Any, **named: Any) -> Any:
        every = (*given, *named.values())
        if getattr(_here, "targets", None) is None or not any(map(_has_symbol, every)):
            return self._original(*given, **named)
        _refuse_out(every, named)
        try:
            return self._function(*given, **named)
        except TypeError as error:
            what = f"{getattr(self._original, '__name__', 'a function')} with these arguments"
            raise _symbol_in(every).recorder.refusal(what) from error

    def __getattr__(self, name: str) -> Any:
        return getattr(self._original, name)


class _Target(_Replaced):
    """A replacement of numpy.zeros, empty or ones, whose array accepts symbols."""

    def __init__(self, original: Callable[..., Any], value: float) -> None:
        super().__init__(original, lambda shape, *_, **__: symbol_array(np.full(shape, value)))

    def __call__(self, *given: Any, **named: Any) -> Any:
        is_target = getattr(_here, "targets", None) and _is_float(given, named)
        return (self._function if is_target else self._original)(*given, **named)


def _is_float(given: Sequence[Any], named: Mapping[str, Any]) -> bool:
    kind = given[1] if len(given) > 1 else named.get("dtype", float)
    return kind is float or kind is object or kind is np.float64


def _refuse_out(given: Any, named: Mapping[str, Any]) -> None:
    if named.get("out") is not None:
        raise _symbol_in(given).recorder.refusal("the argument out", "an assignment")


def _has_symbol(value: Any) -> bool:
    if isinstance(value, (list, tuple)):
        return any(map(_has_symbol, value))
    if isinstance(value, np.ndarray):
        return value.dtype == object and any(isinstance(x, Symbol) for x in value.flat)
    return isinstance(value, Symbol)


def _comparison(compare: Callable[[Any, Any], Any]) -> Any:
    def compared(x: Any, y: Any) -> Any:
        found = compare(x, y)
        # ~True is -2 in Python, not False.
        return np.bool_(found) if isinstance(found, bool) else found

    return lambda array, other: np.frompyfunc(compared, 2, 1)(array, other)


class SymbolArray(np.ndarray[Any, Any]):
    """An array of symbols, whose comparisons are arrays of conditions."""

    __lt__, __le__ = _comparison(operator.lt), _comparison(operator.le)
    __gt__, __ge__ = _comparison(operator.gt), _comparison(operator.ge)

    def __array_wrap__(self, array: Any, *_: Any) -> Any:
        return array.view(SymbolArray) if array.shape else array.item()

    def clip(self, *given: Any, **named: Any) -> Any:
        _refuse_out(self, named)
        return _clip(self, *given, **named)


def symbol_array(values: Any) -> Any:
    return np.array(values, dtype=object).view(SymbolArray)


def _wrapped(original: Callable[..., Any]) -> _Replaced:
    return _Replaced(original, lambda *given, **named: _viewed(original(*given, **named)))


def _viewed(found: Any) -> Any:
    is_array = isinstance(found, np.ndarray) and found.dtype == object
    return found.view(SymbolArray) if is_array else found


def _by_element(function: Callable[..., Any], count: int) -> Callable[..., Any]:
    loop = np.frompyfunc(function, count, 1)

    def called(*given: Any) -> Any:
        found = loop(
            *(np.asarray(x, dtype=object) if isinstance(x, (list, tuple)) else x for x in given)
        )
        return _viewed(found)

    return called


def _of_symbol(name: str, function: Callable[[float], float]) -> Callable[[Any], Any]:
    def called(x: Any) -> Any:
        return getattr(x, name)() if isinstance(x, Symbol) else function(x)

    return _by_element(called, 1)


def _largest(x: Any, y: Any) -> Any:
    return select(x > y, x, y)


def _smallest(x: Any, y: Any) -> Any:
    return select(x < y, x, y)


def _limited(x: Any, low: Any, high: Any) -> Any:
    found = x if low is None else _largest(x, low)
    return found if high is None else _smallest(found, high)


def _clip(x: Any, a_min: Any = None, a_max: Any = None, **named: Any) -> Any:
    low, high = named.get("min", a_min), named.get("max", a_max)
    return _by_element(_limited, 3)(x, low, high)


def _selected(condlist: Any, choicelist: Any, default: Any = 0) -> Any:
    found = default
    for condition, choice in zip(reversed(condlist), reversed(choicelist), strict=True):
        found = _CHOICES["where"](condition, choice, found)
    return found


def _with_sign(x: Any, y: Any) -> Any:
    return select(y < 0.0, -abs(x), abs(x)) if isinstance(y, Symbol) else abs(x) * np.copysign(1, y)


def _remainder(x: Any, y: Any) -> Any:
    is_number = not (isinstance(x, Symbol) or isinstance(y, Symbol))
    return math.fmod(x, y) if is_number else x - y * (x / y).trunc()


def _arctan2(y: Any, x: Any) -> Any:
    if not isinstance(y, Symbol) and not isinstance(x, Symbol):
        return math.atan2(y, x)
    return (y if isinstance(y, Symbol) else 0.0 * x + y).arctan2(x)


def _interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None) -> Any:
    places, values = np.asarray(xp, dtype=float), np.asarray(fp, dtype=float)
    np.interp(0.0, places, values)  # raises NumPy's errors
    widths = np.diff(places)
    if not (np.isfinite(places).all() and (widths >= 0.0).all()):
        what = "interp of points that are not finite, or not in ascending order,"
        raise _symbol_in([x, left, right]).recorder.refusal(what)
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


def _extreme(choose: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    def called(values: Any, axis: Any = None) -> Any:
        array = np.asarray(values, dtype=object)
        return np.frompyfunc(choose, 2, 1).reduce(
            array.ravel() if axis is None else array, axis=axis or 0
        )

    return called


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    array = np.asarray(x, dtype=object)
    if ord not in (None, 2) or (ord == 2 and array.ndim > 1 and axis is None):
        raise _symbol_in(array).recorder.refusal(f"the norm of order {ord}", "the Euclidean norm")
    return np.sum(array * array, axis=axis, keepdims=keepdims) ** 0.5


def _solve(a: Any, b: Any) -> Any:
    return _inverse(a) @ np.asarray(b, dtype=object)


def _inverse(a: Any) -> Any:
    array = np.asarray(a)
    if not _has_symbol(array):
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
        raise _symbol_in(array).recorder.refusal(
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


def _symbol_in(values: Any) -> Symbol:
    if isinstance(values, Symbol):
        return values
    if isinstance(values, np.ndarray):
        values = values.ravel().tolist()
    return next(_symbol_in(each) for each in values if _has_symbol(each))


def called_once(
    function: Callable[..., Any], given: Sequence[Any], recorder: Recorder, allowed: str
) -> list[Any]:
    """Return the components that a user's function returns for symbols.

    Raise InputError if the call fails, or returns one number or nothing.
    """
    # Called again with numpy.zeros replaced, if a symbol had to become a float.
    for with_targets in (False, True):
        try:
            with replaced_functions(with_targets):
                found = function(*given)
                if found is None or isinstance(found, (Symbol, float, int)):
                    what = "nothing" if found is None else "one number"
                    raise InputError(
                        f"{recorder.place}: the function returned {what}; allowed: {allowed}"
                    )
                return list(found)
        except InputError:
            if with_targets or not recorder.was_converted:
                raise
        except Exception as error:
            missing = re.search(r"no callable (\w+) method", str(error))
            if missing:
                raise recorder.refusal(f"{missing[1]} of the state") from None
            if _OF_NUMBERS.search(str(error)):
                reason = f"{type(error).__name__}: {printable(str(error))}"
                raise recorder.refusal_of_numbers(reason) from error
            raise InputError(
                f"{recorder.place}: the function raised {type(error).__name__}: "
                f"{printable(str(error))}; allowed: {allowed}"
            ) from error
    raise AssertionError


# Messages of functions that accept numbers only.
_OF_NUMBERS = re.compile(r"[Oo]bject\b|dtype\('O'\)|input types|Symbol")
_WRAPPED = (
    "array", "asarray", "cross", "dot", "inner", "outer", "matmul", "einsum", "stack",
    "concatenate", "hstack", "vstack", "column_stack", "roll", "diff", "ravel", "reshape",
)  # fmt: skip
_ELEMENTARY = {
    "sqrt": math.sqrt, "exp": math.exp, "sin": math.sin, "cos": math.cos, "tan": math.tan,
    "sinh": math.sinh, "cosh": math.cosh, "tanh": math.tanh, "log": math.log, "log1p": math.log1p,
    "log2": math.log2, "log10": math.log10, "exp2": lambda x: 2.0**x, "expm1": math.expm1,
    "cbrt": lambda x: math.copysign(abs(x) ** (1.0 / 3.0), x), "floor": math.floor,
    "ceil": math.ceil, "trunc": math.trunc, "radians": math.radians, "degrees": math.degrees,
}  # fmt: skip
_ARCS = {
    "sin": math.asin, "cos": math.acos, "tan": math.atan, "sinh": math.asinh, "cosh": math.acosh,
    "tanh": math.atanh,
}  # fmt: skip
_CHOICES: dict[str, Callable[..., Any]] = {
    "where": _by_element(select, 3), "select": _selected, "clip": _clip,
    "heaviside": _by_element(lambda x, at_zero: select(x > 0.0, 1.0, 0.0), 2),
    "maximum": _by_element(_largest, 2), "minimum": _by_element(_smallest, 2),
    "fmax": _by_element(_largest, 2), "fmin": _by_element(_smallest, 2),
    "max": _extreme(_largest), "min": _extreme(_smallest), "amax": _extreme(_largest),
    "amin": _extreme(_smallest), "interp": _interp, "arctan2": _by_element(_arctan2, 2),
    "hypot": _by_element(lambda x, y: (x * x + y * y) ** 0.5, 2),
    "sign": _of_symbol("sign", np.sign), "fabs": _by_element(abs, 1),
    "copysign": _by_element(_with_sign, 2), "fmod": _by_element(_remainder, 2),
    "logical_and": _by_element(operator.and_, 2), "logical_or": _by_element(operator.or_, 2),
    "logical_not": _by_element(negated, 1),
}  # fmt: skip
_OF_NUMPY = (
    {name: _of_symbol(name, each) for name, each in _ELEMENTARY.items()}
    | {f"arc{name}": _of_symbol(f"arc{name}", each) for name, each in _ARCS.items()}
    | {"rint": _of_symbol("rint", round)}
    | {"deg2rad": _of_symbol("radians", math.radians)}
    | {"rad2deg": _of_symbol("degrees", math.degrees)}
    | _CHOICES
)
_OF_MATH = (
    {name: _of_symbol(name, each) for name, each in _ELEMENTARY.items() if hasattr(math, name)}
    | {f"a{name}": _of_symbol(f"arc{name}", each) for name, each in _ARCS.items()}
    | {name: _CHOICES[name] for name in ("copysign", "fabs", "fmod", "hypot")}
    | {"atan2": _CHOICES["arctan2"], "pow": _by_element(operator.pow, 2)}
)
# The functions of scene files, for numbers and symbols.
ELEMENTARY: dict[str, Callable[..., Any]] = {
    name: _OF_MATH[name]
    for name in (
        "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sinh", "cosh", "tanh",
        "floor", "atan2",
    )
} | {
    "cbrt": _OF_NUMPY["cbrt"], "abs": abs, "sign": lambda x: (x > 0.0) * 2.0 - 1.0,
    "heaviside": lambda x: select(x > 0.0, 1.0, 0.0), "min": _smallest, "max": _largest,
    "clip": _limited, "where": select,
}  # fmt: skip
_OF_LINALG: dict[str, Callable[..., Any]] = {
    "norm": _norm, "solve": _solve, "inv": _inverse, "det": _determinant_of,
}  # fmt: skip
_TARGETS = {"zeros": 0.0, "empty": 0.0, "ones": 1.0}
# By module and name: a function from the original to its replacement.
_REPLACEMENTS: list[tuple[Any, dict[str, Callable[..., Any]]]] = [
    (module, {name: partial(_Replaced, function=each) for name, each in functions.items()})
    for module, functions in ((np, _OF_NUMPY), (np.linalg, _OF_LINALG), (math, _OF_MATH))
]
_REPLACEMENTS += [
    (np, dict.fromkeys(_WRAPPED, _wrapped)),
    (np, {name: partial(_Target, value=each) for name, each in _TARGETS.items()}),
]
