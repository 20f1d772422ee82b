"""States of the user's own beside omega and attitude: integral terms, wheel speeds, lags."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from inspect import Parameter, signature
from typing import Any, NamedTuple

import numpy as np

from pyharness.model.errors import InputError, kind_of
from pyharness.model.numpy_calls import called_once, symbol_array
from pyharness.model.state_torque import StateTorque
from pyharness.model.symbols import Recorder, recorded_twice
from pyharness.model.tape import N_INPUTS, Tape
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import finite

MOST_STATES = 8  # what the kernel has room for beside omega and attitude
_FUNCTION = (
    "a function of (t, omega, states) or (t, omega, attitude, states) that returns the torque and "
    "the rates of the states"
)
_PLACES = (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)


# Names of other columns of results.
_TAKEN = (
    *("t", "time", "recorded_time", "omega", "omega1", "omega2", "omega3", "velocity", "velocity1"),
    *("velocity2", "velocity3", "attitude", "q0", "q1", "q2", "q3", "ier", "axis", "component"),
)


class OwnState(NamedTuple):
    """A state of the user's own, in any unit: its name, and its value at time 0.

    Its error is relative to its largest absolute value so far, or to `scale` if that is larger.
    """

    name: str
    start: float
    scale: float = 0.0


def checked_states(value: object) -> tuple[OwnState, ...]:
    """Return the argument `states` of a scene, or raise InputError."""
    if isinstance(value, tuple) and all(isinstance(each, OwnState) for each in value):
        return value
    if not isinstance(value, Mapping):
        raise InputError(
            f"states is {kind_of(value)}; it must be a dict of names and values at time 0"
        )
    if len(value) > MOST_STATES:
        raise InputError(f"states: {len(value)} are given; allowed: at most {MOST_STATES}")
    return tuple(_state(name, each) for name, each in value.items())


def _state(name: object, value: Any) -> OwnState:
    if not (isinstance(name, str) and name.isidentifier()) or name in _TAKEN:
        raise InputError(
            f"states: {name!r}; allowed: a Python identifier, but none of {', '.join(_TAKEN)}"
        )
    where, pair = f"states: {name}", value
    if not isinstance(value, (tuple, list)):
        pair = value, 0.0
    if len(pair) != 2:
        raise InputError(f"{where} has {len(pair)} numbers; allowed: a start, or a start and scale")
    start, scale = (finite(where, each) for each in pair)
    if scale < 0.0:
        raise InputError(f"{where}: the scale is {scale:g}; allowed: a number from 0 on")
    return OwnState(name, start, scale)


def torque_with_states(
    torque: object, states: Sequence[OwnState], torque_of_scene: Callable[[object], Any]
) -> TorqueLaw | StateTorque:
    """Return the torque of a scene with these states, recorded if it is a function.

    `torque_of_scene` checks a torque without states. Raise InputError if the states are not those
    of the torque.
    """
    names = tuple(each.name for each in states)
    if names and callable(torque) and not isinstance(torque, (StateTorque, TorqueLaw)):
        return _recorded(torque, names)
    found: TorqueLaw | StateTorque = torque_of_scene(torque)
    own = found.own if isinstance(found, StateTorque) else ()
    if own != names:
        raise InputError(
            f"states: {_listed(names)}, but the torque computes the rates of {_listed(own)}; "
            f"allowed: {_FUNCTION}"
        )
    return found


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


def _recorded(function: Callable[..., Any], names: tuple[str, ...]) -> StateTorque:
    takes_attitude = _count_arguments(function) == 4

    def record(recorder: Recorder) -> Tape:
        time, *state = recorder.inputs()
        omega, attitude = map(symbol_array, (state[:3], state[3:7]))
        own = dict(zip(names, state[7:], strict=True))
        given = (time, omega, attitude, own) if takes_attitude else (time, omega, own)
        parts = called_once(function, given, recorder, _FUNCTION)
        if len(parts) != 2:
            raise InputError(
                f"[torque]: the function returned {len(parts)} values; it must be {_FUNCTION}"
            )
        components = list(parts[0])
        if len(components) != 3:
            raise InputError(f"[torque]: {len(components)} components; allowed: three")
        return recorder.tape([*components, *_ordered(parts[1], names)])

    tape = recorded_twice(record, partial(Recorder, n_inputs=N_INPUTS + len(names)))
    return StateTorque(tape, None, tape.needs_attitude, own=names)


def _ordered(rates: Any, names: tuple[str, ...]) -> list[Any]:
    if isinstance(rates, Mapping):
        if set(rates) != set(names):
            raise InputError(
                f"[torque]: rates of {_listed(map(str, rates))}; allowed: of {_listed(names)}"
            )
        return [rates[name] for name in names]
    found = list(np.atleast_1d(np.asarray(rates, dtype=object)))
    if len(found) != len(names):
        raise InputError(
            f"[torque]: {len(found)} rates of states; allowed: {len(names)}, those of "
            f"{_listed(names)}"
        )
    return found


def _count_arguments(function: Callable[..., Any]) -> int:
    try:
        places = [each for each in signature(function).parameters.values() if each.kind in _PLACES]
    except (TypeError, ValueError):
        raise InputError(
            f"[torque]: the function's arguments are unknown; allowed: {_FUNCTION}"
        ) from None
    if len(places) not in (3, 4):
        raise InputError(
            f"[torque]: the function has {len(places)} arguments; allowed: {_FUNCTION}"
        )
    return len(places)
