"""Checked arguments of torque terms, also from scene files; error messages begin with `where`."""

from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.model.errors import InputError, kind_of
from pyharness.model.inertia import checked_inertia
from pyharness.model.state_torque import Function, StateTorque, replayed
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array
from pyharness.model.values import converted, finite, number_list, three


def ready_term(kind: str, function: Function, **arguments: Any) -> StateTorque:
    """Return the torque that `function` computes, with its kind and checked arguments."""
    pairs = ((key, _file_value(value)) for key, value in arguments.items())
    return replace(replayed(function), terms=((("kind", kind), *pairs),))


def _file_value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        if value.shape == (3, 3) and is_diagonal(value):
            value = np.diag(value)
            if (value == value[0]).all():
                return float(value[0])
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return tuple(map(_file_value, value))
    if isinstance(value, TorqueLaw) and value == TorqueLaw(value.constant, frame=value.frame):
        return value.constant
    return value


def is_diagonal(matrix: Array) -> bool:
    return np.array_equal(matrix, np.diag(np.diag(matrix)))


def matrix_of(where: str, value: object) -> Array:
    if isinstance(converted(value), float):
        return np.diag([finite(where, value)] * 3)
    allowed = "allowed: a number, three numbers for the axes, or three rows of three numbers"
    # At most four elements are read, because a generator may be endless.
    given = [each for each, _ in zip(number_list(where, value, allowed), range(4), strict=False)]
    if len(given) != 3:
        count = "more than 3" if len(given) > 3 else str(len(given))
        raise InputError(f"{where}: {count} numbers or rows; {allowed}")
    if all(isinstance(converted(each), float) for each in given):
        return np.diag(three(where, given))
    return np.array([three(where, row) for row in given])


def inertia_of(where: str, value: object) -> Array:
    if isinstance(converted(value), float):
        raise InputError(f"{where}: {kind_of(value)}; allowed: three moments, or three rows, kg m2")
    matrix = matrix_of(where, value)
    if is_diagonal(matrix):
        if not (np.diag(matrix) > 0.0).all():
            raise InputError(f"{where}: a moment is not above 0; allowed: numbers above 0, kg m2")
        return matrix
    return np.array(checked_inertia(where, matrix))


def law_of_vector(where: str, value: object, frame: str) -> TorqueLaw:
    allowed = f'allowed: three numbers, or a TorqueLaw with frame="{frame}"'
    if isinstance(value, TorqueLaw):
        if value.frame != frame:
            raise InputError(f"{where}: a TorqueLaw with frame {value.frame}; {allowed}")
        return value
    # Unlike `three`, `number_list` has a message that a law is allowed.
    number_list(where, value, allowed)
    return TorqueLaw(three(where, value), frame=frame)
