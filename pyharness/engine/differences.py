"""Sensitivities by differences, for scenes whose rates jump, or that have states of their own.

A perturbation moves the time of a switch, which the linearised equations of a smooth torque leave
out. Central differences with decreasing steps are extrapolated (Ridders 1982).
"""

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.engine.parameters import (
    ATTITUDE,
    INERTIA_ELEMENTS,
    OMEGA,
    TORQUE,
    parameters_of,
    torque_with_values,
)
from pyharness.model.array_type import Array
from pyharness.model.attitude import IDENTITY, product
from pyharness.model.errors import InputError
from pyharness.model.scene import ImpossibleBodyWarning, Scene
from pyharness.model.values import triple

_FIRST = 0.02  # first difference, relative to the parameter
_LEVELS, _RATIO = 13, 2.0
_ENOUGH = 1e-11  # estimated error, relative, at which no smaller differences are tried
# Largest estimated error, relative to the largest derivative by a parameter.
_ALLOWED = 1e-7
_SMALL = 1e-10  # or so large a change of the state, relative, by that of the parameter

# A function that returns the states at the times, shape (n, m), of a scene.
States = Callable[[Scene], Array]


def slopes_by_differences(scene: Scene, names: Sequence[str], states: States) -> dict[str, Array]:
    """Return the derivatives of n states by each parameter, (n, m, k) for k values.

    Raise InputError if the states do not depend smoothly on a parameter, as where a switch is only
    touched, or if one is not the number of a torque that can be changed.
    """
    return {
        name: np.stack(
            [_slope(name, moved, size, states) for moved, size in _moves(scene, name)], 2
        )
        for name in names
    }


def _slope(name: str, moved: Callable[[float], Scene], size: float, states: States) -> Array:
    """Return the derivative of the states by one number, (n, m), by Ridders' method."""
    best, least, largest = np.zeros((0, 0)), np.inf, 0.0
    row: list[Array] = []
    for level in range(_LEVELS):
        h = _FIRST * size / _RATIO**level
        try:
            with warnings.catch_warnings(action="ignore", category=ImpossibleBodyWarning):
                after, before = states(moved(h)), states(moved(-h))
        except InputError:  # such as a motion that ends where it slides; a smaller change may not
            row = []
            continue
        largest = max(largest, np.abs(after).max())
        found, factor = [(after - before) / (2.0 * h)], 1.0
        for other in row:
            factor *= _RATIO**2
            found.append(found[-1] + (found[-1] - other) / (factor - 1.0))
            error = max(np.abs(found[-1] - found[-2]).max(), np.abs(found[-1] - other).max())
            if error <= least:
                best, least = found[-1], error
        if least <= _ENOUGH * np.abs(best).max(initial=0.0):
            break
        row = found
    if not least <= _ALLOWED * np.abs(best).max(initial=0.0) + _SMALL * largest / size:
        raise InputError(
            f"sensitivities: the state does not depend smoothly on {name}; allowed: a torque whose "
            "switches are crossed, and not only touched, or times before"
        )
    return best


def _moves(scene: Scene, name: str) -> Iterator[tuple[Callable[[float], Scene], float]]:
    """Yield a function of a change that returns the changed scene, and the size of changes."""
    if name == ATTITUDE:
        for axis in np.eye(3):
            yield lambda h, axis=axis: _turned(scene, h * axis), 1.0  # type: ignore[misc]
        return
    listed = list(scene.omega) if name == OMEGA else parameters_of(scene)[name]
    assert listed is not None
    if name.startswith(TORQUE) and len(listed) != 1:
        raise InputError(
            f"sensitivities: {name} of a scene with switches or states; allowed: keyword "
            "arguments, constants of expressions, the body and the initial state"
        )
    largest = max(map(abs, listed)) or 1.0
    for k, value in enumerate(listed):
        size = largest if name == OMEGA else abs(value) or largest

        def moved(h: float, k: int = k) -> Scene:
            return _changed(scene, name, [x + h * (i == k) for i, x in enumerate(listed)])

        yield moved, size


def _changed(scene: Scene, name: str, values: list[float]) -> Scene:
    if name == OMEGA:
        return replace(scene, omega=triple(values))
    if name.startswith(TORQUE):
        changed = torque_with_values(scene.torque, {name.removeprefix(TORQUE): values[0]})
        return replace(scene, torque=changed)
    changes: dict[str, Any] = {name: values}
    if name == "inertia":
        matrix = np.zeros((3, 3))
        for (i, j), value in zip(INERTIA_ELEMENTS, values, strict=True):
            matrix[i, j] = matrix[j, i] = value
        changes = {name: matrix.tolist()}
    return replace(scene, **changes)


def _turned(scene: Scene, turn: Array) -> Scene:
    """Return the scene after a rotation about body axes by the vector `turn` (rad)."""
    angle = float(np.linalg.norm(turn))
    half = 0.5 * np.sinc(0.5 * angle / np.pi) * turn
    small = (np.cos(0.5 * angle), *half)
    return replace(scene, attitude=product(scene.attitude or IDENTITY, small))
