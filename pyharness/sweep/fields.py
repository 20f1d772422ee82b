"""Fields that an axis may vary: numbers of a scene or solver, and names of solvers."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

# Fields whose values are names, with the allowed values.
CHOICES = {
    "program": "a program of the appendix",
    "method": "a method",
    "listing": "original, corrected, or fix:NAME+NAME, keep:NAME+NAME",
    "reading": "adopted, or readings that are not, as NAME+NAME",
}


@dataclass(frozen=True)
class Field:
    """A number of a scene or solver that an axis may vary.

    `takes` returns whether a value is allowed; `allowed` describes the allowed values. If `looped`,
    all scenes of a batch share the value; step size and Lipschitz constant are exceptions for the
    thesis's programs. If `whole`, values are rounded to integers.
    """

    units: str
    title: str
    allowed: str = "a finite number"
    takes: Callable[[float], bool] = lambda value: True
    looped: bool = False
    whole: bool = False


# Prefix of fields that are constants of a torque's expressions, as in `torque.constants.k`. Their
# units depend on the expressions.
CONSTANTS = "torque.constants."
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
    "steps": Field("1", "steps", "1 and above", lambda v: v >= 1.0, looped=True, whole=True),
    "lipschitz": Field("1/s", "constant of the stop test", *_FROM_ZERO, looped=True),
}
# Pairs of groups of fields, by the beginnings of their names, that exclude each other, mostly
# because they describe the same quantity.
RIVALS = (
    (
        ("omega.1", "omega.2", "omega.3"),
        ("omega.magnitude", "tilt", "azimuth", "height", "longitude"),
    ),
    (("tilt", "azimuth"), ("height", "longitude")),
    (("body.moments",), ("body.coefficients", "body.ratio", "body.square")),
    (("body.coefficients",), ("body.ratio", "body.square")),
    (("body.ratio",), ("body.square",)),
    (("program",), ("method", "t_end", "tolerance")),
    (("listing", "reading", "lipschitz"), ("method", "t_end", "tolerance")),
)


def field_names() -> list[str]:
    """Return the fields that an axis may vary, without the constants of expressions."""
    return [*NUMBERS, *CHOICES]


def number_field(name: str) -> Field:
    """Return the field of a key of `NUMBERS`, or of a constant; raise KeyError for others."""
    if name.startswith(CONSTANTS):
        return Field("", "constant of the torque's expressions", looped=True)
    return NUMBERS[name]


def units_of(field: str) -> str:
    """Return the unit of a field; empty for names and constants."""
    return NUMBERS[field].units if field in NUMBERS else ""
