"""Declarations of ready torques and events.

Scene files and their schema, compiled leaves, documents, random scenes, run times and tests are
made from them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from inspect import Parameter, signature
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])
Values = dict[str, Any]  # of arguments, by name


@dataclass(frozen=True)
class Argument:
    """An argument; documents show its name, symbol, unit and remark."""

    form: dict[str, Any]  # its JSON schema
    about: str
    unit: str
    sample: Any
    symbol: str = ""
    remark: str = ""
    frame: str | None = None  # axes of a vector that may be a law of time
    is_of_body: bool = False  # whether the inertia of a scene file's body is the default


MATRIX, VECTOR, LAW, QUATERNION = (
    {"$ref": f"#/$defs/{name}"} for name in ("matrix", "vector", "law", "quaternion")
)
NUMBER, FLAG = {"type": "number"}, {"type": "boolean"}
matrix, vector, law, quaternion, number, flag = (
    partial(Argument, form) for form in (MATRIX, VECTOR, LAW, QUATERNION, NUMBER, FLAG)
)


def choice(*values: Any) -> Callable[..., Argument]:
    return partial(Argument, {"enum": list(values)})


def list_form(form: dict[str, Any], fewest: int, most: int) -> dict[str, Any]:
    return {"type": "array", "items": form, "minItems": fewest, "maxItems": most}


@dataclass(frozen=True)
class Ready:
    """A ready torque or event."""

    function: Callable[..., Any]
    about: str
    arguments: dict[str, Argument]
    formula: str = ""  # in Markdown
    note: str = ""  # on the formula
    convention: str = ""
    # From sizes of a random scene (`Sizes` of checks/scenes/state_scenes.py).
    draw: Callable[[Any], Values] | None = None
    # What differs from the sample in each torque whose leaves are built.
    leaves: tuple[Values, ...] = ({},)

    @property
    def sample(self) -> Values:
        return {name: each.sample for name, each in self.arguments.items()}

    @property
    def defaults(self) -> Values:
        given = signature(self.function).parameters
        return {
            name: given[name].default
            for name in self.arguments
            if given[name].default is not Parameter.empty
        }

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the table in a scene file."""
        properties: dict[str, Any] = {"kind": {"const": self.function.__name__}}
        for name, each in self.arguments.items():
            about = ", ".join(filter(None, (each.about, each.unit, each.remark)))
            properties[name] = {**each.form, "description": f"{about}."}
        optional = {*self.defaults, *(x for x, each in self.arguments.items() if each.is_of_body)}
        return {
            "type": "object",
            "description": f"{self.about}.",
            "properties": properties,
            "required": [name for name in properties if name not in optional],
            "additionalProperties": False,
        }


TORQUES: dict[str, Ready] = {}
EVENTS: dict[str, Ready] = {}


def ready_torque(
    about: str,
    formula: str,
    draw: Callable[[Any], Values],
    *,
    note: str = "",
    convention: str = "",
    leaves: tuple[Values, ...] = ({},),
    **arguments: Argument,
) -> Callable[[Function], Function]:
    """Declare a function as a ready torque, which is a `kind` in scene files."""
    return _declare_in(
        TORQUES, (), arguments, about=about, formula=formula, draw=draw, note=note,
        convention=convention, leaves=leaves,
    )  # fmt: skip


def ready_event(about: str, **arguments: Argument) -> Callable[[Function], Function]:
    """Declare a function as a ready event, which has `terminal` and `direction` too."""
    return _declare_in(EVENTS, ("terminal", "direction"), arguments, about=about)


def _declare_in(
    ready: dict[str, Ready], common: tuple[str, ...], arguments: dict[str, Argument], **more: Any
) -> Callable[[Function], Function]:
    def declare(function: Function) -> Function:
        name = function.__name__
        parameters = [each for each in signature(function).parameters if each not in common]
        for each in [*parameters, *arguments]:
            if each not in arguments:
                raise TypeError(f"{name}: {each} is a parameter, but not declared")
            if each not in parameters:
                raise TypeError(f"{name}: {each} is declared, but no parameter")
        ordered = {each: arguments[each] for each in parameters}
        ready[name] = Ready(function, arguments=ordered, **more)
        return function

    return declare
