"""Axes of a sweep's grid, each of which varies a field of the scene or solver."""

import math
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.system.parameters import INERTIA_ELEMENTS
from pyharness.model.errors import InputError, kind_of, kind_or_empty, unknown
from pyharness.model.scene import most_steps
from pyharness.model.scene_file import check_keys
from pyharness.model.values import finite, integer

Floats = NDArray[np.float64]

# Fields whose values are names.
CHOICES = {
    "program": "a program of the appendix",
    "method": "a method",
    "listing": "original, corrected, or fix:NAME+NAME, keep:NAME+NAME",
    "reading": "adopted, or readings that are not, as NAME+NAME",
}


@dataclass(frozen=True)
class Field:
    """A number of a scene or solver that an axis may vary."""

    units: str
    title: str
    allowed: str = "a finite number"  # description of accepted values
    takes: Callable[[float], bool] = lambda value: True  # whether a value is accepted
    # whether scenes of one call share the value; see `looped_fields`
    looped: bool = False
    whole: bool = False  # whether values are rounded to integers


# Prefix of the constants of a torque's expressions, as in `torque.constants.k`.
CONSTANTS = "torque.constants."
INERTIA = "body.inertia."
ELEMENTS = {f"{i + 1}{j + 1}": (i, j) for i, j in INERTIA_ELEMENTS}
ATTITUDE = tuple(f"attitude.{number}" for number in range(4))


_ABOVE_ZERO: tuple[str, Callable[[float], bool]] = ("a number above 0", lambda value: value > 0.0)
_FROM_ZERO: tuple[str, Callable[[float], bool]] = ("a number from 0", lambda value: value >= 0.0)


def _from_zero_to_one(value: float) -> bool:
    return 0.0 < value <= 1.0


def _three(name: str, *about: Any) -> dict[str, Field]:
    return {f"{name}.{number}": Field(*about) for number in (1, 2, 3)}


NUMBERS = {
    **_three("omega", "rad/s", "initial angular velocity"),
    "omega.magnitude": Field("rad/s", "its length", *_FROM_ZERO),
    "tilt": Field("rad", "its angle from the axis of the middle moment"),
    "azimuth": Field("rad", "its angle about that axis, from the axis of the least moment"),
    "height": Field(
        "1", "its third component over its length", "-1 to 1", lambda v: -1.0 <= v <= 1.0
    ),
    "longitude": Field("rad", "its angle about the third axis, from the first"),
    **_three("body.moments", "kg m2", "moments", *_ABOVE_ZERO),
    **{f"{INERTIA}{name}": Field("kg m2", "element of the inertia matrix") for name in ELEMENTS},
    **_three("body.coefficients", "1", "coefficients A, B, C"),
    "body.ratio.1": Field("1", "I1 over I3", *_ABOVE_ZERO),
    "body.ratio.2": Field("1", "I2 over I3", *_ABOVE_ZERO),
    "body.square.1": Field(
        "1", "middle second moment over largest", "0 to 1, not 0", _from_zero_to_one
    ),
    "body.square.2": Field(
        "1", "least second moment over middle", "0 to 1", lambda v: 0.0 <= v <= 1.0
    ),
    **_three("torque.constant", "N m", "constant torque"),
    **_three("torque.rate", "N m/s", "torque that grows with time"),
    **{name: Field("1", "initial attitude, a quaternion, scalar first") for name in ATTITUDE},
    "t_end": Field("s", "time of the end"),
    "tolerance": Field("1", "tolerance", "above 0, to 1", _from_zero_to_one, looped=True),
    "step_size": Field("s", "step", *_ABOVE_ZERO, looped=True),
    "steps": Field(
        "1",
        "steps",
        "1 to what fits in this machine's memory",
        lambda v: 1.0 <= v <= most_steps(),
        looped=True,
        whole=True,
    ),
    "lipschitz": Field("1/s", "constant of the stop test", *_FROM_ZERO, looped=True),
}
_POLAR = ("omega.magnitude", "tilt", "azimuth", "height", "longitude")
# Pairs of groups of fields, by the beginnings of their names. A field of one group excludes those
# of the other, mostly because both describe one quantity.
RIVALS = (
    (("omega.1", "omega.2", "omega.3"), _POLAR),
    (("tilt", "azimuth"), ("height", "longitude")),
    (("body.moments",), ("body.coefficients", "body.ratio", "body.square")),
    (("body.coefficients",), ("body.ratio", "body.square")),
    (("body.ratio",), ("body.square",)),
    (("program",), ("method", "t_end", "tolerance")),
    (("listing", "reading", "lipschitz"), ("method", "t_end", "tolerance")),
)


def field_names() -> list[str]:
    return [*NUMBERS, *CHOICES]


def number_field(name: str) -> Field:
    if name.startswith(CONSTANTS):
        return Field("", "constant of the torque's expressions", looped=True)
    return NUMBERS[name]


def units_of(field: str) -> str:
    return NUMBERS[field].units if field in NUMBERS else ""


# Most values on one axis: all are in memory at once, and in one file.
MOST_VALUES = 30_000_000
SPACINGS = ("linear", "log")
# Random distributions, with the keys of their parameters in a sweep file.
DRAWS = {
    "uniform": ("from", "to"),
    "log-uniform": ("from", "to"),
    "normal": ("mean", "deviation"),
    # Angles between a fixed axis and directions that are uniform on the sphere.
    "sphere": (),
}
_SPREAD_KEYS = ("count", "spacing", "from", "to", "draw", "mean", "deviation", "seed")
_SAMPLE = "sample"


@dataclass(frozen=True)
class Axis:
    """One axis of a sweep's grid, which varies a `field` such as ``omega.1``."""

    field: str
    dimension: str  # axes of the same dimension vary together
    count: int
    how: str  # "listed", a spacing of SPACINGS, or a distribution of DRAWS
    values: tuple[Any, ...]  # all values, the first and last, or the distribution's parameters
    seed: int = 0  # of a distribution

    @property
    def is_choice(self) -> bool:
        return self.field in CHOICES

    def coordinates(self) -> NDArray[Any]:
        """Return all values, shape (count,); cached, so do not change them."""
        return _coordinates(self)


@lru_cache(maxsize=32)
def _coordinates(axis: Axis) -> NDArray[Any]:
    found: NDArray[Any]
    if axis.how == "listed":
        found = np.array(axis.values, dtype=object if axis.is_choice else np.float64)
    elif axis.how == "linear":
        first, last = axis.values
        found = _between(first, last, lambda a, b: np.linspace(a, b, axis.count))
    elif axis.how == "log":
        found = np.geomspace(axis.values[0], axis.values[1], axis.count)
    else:
        found = _draw(axis)
    if not axis.is_choice and number_field(axis.field).whole:
        found = np.rint(found)
    found.setflags(write=False)
    return found


def _draw(axis: Axis) -> Floats:
    # All values are drawn at once, so that they do not depend on the chunks. Each field has its own
    # random sequence.
    seeds = np.random.SeedSequence([axis.seed, zlib.crc32(axis.field.encode())])
    source = np.random.Generator(np.random.Philox(seeds))
    if axis.how == "sphere":
        return np.arccos(source.uniform(-1.0, 1.0, axis.count))
    first, second = axis.values
    if axis.how == "normal":
        return source.normal(first, second, axis.count)
    low, high = min(first, second), max(first, second)
    if axis.how == "uniform":
        return _between(low, high, lambda a, b: source.uniform(a, b, axis.count))
    drawn = np.exp(source.uniform(math.log(low), math.log(high), axis.count))
    # Rounding may put a value beyond the ends, and even beyond the range of floats.
    return np.clip(drawn, low, high)


def _between(first: float, last: float, made: Callable[[float, float], Floats]) -> Floats:
    """Return ``made(first, last)``, even if ``last - first`` overflows."""
    if math.isfinite(last - first):
        return made(first, last)
    # Numbers as large as these are halved and doubled without rounding.
    with np.errstate(over="ignore"):
        doubled = 2.0 * made(0.5 * first, 0.5 * last)
    return np.clip(doubled, min(first, last), max(first, last))


def check_name(what: str, name: object, allowed: Iterable[str], where: str = "") -> str:
    if not isinstance(name, str) or name not in allowed:
        raise unknown(what, name, allowed, where)
    return name


def axis_of(table: object, number: int) -> Axis:
    where = f"[[axis]] {number}"
    if not isinstance(table, dict):
        raise InputError(f"{where} is {kind_of(table)}; it must be a table [[axis]]")
    check_keys(table, ("field", "dimension", "values", *_SPREAD_KEYS), where)
    if "field" not in table:
        raise InputError(f"{where}: field is missing; allowed: {', '.join(field_names())}")
    field = table["field"]
    if not isinstance(field, str) or not (field in field_names() or field.startswith(CONSTANTS)):
        raise unknown("field", field, field_names(), where)
    where = f"{where} ({field})"
    dimension = table.get("dimension", _SAMPLE if "draw" in table else field)
    if not isinstance(dimension, str) or not dimension or not dimension.isprintable():
        raise InputError(f"{where}: dimension must be text; allowed: a name")
    if "/" in dimension or dimension.startswith((".", "_")):
        raise InputError(
            f"{where}: dimension '{dimension}'; allowed: a name without '/' that does not begin "
            "with '.' or '_'"
        )
    if "values" in table:
        return _listed(where, table, field, dimension)
    if field in CHOICES:
        raise InputError(f"{where}: values is missing; give a list of names")
    return _spread(where, table, field, dimension)


def _listed(where: str, table: dict[str, Any], field: str, dimension: str) -> Axis:
    _refuse(where, table, "values", _SPREAD_KEYS)
    values = table["values"]
    if not isinstance(values, list) or not values:
        raise InputError(f"{where}: values is {kind_or_empty(values)}; allowed: a list, not empty")
    if field in CHOICES:
        for each in values:
            if not isinstance(each, str):
                raise InputError(f"{where}: {kind_of(each)} where a name belongs")
        if len(set(values)) < len(values):
            raise InputError(f"{where}: a name is given twice; give each name once")
        return Axis(field, dimension, len(values), "listed", tuple(values))
    floats = tuple(finite(where, each) for each in values)
    for each in floats if number_field(field).whole else ():
        if not each.is_integer():
            raise InputError(f"{where}: {each:g}; allowed: whole numbers")
    return _checked(where, Axis(field, dimension, len(values), "listed", floats))


def _spread(where: str, table: dict[str, Any], field: str, dimension: str) -> Axis:
    if "count" not in table:
        raise InputError(f"{where}: give either values, or from, to and count, or draw and count")
    count = integer(f"{where} count", table["count"])
    if not 1 <= count <= MOST_VALUES:
        shown = str(count) if abs(count) < 10**18 else "of more than 18 digits"
        raise InputError(f"{where}: count {shown}; allowed: 1 to {MOST_VALUES} on one axis")
    keys: tuple[str, ...] = ("from", "to")
    if "draw" in table:
        how = check_name("distribution", table["draw"], DRAWS, f"{where} draw")
        _refuse(where, table, "draw", ("spacing",))
        keys = DRAWS[how]
        if "seed" not in table:
            raise InputError(f"{where}: seed is missing; give a whole number from 0")
    else:
        how = check_name("spacing", table.get("spacing", "linear"), SPACINGS, f"{where} spacing")
    used = {*keys, "seed"} if "draw" in table else {*keys}
    _refuse(where, table, how, sorted({"from", "to", "mean", "deviation", "seed"} - used))
    for key in keys:
        if key not in table:
            raise InputError(f"{where}: {key} is missing; {how} takes {' and '.join(keys)}")
    ends = tuple(finite(f"{where} {key}", table[key]) for key in keys)
    if how.startswith("log") and not all(each > 0.0 for each in ends):
        raise InputError(f"{where}: {how} from {ends[0]:g} to {ends[1]:g}; allowed: above 0")
    if how == "normal" and ends[1] < 0.0:
        raise InputError(f"{where}: deviation {ends[1]:g}; allowed: a number from 0")
    seed = integer(f"{where} seed", table.get("seed", 0))
    if not 0 <= seed < 2**63:
        raise InputError(f"{where}: seed is out of range; allowed: a whole number from 0 to 2^63")
    return _checked(where, Axis(field, dimension, count, how, ends, seed))


def _refuse(where: str, table: dict[str, Any], chosen: str, keys: Iterable[str]) -> None:
    for key in keys:
        if key in table:
            raise InputError(f"{where}: {key} has no meaning with {chosen}")


def _checked(where: str, axis: Axis) -> Axis:
    field = number_field(axis.field)
    ends = axis.coordinates() if axis.how in ("normal", "sphere") else axis.values
    for value in (float(np.min(ends)), float(np.max(ends))):
        if not (math.isfinite(value) and field.takes(value)):
            raise InputError(f"{where}: {value:g}; allowed: {field.allowed}")
    return axis
