"""Scenes for the cases of Table 1 of the thesis, and scenes in TOML files that users write."""

import os
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, SupportsIndex

from pyharness.model.attitude import of_angles
from pyharness.model.errors import InputError, kind_of, unknown
from pyharness.model.expressions import parsed
from pyharness.model.facts import facts
from pyharness.model.pipes import read_input
from pyharness.model.scene import Scene
from pyharness.model.schema import SCHEMAS, check_schema
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import integer

_LARGEST_FILE = 1_000_000
_TABLES = {
    "body": ("moments", "coefficients", "inertia"),
    "initial": ("omega", "attitude", "angles_deg", "sequence"),
    "torque": ("constant", "rate", "sines", "cosines", "frame", "expression", "constants"),
    "run": ("step_size", "steps"),
}
_WAVES = ("sines", "cosines")
_TEXTS = ("expression", "constants")


def case_numbers() -> list[int]:
    """Return the list of the numbers, 1 to 7, of the cases of Table 1 of the thesis."""
    return [entry["number"] for entry in facts("cases")["case"]]


def case_scene(number: SupportsIndex) -> Scene:
    """Return the scene (the problem to solve) of a case of Table 1 of the thesis.

    Parameters
    ----------
    number : int
        The number of the case, 1 to 7.

    Returns
    -------
    Scene
        The case, with the step size (0.01 s) and the number of steps (100) that all cases share.

    Raises
    ------
    InputError
        If there is no such case.

    Examples
    --------
    >>> from pyharness import case_scene
    >>> case_scene(2).moments
    (40.0, 40.0, 20.0)
    """
    number = integer("case", number)
    for entry in facts("cases")["case"]:
        if entry["number"] == number:
            deck = facts("cases")["deck"]
            return Scene(
                name=entry["title"],
                omega=entry["omega"],
                moments=entry["moments"],
                torque=_torque(entry.get("torque", {})),
                step_size=deck["step_size"],
                steps=deck["steps"],
                case=number,
            )
    shown = str(number) if abs(number) < 10**18 else "of more than 18 digits"
    raise unknown("case", shown, map(str, case_numbers()), "--case")


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """Return the scene (the problem to solve) that a TOML file describes.

    Parameters
    ----------
    path : str or path
        The path of the file, of at most 1 000 000 bytes. If the file has no key ``name``, the
        scene's name is the file's name without its suffix.

    Returns
    -------
    Scene
        The scene, with all its values checked.

    Raises
    ------
    InputError
        If the file can't be read, is not TOML, has an unknown key, or lacks a value.

    Examples
    --------
    >>> from pyharness import read_scene
    >>> read_scene("brick.toml").omega  # doctest: +SKIP
    (0.0, 1.0, 1.0)
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"scene file: {kind_of(path)}; allowed: a path, as text or a Path")
    path = os.fsdecode(path)
    where = f"scene file '{path}'"
    return scene_of_file(read_file(path, where), Path(path).stem, where)


def scene_of_file(content: bytes, default_name: str, where: str) -> Scene:
    """Return the scene that a TOML file, a scene file with the bytes `content`, describes.

    `default_name` is the name of the scene if the file has no key ``name``. Raise InputError, with
    `where` in front of the message, if the content is invalid.
    """
    data = toml_of(content, where)
    try:
        return scene_of(data, default_name)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def read_toml(path: str | os.PathLike[str], where: str) -> dict[str, Any]:
    """Return the data of a user's TOML file as a dictionary.

    Raise InputError, with `where` in front of the message, if the file can't be read or is not
    TOML.
    """
    return toml_of(read_file(path, where), where)


def read_file(path: str | os.PathLike[str], where: str) -> bytes:
    """Return the bytes of a user's TOML file.

    Raise InputError, with `where` in front of the message, if the file can't be read. A caller that
    needs the bytes twice must store them, because a pipe can be read only once.
    """
    return read_input(path, where, _LARGEST_FILE, "a TOML file")


def toml_of(content: bytes, where: str) -> dict[str, Any]:
    """Return the data in the content of a TOML file as a dictionary.

    Raise InputError, with `where` in front of the message, if the content is not TOML.
    """
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise InputError(f"{where}: not UTF-8 text; TOML files are") from None
    except RecursionError:
        raise InputError(f"{where}: nested too deeply; a scene has two levels") from None
    except ValueError as error:
        raise InputError(f"{where}: not TOML: {' '.join(str(error).split())}") from None


def scene_text(scene: Scene, comments: Iterable[str] = ()) -> str:
    """Return a scene as the text of a scene file, from which `read_scene` restores the scene.

    The restored numbers are bit-for-bit identical. Masses, forces and the number of the case are
    not written, because scene files have no keys for them. `comments` are lines at the beginning of
    the text. Raise InputError if the torque is an opaque function, or was recorded from a function.
    """
    import json

    body, values = body_of(scene)
    torque = _torque_lines(scene.torque)
    lines = [f"# {line}" for line in comments]
    lines.append(f"schema = {SCHEMAS['scene file']}")
    lines += [f"name = {json.dumps(scene.name, ensure_ascii=False)}", "[body]"]
    lines += [f"{body} = {values}"]
    lines += ["[initial]", f"omega = {list(scene.omega)}"]
    if scene.attitude is not None:
        lines.append(f"attitude = {list(scene.attitude)}")
    lines += torque
    lines += ["[run]", f"step_size = {scene.step_size!r}", f"steps = {scene.steps}"]
    return "\n".join(lines) + "\n"


def _torque_lines(torque: TorqueLaw | StateTorque) -> list[str]:
    """Return the lines of a scene file with the table of a torque."""
    if isinstance(torque, StateTorque):
        if not torque.expression:
            kind = "an opaque function" if torque.tape is None else "recorded from a function"
            raise InputError(
                f"[torque]: a torque that is {kind} can't be written to a file; allowed: "
                "expressions"
            )
        # The texts have printable characters of ASCII alone, and neither quotes nor backslashes.
        texts = ", ".join(f'"{text}"' for text in torque.expression)
        lines = ["[torque]", f"expression = [{texts}]", "[torque.constants]"]
        return lines + [f"{name} = {value!r}" for name, value in torque.constants]
    lines = ["[torque]", f"constant = {list(torque.constant)}", f"rate = {list(torque.rate)}"]
    if torque.frame != "body":
        lines.append(f'frame = "{torque.frame}"')
    for key, waves in (("sines", torque.sines), ("cosines", torque.cosines)):
        each = [f"{{ amplitude = {list(a)}, frequency = {f!r} }}" for a, f in waves]
        lines.append(f"{key} = [{', '.join(each)}]")
    return lines


def body_of(scene: Scene) -> tuple[str, list[Any]]:
    """Return the key and the value with which a scene file specifies the body of `scene`.

    The key is "moments" (kg m2), "coefficients" or "inertia" (kg m2). The value is a list.
    """
    if scene.inertia is not None:
        return "inertia", [list(row) for row in scene.inertia]
    if scene.moments is not None:
        return "moments", list(scene.moments)
    return "coefficients", list(scene.coefficients or ())


def scene_of(data: dict[str, Any], default_name: str) -> Scene:
    """Return the scene that `data`, the content of a scene file as a dictionary, describes.

    `default_name` is the name of the scene if the data have no key ``name``. Raise InputError if
    the data are invalid.
    """
    check_written_schema(data, "scene file")
    check_keys(data, ("schema", "name", *_TABLES), "top level")
    tables: dict[str, dict[str, Any]] = {}
    for table, keys in _TABLES.items():
        tables[table] = data.get(table, {})
        if not isinstance(tables[table], dict):
            raise InputError(f"{table} is {kind_of(tables[table])}; it must be a table [{table}]")
        if table != "torque":
            check_keys(tables[table], keys, f"[{table}]")
    body, initial, run = tables["body"], tables["initial"], tables["run"]
    if "omega" not in initial:
        raise InputError("[initial] omega is missing; give three numbers in rad/s")
    return Scene(
        name=data.get("name", default_name),
        omega=initial["omega"],
        attitude=_attitude(initial),
        torque=_torque(tables["torque"]),
        **body,
        **run,
    )


def _attitude(initial: dict[str, Any]) -> Any:
    given = [key for key in ("attitude", "angles_deg", "sequence") if key in initial]
    if given in ([], ["attitude"]):
        return initial.get("attitude")
    if given != ["angles_deg", "sequence"]:
        raise InputError(
            f"[initial]: {' and '.join(given)}; allowed: attitude, or angles_deg with a sequence"
        )
    return of_angles("[initial] angles_deg", initial["angles_deg"], initial["sequence"])


def _torque(table: dict[str, Any]) -> TorqueLaw | StateTorque:
    check_keys(table, _TABLES["torque"], "[torque]")
    if any(key in table for key in _TEXTS):
        if "expression" not in table:
            raise InputError(
                "[torque]: constants without expression; give an expression, a list of three "
                "texts, or constant, three numbers"
            )
        if others := [key for key in table if key not in _TEXTS]:
            raise InputError(
                f"[torque]: expression and {others[0]}; allowed: expression with constants, or "
                "constant, rate, sines, cosines and frame"
            )
        return parsed(table["expression"], table.get("constants", {}))
    waves = {key: _waves(f"[torque] {key}", table[key]) for key in _WAVES if key in table}
    return TorqueLaw(**{**table, **waves})


def _waves(where: str, entries: object) -> list[tuple[Any, Any]]:
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{where} must be a list of {{ amplitude = [..], frequency = .. }}")
    for entry in entries:
        check_keys(entry, ("amplitude", "frequency"), where)
        for key in ("amplitude", "frequency"):
            if key not in entry:
                raise InputError(f"{where}: {key} is missing")
    return [(entry["amplitude"], entry["frequency"]) for entry in entries]


def check_written_schema(data: dict[str, Any], kind: str) -> None:
    """Raise InputError if a file that users write has a schema number that is not supported.

    A schema number is the version of a file format. `data` are the data of the file, as a
    dictionary. A missing schema number is accepted, and stands for the supported one. `kind` is the
    kind of the file, as in "scene file".
    """
    given = data.get("schema", SCHEMAS[kind])
    check_schema("top level", kind, given, "write it in that form, or take a version that reads it")


def check_keys(table: dict[str, Any], allowed: Iterable[str], where: str) -> None:
    """Raise InputError if a table of a file has a key that is not among the keys in `allowed`.

    `where` names the table; the message begins with it.
    """
    for key in table:
        if key not in allowed:
            raise unknown("key", key, allowed, where)
