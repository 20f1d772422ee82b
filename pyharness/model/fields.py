"""Fields of trajectories and ensembles, each declared once.

Columns in files, pandas, xarray, HTML, JSON and reports, the change to other axes and units of
time, and the names that own states can't have come from these declarations.
"""

from collections.abc import Callable
from dataclasses import MISSING, dataclass, field, fields
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self, get_args

from numpy.typing import NDArray

from pyharness.model.array_type import Array, Maybe
from pyharness.model.changing import Changing
from pyharness.model.values import Triple

if TYPE_CHECKING:
    from pyharness.model.dense_output import DenseOutput
    from pyharness.model.scene import Scene
    from pyharness.model.trajectory import Stop


class Rows(NamedTuple):
    """Facts about a field with a row for each result."""

    about: str
    unit: str
    columns: tuple[str, ...]  # names of the components, or one name
    heads: tuple[str, ...]  # of these columns in a terminal; none if they are not shown
    dimension: str = ""  # of the components in xarray; if empty, each is a variable
    rates: int = 0  # exponent of 1/s in the unit
    turns: str = ""  # "vector" or "quaternion" about the body axes
    kind: str = "f8"  # type of the numbers

    @property
    def shape(self) -> tuple[int, ...]:
        return (len(self.columns),) if len(self.columns) > 1 else ()


class Quantity(NamedTuple):
    """A field with its values, to be shown or written."""

    name: str
    about: str
    unit: str
    columns: tuple[str, ...]
    dimension: str
    values: NDArray[Any]


def _name_components(name: str) -> tuple[str, ...]:
    return tuple(f"{name}{axis}" for axis in (1, 2, 3))


_TIME = Rows("time", "s", ("time",), ("time",), rates=-1)
_RECORDED_TIME = Rows(
    "time in the output file of the program", "s", ("recorded_time",), ("TIME",), rates=-1
)
_OMEGA = Rows(
    "angular velocity about the body axes", "rad/s",
    _name_components("omega"), _name_components("U"), "axis", rates=1, turns="vector",
)  # fmt: skip
_VELOCITY = Rows(
    "translational velocity along the body axes", "m/s",
    _name_components("velocity"), _name_components("V"), "axis", rates=1, turns="vector",
)  # fmt: skip
_COMPONENTS = ("q0", "q1", "q2", "q3")
_ATTITUDE = Rows(
    "quaternion from body to space", "1", _COMPONENTS, _COMPONENTS, "component", turns="quaternion"
)
_IER = Rows("error code of the linear solver", "1", ("ier",), (), kind="i4")
ESTIMATES = Rows("estimated error and error amplification", "1", ("error", "growth"), ())
_FACT = "a value in the header of files, and in the attributes of xarray"


def _find_rows(owner: type) -> dict[str, Rows]:
    """Return the fields of a dataclass with a row for each result."""
    found = {each.name: getattr(each.type, "__metadata__", (None,))[0] for each in fields(owner)}
    return {name: each for name, each in found.items() if isinstance(each, Rows)}


@dataclass(frozen=True, eq=False, repr=False)
class Fields:
    """The fields of a trajectory, which `Trajectory` explains."""

    time: Annotated[Array, _TIME]
    recorded_time: Annotated[Array, _RECORDED_TIME]
    omega: Annotated[Array, _OMEGA]
    velocity: Annotated[Maybe[Array], _VELOCITY]
    steps: Annotated[int, _FACT]
    evaluations: Annotated[int, _FACT]
    ended: Annotated[str, _FACT] = "complete"
    stop: "Maybe[Stop]" = None
    ier: Annotated[Maybe[NDArray[Any]], _IER] = None
    error: Annotated[Maybe[float], _FACT] = None
    growth: Annotated[Maybe[float], _FACT] = None
    reason: Annotated[str | None, _FACT] = field(default=None, repr=False)
    attitude: Annotated[Maybe[Array], _ATTITUDE] = None
    own: Maybe[Array] = None  # a row for each time, and columns from `Scene.states`
    moments: Triple | Changing | None = None
    axes: Maybe[Array] = None
    exact: Maybe[NDArray[Any]] = None
    tolerance: Annotated[Maybe[float], _FACT] = None
    scene: "Maybe[Scene]" = field(default=None, repr=False)
    sol: "Maybe[DenseOutput]" = field(default=None, repr=False)
    t_events: Maybe[list[Array]] = field(default=None, repr=False)
    y_events: Maybe[list[Array]] = field(default=None, repr=False)
    sensitivities: Maybe[dict[str, Array]] = field(default=None, repr=False)

    @classmethod
    def create(cls, **values: Any) -> Self:
        """Return an object with defaults for other fields; the constructor takes longer."""
        found = object.__new__(cls)
        found.__dict__.update(_DEFAULTS, **values)
        return found

    def with_values(self, **values: Any) -> Self:
        """Return a copy with other values; `dataclasses.replace` would compute the estimates."""
        found = object.__new__(type(self))
        found.__dict__.update(self.__dict__)
        found.__dict__.update(values)
        return found

    def estimate_later(self, estimates: Callable[[], tuple[float | None, float | None]]) -> Self:
        """Let this new object call `estimates` for `error` and `growth` when one is read."""
        content = self.__dict__
        content["_estimates"] = estimates
        for name in _ESTIMATED:
            del content[name]
        return self

    def __getstate__(self) -> dict[str, Any]:
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def with_rows(self) -> dict[str, Any]:
        """Return the arrays with a row for each time, by name."""
        found = {name: getattr(self, name) for name in (*ROWS, "own")}
        return {name: each for name, each in found.items() if each is not None}


class _Estimate:
    """A value that is in the instance, or computed there when it is first read."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, found: Any, _owner: type) -> Any:
        content = {} if found is None else found.__dict__
        if "_estimates" in content:
            content.update(zip(_ESTIMATED, content["_estimates"](), strict=True))
        return content.get(self._name)


_ESTIMATED = ("error", "growth")
for _each in _ESTIMATED:
    setattr(Fields, _each, _Estimate(_each))
_DEFAULTS = {each.name: each.default for each in fields(Fields) if each.default is not MISSING}
ROWS = _find_rows(Fields)
ENSEMBLE_ROWS = {"omega": _OMEGA, "attitude": _ATTITUDE, "estimates": ESTIMATES}
# By name, the types of facts.
FACTS: dict[str, Any] = {
    each.name: get_args(each.type)[0]
    for each in fields(Fields)
    if getattr(each.type, "__metadata__", ()) == (_FACT,)
}
