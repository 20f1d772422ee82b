"""Own states: unknowns of the user beside omega and attitude, such as integral terms."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from pyharness.model.errors import InputError, kind_of
from pyharness.model.fields import ESTIMATES, ROWS
from pyharness.model.values import finite

_LARGE = 1e120  # products of smaller states, and of their errors, are finite
MOST_STATES = 8  # the kernel has no place for more
# Names of other columns of results, and of other values in expressions.
_TAKEN = (
    *("t", "body", "ended", "axis", "component"),
    *(name for key, each in ROWS.items() for name in {key: None} | dict.fromkeys(each.columns)),
    *ESTIMATES.columns,
)


class OwnState(NamedTuple):
    """An own state: its name, and its value at time 0 in any unit."""

    name: str
    start: float
    # Errors are relative to the largest absolute value so far, or to this if larger.
    scale: float = 0.0


class BroughtStates(tuple[OwnState, ...]):
    """Own states from a torque; a scene copied with another torque gets that torque's states."""

    __slots__ = ()


def checked_states(value: object) -> tuple[OwnState, ...]:
    if isinstance(value, tuple) and all(isinstance(each, OwnState) for each in value):
        names = [each.name for each in value]
        if len(set(names)) < len(names):
            raise InputError(f"states: a name is given twice; allowed: other than {names}")
        value = {name: pair for name, *pair in value}
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
    if not all(size == 0.0 or 1.0 / _LARGE <= size <= _LARGE for size in (abs(start), abs(scale))):
        raise InputError(
            f"{where}: {start:g}, scale {scale:g}; allowed: 0, and sizes from 1e-120 to 1e120; use "
            "another unit"
        )
    if scale < 0.0:
        raise InputError(f"{where}: the scale is {scale:g}; allowed: a number from 0 on")
    return OwnState(name, start, scale)
