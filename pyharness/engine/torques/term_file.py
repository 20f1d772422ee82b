"""Reading of torques from the tables [[torque.terms]] of scene files."""

from dataclasses import replace
from typing import Any

from pyharness.engine.torques import field_terms, table_terms, terms, wheel_terms
from pyharness.engine.torques.ready import FLAG, TORQUES, Argument, Ready
from pyharness.engine.torques.term_input import inertia_of
from pyharness.model.changing import Changing
from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.scene_file import MOST_TERMS, check_keys, law_of_table
from pyharness.model.state_torque import StateTorque
from pyharness.model.values import boolean

# In this order, whichever module was imported first.
_MODULES = (terms, wheel_terms, field_terms, table_terms)
KINDS: dict[str, Ready] = {
    name: each
    for module in _MODULES
    for name, each in TORQUES.items()
    if each.function.__module__ == module.__name__
}
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
    ready = KINDS[kind]
    check_keys(table, ("kind", *ready.arguments), f"{where}, {kind}")
    given = {key: value for key, value in table.items() if key != "kind"}
    for name, argument in ready.arguments.items():
        if name in given or name in ready.defaults:
            continue
        if not argument.is_of_body:
            raise InputError(
                f"{where}, {kind}: {name} is missing; keys: {', '.join(ready.arguments)}"
            )
        keys = [key for key in ("moments", "inertia") if key in body]
        if not keys:
            raise InputError(
                f"{where}, {kind}: inertia is missing, and [body] has no moments and no inertia; "
                "give inertia, kg m2"
            )
        given[name] = body[keys[0]]
        if not isinstance(given[name], Changing):
            inertia_of(f"[body] {keys[0]}", given[name])
    arguments = {
        key: _argument(f"{where}, {key}", value, ready.arguments[key])
        for key, value in given.items()
    }
    try:
        torque: StateTorque = ready.function(**arguments)
        return torque
    except InputError as error:
        raise _placed(error, where) from None


def _argument(where: str, value: object, argument: Argument) -> object:
    """Return a term's argument; a table becomes a law if the argument may be one."""
    if argument.form == FLAG:
        return boolean(where, value)
    if argument.frame is None:
        return value
    if isinstance(value, dict):
        check_keys(value, _LAW, where)
        try:
            return replace(law_of_table(value), frame=argument.frame)
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
