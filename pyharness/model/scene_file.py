"""Scenes of Table 1 of the thesis, and the text of scene files (TOML).

`pyharness.engine.torques.scene_reader` reads scene files.
"""

import os
import sys
import tomllib
from collections.abc import Iterable
from typing import Any, SupportsIndex

from pyharness.model.changing import Changing, ChangingInertia, ChangingMoments
from pyharness.model.errors import InputError, unknown
from pyharness.model.facts import facts
from pyharness.model.inertia_function import InertiaFunction
from pyharness.model.pipes import read_input
from pyharness.model.scene import Scene
from pyharness.model.schema import SCHEMAS, check_schema
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import integer

_LARGEST_FILE = 1_000_000
MOST_TERMS = 50  # tables [[torque.terms]] of a scene file
_WAVES = ("sines", "cosines")


def case_numbers() -> list[int]:
    return [entry["number"] for entry in facts("cases")["case"]]


def case_scene(number: SupportsIndex) -> Scene:
    """Return the scene of one case in Table 1 of Jacobs 1982.

    Parameters
    ----------
    number : int
        The case, 1 to 7.

    Returns
    -------
    Scene
        The case, with the common step size (0.01 s) and number of steps (100).

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
                torque=law_of_table(entry.get("torque", {})),
                step_size=deck["step_size"],
                steps=deck["steps"],
                case=number,
            )
    shown = str(number) if abs(number) < 10**18 else "of more than 18 digits"
    raise unknown("case", shown, map(str, case_numbers()))


def read_toml(path: str | os.PathLike[str], where: str) -> dict[str, Any]:
    return toml_of(read_file(path, where), where)


def read_file(path: str | os.PathLike[str], where: str) -> bytes:
    return read_input(path, where, _LARGEST_FILE, "a TOML file")


def toml_of(content: bytes, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise InputError(f"{where}: not UTF-8 text; TOML files are") from None
    except RecursionError:
        raise InputError(
            f"{where}: nested too deeply; the tables of a scene need few levels"
        ) from None
    except ValueError as error:
        if "integer string conversion" in str(error):
            most = sys.get_int_max_str_digits()
            raise InputError(
                f"{where}: a whole number is too long; allowed: at most {most} digits"
            ) from None
        raise InputError(f"{where}: not TOML: {' '.join(str(error).split())}") from None


def scene_text(scene: Scene, comments: Iterable[str] = ()) -> str:
    """Return the text of a scene file, without masses, forces and case.

    Raise InputError for Python functions and too long a text.
    """
    import json

    body, values = body_of(scene)
    torque = _torque_lines(scene)
    lines = [f"# {line}" for line in comments]
    lines.append(f"schema = {SCHEMAS['scene file']}")
    lines += [f"name = {json.dumps(scene.name, ensure_ascii=False)}", "[body]"]
    if values is None:
        raise InputError(
            f"[body] {body}: a function of time can't be written to a file; allowed: expressions, "
            "inertia_table, ChangingMoments or ChangingInertia"
        )
    lines += [f"{body} = {_toml(values) if isinstance(values, dict) else values}"]
    lines += ["[initial]", f"omega = {list(scene.omega)}"]
    if scene.attitude is not None:
        lines.append(f"attitude = {list(scene.attitude)}")
    if scene.t0:
        lines.append(f"t0 = {scene.t0!r}")
    lines += torque
    lines += ["[run]", f"step_size = {scene.step_size!r}", f"steps = {scene.steps}"]
    text = "\n".join(lines) + "\n"
    if (size := len(text.encode())) > _LARGEST_FILE:
        raise InputError(
            f"[torque]: the scene file would have {size} bytes; allowed: at most {_LARGEST_FILE}; "
            "use shorter tables or fewer pulses"
        )
    return text


def _torque_lines(scene: Scene) -> list[str]:
    torque = scene.torque
    if isinstance(torque, TorqueLaw):
        return ["[torque]", *_law_lines(torque)]
    if not (torque.expression or torque.terms):
        if torque.tape is None:
            kind = "an opaque function"
        elif torque.parts and all(map(_has_form, torque.parts)):
            kind = "a sum of several expressions or laws"
        else:
            kind = "recorded from a function"
        raise InputError(
            f"[torque]: a torque that is {kind} can't be written to a file; allowed: ready terms, "
            "expressions or a TorqueLaw, and the sum of ready terms and one of these"
        )
    count = sum(not isinstance(part, TorqueLaw) for part in torque.terms)
    if count > MOST_TERMS:
        raise InputError(f"[[torque.terms]]: {count} terms; allowed: at most {MOST_TERMS}")
    lines = ["[torque]"]
    if torque.expression:
        # The texts need no escapes: they have no quotes, backslashes or control characters.
        texts = ", ".join(f'"{text}"' for text in torque.expression[:3])
        lines += [f"expression = [{texts}]", "[torque.constants]"]
        lines += [f"{name} = {value!r}" for name, value in torque.constants]
    for part in torque.terms:
        if isinstance(part, TorqueLaw):
            lines += _law_lines(part)
        else:
            lines += ["[[torque.terms]]", *_term_lines(part, scene.changing)]
    for state, rate in zip(scene.states, torque.expression[3:], strict=True):
        lines += [f"[states.{state.name}]", f"start = {state.start!r}", f"scale = {state.scale!r}"]
        lines.append(f'rate = "{rate}"')
    return lines


def _term_lines(term: tuple[tuple[str, Any], ...], changing: Changing | None) -> list[str]:
    if any(isinstance(value, Changing) and value != changing for _, value in term):
        raise InputError(
            f"[torque]: a term {term[0][1]} whose changing inertia differs from the body's "
            "can't be written to a file; allowed: the inertia of the body"
        )
    return [f"{key} = {_toml(value)}" for key, value in term if not isinstance(value, Changing)]


def _has_form(torque: TorqueLaw | StateTorque) -> bool:
    return isinstance(torque, TorqueLaw) or bool(torque.expression or torque.terms)


def law_table(law: TorqueLaw) -> dict[str, Any]:
    """Return the table [torque] of a law, without its frame."""
    waves = {
        key: [{"amplitude": list(amplitude), "frequency": f} for amplitude, f in getattr(law, key)]
        for key in _WAVES
    }
    return {"constant": list(law.constant), "rate": list(law.rate), **waves}


def _law_lines(law: TorqueLaw) -> list[str]:
    lines = [f"{key} = {_toml(value)}" for key, value in law_table(law).items()]
    return lines if law.frame == "body" else [*lines[:2], f'frame = "{law.frame}"', *lines[2:]]


def _toml(value: Any) -> str:
    if isinstance(value, TorqueLaw):
        value = law_table(value)
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_toml(each)}' for key, each in value.items())} }}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, str):
        return f'"{value}"'
    return str(value).lower() if isinstance(value, bool) else repr(value)


def body_of(scene: Scene) -> tuple[str, Any]:
    if isinstance(scene.changing, InertiaFunction):
        return scene.changing.place, scene.changing.values()
    if isinstance(scene.changing, ChangingMoments):
        return "moments", as_lists(scene.changing.polynomials)
    if isinstance(scene.changing, ChangingInertia):
        return "inertia", as_lists(scene.changing.matrices)
    bodies = {key: getattr(scene, key) for key in ("inertia", "moments", "coefficients")}
    return next((key, as_lists(each)) for key, each in bodies.items() if each is not None)


def as_lists(value: Any) -> Any:
    if isinstance(value, TorqueLaw):
        return law_table(value)
    return list(map(as_lists, value)) if isinstance(value, tuple) else value


def law_of_table(table: dict[str, Any]) -> TorqueLaw:
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
    given = data.get("schema", SCHEMAS[kind])
    check_schema("top level", kind, given, "write it in that form, or take a version that reads it")


def check_keys(table: dict[str, Any], allowed: Iterable[str], where: str) -> None:
    for key in table:
        if key not in allowed:
            raise unknown("key", key, allowed, where)
