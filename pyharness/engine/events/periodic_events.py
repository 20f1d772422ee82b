"""Events of a body without torque, by repetition of one period's events."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.events.event_functions import EventFunction
from pyharness.model.array_type import Array
from pyharness.model.errors import InputError
from pyharness.model.symbols import Recorder
from pyharness.model.tape import ATTITUDE, N_INPUTS, TIME

# Events are searched in so many periods; the second, which is far from any end, is repeated.
PERIODS = 3.0
_MOST_EVENTS = 5_000_000
_BLOCK = 100_000  # events that are improved together
# Step of the difference quotient of a function, and largest correction of a time, in periods.
_PROBE = 1e-5
# Largest error of the time of an event before its improvement, in periods.
_MARGIN = 1e-6


def are_of_omega(functions: Sequence[EventFunction]) -> bool:
    """Return whether all functions can be recorded, and depend only on omega and its derivative."""
    return all(map(_is_of_omega, functions))


def _is_of_omega(g: EventFunction) -> bool:
    recorder = Recorder(n_inputs=N_INPUTS + 3)
    time, *state = recorder.inputs()
    omega, attitude, rates = np.split(np.array(state, dtype=object), [3, 7])
    try:
        tape = recorder.tape([g.event.function(time, omega, attitude, rates)])
    except Exception:  # the function may raise anything where it expects a number
        return False
    return tape.inputs.isdisjoint({TIME, *ATTITUDE})


def repeat(
    times: Array, period: float, end: float, where: str
) -> tuple[Array, NDArray[np.intp], int]:
    """Return event times (s) until `end`, their originals, and how many precede the repetition.

    `times` are events of the first three periods.
    """
    # An event at the end of a period may be found on either side of it.
    margin = _MARGIN * period
    inner = times[(times > period - margin) & (times <= 2.0 * period + margin)]
    if not inner.size:
        return times, np.arange(len(times)), len(times)
    # The repeated period begins in the largest gap, far from any event.
    phases = np.sort(inner % period)
    gaps = np.diff(phases, append=phases[0] + period)
    begin = period + phases[gaps.argmax()] + 0.5 * gaps.max()
    begin -= period if begin > 2.0 * period else 0.0
    first = np.flatnonzero(times <= begin)
    one = np.flatnonzero((times > begin) & (times <= begin + period))
    count = np.floor((end - begin) / period) + 1.0
    if count * len(one) > _MOST_EVENTS:
        raise InputError(
            f"{where}: more than {_MOST_EVENTS} events; use a shorter time, or the attribute "
            "terminal"
        )
    later = (times[one] + period * np.arange(count)[:, None]).ravel()
    found = np.concatenate([times[first], later[later <= end]])
    return found, np.concatenate([first, np.tile(one, int(count))])[: len(found)], len(first)


def improved(
    g: EventFunction, times: Array, values: Callable[[EventFunction, Array], Array], period: float
) -> Array:
    """Return the times (s) of events, each after one step of Newton's method."""
    found, probe = times.copy(), _PROBE * period
    for begin in range(0, len(times), _BLOCK):
        block = times[begin : begin + _BLOCK]
        before, value, after = (values(g, block + shift) for shift in (-probe, 0.0, probe))
        with np.errstate(all="ignore"):
            step = -value * 2.0 * probe / (after - before)
        # A root without a sign change has no slope.
        is_simple = (np.abs(step) < probe) & (before * after < 0.0)
        found[begin : begin + _BLOCK] += np.where(is_simple, step, 0.0)
    return found
