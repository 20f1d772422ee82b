"""Faults of a chosen size: which function is faulty, and how its result changes.

A fault is planted in the running process, and removed when its context ends.
"""

import itertools
import pkgutil
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np

from pyharness.engine.registry import METHODS
from pyharness.model.trajectory import Array

COMPILED = "pyharness.thesis.compiled.run"
PROGRAM = "pyharness.thesis.programs.Program.run"  # in either language

Fault = Callable[[float], AbstractContextManager[Any]]
"""A function from the size of a fault to a context in which the fault is present.

A fault of size 0 changes no result.
"""

Change = Callable[[Any, float], Any]
"""A function from a right result and the size of a fault to the wrong result."""

Faulty = Callable[..., Any]
"""A function that replaces a right function.

Its arguments are the size of the fault, the right function, and the arguments of a call.
"""


def instead(target: str, faulty: Faulty) -> Fault:
    """Return a fault that replaces the function with the dotted name `target` by `faulty`."""

    def planted(size: float) -> AbstractContextManager[Any]:
        right = pkgutil.resolve_name(target)
        # A lambda, unlike a partial function, can replace a method of a class.
        return patch(target, lambda *rest, **named: faulty(size, right, *rest, **named))

    return planted


def in_method(name: str, faulty: Faulty) -> Fault:
    """Return a fault that replaces the function `solve` of the method `name`."""
    known = METHODS[name]
    return lambda size: patch.dict(
        METHODS, {name: replace(known, solve=partial(faulty, size, known.solve))}
    )


def changing(change: Change) -> Faulty:
    """Return a faulty function that applies `change` to the result of the right function."""
    return lambda size, right, *rest, **named: change(right(*rest, **named), size)


def change_result(target: str, change: Change, call: int | None = None) -> Fault:
    """Return a fault that changes the result of `target`, in call number `call` or in all calls."""

    def planted(size: float) -> AbstractContextManager[Any]:
        calls = itertools.count(1)

        def wrong(found: Any, size: float) -> Any:
            return found if call and next(calls) != call else change(found, size)

        return instead(target, changing(wrong))(size)

    return planted


def change_at(path: str, change: Callable[[Any], Any]) -> Callable[[dict[str, Any]], None]:
    """Return a change in place of the value at `path`, as in ``scene.run``, unless it is empty."""
    *outer, last = path.split(".")

    def changed(record: dict[str, Any]) -> None:
        for name in outer:
            record = record.get(name) or {}
        if record.get(last):
            record[last] = change(record[last])

    return changed


def change_attribute(name: str, change: Change) -> Change:
    """Return a change of the attribute `name` of a result; it has no effect on None."""

    def changed(found: Any, size: float) -> Any:
        value = getattr(found, name)
        return found if value is None else replace(found, **{name: change(value, size)})

    return changed


def plus(found: Any, size: float) -> Any:
    """Return a number plus `size`, or plus its integer part if the number is an integer."""
    return found + (int(size) if isinstance(found, int) else size)


def off(found: Any, size: float) -> Any:
    """Return omega, or a result with it, each component enlarged by `size` times the largest."""
    if not isinstance(found, np.ndarray):
        return replace(found, omega=off(found.omega, size))
    return found + size * np.abs(found).max(initial=0.0) * np.sign(found)


def bit_off(found: Any, size: float) -> Any:
    """Return an array, or a result with omega, with the largest element times 1 + `size`."""
    if not isinstance(found, np.ndarray):
        return replace(found, omega=bit_off(found.omega, size))
    wrong = found.copy()
    wrong[np.unravel_index(np.abs(found).argmax(), found.shape)] *= 1.0 + size
    return wrong


def third_off(found: Array, size: float) -> Array:
    """Return vectors whose third component is multiplied by 1 - `size`."""
    wrong: Array = found * [1.0, 1.0, 1.0 - size]
    return wrong


def swapped(found: Array, size: float) -> Array:
    """Return vectors with the first two components exchanged, if the size is not 0."""
    return found[:, [1, 0, 2]] if size else found
