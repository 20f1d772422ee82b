"""Functions that check the arguments of the torque terms."""

import numpy as np

from pyharness.model.errors import InputError, kind_of
from pyharness.model.inertia import checked_inertia
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.trajectory import Array
from pyharness.model.values import converted, finite, number_list, three


def matrix_of(where: str, value: object) -> Array:
    """Return a matrix, shape (3, 3), from a number, three diagonal elements, or three rows.

    Raise InputError, with `where` in front of the message, for anything else, and for a number that
    is not finite.
    """
    if isinstance(converted(value), float):
        return np.diag([finite(where, value)] * 3)
    allowed = "allowed: a number, three numbers for the axes, or three rows of three numbers"
    # One element more than allowed is read, so that an endless generator is refused.
    given = [each for each, _ in zip(number_list(where, value, allowed), range(4), strict=False)]
    if len(given) != 3:
        count = "more than 3" if len(given) > 3 else str(len(given))
        raise InputError(f"{where}: {count} numbers or rows; {allowed}")
    if all(isinstance(converted(each), float) for each in given):
        return np.diag(three(where, given))
    return np.array([three(where, row) for row in given])


def inertia_of(where: str, value: object) -> Array:
    """Return an inertia matrix (kg m2), shape (3, 3), from three moments or three rows.

    Raise InputError, with `where` in front of the message, unless the moments are above 0, or the
    matrix is symmetric and positive definite.
    """
    if isinstance(converted(value), float):
        raise InputError(f"{where}: {kind_of(value)}; allowed: three moments, or three rows, kg m2")
    matrix = matrix_of(where, value)
    if np.array_equal(matrix, np.diag(np.diag(matrix))):
        if not (np.diag(matrix) > 0.0).all():
            raise InputError(f"{where}: a moment is not above 0; allowed: numbers above 0, kg m2")
        return matrix
    return np.array(checked_inertia(where, matrix))


def law_of_vector(where: str, value: object, frame: str) -> TorqueLaw:
    """Return a vector that depends on time, from three numbers or a TorqueLaw about given axes.

    Raise InputError, with `where` in front of the message, for anything else, and for a TorqueLaw
    with another frame.
    """
    allowed = f'allowed: three numbers, or a TorqueLaw with frame="{frame}"'
    if isinstance(value, TorqueLaw):
        if value.frame != frame:
            raise InputError(f"{where}: a TorqueLaw with frame {value.frame}; {allowed}")
        return value
    # The list is made here, so that the message says that a law is allowed too.
    number_list(where, value, allowed)
    return TorqueLaw(three(where, value), frame=frame)
