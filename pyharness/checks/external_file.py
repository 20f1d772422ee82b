"""Published results, and their files.

A file has a scene, the results' source, and their printed digits, which determine the accuracy.
"""

import math
import re
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache, partial
from pathlib import Path
from typing import Any

from pyharness.engine.torques.scene_reader import scene_of
from pyharness.model.attitude import IDENTITY, Quaternion, of_angles, unit_quaternion
from pyharness.model.errors import InputError, kind_of, printable, unknown
from pyharness.model.scene import Scene, checked_scene
from pyharness.model.scene_file import check_keys, check_written_schema, read_toml
from pyharness.model.values import number

UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180.0}

_FOLDER = Path(__file__).parent.parent / "data" / "external"
_TEXTS = ("title", "source", "where", "conditions")
_SCENE = ("body", "initial", "torque")
_PRINTED = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?")
_LONGEST_PRINT = 100


@dataclass(frozen=True)
class Figure:
    """A published number."""

    print: str  # digits as printed
    value: Decimal
    # error bound in the printed unit: half a unit of the last digit, or more if the source says so
    accuracy: float


@dataclass(frozen=True)
class Pointing:
    attitude: Quaternion  # unit quaternion
    accuracy: float  # error bound, rad


@dataclass(frozen=True)
class Value:
    time: str  # as printed (s); taken as exact
    # in the unit of the problem; None where nothing is printed
    omega: tuple[Figure | None, ...]
    pointing: Pointing | None = None


@dataclass(frozen=True)
class Problem:
    name: str  # name of its file
    title: str  # title as a sentence
    unit: str  # unit of the printed omega, one of `UNITS`
    scene: Scene  # equations and initial state; the step size is not used
    values: tuple[Value, ...]  # one for each time
    path: str | None = None  # None for a problem of the package


def figure(where: str, text: object, good_to: float = 0.0) -> Figure:
    """Return the published number printed as `text`.

    Its accuracy is half a unit of the last digit or, if larger, `good_to`.
    """
    if not isinstance(text, str):
        raise InputError(f"{where}: {kind_of(text)}; allowed: the digits as text, '0.606'")
    if len(text) > _LONGEST_PRINT or not _PRINTED.fullmatch(text):
        shown = text if len(text) <= 30 else text[:27] + "..."
        raise InputError(f"{where}: '{shown}'; allowed: a printed number, '-0.606' or '6.06e-01'")
    value = Decimal(text)
    if math.isinf(float(value)):
        raise InputError(f"{where}: '{text}' is too large for binary64")
    exponent = value.as_tuple().exponent
    assert isinstance(exponent, int)
    half_unit = float(Decimal(5).scaleb(exponent - 1))
    return Figure(text, value, max(half_unit, good_to, math.ulp(0.0)))


def read_problem(path: str | Path) -> Problem:
    """Return the problem in a user's file (docs/how-to/external.md), or raise InputError."""
    return _read(path, str(path))


@cache
def problems() -> tuple[Problem, ...]:
    return tuple(_read(path, None) for path in sorted(_FOLDER.glob("*.toml")))


def _read(path: str | Path, given: str | None) -> Problem:
    where = f"external file '{path}'"
    data = read_toml(path, where)
    try:
        return _problem(data, Path(path).stem, given)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _problem(data: dict[str, Any], name: str, given: str | None) -> Problem:
    check_written_schema(data, "external file")
    check_keys(data, ("schema", *_TEXTS, "unit", "sequence", *_SCENE, "value"), "top level")
    if not re.fullmatch(r"[\w.-]+", name):
        raise InputError(
            "the name of the file is the name of its checks; allowed: letters, digits, '-', "
            "'_' and '.'"
        )
    for key in _TEXTS:
        text = data.get(key)
        if not isinstance(text, str) or not text.strip():
            raise InputError(f"{key} is missing; give it as text")
    title = printable(" ".join(data["title"].split()))
    unit = data.get("unit", "rad/s")
    if not isinstance(unit, str) or unit not in UNITS:
        raise unknown("unit", str(unit), UNITS)
    for table in ("body", "initial"):
        if table not in data:
            raise InputError(f"[{table}] is missing")
    scene = checked_scene(scene_of({key: data[key] for key in _SCENE if key in data}, title))
    first, second, third = (w * UNITS[unit] for w in scene.omega)
    entries = data.get("value")
    if not isinstance(entries, list) or not entries:
        raise InputError("[[value]] is missing; give at least one, with time and omega")
    values: dict[float, Value] = {}
    for entry in entries:
        value = _value(entry, data.get("sequence"))
        if float(value.time) in values:
            raise InputError(f"[[value]] time {value.time} is given twice; give each time once")
        values[float(value.time)] = value
    told = tuple(values.values())
    attitude = (scene.attitude or IDENTITY) if any(value.pointing for value in told) else None
    scene = replace(scene, omega=(first, second, third), attitude=attitude)
    return Problem(name, title, unit, scene, told, given)


def _value(entry: object, sequence: object) -> Value:
    if not isinstance(entry, dict):
        raise InputError(f"[[value]] is {kind_of(entry)}; it must be a table")
    check_keys(entry, ("time", "omega", "attitude", "angles_deg", "good_to"), "[[value]]")
    time = figure("[[value]] time", entry.get("time", "")).print
    if float(time) == 0.0:
        raise InputError("[[value]] time is 0, the time of the initial state; give another time")
    where = f"[[value]] time {time}"
    good_to = number(f"{where}: good_to", entry.get("good_to", 0.0))
    if not (math.isfinite(good_to) and good_to >= 0.0):
        raise InputError(
            f"{where}: good_to is {good_to:g}; allowed: an error from 0 on, in the unit of the "
            "printed numbers"
        )
    pointing = _pointing(where, entry, sequence, good_to)
    prints = entry.get("omega", ["", "", ""] if pointing else None)
    if not isinstance(prints, list) or len(prints) != 3:
        raise InputError(
            f"{where}: omega must be a list of three texts; '' means that the component is "
            "not printed"
        )
    read = partial(figure, f"{where}: omega", good_to=good_to)
    omega = tuple(None if text == "" else read(text) for text in prints)
    if not any(omega) and pointing is None:
        raise InputError(f"{where}: no component of omega is given; give at least one")
    return Value(time, omega, pointing)


def _pointing(
    where: str, entry: dict[str, Any], sequence: object, good_to: float
) -> Pointing | None:
    given = [key for key in ("attitude", "angles_deg") if key in entry]
    if not given:
        return None
    if len(given) > 1:
        raise InputError(f"{where}: give either attitude or angles_deg")
    (key,) = given
    count, prints = {"attitude": 4, "angles_deg": 3}[key], entry[key]
    if not isinstance(prints, list) or len(prints) != count:
        raise InputError(f"{where}: {key} must be a list of {count} texts")
    # If an omega is given too, `good_to` is its accuracy, not the attitude's.
    alone = 0.0 if "omega" in entry else good_to
    figures = [figure(f"{where}: {key}", text, alone) for text in prints]
    values = [float(each.value) for each in figures]
    accuracy = math.hypot(*(each.accuracy for each in figures))
    if key == "attitude":
        q, length = unit_quaternion(f"{where}: attitude", values)
        return Pointing(q, 2.0 * accuracy / length)
    q = of_angles(f"{where}: angles_deg", values, sequence)
    return Pointing(q, math.radians(sum(each.accuracy for each in figures)))
