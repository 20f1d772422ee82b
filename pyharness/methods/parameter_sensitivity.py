"""Sensitivities: derivatives of a solution with respect to its parameters, by Taylor series."""

import itertools
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from pyharness.dynamics.parameters import (
    ATTITUDE,
    OMEGA0,
    initial_state,
    is_opaque,
    parameters_of,
    varied_equations,
)
from pyharness.methods.recorded import kernel_tape
from pyharness.model.array_type import Array
from pyharness.model.errors import InputError, TimedError, kind_of, unknown
from pyharness.model.extension import COMPLETE, GAVE_UP, extension
from pyharness.model.scene import Scene
from pyharness.model.tape import Tape
from pyharness.model.trajectory import Trajectory

_METHODS = ("auto", "taylor", "closed-form")
_MOST_NAMES = 1000


def checked_names(
    scene: Scene, names: Iterable[str], method: str, attitude: bool
) -> tuple[str, ...]:
    """Return the names of parameters that a user gives, each once.

    Raise InputError if a name is unknown, or if the sensitivities can't be computed.
    """
    place = "sensitivities"
    if method not in _METHODS:
        raise InputError(f"{place}: the method is {method}; allowed: {', '.join(_METHODS)}")
    allowed = "allowed: names, as in ['omega0', 'moments']"
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise InputError(f"{place}: {kind_of(names)}; {allowed}")
    if is_opaque(scene):
        raise InputError(f"{place}: the torque is opaque; allowed: a torque that can be recorded")
    known = [OMEGA0, *([ATTITUDE] if attitude else []), *parameters_of(scene)]
    found: dict[str, None] = {}
    for name in itertools.islice(names, _MOST_NAMES):
        if not isinstance(name, str):
            raise InputError(f"{place}: {kind_of(name)}; {allowed}")
        if name == ATTITUDE and not attitude:
            raise InputError(f"{place}: the attitude is not computed; give attitude=True")
        if name not in known:
            raise unknown("parameter", name, known, place)
        found[name] = None
    return tuple(found)


def sensitivities_at(
    scene: Scene, found: Trajectory, names: Sequence[str], tolerance: float, effort: float
) -> dict[str, Array]:
    """Return the derivatives of the solution `found` at its times, by the name of each parameter.

    An array has the shape (n, 3, m), or (n, 7, m) with the attitude, where m is the number of
    values of the parameter. `tolerance` is relative to the largest derivative of a column so far.
    `effort` multiplies the work limit. Raise InputError if this limit is exceeded, or if a
    derivative overflows.
    """
    if not names:
        return {}
    equations = varied_equations(scene, names, found.attitude is not None)
    state, starts = initial_state(scene, equations)
    packed, forcings = _packed(equations.tape, len(state), equations.forcings)
    rows = np.empty((len(found.time), *starts.shape))
    is_before = found.time < 0.0
    for side in (is_before, ~is_before):
        places = np.flatnonzero(side)
        # Each side is computed from 0 outward.
        places = places[np.argsort(np.abs(found.time[places]))]
        if places.size:
            times = found.time[places]
            derivatives, n_rows, status, _ = extension().tape_derivatives(
                packed, state, starts, forcings, times, tolerance, effort
            )
            _check(status, n_rows, times, derivatives)
            rows[places] = derivatives.transpose(2, 0, 1)
    return {name: rows[:, :, columns] for name, columns in equations.columns.items()}


def _packed(
    tape: Tape, n_unknowns: int, forcings: NDArray[np.int32]
) -> tuple[Array, NDArray[np.int32]]:
    """Return a tape as the kernel reads it, with its combinations in place of its outputs."""
    packed = kernel_tape(tape, n_unknowns)
    # The outputs are the last combinations, which the array counts here.
    first = int(packed[3]) - len(tape.outputs)
    return packed, np.where(forcings > 0, forcings + first, 0).astype(np.int32)


def _check(status: int, n_rows: int, times: Array, derivatives: Array) -> None:
    """Raise InputError if a kernel's derivatives at `times` (s) are not complete or not finite."""
    time = times[min(n_rows, len(times) - 1)]
    if status == GAVE_UP:
        raise TimedError(
            "sensitivities exceeded their work limit before t = {time} s; use a shorter time, a "
            "larger tolerance, or more effort",
            time,
        )
    if status != COMPLETE or not np.isfinite(derivatives).all():
        raise TimedError("sensitivities overflow before t = {time} s; use a shorter time", time)
