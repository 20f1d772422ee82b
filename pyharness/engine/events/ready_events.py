"""Ready events: predefined functions of time and state whose roots `solve` computes."""

import math
from typing import Any

import numpy as np

from pyharness.engine.events.event_functions import Event
from pyharness.engine.torques.ready import EVENTS as EVENTS
from pyharness.engine.torques.ready import choice, number, ready_event, vector
from pyharness.model.errors import InputError
from pyharness.model.values import Number, Numbers, finite, integer, three

__all__ = ["crosses", "extremum", "flip", "rest", "tilt"]
_AXIS = choice(1, 2, 3)("Body axis", "", 2)


@ready_event("A component of omega equals a value", axis=_AXIS, value=number("Value", "rad/s", 0.4))
def crosses(
    axis: int, value: Number = 0.0, *, terminal: bool | int = False, direction: int = 0
) -> Event:
    """Return the event that a component of omega equals a value.

    Parameters
    ----------
    axis : {1, 2, 3}
        The body axis of the component.
    value : float
        The value (rad/s).
    terminal : bool or int
        Whether the first event ends the integration; with a number n, the n-th does.
    direction : {-1, 0, 1}
        1 for increasing, -1 for decreasing components, in the direction of integration; 0 for both.
        With 0, an extremum that equals the value is also an event.

    Returns
    -------
    Event
        The event, for the argument `events` of `pyharness.solve`.

    Raises
    ------
    InputError
        If `axis` is not 1, 2 or 3, or `value` is not finite.

    Examples
    --------
    >>> from pyharness import case_scene, solve
    >>> from pyharness.events import crosses
    >>> found = solve(case_scene(1), 2.0, events=crosses(1, 3.0))
    >>> found.t_events[0].round(9), found.y_events[0].round(9)
    (array([0.8]), array([[3., 3., 3.]]))
    """
    where = "events: crosses"
    k, level = _axis(where, axis), finite(f"{where} value", value)
    return Event(
        f"crosses({k + 1}, {level:g})",
        lambda t, omega, attitude, rates: omega[k] - level,
        terminal,
        direction,
    )


@ready_event("A component of omega changes its sign", axis=_AXIS)
def flip(axis: int, *, terminal: bool | int = False, direction: int = 0) -> Event:
    """Return the event that a component of omega changes its sign.

    A zero without a sign change, or at the ends of the integration, is no event.

    Parameters
    ----------
    axis : {1, 2, 3}
        The body axis of the component.
    terminal : bool or int
        As in `crosses`.
    direction : {-1, 0, 1}
        1 if it becomes positive, -1 if negative, in the direction of integration; 0 for both.

    Returns
    -------
    Event
        The event.

    Raises
    ------
    InputError
        If `axis` is not 1, 2 or 3.

    Examples
    --------
    >>> from pyharness import Scene, solve
    >>> from pyharness.events import flip
    >>> wing_nut = Scene("wing nut", omega=(0.01, 5.0, 0.0), moments=(1.0, 2.0, 3.0))
    >>> found = solve(wing_nut, 20.0, events=flip(2))
    >>> found.t_events[0].round(3)
    array([ 2.633,  7.899, 13.165, 18.431])
    """
    k = _axis("events: flip", axis)
    return Event(
        f"flip({k + 1})",
        lambda t, omega, attitude, rates: omega[k],
        terminal,
        direction,
        counts_touches=False,
    )


@ready_event("A component of omega has a maximum or a minimum", axis=_AXIS)
def extremum(axis: int, *, terminal: bool | int = False, direction: int = 0) -> Event:
    """Return the event that a component of omega has a maximum or a minimum.

    Parameters
    ----------
    axis : {1, 2, 3}
        The body axis of the component.
    terminal : bool or int
        As in `crosses`.
    direction : {-1, 0, 1}
        1 if the component's derivative becomes positive, -1 if negative, in the direction of
        integration; 0 for both. Forward in time, 1 selects minima and -1 maxima; backward, the
        reverse.

    Returns
    -------
    Event
        The event.

    Raises
    ------
    InputError
        If `axis` is not 1, 2 or 3.

    Examples
    --------
    >>> from pyharness import Scene, solve
    >>> from pyharness.events import extremum
    >>> wing_nut = Scene("wing nut", omega=(0.01, 5.0, 0.0), moments=(1.0, 2.0, 3.0))
    >>> solve(wing_nut, 6.0, events=extremum(3)).t_events[0].round(3)
    array([2.633])
    """
    k = _axis("events: extremum", axis)
    return Event(
        f"extremum({k + 1})",
        lambda t, omega, attitude, rates: rates[k],
        terminal,
        direction,
        needs_rates=True,
    )


@ready_event("The magnitude of omega falls to a value", value=number("Value", "rad/s", 2.0))
def rest(value: Number, *, terminal: bool | int = False, direction: int = -1) -> Event:
    """Return the event that the magnitude of omega falls to a value, or rises to it.

    Parameters
    ----------
    value : float
        The value (rad/s), above 0, because a damped body never reaches 0.
    terminal : bool or int
        As in `crosses`.
    direction : {-1, 0, 1}
        -1 for falling, 1 for rising magnitudes, in the direction of integration; 0 for both.

    Returns
    -------
    Event
        The event.

    Raises
    ------
    InputError
        If `value` is not from 1e-150 to 1e150.

    Examples
    --------
    >>> from pyharness import Scene, solve
    >>> from pyharness.events import rest
    >>> from pyharness.torques import damping
    >>> scene = Scene("ball", (0.0, 0.0, 1.0), moments=(1.0, 1.0, 1.0), torque=damping(1.0))
    >>> found = solve(scene, [1.0, 2.0, 3.0], events=rest(0.1, terminal=True))
    >>> found.t_events[0].round(9), found.time, found.ended
    (array([2.30258509]), array([1., 2.]), 'event')
    """
    level = finite("events: rest value", value)
    # Squares of other values are subnormal or may overflow.
    if not 1e-150 <= level <= 1e150:
        raise InputError(f"events: rest value is {level:g} rad/s; allowed: 1e-150 to 1e150 rad/s")
    return Event(
        f"rest({level:g})",
        lambda t, omega, attitude, rates: sum(each * each for each in omega) - level * level,
        terminal,
        direction,
    )


@ready_event(
    "The angle between a body axis and a direction in space equals a value; needs `attitude=True`",
    axis=_AXIS,
    toward=vector("Direction in space", "", (1.0, -2.0, 0.5), "direction in space"),
    angle=number("Angle", "rad", 1.2),
)
def tilt(
    axis: int, toward: Numbers, angle: Number, *, terminal: bool | int = False, direction: int = 0
) -> Event:
    """Return the event that the angle between a body axis and a direction in space equals a value.

    It needs ``attitude=True`` in `pyharness.solve`.

    Parameters
    ----------
    axis : {1, 2, 3}
        The body axis.
    toward : three numbers
        The direction in space, of any length.
    angle : float
        The angle (rad), from 0 to pi.
    terminal : bool or int
        As in `crosses`.
    direction : {-1, 0, 1}
        1 for increasing, -1 for decreasing angles, in the direction of integration; 0 for both.

    Returns
    -------
    Event
        The event.

    Raises
    ------
    InputError
        If `axis`, `toward` or `angle` is not as stated.

    Examples
    --------
    >>> import math
    >>> from pyharness import Scene, solve
    >>> from pyharness.events import tilt
    >>> scene = Scene("ball", (0.5, 0.0, 0.0), moments=(1.0, 1.0, 1.0))
    >>> found = solve(scene, 4.0, attitude=True, events=tilt(3, (0, 0, 1), math.pi / 4))
    >>> found.t_events[0].round(9)
    array([1.57079633])
    """
    where = "events: tilt"
    k, vector = _axis(where, axis), np.array(three(f"{where} toward", toward))
    largest = float(np.abs(vector).max())
    if largest == 0.0:
        raise InputError(f"{where} toward: 0, 0, 0; allowed: three numbers that are not all 0")
    vector = vector / largest
    unit = (vector / np.linalg.norm(vector)).tolist()
    level = finite(f"{where} angle", angle)
    if not 0.0 <= level <= math.pi:
        raise InputError(f"{where} angle: {level:g} rad; allowed: 0 to pi")

    def difference(t: Any, omega: Any, attitude: Any, rates: Any) -> Any:
        return math.cos(level) - _component(unit, k, attitude)

    return Event(
        f"tilt({k + 1}, {unit}, {level:g})", difference, terminal, direction, needs_attitude=True
    )


def _component(unit: list[float], k: int, attitude: Any) -> Any:
    """Return the component along body axis k of a vector given about the axes of space."""
    scalar, vector = attitude[0], attitude[1:]
    i, j = (k + 1) % 3, (k + 2) % 3
    # Column k of the rotation matrix of a unit quaternion.
    own = 1.0 - 2.0 * (vector[i] * vector[i] + vector[j] * vector[j])
    at_i = 2.0 * (vector[k] * vector[i] + scalar * vector[j])
    at_j = 2.0 * (vector[k] * vector[j] - scalar * vector[i])
    return unit[k] * own + unit[i] * at_i + unit[j] * at_j


def _axis(where: str, axis: object) -> int:
    found = integer(f"{where} axis", axis)
    if found not in (1, 2, 3):
        raise InputError(f"{where} axis: {found}; allowed: 1, 2, 3")
    return found - 1
