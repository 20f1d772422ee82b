"""Torque terms given by tables over time, and pulses, about the body axes.

Taylor series begin a new step where a table changes, and so remain accurate.
"""

import math
import warnings
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any

import numpy as np

from pyharness.engine.torques.ready import NUMBER, VECTOR, Argument, choice, list_form, ready_torque
from pyharness.engine.torques.term_input import ready_term
from pyharness.model.array_type import Array
from pyharness.model.errors import InputError, unknown
from pyharness.model.inertia_function import InertiaFunction, inertia_of_tables
from pyharness.model.report import counted
from pyharness.model.state_torque import Function, StateTorque
from pyharness.model.tape import Table
from pyharness.model.tape_arrays import value_of_table, without_equal_constants
from pyharness.model.values import Numbers, Triple, converted, finite, number_list, three

__all__ = ["pulses", "table"]
_INTERPOLATIONS = ("held", "linear", "cubic")
_MOST_TIMES, _MOST_PULSES = 1_000_000, 10_000
_TIMES = list_form(NUMBER, 1, _MOST_PULSES)
_LARGEST_TIME = 1e300
# Pulses touch if the gap is at most this many spacings of floats, because the end of a pulse is
# rounded.
_TOUCHING = 4.0


@ready_torque(
    "Values over time, interpolated",
    "values over time",
    lambda sizes: {
        "times": sizes.times(), "values": sizes.rows(12),
        "interpolation": sizes.source.choice(_INTERPOLATIONS),
    },
    note="constant before the first and after the last time",
    leaves=(),
    times=Argument(
        list_form(NUMBER, 2, _MOST_TIMES), "Times", "s", [-1.0, 0.5, 1.0], remark="ascending"
    ),
    values=Argument(
        list_form(VECTOR, 2, _MOST_TIMES), "A row of three numbers for each time", "N m",
        [(0.1, 0.2, 0.3), (0.5, -0.2, 0.1), (0.0, 0.3, 0.2)],
    ),
    interpolation=choice(*_INTERPOLATIONS)("Interpolation between the times", "", "linear"),
)  # fmt: skip
def table(times: Numbers, values: Iterable[Numbers], interpolation: str = "linear") -> StateTorque:
    """Return the torque that a table of values over time specifies.

    Before the first time the first value holds, after the last time the last value.

    Parameters
    ----------
    times : iterable of numbers, shape (n,)
        2 to 1 000 000 ascending times (s).
    values : iterable of three numbers, shape (n, 3)
        The torque about the body axes (N m) at each time; an array, list or DataFrame.
    interpolation : str
        ``held`` (constant until the next time), ``linear``, or ``cubic``: a spline whose first two
        pieces are one polynomial, as are the last two.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If the times do not ascend, the numbers of times and values differ, the interpolation is
        unknown, or a number is not finite.

    References
    ----------
    C. de Boor, A Practical Guide to Splines, revised edition, 2001, chapter 4 (not-a-knot).

    Examples
    --------
    >>> from pyharness.torques import table
    >>> ramp = table([0.0, 1.0, 3.0], [(0, 0, 0), (2, 0, 0), (2, 0, 4)])
    >>> ramp.at(2.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    (2.0, 0.0, 2.0)
    """
    if not isinstance(interpolation, str) or interpolation not in _INTERPOLATIONS:
        raise unknown("interpolation", interpolation, _INTERPOLATIONS, "[torque] table")
    found = _ascending("[torque] table times", times)
    n = len(found)
    rows: Any = _as_array(values)
    is_array = type(rows) is np.ndarray and rows.dtype == float and rows.shape == (n, 3)
    if not (is_array and np.isfinite(rows).all()):
        rows = np.array(_rows("[torque] table values", rows, n, "allowed: a list of rows", "time"))
    tables = [_piecewise(found, axis, interpolation, "[torque] table") for axis in rows.T]
    return ready_term(
        "table", _torque(tables), times=found, values=rows.tolist(), interpolation=interpolation
    )


def inertia_table(
    times: Numbers, values: Iterable[Any], interpolation: str = "cubic"
) -> InertiaFunction:
    """Return the inertia that a table of moments or matrices over time specifies.

    Before the first time the first value holds, after the last time the last value.

    Parameters
    ----------
    times : iterable of numbers, shape (n,)
        2 to 1 000 000 ascending times (s).
    values : array, shape (n, 3) or (n, 3, 3)
        The principal moments, or the inertia matrices about the body axes, at each time (kg m2).
    interpolation : str
        ``cubic``, the spline of `pyharness.torques.table`, or ``linear``.

    Returns
    -------
    InertiaFunction
        The inertia, for the argument `moments` or `inertia` of `Scene`.

    Raises
    ------
    InputError
        If the times do not ascend, the shapes differ, the interpolation is unknown, or a value is
        no inertia.

    Examples
    --------
    >>> from pyharness import Scene, inertia_table, solve
    >>> boom = inertia_table([0.0, 10.0], [(4.0, 4.0, 2.0), (8.0, 8.0, 2.0)], "linear")
    >>> solve(Scene(omega=(1.0, 0.0, 0.0), moments=boom), 10.0).omega
    array([[0.5, 0. , 0. ]])
    """
    if not isinstance(interpolation, str) or interpolation not in ("linear", "cubic"):
        raise unknown("interpolation", str(interpolation), ("linear", "cubic"), "[body] table")
    found = _ascending("[body] table times", times)
    try:
        rows = np.array(_as_array(values), dtype=float)
    except (TypeError, ValueError, OverflowError):
        rows = np.zeros(0)
    n = len(found)
    if rows.shape not in ((n, 3), (n, 3, 3)) or not np.isfinite(rows).all():
        raise InputError(
            f"[body] table values: allowed: an array of finite numbers of shape ({n}, 3), moments, "
            f"or ({n}, 3, 3), matrices, because there are {n} times"
        )
    place = "moments" if rows.ndim == 2 else "inertia"
    axes = rows.reshape(n, -1).T
    columns = [_piecewise(found, axis, interpolation, "[body] table") for axis in axes]
    written = tuple({"times": found.tolist(), "values": rows.tolist()}.items())
    return inertia_of_tables(place, columns, (*written, ("interpolation", interpolation)))


def _ascending(where: str, times: Any) -> Array:
    found = _times(where, times, 2, _MOST_TIMES)
    if not (np.diff(found) > 0.0).all():
        raise InputError(f"{where}: not in ascending order; allowed: ascending times")
    return found


# Iteration over a DataFrame would yield its column names.
def _as_array(values: Any) -> Any:
    return values.to_numpy() if hasattr(values, "to_numpy") else values


def _rows(where: str, values: Any, count: int, allowed: str, what: str) -> list[Triple]:
    given = list(islice(number_list(where, values, allowed), count + 1))
    if len(given) != count:
        raise _other_number(where, "row", len(given), count, what)
    return [three(f"{where}, row {n}", row) for n, row in enumerate(given, 1)]


@ready_torque(
    "Pulses of constant torque",
    "torque within pulses, otherwise 0",
    lambda sizes: {
        "starts": (times := sizes.times())[::2], "durations": times[1::2] - times[::2],
        "torque": sizes.rows(6),
    },
    leaves=(),
    starts=Argument(_TIMES, "Beginnings", "s", [-1.0, 0.5]),
    durations=Argument(_TIMES, "Durations", "s", [0.3, 0.2]),
    torque=Argument(
        {"anyOf": [VECTOR, list_form(VECTOR, 1, _MOST_PULSES)]},
        "One torque for all pulses, or one for each", "N m", (0.5, -1.0, 0.7),
    ),
)  # fmt: skip
def pulses(starts: Numbers, durations: Numbers, torque: Numbers | Iterable[Numbers]) -> StateTorque:
    """Return a torque that acts within pulses, and is 0 elsewhere.

    The impulse is torque times duration, even if the end of a pulse is rounded.

    Parameters
    ----------
    starts : iterable of numbers, shape (n,)
        1 to 10 000 times (s) at which the pulses begin, in any order.
    durations : iterable of numbers, shape (n,)
        The durations (s), above 0. A pulse may begin when another ends, not before.
    torque : three numbers, or iterable of three numbers, shape (n, 3)
        The torque about the body axes (N m), one for all pulses or one each.

    Returns
    -------
    StateTorque
        The torque about the body axes (N m).

    Raises
    ------
    InputError
        If pulses overlap, the numbers of starts, durations and torques differ, a duration is not
        above 0, or a number is not finite.

    References
    ----------
    B. Wie, Space Vehicle Dynamics and Control, 2nd edition, 2008, chapter 7 (thrusters).

    Examples
    --------
    >>> from pyharness.torques import pulses
    >>> thruster = pulses([1.0, 5.0], [0.5, 0.25], (0.0, 2.0, 0.0))
    >>> thruster.at(1.25, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    (0.0, 2.0, 0.0)
    """
    begins = _times("[torque] pulses starts", starts, 1, _MOST_PULSES).tolist()
    where = "[torque] pulses durations"
    allowed = "allowed: a list of numbers above 0, s"
    given = list(islice(number_list(where, durations, allowed), len(begins) + 1))
    if len(given) != len(begins):
        raise _other_number(where, "number", len(given), len(begins), "pulse")
    lengths = [finite(f"{where}, number {n}", each) for n, each in enumerate(given, 1)]
    for begin, length in zip(begins, lengths, strict=True):
        if not length > 0.0:
            raise InputError(f"{where}: {length:g} is not above 0; {allowed}")
        if begin + length == begin or begin + length > _LARGEST_TIME:
            raise InputError(
                f"{where}: the pulse that begins at {begin:g} s ends at {begin + length:g} s in "
                f"binary64; allowed: a later end, up to {_LARGEST_TIME:g} s"
            )
    where = "[torque] pulses torque"
    wanted = "allowed: three numbers, or three numbers for each pulse"
    given = list(islice(number_list(where, torque, wanted), max(len(begins), 3) + 1))
    if any(isinstance(converted(each), float) for each in given):
        torques = [three(where, given)] * len(begins)
    else:
        torques = _rows(where, given, len(begins), wanted, "pulse")
    ordered = sorted(zip(begins, lengths, torques, strict=True))
    ends = [begin + length for begin, length, _ in ordered]
    for n, (after, _, _) in enumerate(ordered[1:]):
        begin = ordered[n][0]
        if begin < after and abs(ends[n] - after) <= _TOUCHING * math.ulp(after):
            ends[n] = after
        if ends[n] > after:
            raise InputError(
                f"[torque] pulses: the pulse that begins at {begin:g} s overlaps the one that "
                f"begins at {after:g} s; allowed: pulses that do not overlap"
            )
    times, values = [_before(ordered[0][0], ends[0])], [(0.0, 0.0, 0.0)]
    begun = acting = 0.0  # start and total duration (s) of the last equal pulses that touch
    for n, (begin, length, each) in enumerate(ordered):
        if n and ends[n - 1] == begin and ordered[n - 1][2] == each:
            acting += length
            del times[-2:], values[-2:]
        else:
            begun, acting = begin, length
            if times[-1] == begin:
                del times[-1], values[-1]
        # Compensates for the rounding of the end, so that the impulse is torque times duration.
        factor = acting / (ends[n] - begun)
        x, y, z = each
        times += [begun, ends[n]]
        values += [(factor * x, factor * y, factor * z), (0.0, 0.0, 0.0)]
    axes = np.array(values).T
    held = [_piecewise(np.array(times), axis, "held", "[torque] pulses") for axis in axes]
    different = any(each != torques[0] for each in torques)
    return ready_term(
        "pulses",
        _torque(held),
        starts=begins,
        durations=lengths,
        torque=torques if different else torques[0],
    )


def _times(where: str, values: Any, fewest: int, most: int) -> Array:
    allowed = f"allowed: a list of {fewest} to {most} times, s"
    values = _as_array(values)
    if type(values) is np.ndarray and values.dtype.kind in "iuf" and values.ndim == 1:
        values = values.tolist()
    given = list(islice(number_list(where, values, allowed), most + 1))
    if not fewest <= len(given) <= most:
        count = f"more than {most}" if len(given) > fewest else str(len(given))
        raise InputError(f"{where}: {count} times; {allowed}")
    found = np.array([finite(f"{where}, number {n}", each) for n, each in enumerate(given, 1)])
    largest = found[np.abs(found).argmax()]
    if abs(largest) > _LARGEST_TIME:
        raise InputError(
            f"{where}: {largest:g}; allowed: from -{_LARGEST_TIME:g} to {_LARGEST_TIME:g} s"
        )
    return found


def _other_number(where: str, thing: str, given: int, wanted: int, what: str) -> InputError:
    count = f"more than {counted(wanted, thing)}" if given > wanted else counted(given, thing)
    due = counted(wanted, what)
    return InputError(f"{where}: {count} for {due}; allowed: one for each {what}")


def _before(first: float, second: float) -> float:
    """Return the start of a piece that ends at `first` and has the length of the next piece."""
    return min(2.0 * first - second, math.nextafter(first, -math.inf))


def _piecewise(times: Array, values: Array, interpolation: str, where: str) -> Table:
    """Return the table of a function, constant beyond the first and the last value."""
    is_held = interpolation == "held"
    pieces = np.zeros((len(values) - (not is_held), 4))
    pieces[:, 0] = values[: len(pieces)]
    if is_held:
        return Table(times, pieces)
    with np.errstate(all="ignore"):
        if interpolation == "linear":
            pieces[:, 1] = np.diff(values) / np.diff(times)
        else:
            # Imported late, because few scenes have a spline.
            from scipy.interpolate import CubicSpline

            try:
                # Very different distances of times cause a warning, but hardly an error.
                with warnings.catch_warnings(action="ignore"):
                    pieces = CubicSpline(times, values).c[::-1].T
            except (ValueError, ArithmeticError, np.linalg.LinAlgError):
                pieces[:] = np.nan
    if not np.isfinite(pieces).all():
        raise InputError(
            f"{where}: a slope or a coefficient overflows; allowed: smaller values, or times with "
            "a larger distance"
        )
    first = _before(float(times[0]), float(times[1]))
    ends = np.zeros((2, 4))
    ends[:, 0] = values[[0, -1]]
    return Table([first, *times.tolist()], np.concatenate((ends[:1], pieces, ends[1:])))


def _torque(axes: Sequence[Table]) -> Function:
    reduced = [without_equal_constants(each) for each in axes]
    return lambda time, omega, attitude: [value_of_table(each, time) for each in reduced]
