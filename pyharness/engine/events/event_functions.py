"""Checks and evaluation of functions whose roots are events."""

import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import FunctionType
from typing import Any

import numpy as np

from pyharness.engine.system.recorded import outputs_at
from pyharness.model.arguments import count_inputs, has_signature
from pyharness.model.array_type import Array
from pyharness.model.called_function import called_once
from pyharness.model.errors import InputError, TimedError, kind_of
from pyharness.model.numpy_protocol import symbol_array
from pyharness.model.own_states import OwnState
from pyharness.model.symbols import Recorder
from pyharness.model.tape import N_INPUTS, Tape, float_outputs
from pyharness.model.values import converted

_FUNCTIONS_ALLOWED = (
    "allowed: a function of (t, omega) or (t, omega, attitude), or a list of such functions; with "
    "states of your own, they are one more argument"
)
# Largest relative difference of values for one time and for many, due to rounding.
_AGREEMENT = 1e-10
CHECKED = 9  # values that are compared

# Attributes that change the signature of a function.
_SIGNED = {"__wrapped__", "__signature__"}
_MORE_ARGUMENTS = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS


@dataclass(eq=False)
class Event:
    """An event of `pyharness.events`; `terminal` and `direction` are as in `crosses`.

    `function` takes time, omega, attitude (with `Scene.states` appended), and omega's derivative.
    """

    name: str
    function: Callable[[Any, Any, Any, Any], Any] = field(repr=False)
    terminal: bool | int = False
    direction: int = 0
    needs_attitude: bool = False
    needs_rates: bool = False
    counts_touches: bool = True  # whether roots without sign change are events


@dataclass(eq=False)
class EventFunction:
    """A checked event, which is called with n times (s) and states."""

    name: str
    event: Event
    limit: float  # number, from 1, of the event that ends the integration; infinite for none
    is_vectorized: bool | None = None  # whether the function accepts arrays; None: unknown
    _tapes: list[Tape | None] = field(default_factory=list, repr=False)  # at most one
    _is_checked: bool = False  # whether the tape's values are those of the function

    def __call__(self, times: Array, states: Array, rates: Array | None = None) -> Array:
        if not times.size:
            return np.zeros(0)
        given = times, states, None if rates is None else rates[:, :3]
        found = self._of_arrays(*given) if self.is_vectorized is not False else None
        if found is None:
            self.is_vectorized = False
            found = self._of_tape(*given)
        if found is None:
            found = np.array(self._of_each(*given))
        if not np.isfinite(found).all():
            wrong = np.flatnonzero(~np.isfinite(found))
            raise TimedError(
                f"{self.name}: the function returned {found[wrong[0]]:g} at t = {{time}} s; "
                "allowed: finite numbers",
                times[wrong[0]],
            )
        return found

    def _of_arrays(self, times: Array, states: Array, rates: Array | None) -> Array | None:
        omega, attitude = states[:, :3].T.copy(), states[:, 3:].T.copy()
        rate = None if rates is None else rates.T
        try:
            with np.errstate(all="ignore"):
                found = self.event.function(times.copy(), omega, attitude, rate)
            found = np.array(found, dtype=np.float64)
            if found.shape != times.shape:
                found = np.array(np.broadcast_to(found, times.shape))
        except Exception:  # the function may raise anything where it expects one number
            if self.is_vectorized:
                raise
            return None
        if self.is_vectorized is None:
            if not self._is_confirmed(found, times, states, rates):
                return None
            # Agreement at few times does not show that the function accepts arrays.
            self.is_vectorized = True if len(times) > CHECKED else None
        return found

    def _is_confirmed(self, found: Array, times: Array, states: Array, rates: Array | None) -> bool:
        some = sorted({k * (len(times) - 1) // (CHECKED - 1) for k in range(CHECKED)})
        each = self._of_each(times[some], states[some], None if rates is None else rates[some])
        return _are_alike(found[some].tolist(), each)

    def _of_tape(self, times: Array, states: Array, rates: Array | None) -> Array | None:
        tape = self.tape(states.shape[1])
        some = slice(None, None, max(1, len(times) // CHECKED))
        if tape is None or not self.is_tape(times[some], states[some]):
            return None
        found: Array = outputs_at(tape, times, states)[:, 0]
        return found

    def tape(self, width: int) -> Tape | None:
        """Return the recorded function of `width` unknowns; None if it can't be recorded."""
        if not self._tapes:
            self._tapes.append(self._recorded(width))
        return self._tapes[0]

    def is_tape(self, times: Array, states: Array) -> bool:
        """Return whether the function's values at n times and states are those of its tape."""
        (tape,) = self._tapes
        if tape is not None and not self._is_checked:
            self._is_checked = True
            given = np.zeros((len(times), tape.n_inputs))
            given[:, 0], given[:, 1 : 1 + states.shape[1]] = times, states
            found = [float_outputs(tape, each)[0] for each in given.tolist()]
            if not _are_alike(found, self._of_each(times, states, None)):
                self._tapes[0] = None
        return self._tapes[0] is not None

    def _recorded(self, width: int) -> Tape | None:
        if self.event.needs_rates:
            return None

        recorder = Recorder(n_inputs=max(N_INPUTS, 1 + width))
        time, *state = recorder.inputs()
        given = time, symbol_array(state[:3]), symbol_array(state[3:width]), None
        try:
            # Functions that change from call to call are found by their values.
            (value,) = called_once(lambda *x: [self.event.function(*x)], given, recorder, "")
            return recorder.tape([value])
        except InputError:
            return None

    def _of_each(self, times: Array, states: Array, rates: Array | None) -> list[float]:
        each_rate = [None] * len(times) if rates is None else rates.copy()
        values = []
        with np.errstate(all="ignore"):
            for time, state, rate in zip(times.tolist(), states.copy(), each_rate, strict=True):
                found = self.event.function(time, state[:3], state[3:], rate)
                if isinstance(found, np.ndarray) and found.size == 1:
                    found = found.item()
                if not isinstance(found, float):
                    found = converted(found)
                if isinstance(found, str):
                    raise TimedError(
                        f"{self.name}: the function returned {found} at t = {{time}} s; "
                        "allowed: a number",
                        time,
                    )
                values.append(found)
        return values


def _are_alike(values: Sequence[float], others: Sequence[float]) -> bool:
    scale = _AGREEMENT * max(map(abs, others))
    # Equal infinite values have no difference.
    return all(x == y or abs(x - y) <= scale for x, y in zip(values, others, strict=True))


def event_functions(
    events: object, attitude: bool, states: Sequence[OwnState] = ()
) -> list[EventFunction]:
    if callable(events) or isinstance(events, Event):
        events = [events]
    if not isinstance(events, (list, tuple)):
        raise InputError(f"events: {kind_of(events)}; {_FUNCTIONS_ALLOWED}")
    names = [each.name for each in states]
    return [
        _checked(each, f"events: event {k}", attitude, names) for k, each in enumerate(events, 1)
    ]


def _checked(given: Any, name: str, attitude: bool, own: Sequence[str]) -> EventFunction:
    n_attitude = 4 if attitude else 0
    if isinstance(given, Event):
        event, needs_attitude = given, given.needs_attitude
    elif isinstance(given, type):
        raise InputError(f"{name} is a class; {_FUNCTIONS_ALLOWED}")
    elif callable(given):
        count = _arguments(given, name, len(own) > 0)
        needs_attitude = count == 3
        function = _with_attitude(given) if needs_attitude else _without_attitude(given)
        event = Event(
            name,
            _with_own(given, own, n_attitude, needs_attitude) if own else function,
            getattr(given, "terminal", False),
            getattr(given, "direction", 0),
        )
    else:
        raise InputError(f"{name} is {kind_of(given)}; {_FUNCTIONS_ALLOWED}")
    if needs_attitude and not attitude:
        raise InputError(f"{name} needs the attitude, which was not requested; use attitude=True")
    limit = _limit(event.terminal, name)
    direction = converted(event.direction)
    if direction not in (-1.0, 0.0, 1.0):
        raise InputError(f"{name}: direction is {event.direction!r}; allowed: -1, 0, 1")
    return EventFunction(name, event, limit)


def _with_attitude(given: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
    return lambda t, omega, attitude, rates: given(t, omega, attitude)


def _without_attitude(given: Callable[..., Any]) -> Callable[[Any, Any, Any, Any], Any]:
    return lambda t, omega, attitude, rates: given(t, omega)


def _with_own(
    given: Callable[..., Any], own: Sequence[str], n_attitude: int, needs_attitude: bool
) -> Callable[..., Any]:
    def function(t: Any, omega: Any, rest: Any, rates: Any) -> Any:
        states = dict(zip(own, rest[n_attitude:], strict=True))
        attitude = (rest[:n_attitude],) if needs_attitude else ()
        return given(t, omega, *attitude, states)

    return function


def _arguments(given: Callable[..., Any], name: str, with_own: bool = False) -> int:
    """Return the number of a function's arguments, 2 or 3, without the user's own states."""
    if type(given) is FunctionType and not (given.__defaults__ or vars(given).keys() & _SIGNED):
        code = given.__code__
        count = code.co_argcount - with_own
        # A function without defaults, *args and **kwargs has exactly `count` arguments.
        if count in (2, 3) and not (code.co_kwonlyargcount or code.co_flags & _MORE_ARGUMENTS):
            return count
    least = 2 + with_own
    if not has_signature(given):
        return 2
    return count_inputs(given, name, _FUNCTIONS_ALLOWED, least, least) - with_own


def _limit(terminal: Any, name: str) -> float:
    if terminal is None:
        return math.inf
    found = float(terminal) if isinstance(terminal, (bool, np.bool_)) else converted(terminal)
    if isinstance(found, str) or found < 0.0 or not found.is_integer():
        raise InputError(
            f"{name}: terminal is {terminal!r}; allowed: True, False, or a number of events"
        )
    return found or math.inf
