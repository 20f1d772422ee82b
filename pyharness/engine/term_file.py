"""Reading of torques from the tables [[torque.terms]] of scene files."""

from collections.abc import Callable
from dataclasses import replace
from inspect import Parameter, signature
from typing import Any

from pyharness.engine.field_terms import (
    gravity_gradient,
    in_space,
    magnetic_damping,
    magnetic_dipole,
)
from pyharness.engine.table_terms import pulses, table
from pyharness.engine.term_input import inertia_of
from pyharness.engine.terms import attitude_control, damping, drag, rate_control, wheels
from pyharness.model.changing import Changing
from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.scene_file import MOST_TERMS, check_keys, law_of_table
from pyharness.model.state_torque import StateTorque
from pyharness.model.values import boolean

Function = Callable[..., StateTorque]

KINDS: dict[str, Function] = {
    each.__name__: each
    for each in (
        *(damping, drag, rate_control, attitude_control, wheels),
        *(gravity_gradient, magnetic_dipole, magnetic_damping, in_space),
        *(table, pulses),
    )
}
# The axes of the arguments that may depend on time.
_FRAMES = {"motor": "body", "field": "space", "torque": "space"}
_LAW = ("constant", "rate", "sines", "cosines")


def read_terms(tables: object, body: dict[str, Any]) -> list[StateTorque]:
    if not isinstance(tables, list):
        raise InputError(
            f"[torque] terms is {kind_of(tables)}; it must be a list of tables [[torque.terms]]"
        )
    if len(tables) > MOST_TERMS:
        raise InputError(f"[[torque.terms]]: {len(tables)} terms; allowed: at most {MOST_TERMS}")
    return [_term(table, f"[[torque.terms]] {n}", body) for n, table in enumerate(tables, 1)]


def _term(table: object, where: str, body: dict[str, Any]) -> StateTorque:
    if not isinstance(table, dict):
        raise InputError(f"{where} is {kind_of(table)}; it must be a table [[torque.terms]]")
    if "kind" not in table:
        raise InputError(f"{where}: kind is missing; allowed: {', '.join(KINDS)}")
    kind = table["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        raise unknown("kind", kind, KINDS, where)
    parameters = signature(KINDS[kind]).parameters
    check_keys(table, ("kind", *parameters), f"{where}, {kind}")
    given = {key: value for key, value in table.items() if key != "kind"}
    if kind == "gravity_gradient" and "inertia" not in given:
        keys = [key for key in ("moments", "inertia") if key in body]
        if not keys:
            raise InputError(
                f"{where}, gravity_gradient: inertia is missing, and [body] has no moments and no "
                "inertia; give inertia, kg m2"
            )
        given["inertia"] = body[keys[0]]
        if not isinstance(given["inertia"], Changing):
            inertia_of(f"[body] {keys[0]}", given["inertia"])
    for name, parameter in parameters.items():
        if name not in given and parameter.default is Parameter.empty:
            raise InputError(f"{where}, {kind}: {name} is missing; keys: {', '.join(parameters)}")
    # The torque of pulses can't be a law.
    frames = {} if kind == "pulses" else _FRAMES
    arguments = {
        key: _argument(f"{where}, {key}", value, key, frames.get(key))
        for key, value in given.items()
    }
    try:
        return KINDS[kind](**arguments)
    except InputError as error:
        raise _placed(error, where) from None


def _argument(where: str, value: object, key: str, frame: str | None) -> object:
    """Return a term's argument; a table becomes a law about the axes of `frame`, if given."""
    if key == "per_axis":
        return boolean(where, value)
    if frame is None:
        return value
    if isinstance(value, dict):
        check_keys(value, _LAW, where)
        try:
            return replace(law_of_table(value), frame=frame)
        except InputError as error:
            raise _placed(error, where) from None
    if not isinstance(value, list):
        raise InputError(
            f"{where} is {kind_of(value)}; allowed: three numbers, or a table with constant, rate, "
            "sines or cosines"
        )
    return value


def _placed(error: InputError, where: str) -> InputError:
    message = str(error).removeprefix("[torque]").lstrip(": ")
    return InputError(f"{where}, {message}")
