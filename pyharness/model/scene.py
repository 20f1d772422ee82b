"""Scenes: a body, a torque, initial conditions and steps, checked when created."""

import math
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields
from typing import TYPE_CHECKING, Any, SupportsIndex

from pyharness.model.attitude import Quaternion, Rotation, unit_quaternion
from pyharness.model.changing import Changing
from pyharness.model.errors import InputError, kind_of, printable
from pyharness.model.facts import facts
from pyharness.model.keywords import with_hints
from pyharness.model.own_states import BroughtStates, OwnState, checked_states
from pyharness.model.state_torque import StateTorque, checked_torque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import (
    Matrix,
    Number,
    Numbers,
    finite,
    integer,
    number,
    three,
    three_floats,
    triple,
)
from pyharness.model.values import Triple as Triple

if TYPE_CHECKING:
    from pyharness.model.inertia import Exact

# Bytes for the results of a step, eight binary64 numbers and the error code IER, in the kernel and
# again in the trajectory.
_BYTES_PER_STEP = 2 * (8 * 8 + 4)
# The compiled programs count steps and right-hand sides in 32 bits. A step evaluates at most five
# right-hand sides.
_COUNTABLE_STEPS = 400_000_000
_LONGEST_NAME = 60
# Modules whose stack frames may be between the user's call and the creation of a scene.
_BETWEEN = (
    *("copy", "dataclasses", "pyharness.engine.torques.scene_reader"),
    *("pyharness.model.keywords", "pyharness.model.scene_file", __name__),
)
# Ratio of the largest moment to an excess that rounding may cause.
_ROUNDED = 2**50
FULL_INERTIA = (
    "the scene has a full inertia matrix; allowed: moments, or the scene that pyharness.principal "
    "returns"
)
STATE_TORQUE = (
    "the scene's torque depends on the state; allowed: a TorqueLaw of constant, linear and "
    "sinusoidal terms of time; for this torque: solve, prepare, solve_many, compare_methods, and "
    "the verbs plan, prove, stress, and, with the method auto, run, compare and sweep"
)
CHANGING = (
    "the scene's inertia changes with time; allowed: a constant inertia; for a changing inertia: "
    "solve, prepare, solve_many, Stepper, and the verbs prove and run --method"
)
OWN_STATES = (
    "the scene has states of its own; allowed for it: Stepper, and, with the methods auto and "
    "taylor, solve, solve_many with one scene, and the verbs run and plan"
)
SPACE_TORQUE = (
    "the torque is about the axes of space; allowed: a torque about the axes of the body, or the "
    "methods auto and taylor with the attitude"
)


class ImpossibleBodyWarning(UserWarning):
    """A warning that the largest moment of a body exceeds the sum of the other two.

    The results are nevertheless computed.

    Examples
    --------
    >>> import warnings
    >>> from pyharness import ImpossibleBodyWarning, Scene
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", ImpossibleBodyWarning)
    ...     scene = Scene("impossible", (0.0, 1.0, 0.0), moments=(3.0, 1.0, 1.0))
    >>> scene.is_impossible
    True
    """


@dataclass(frozen=True)
class Scene:
    """A problem to solve: a body, the torque on it, and initial conditions.

    Exactly one of `moments`, `coefficients`, `inertia` and `changing` is required. Three numbers
    may be a list, a tuple or an array; the fields are tuples of floats.

    Parameters
    ----------
    name : str, optional
        A title, shortened to one line of 60 printable characters.
    omega : three numbers
        The angular velocity about the body axes at time 0 (rad/s).
    moments : three numbers, ChangingMoments, or function of t, optional
        The principal moments of inertia (kg m2). A function of the time t (s) must be continuous;
        `inertia_table` makes moments from a table.
    coefficients : three numbers, optional
        The dimensionless coefficients A, B, C of Euler's equations (13-15 of Jacobs 1982).
    torque : TorqueLaw, three numbers, StateTorque, or function of (t, omega[, attitude])
        The torque in N m; for `coefficients`, divided by the moments, in rad/s2 (default: none).
        `pyharness.torques` has functions that return a StateTorque. Your own function returns the
        components about the body axes. It is called with symbols, which record its arithmetic; if
        that fails, pass ``opaque(function)``.
    attitude : four numbers or scipy.spatial.transform.Rotation, optional
        The quaternion from body to space at time 0, scalar first. It is normalised.
    inertia : three rows of three numbers, ChangingInertia, or function of t, optional
        A symmetric inertia matrix about the body axes (kg m2).
    changing : ChangingMoments, ChangingInertia, or a recorded function, optional
        An inertia that changes with time. If given as `moments` or `inertia`, it is moved here, and
        that field becomes None.
    states : dict of str to float, or to pair of floats, optional
        Own states: at most eight unknowns beside omega and attitude, in any unit. The dict maps
        each name to its value at time 0, or to a pair of this value and a scale. The torque is then
        a function of ``(t, omega, states)`` or ``(t, omega, attitude, states)``, which returns the
        torque and a dict of the states' time derivatives. The error of a state is relative to its
        largest absolute value so far, or to the scale if larger.
    step_size : float
        The step size (s) of methods with a fixed step, and of the programs of the thesis. The
        arguments below are for these programs only.
    steps : int
        The number of steps.
    masses, forces : three numbers
        The masses (kg) and forces (N) in the equations of the translational velocity; by default as
        printed in the thesis.
    case : int, optional
        The number of the case in Table 1 of the thesis.
    t0 : float
        The time of the initial state (s), which other descriptions call time 0. Torque and inertia
        remain functions of the true time. `Trajectory.scene_at` returns such scenes.

    Raises
    ------
    InputError
        If a value is missing, not finite or out of range, or if the run does not fit in memory.

    Examples
    --------
    >>> from pyharness import Scene
    >>> scene = Scene("symmetric top", omega=(0.0, 1.0, 10.0), moments=(40.0, 40.0, 20.0))
    >>> scene.euler_coefficients
    (0.5, -0.5, 0.0)
    """

    name: str = "body"
    omega: Triple = ()  # type: ignore[assignment]  # required, in spite of the name's default
    moments: Triple | None = None
    coefficients: Triple | None = None
    torque: TorqueLaw | StateTorque = field(default_factory=TorqueLaw)
    attitude: Quaternion | None = None
    inertia: Matrix | None = None
    changing: Changing | None = None
    states: tuple[OwnState, ...] = ()
    _: KW_ONLY
    step_size: float = 0.01
    steps: int = 100
    masses: Triple = field(default_factory=lambda: tuple(facts("cases")["deck"]["masses"]))
    forces: Triple = field(default_factory=lambda: tuple(facts("cases")["deck"]["forces"]))
    case: int | None = None
    t0: float = 0.0
    # Norm of the attitude before normalisation.
    attitude_length: float = field(default=1.0, init=False, compare=False, repr=False)

    if TYPE_CHECKING:

        def __init__(
            self,
            name: str = "body",
            omega: Numbers = ...,
            moments: Numbers | Changing | Callable[[Any], Any] | None = None,
            coefficients: Numbers | None = None,
            torque: TorqueLaw | StateTorque | Numbers | Callable[..., Any] | None = None,
            attitude: Numbers | Rotation | None = None,
            inertia: Iterable[Numbers] | Changing | Callable[[Any], Any] | None = None,
            changing: Changing | None = None,
            states: Mapping[str, Number | Sequence[Number]] | tuple[OwnState, ...] = (),
            *,
            step_size: Number = 0.01,
            steps: SupportsIndex = 100,
            masses: Numbers = ...,
            forces: Numbers = ...,
            case: SupportsIndex | None = None,
            t0: Number = 0.0,
        ) -> None: ...

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InputError(
                f"name is {kind_of(self.name)}; allowed: text; in Python, write omega=, moments="
            )
        self._set("name", printable(" ".join(self.name.split()))[:_LONGEST_NAME].rstrip())
        self._set_changing()
        bodies = ("moments", "coefficients", "inertia", "changing")
        given = [each for each in bodies if getattr(self, each) is not None]
        if len(given) > 1:
            raise InputError(f"[body] has {' and '.join(given)}; allowed: one of them")
        if not given:
            raise InputError(
                "[body]: give either moments or coefficients, three numbers, or inertia, three rows"
            )
        if self.moments is not None:
            self._set("moments", _above_zero("[body] moments", "I", self.moments))
        if self.coefficients is not None:
            self._set("coefficients", three("[body] coefficients", self.coefficients))
        if self.inertia is not None:
            from pyharness.model.inertia import checked_inertia

            self._set("inertia", checked_inertia("[body] inertia", self.inertia))
        if isinstance(self.omega, tuple) and not self.omega:
            raise InputError("[initial] omega is missing; give three numbers, in rad/s")
        self._set("omega", three("[initial] omega", self.omega))
        if self.attitude is not None:
            unit, length = unit_quaternion("[initial] attitude", self.attitude)
            self._set("attitude", unit)
            self._set("attitude_length", length)
        if self.torque is None:
            self._set("torque", TorqueLaw())
        # A torque may bring its states, such as the momentum of wheels.
        brought = self.torque.starts if isinstance(self.torque, StateTorque) else ()
        has_none = isinstance(self.states, (tuple, Mapping)) and not self.states
        if has_none or isinstance(self.states, BroughtStates):
            self._set("states", BroughtStates(checked_states(brought)))
        else:
            self._set("states", checked_states(self.states))
        names = tuple(each.name for each in self.states)
        self._set("torque", checked_torque(self.torque, names))
        if self.torque.in_space and self.coefficients is not None:
            # Torque over moment has components about the axes of the body, which rotate.
            raise InputError(
                "[torque] frame is space, and the body is given by coefficients; allowed: moments "
                "or inertia"
            )
        self._set("step_size", number("[run] step_size", self.step_size))
        if not (math.isfinite(self.step_size) and self.step_size > 0.0):
            raise InputError(
                f"[run] step_size is {self.step_size:g}; "
                "allowed: a finite number above 0, in seconds"
            )
        self._set("steps", integer("[run] steps", self.steps))
        limit = most_steps()
        if not 1 <= self.steps <= limit:
            raise InputError(
                f"[run] steps is {_size(self.steps, limit)}; "
                f"allowed: 1 to {limit}, what fits in this machine's memory"
            )
        if not math.isfinite(self.step_size * self.steps):
            raise InputError("step size times steps is not finite; use fewer or smaller steps")
        self._set("masses", _above_zero("masses", "m", self.masses))
        self._set("forces", three("forces", self.forces))
        if self.case is not None:
            self._set("case", integer("case", self.case))
        self._set("t0", finite("[initial] t0", self.t0))
        _warn_of_impossible(self)

    def __repr__(self) -> str:
        shown = {each.name: getattr(self, each.name) for each in fields(self) if each.repr}
        usual = {each.name: each.default for each in fields(self)}
        usual |= {x.name: x.default_factory() for x in fields(self) if callable(x.default_factory)}
        given = {x: value for x, value in shown.items() if value != usual[x]}
        return f"Scene({', '.join(f'{x}={value!r}' for x, value in given.items())})"

    def __getstate__(self) -> dict[str, Any]:
        # Without the problems that `solve` keeps.
        return {name: each for name, each in self.__dict__.items() if name != "_kept"}

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def _set_changing(self) -> None:
        # Moved to `changing`, so that code for a constant inertia does not use it.
        for place in ("moments", "inertia"):
            given = getattr(self, place)
            if callable(given):
                from pyharness.model.inertia_function import inertia_function

                given = inertia_function(place, given)
            if isinstance(given, Changing) and self.changing is None:
                if given.place != place:
                    raise InputError(
                        f"[body] {place}: the value belongs to {given.place}; write {given.place}="
                    )
                self._set("changing", given)
                self._set(place, None)
        if self.changing is None:
            return
        if not isinstance(self.changing, Changing):
            raise InputError(
                f"changing is {kind_of(self.changing)}; it must be ChangingMoments or "
                "ChangingInertia"
            )
        if self.changing.is_constant and getattr(self, self.changing.place) is None:
            self._set(self.changing.place, self.changing.at(0.0))
            self._set("changing", None)

    @property
    def has_attitude(self) -> bool:
        """Whether the attitude is computed by default."""
        return self.attitude is not None or self.torque.needs_attitude

    @property
    def euler_coefficients(self) -> Triple:
        """The coefficients A = (I2 - I3)/I1, B, C of Euler's equations.

        Raise InputError for a full inertia matrix or changing inertia.
        """
        if self.coefficients is not None:
            return self.coefficients
        if self.moments is None:
            raise InputError(FULL_INERTIA if self.changing is None else CHANGING)
        first, second, third = self.moments
        return (second - third) / first, (third - first) / second, (first - second) / third

    @property
    def exact_moments(self) -> "Exact | None":
        """The principal moments (kg m2) as exact fractions; None with coefficients.

        Raise InputError for a full inertia matrix or changing inertia.
        """
        if self.coefficients is not None:
            return None
        if self.moments is None:
            raise InputError(FULL_INERTIA if self.changing is None else CHANGING)
        from fractions import Fraction

        return triple(map(Fraction, self.moments))

    @property
    def moments_low(self) -> Triple:
        """The exact moments minus `moments` (kg m2): 0 except in a `PrincipalScene`."""
        return 0.0, 0.0, 0.0

    @property
    def is_impossible(self) -> bool:
        """Whether no rigid body has the moments of inertia at time 0.

        The largest then exceeds the others' sum beyond rounding errors.
        """
        moments, inertia = self.moments, self.inertia
        if self.changing is not None:
            at_start: Any = self.changing.at(self.t0)
            moments, inertia = (at_start, None) if self.changing.is_diagonal else (None, at_start)
        if inertia is not None:
            from pyharness.model.inertia import principal_frame

            return breaks_triangle(principal_frame(inertia).exact_moments)
        return moments is not None and breaks_triangle(moments)

    @property
    def law(self) -> TorqueLaw:
        """The torque law; raise InputError for a StateTorque or a changing inertia."""
        if self.changing is not None:
            raise InputError(CHANGING)
        if isinstance(self.torque, StateTorque):
            raise InputError(STATE_TORQUE)
        return self.torque

    @property
    def body_torque(self) -> TorqueLaw:
        """The `law`; raise InputError also for a law about the axes of space."""
        if self.torque.in_space:
            raise InputError(SPACE_TORQUE)
        return self.law

    def times(self) -> list[float]:
        """Return the times (s) of a thesis program's results."""
        return [n * self.step_size for n in range(1, self.steps + 1)]

    def normalized_torque(self, time: float) -> Triple:
        """Return M = N / I, the torque over the moments (rad/s2), at `time` (s)."""
        first, second, third = self.body_torque.at(time)
        if self.moments is None:
            return first, second, third
        return first / self.moments[0], second / self.moments[1], third / self.moments[2]

    def right_hand_side(self) -> Callable[[float, Sequence[float]], list[float]]:
        """Return f(t, omega) (rad/s2) of Euler's equations (16-18 of Jacobs 1982)."""
        a, b, c = self.euler_coefficients
        varies, constant = self.body_torque.varies, self.normalized_torque(0.0)

        def rates(time: float, omega: Sequence[float]) -> list[float]:
            x, y, z = omega
            m1, m2, m3 = self.normalized_torque(time) if varies else constant
            return [m1 + a * y * z, m2 + b * x * z, m3 + c * x * y]

        return rates


# Wrapped here, because the decorator of a data class writes the method.
Scene.__init__ = with_hints(Scene.__init__)  # type: ignore[method-assign]


def breaks_triangle(moments: Iterable[Any]) -> bool:
    """Return whether the largest moment exceeds the others' sum by over 2**-50 of itself."""
    low, middle, high = sorted(moments)
    return bool((high - middle - low) * _ROUNDED > high)


def _warn_of_impossible(scene: Scene) -> None:
    frame, level = sys._getframe(), 1
    while frame.f_back is not None and frame.f_globals.get("__name__") in _BETWEEN:
        frame, level = frame.f_back, level + 1
    name = str(frame.f_globals.get("__name__"))
    if name.partition(".")[0] != "pyharness" and scene.is_impossible:
        warnings.warn(
            "no rigid body has these moments: the largest exceeds the sum of the others",
            ImpossibleBodyWarning,
            stacklevel=level,
        )


def most_steps() -> int:
    """Return the largest number of steps that half of the memory and 32-bit counters allow."""
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return min(memory // 2 // _BYTES_PER_STEP, _COUNTABLE_STEPS)


def _size(steps: int, limit: int) -> str:
    # Python refuses to format an integer of several thousand digits.
    if abs(steps) > 10**18:
        return "a number of more than 18 digits"
    size = f" (it would need {steps * _BYTES_PER_STEP / 1e9:.3g} GB)"
    return f"{steps}{size if steps > limit else ''}"


def any_scene(scene: object) -> Scene:
    return checked_scene(
        scene, any_axes=True, any_torque=True, any_state=True, changing=True, states=True, t0=True
    )


def checked_scene(
    scene: object,
    *,
    any_axes: bool = False,
    any_torque: bool = False,
    any_state: bool = False,
    changing: bool = False,
    states: bool = False,
    t0: bool = False,
) -> Scene:
    """Return `scene`; raise InputError unless it is a Scene that the flags allow."""
    if isinstance(scene, Scene):
        if scene.t0 and not t0:
            raise InputError(
                f"the scene begins at t0 = {scene.t0:g} s; allowed: 0; for other times: solve, "
                "solve_many, Stepper, and the verb run --method"
            )
        if scene.states and not states:
            raise InputError(OWN_STATES)
        if scene.changing is not None and not changing:
            raise InputError(CHANGING)
        if isinstance(scene.torque, StateTorque) and not any_state:
            raise InputError(STATE_TORQUE)
        if scene.torque.in_space and not any_torque:
            raise InputError(SPACE_TORQUE)
        if scene.inertia is not None and not any_axes:
            raise InputError(FULL_INERTIA)
        return scene
    raise InputError(f"scene is {kind_of(scene)}; it must be a Scene, as case_scene makes one")


def _above_zero(where: str, symbol: str, values: object) -> Triple:
    found = three_floats(where, values)
    for axis, value in enumerate(found, 1):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(
                f"{where}: {symbol}{axis} is {value:g}; allowed: a finite number above 0"
            )
    return found
