"""Calls of a user's function with symbols, and replacements of functions that refuse symbols.

NumPy's protocols reach neither functions of `math` nor NumPy's functions of lists, such as `array`,
nor arrays of floats, such as those of numpy.zeros. Where a call with symbols fails, it is repeated
with these functions replaced. Calls from other threads or without symbols reach the originals.
"""

import math
import re
import sys
import threading
from collections.abc import Callable, Collection, Container, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from functools import partial, update_wrapper
from pathlib import Path
from traceback import walk_tb
from types import FrameType, FunctionType, ModuleType
from typing import Any

import numpy as np

from pyharness.model.errors import InputError, printable
from pyharness.model.numpy_calls import OF_MATH
from pyharness.model.numpy_protocol import has_symbol, of_function, of_ufunc, symbol_array, viewed
from pyharness.model.symbols import Recorder, Symbol

_lock = threading.Lock()
_installed = 0
_here = threading.local()
_replaced: list[tuple["_Place", Any, Any]] = []  # with the values before and during a recording


# Folders of code that is called with symbols as it is.
_NOT_REPLACED = str(Path(np.__file__).parent), str(Path(__file__).parents[1])


def _is_user_code(frame: FrameType) -> bool:
    return not frame.f_code.co_filename.startswith(_NOT_REPLACED)


class _Replaced:
    def __init__(self, original: Any, called: Callable[..., Any]) -> None:
        self.original: Any = original
        self._called = called
        # Modules that are imported meanwhile read the function's name and signature.
        update_wrapper(self, original)

    def __call__(self, *given: Any, **named: Any) -> Any:
        if not getattr(_here, "is_recording", False) or not _is_user_code(sys._getframe(1)):
            return self.original(*given, **named)
        return self._called(given, named)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.original, name)
        # Methods of a ufunc, such as np.maximum.reduce.
        is_method = isinstance(self.original, np.ufunc) and callable(found)
        return partial(_called_ufunc, self.original, name) if is_method else found


def _called_ufunc(ufunc: np.ufunc, method: str, *given: Any, **named: Any) -> Any:
    if any(map(has_symbol, given)):
        return of_ufunc(ufunc, method, given, named)
    return getattr(ufunc, method)(*given, **named)


def _replacement(original: Any) -> _Replaced:
    """Return a replacement of NumPy's function that accepts lists with symbols."""

    def called(given: Sequence[Any], named: dict[str, Any]) -> Any:
        if isinstance(original, np.ufunc):
            return _called_ufunc(original, "__call__", *given, **named)
        is_own = isinstance(original, _DISPATCHED)
        if is_own and any(map(has_symbol, (*given, *named.values()))):
            return of_function(original, given, named)
        return viewed(original(*given, **named))

    return _Replaced(original, called)


def _of_math(original: Any, ufunc: np.ufunc) -> _Replaced:
    def called(given: Sequence[Any], named: dict[str, Any]) -> Any:
        if any(map(has_symbol, given)):
            return of_ufunc(ufunc, "__call__", given, named)
        return original(*given, **named)

    return _Replaced(original, called)


def _target(original: Any, function: Any) -> _Replaced:
    """Return a replacement of numpy.zeros, for example, whose array accepts symbols."""

    def called(given: Sequence[Any], named: dict[str, Any]) -> Any:
        found = (function if _here.with_targets else original)(*given, **named)
        return symbol_array(found) if _here.with_targets and found.dtype == float else found

    return _Replaced(original, called)


_DISPATCHED = type(np.where)
_CREATORS = {"array", "asarray", "asanyarray", "ascontiguousarray"}
_TARGETS = {name: getattr(np, name) for name in ("zeros", "ones", "full", "eye", "identity")} | {
    "empty": np.zeros
}
_BY_ORIGINAL: dict[int, _Replaced] = {
    id(each): _replacement(each)
    for module in (np, np.linalg)
    for name, each in vars(module).items()
    if name in _CREATORS or isinstance(each, (np.ufunc, _DISPATCHED))
}
_BY_ORIGINAL |= {
    id(getattr(np, name)): _target(getattr(np, name), x) for name, x in _TARGETS.items()
}
_BY_ORIGINAL |= {
    id(original := getattr(math, name)): _of_math(original, each) for name, each in OF_MATH.items()
}


_NO_OBJECTS = (FunctionType, ModuleType, type)


class _Place:
    """A name of a dictionary, or an attribute, that refers to a function."""

    def __init__(self, holder: Any, name: str) -> None:
        self._holder, self._name = holder, name

    @property
    def key(self) -> tuple[int, str]:
        return id(self._holder), self._name

    @property
    def value(self) -> Any:
        if isinstance(self._holder, dict):
            return self._holder.get(self._name)
        return getattr(self._holder, self._name, None)

    def put(self, value: Any) -> None:
        if isinstance(self._holder, dict):
            self._holder[self._name] = value
        else:
            setattr(self._holder, self._name, value)


_MODULES = [
    _Place(vars(module), name)
    for module in (np, np.linalg, math)
    for name, each in vars(module).items()
    if id(each) in _BY_ORIGINAL
]


def _translated(value: Any) -> Any:
    """Return what replaces a function, or a tuple or partial function with one; else the value."""
    if isinstance(value, tuple):
        found = tuple(map(_translated, value))
        return found if any(x is not y for x, y in zip(found, value, strict=True)) else value
    if type(value) is partial and (function := _translated(value.func)) is not value.func:
        return partial(function, *value.args, **value.keywords)
    return _BY_ORIGINAL.get(id(value), value)


def _is_replaceable(value: Any) -> bool:
    if type(value) is partial:
        value = value.func
    # Another thread may have replaced it.
    if isinstance(value, _Replaced) or _translated(value) is not value:
        return True
    return isinstance(value, tuple) and any(isinstance(each, _Replaced) for each in value)


@contextmanager
def _replaced_functions(with_targets: bool, places: Collection[_Place]) -> Iterator[None]:
    """Replace functions in this thread, where modules and other `places` refer to them.

    If `with_targets`, numpy.zeros and others return arrays for symbols.
    """
    global _installed
    before = vars(_here).copy()
    with _lock:
        _installed += 1
        for place in (*_MODULES, *places):
            value = place.value
            if (new := _translated(value)) is not value:
                _replaced.append((place, value, new))
                place.put(new)
    _here.is_recording, _here.with_targets = True, with_targets
    try:
        yield
    finally:
        vars(_here).clear()
        vars(_here).update(before)
        with _lock:
            _installed -= 1
            while _replaced and not _installed:
                place, value, new = _replaced.pop()
                if place.value is new:
                    place.put(value)


def _places(frames: Sequence[FrameType]) -> Iterator[_Place]:
    """Yield the names of modules, and attributes of objects such as `self`, in a traceback."""
    objects = [x for frame in frames for x in frame.f_locals.values() if type(x) not in _NO_OBJECTS]
    for holder in (
        *(each.f_globals for each in frames),
        *(getattr(x, "__dict__", {}) for x in objects),
    ):
        if isinstance(holder, dict):
            yield from (_Place(holder, name) for name in holder)


def _places_in_functions(frames: Sequence[FrameType]) -> Iterator[_Place]:
    """Yield the variables of closures, and default arguments, of the functions in a traceback."""
    codes, seen = {frame.f_code for frame in frames}, set()
    rest = [x for frame in frames for x in frame.f_locals.values()]
    while rest:
        each = rest.pop()
        if type(each) is partial:
            rest += [each.func, *each.args, *each.keywords.values()]
        if not isinstance(each, FunctionType):
            each = getattr(each, "__func__", getattr(type(each), "__call__", None))  # noqa: B004
        if not isinstance(each, FunctionType) or each.__code__ not in codes or each in seen:
            continue
        seen.add(each)
        places = [_Place(cell, "cell_contents") for cell in each.__closure__ or ()]
        places += [_Place(each.__kwdefaults__, name) for name in each.__kwdefaults__ or ()]
        rest += [*(x.value for x in places), *(each.__defaults__ or ())]
        rest += [each.__globals__.get(name) for name in each.__code__.co_names]
        yield from (*places, _Place(each, "__defaults__"))


def _new_places(error: BaseException, known: Container[tuple[int, str]]) -> list[_Place]:
    """Return places that refer to replaceable functions, for the functions in a traceback."""
    frames = [frame for frame, _ in walk_tb(error.__traceback__)]
    found = (*_places([*filter(_is_user_code, frames)]), *_places_in_functions(frames))
    return [each for each in found if each.key not in known and _is_replaceable(each.value)]


def called_once(
    function: Callable[..., Any], given: Sequence[Any], recorder: Recorder, allowed: str
) -> list[Any]:
    """Return the components that a user's function returns for symbols.

    Raise InputError if the call fails, or returns one number or nothing.
    """
    count = recorder.count
    places: dict[tuple[int, str], _Place] = {}
    # At first nothing is replaced; at last numpy.zeros too, if a symbol had to become a float.
    with_targets = None
    while True:
        recorder.restart(count)
        try:
            replaced = _replaced_functions(bool(with_targets), places.values())
            with nullcontext() if with_targets is None else replaced:
                found = function(*given)
                if found is None or isinstance(found, (Symbol, float, int)):
                    what = "nothing" if found is None else "one number"
                    raise InputError(
                        f"{recorder.place}: the function returned {what}; allowed: {allowed}"
                    )
                return list(found)
        except Exception as error:
            if with_targets is None:
                with_targets = False
            elif more := _new_places(error, places):
                places |= {each.key: each for each in more}
            elif recorder.was_converted and not with_targets:
                with_targets = True
            else:
                raise _translated_error(error, recorder, allowed) from error


def _translated_error(error: Exception, recorder: Recorder, allowed: str) -> InputError:
    if isinstance(error, InputError):
        return error
    missing = re.search(r"no callable (\w+) method", str(error))
    if missing:
        return recorder.refusal(f"{missing[1]} of the state")
    reason = f"{type(error).__name__}: {printable(str(error))}"
    if _OF_NUMBERS.search(str(error)):
        return recorder.refusal_of_numbers(reason)
    return InputError(f"{recorder.place}: the function raised {reason}; allowed: {allowed}")


# Messages of functions that accept numbers only.
_OF_NUMBERS = re.compile(r"[Oo]bject\b|dtype\('O'\)|input types|Symbol")
