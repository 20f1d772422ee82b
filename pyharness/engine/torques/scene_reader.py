"""Reading of scenes from TOML files; `pyharness.model.scene_file` writes these."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pyharness.model.attitude import of_angles
from pyharness.model.changing import ChangingInertia, ChangingMoments
from pyharness.model.errors import InputError, kind_of
from pyharness.model.expressions import parsed
from pyharness.model.inertia_function import inertia_of_texts
from pyharness.model.scene import Scene
from pyharness.model.scene_file import (
    check_keys,
    check_written_schema,
    law_of_table,
    read_file,
    toml_of,
)
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw

_TEXTS = ("expression", "constants")
SCENE_TABLES = {
    "body": ("moments", "coefficients", "inertia"),
    "initial": ("omega", "attitude", "angles_deg", "sequence", "t0"),
    "torque": ("constant", "rate", "sines", "cosines", "frame", *_TEXTS, "terms"),
    "run": ("step_size", "steps"),
}
_STATE = ("start", "scale", "rate")
_TABLE = ("times", "values", "interpolation")


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """Return the scene that a TOML file describes.

    Parameters
    ----------
    path : str or path
        The path of the file, of at most 1 000 000 bytes. Without the key ``name``, the scene has
        the file's name.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    InputError
        If the file can't be read, is not TOML, has an unknown key, or lacks a value.

    Examples
    --------
    >>> from pyharness import read_scene
    >>> read_scene("brick.toml").omega
    (0.0, 1.0, 1.0)
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"scene file: {kind_of(path)}; allowed: a path, as text or a Path")
    path = os.fsdecode(path)
    where = f"scene file '{path}'"
    return scene_of_file(read_file(path, where), Path(path).stem, where)


def scene_of_file(content: bytes, default_name: str, where: str) -> Scene:
    data = toml_of(content, where)
    try:
        return scene_of(data, default_name)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def scene_of(data: dict[str, Any], default_name: str) -> Scene:
    check_written_schema(data, "scene file")
    every: dict[str, Sequence[str]] = {**SCENE_TABLES, "states": ()}
    check_keys(data, ("schema", "name", *every), "top level")
    tables: dict[str, dict[str, Any]] = {}
    for table, keys in every.items():
        tables[table] = data.get(table, {})
        if not isinstance(tables[table], dict):
            raise InputError(f"{table} is {kind_of(tables[table])}; it must be a table [{table}]")
        if table not in ("torque", "states"):
            check_keys(tables[table], keys, f"[{table}]")
    body, initial, run = _body(tables["body"]), tables["initial"], tables["run"]
    if "omega" not in initial:
        raise InputError("[initial] omega is missing; give three numbers in rad/s")
    states, rates = {}, {}
    for name, values in tables["states"].items():
        where = f"[states.{name}]"
        if not isinstance(values, dict):
            raise InputError(f"{where} is {kind_of(values)}; it must be a table with start, rate")
        check_keys(values, _STATE, where)
        if "rate" not in values:
            raise InputError(f"{where}: rate is missing; give an expression, as in '0.4*w3'")
        states[name] = (values.get("start", 0.0), values.get("scale", 0.0))
        rates[name] = values["rate"]
    return Scene(
        name=data.get("name", default_name),
        omega=initial["omega"],
        attitude=_attitude(initial),
        states=states,
        torque=_torque(tables["torque"], body, rates),
        t0=initial.get("t0", 0.0),
        **body,
        **run,
    )


def _body(table: dict[str, Any]) -> dict[str, Any]:
    moments, inertia = table.get("moments"), table.get("inertia")
    for place, given in (("moments", moments), ("inertia", inertia)):
        if isinstance(given, dict):
            check_keys(given, _TABLE, f"[body] {place}")
            if not {"times", "values"} <= given.keys():
                raise InputError(f"[body] {place}: a table needs times and values; give both")
            from pyharness.engine.torques.table_terms import inertia_table

            return {**table, place: inertia_table(**given)}
        if _has_texts(given):
            return {**table, place: inertia_of_texts(place, given)}
    if isinstance(moments, list) and _has_lists(moments):
        return {**table, "moments": ChangingMoments(moments)}
    if isinstance(inertia, list) and any(map(_has_lists, inertia)):
        return {**table, "inertia": ChangingInertia(inertia)}
    return table


def _has_texts(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, list) and any(map(_has_texts, value)))


def _has_lists(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(each, list) for each in value)


def _attitude(initial: dict[str, Any]) -> Any:
    given = [key for key in ("attitude", "angles_deg", "sequence") if key in initial]
    if given in ([], ["attitude"]):
        return initial.get("attitude")
    if given != ["angles_deg", "sequence"]:
        raise InputError(
            f"[initial]: {' and '.join(given)}; allowed: attitude, or both angles_deg and sequence"
        )
    return of_angles("[initial] angles_deg", initial["angles_deg"], initial["sequence"])


def _torque(
    table: dict[str, Any], body: dict[str, Any], rates: dict[str, Any]
) -> TorqueLaw | StateTorque:
    check_keys(table, SCENE_TABLES["torque"], "[torque]")
    given = {key: value for key, value in table.items() if key != "terms"}
    first: TorqueLaw | StateTorque
    if not (rates or any(key in given for key in _TEXTS)):
        first = law_of_table(given)
    elif "expression" not in given:
        what = "a scene with [states]" if rates else "constants"
        raise InputError(
            f"[torque]: expression is missing, which {what} must have; give three texts, as in "
            "expression = ['0', '0', '-0.4*w3']"
        )
    elif others := [key for key in given if key not in _TEXTS]:
        raise InputError(
            f"[torque]: expression and {others[0]}; allowed: expression with constants, or "
            "constant, rate, sines, cosines and frame"
        )
    else:
        first = parsed(given["expression"], given.get("constants", {}), rates)
    if "terms" not in table:
        return first
    from pyharness.engine.torques.term_file import read_terms

    terms = read_terms(table["terms"], body)
    return sum(terms[1:], terms[0]) + first if terms else first
