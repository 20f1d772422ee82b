"""Torques that depend on the state: recorded, or opaque (called at each time)."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from pyharness.model.arguments import count_inputs, defaults_of, has_argument, third_argument
from pyharness.model.array_type import Array
from pyharness.model.attitude import product, quaternion_of_axes
from pyharness.model.called_function import called_once
from pyharness.model.errors import InputError, kind_of
from pyharness.model.numpy_protocol import symbol_array
from pyharness.model.own_states import OwnState
from pyharness.model.symbols import SYMBOLS, Recorder, Symbol, recorded_twice
from pyharness.model.tape import N_INPUTS, TIME, Tape, evaluate, float_outputs
from pyharness.model.torque_law import FRAMES, TorqueLaw, body_torque, law_value, to_body
from pyharness.model.values import Triple, are_several, converted, three_floats, triple

Function = Callable[..., Any]
_MOST_REPLAYED = 1_000_000  # most operations of an internal function
_ARGUMENTS = "allowed: a function of (t, omega), or of (t, omega, attitude)"
_CONSTANTS = ("args", "params", "parameters", "constants", "p", "k", "c")  # not attitudes
_WITH_STATES = (
    "a function of (t, omega, states) or (t, omega, attitude, states) that returns the torque and "
    "the rates of the states"
)


@dataclass(frozen=True)
class StateTorque:
    """A torque about the body axes that depends on time, omega and attitude.

    Its unit is N m; for a body with coefficients, it is torque over moment in rad/s2. A scene
    converts a function to a StateTorque, or to an equal TorqueLaw.

    Attributes
    ----------
    tape : Tape or None
        The recorded operations; None for an opaque torque, which is not recorded.
    function : callable or None
        The function that an opaque torque calls, else None.
    needs_attitude : bool
        Whether the torque depends on the attitude.
    expression, constants : tuple
        For a torque from a scene file, its three expressions, followed by one for the rate of each
        own state, and pairs of name and value of their constants; else empty.
    terms : tuple
        The other summands in a scene file: at most one `TorqueLaw`, and torques of
        `pyharness.torques`, each of these as pairs of key and value.
    parameters : tuple of pairs
        Name and value of each argument of the function whose default is a number.
    varied : Tape or None
        The recorded operations, with `parameters` as further inputs, after own states.
    own : tuple of str
        The names of the scene's own states (`Scene.states`). Their values are further inputs of the
        tape, and their time derivatives further outputs.
    starts : tuple of OwnState
        Own states that a scene with this torque gets if it defines none.
    parts : tuple
        The summands, if the torque is a sum.
    is_zero, varies, in_space : bool
        Always False, True and False, for code that also takes a `TorqueLaw`.
    """

    tape: Tape | None
    function: Function | None = None
    needs_attitude: bool = False
    expression: tuple[str, ...] = ()
    constants: tuple[tuple[str, float], ...] = ()
    terms: tuple[TorqueLaw | tuple[tuple[str, Any], ...], ...] = ()
    parameters: tuple[tuple[str, float], ...] = field(default=(), repr=False)
    varied: Tape | None = field(default=None, repr=False)
    own: tuple[str, ...] = ()
    starts: tuple[OwnState, ...] = field(default=(), compare=False, repr=False)
    parts: "tuple[StateTorque | TorqueLaw, ...]" = field(default=(), compare=False, repr=False)
    is_zero: bool = field(default=False, init=False, repr=False)
    varies: bool = field(default=True, init=False, repr=False)
    in_space: bool = field(default=False, init=False, repr=False)

    def __repr__(self) -> str:
        if self.tape is None:
            return f"StateTorque(opaque, needs_attitude={self.needs_attitude})"
        # Expressions and constants may be long, and are shortened as one text.
        parts = [f"{list(self.expression)}, {dict(self.constants)}"] if self.expression else []
        parts += [repr(x) if isinstance(x, TorqueLaw) else str(x[0][1]) for x in self.terms]
        given = " + ".join(parts)
        shown = given if len(given) <= 200 else f"{given[:197]}..."
        count = len(self.tape.operations)
        return (
            f"StateTorque({shown or 'recorded'}, {count} operations, "
            f"needs_attitude={self.needs_attitude})"
        )

    def at(
        self,
        time: float,
        omega: Sequence[float],
        attitude: Sequence[float],
        own: Sequence[float] = (),
    ) -> Triple:
        """Return the torque at `time` (s), omega (rad/s), attitude and own states; NaN if singular.

        Raise InputError for wrong numbers of components.
        """
        if len(omega) != 3 or len(attitude) != 4:
            raise InputError(
                f"[torque]: omega has {len(omega)} components, and the attitude {len(attitude)}; "
                "allowed: 3 and 4"
            )
        if self.tape is None:
            assert self.function is not None
            given = [time, np.array(omega)] + ([np.array(attitude)] if self.needs_attitude else [])
            return three_floats("[torque]", self.function(*given))
        try:
            return triple(float_outputs(self.tape, [time, *omega, *attitude, *own])[:3])
        except ZeroDivisionError:
            return math.nan, math.nan, math.nan

    def __add__(self, other: "StateTorque | TorqueLaw | Function | int") -> "StateTorque":
        """Return the sum with a torque, law or function (not `opaque`), or with 0 (for ``sum``)."""
        if type(other) is int and other == 0:
            return self
        if isinstance(other, (StateTorque, TorqueLaw)):
            second = other
        elif callable(other):
            second = recorded(other)
        else:
            return NotImplemented
        return _sum([*_list_summands(self), *_list_summands(second)])

    __radd__ = __add__

    def rotated(self, axes: Array) -> "StateTorque":
        """Return the torque with its arguments and components about new `axes` (columns).

        Raise InputError for an opaque torque.
        """
        if self.tape is None:
            raise InputError(
                "an opaque torque can't be transformed to principal axes; allowed: a torque that "
                "can be recorded, or a body with moments"
            )
        old = self.tape
        w, x, y, z = quaternion_of_axes(axes)

        def turned(time: Any, omega: Any, attitude: Any, *own: Any) -> Any:
            before = product(attitude, (w, -x, -y, -z))  # the attitude of the body's old axes
            found = torque_of(old, time, axes @ omega, before, *own)
            return [*(axes.T @ found[:3]), *found[3:]]

        return replayed(turned, self.own)


def torque_of(tape: Tape, time: Any, omega: Any, attitude: Any, *own: Any) -> Array:
    """Return the torque and the rates of `Scene.states` as symbols, from a tape and its inputs."""
    return np.array(evaluate(tape, [time, *omega, *attitude, *own], SYMBOLS), dtype=object)


def replayed(function: Function, own: tuple[str, ...] = ()) -> StateTorque:
    """Return the recorded torque of an internal function, without checks; `own` are own states."""
    tape = _recorded_with(Recorder(_MOST_REPLAYED, N_INPUTS + len(own)), function)
    return StateTorque(tape, None, tape.needs_attitude, own=own)


def _recorded_with(recorder: Recorder, function: Function) -> Tape:
    time, *state = recorder.inputs()
    omega, attitude = map(symbol_array, (state[:3], state[3:7]))
    return recorder.tape(list(function(time, omega, attitude, *state[7:])))


@lru_cache(maxsize=64)
def of_law(law: TorqueLaw) -> StateTorque:
    """Return a torque law as a recorded torque about the body axes."""
    given = turned_law if law.in_space else body_torque
    return replayed(lambda time, omega, attitude: given(law, time, attitude))


def turned_law(law: TorqueLaw, time: Symbol, attitude: Any) -> Array:
    """Return the body components of a torque law about the axes of space."""
    angles = [frequency * time for _, frequency in (*law.sines, *law.cosines)]
    terms = [time, *(wave(each) for each in angles for wave in (np.sin, np.cos))]
    value = law_value(law, time)
    # Each component has the terms of all waves, some with factor 0, so that laws with equally many
    # waves share compiled code.
    return to_body([x.with_terms_of(terms) for x in value] if law.varies else value, attitude)


def recorded(function: Function, states: Sequence[str] = ()) -> StateTorque:
    """Return the torque that a user's function computes, recorded with symbols.

    Use it for one of several summands; pass a scene's only torque function to `Scene` directly.

    Parameters
    ----------
    function : callable
        A function of (t, omega) or (t, omega, attitude) that returns the torque about the body axes
        (N m). Arguments with numbers as defaults are parameters for sensitivities.
    states : sequence of str
        The names of the scene's own states (`Scene.states`). With states, the function has a
        further argument, the dict of their values, and returns the torque and a dict of their time
        derivatives.

    Returns
    -------
    StateTorque
        The torque, which can be added to other torques.

    Raises
    ------
    InputError
        If the function can't be recorded, does not return three numbers, or returns different
        results in two calls, as with memory or random numbers.

    Examples
    --------
    >>> from pyharness import TorqueLaw
    >>> from pyharness.torques import recorded
    >>> total = TorqueLaw((1.0, 0.0, 0.0)) + recorded(lambda t, omega: -0.5 * omega)
    >>> total.at(0.0, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0))
    (0.5, -1.0, -1.5)
    """
    if not are_several(states):
        raise InputError(f"states is {kind_of(states)}; allowed: a list of names")
    names = tuple(states)
    if not all(isinstance(each, str) for each in names) or len(set(names)) < len(names):
        raise InputError(f"states: {list(names)!r}; allowed: different names, as texts")
    if names:
        return _with_states(function, names)
    takes_attitude = _takes_attitude(function)

    def called(time: Symbol, omega: Any, attitude: Any, **values: Symbol) -> list[Any]:
        given = (time, omega, attitude) if takes_attitude else (time, omega)
        allowed = "a function that returns three components in N m"
        with_values = partial(function, **values) if values else function
        return _checked_components(called_once(with_values, given, time.recorder, allowed))

    tape = recorded_twice(lambda recorder: _recorded_with(recorder, called), Recorder)
    torque = StateTorque(tape, None, tape.needs_attitude)
    return _with_parameters(torque, function, called)


def _with_states(function: Function, names: tuple[str, ...]) -> StateTorque:
    takes_attitude = count_inputs(function, "[torque]", f"allowed: {_WITH_STATES}", 3, 4) == 4

    def called(
        time: Symbol, omega: Any, attitude: Any, *states: Symbol, **values: Symbol
    ) -> list[Any]:
        own = dict(zip(names, states, strict=True))
        given = (time, omega, attitude, own) if takes_attitude else (time, omega, own)
        with_values = partial(function, **values) if values else function
        parts = called_once(with_values, given, time.recorder, _WITH_STATES)
        if len(parts) != 2:
            raise InputError(
                f"[torque]: the function returned {len(parts)} values; it must be {_WITH_STATES}"
            )
        return [*_checked_components(list(parts[0])), *_ordered_rates(parts[1], names)]

    new = partial(Recorder, n_inputs=N_INPUTS + len(names))
    tape = recorded_twice(lambda recorder: _recorded_with(recorder, called), new)
    torque = StateTorque(tape, None, tape.needs_attitude, own=names)
    return _with_parameters(torque, function, called)


def _checked_components(components: list[Any]) -> list[Any]:
    if len(components) != 3:
        raise InputError(f"[torque]: {len(components)} components; allowed: three")
    return components


def _ordered_rates(rates: Any, names: tuple[str, ...]) -> list[Any]:
    if not isinstance(rates, Mapping):
        found = list(np.atleast_1d(np.asarray(rates, dtype=object)))
        if len(found) != len(names):
            raise InputError(
                f"[torque]: {len(found)} rates of states; allowed: {len(names)}, those of "
                f"{_listed(names)}"
            )
        return found
    if set(rates) != set(names):
        raise InputError(
            f"[torque]: the function returned rates of the states {_listed(map(str, rates))}; "
            f"allowed: rates of {_listed(names)}"
        )
    return [rates[name] for name in names]


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


def opaque(function: Any) -> StateTorque:
    """Return a torque that is evaluated by calling a Python function.

    Only the methods of SciPy accept it.

    Parameters
    ----------
    function : callable
        A function of (t, omega) or (t, omega, attitude), where t is a float and the others are
        arrays, that returns the torque about the body axes (N m).

    Returns
    -------
    StateTorque
        The torque, for a `Scene`.

    Raises
    ------
    InputError
        If `function` has other arguments.

    Examples
    --------
    >>> from pyharness import Scene, opaque, solve
    >>> def brake(t, omega):
    ...     return [-0.1 if omega[0] > 0.5 else 0.0, 0.0, 0.0]
    >>> scene = Scene("brake", (1.0, 0.0, 0.0), moments=(1.0, 2.0, 3.0), torque=opaque(brake))
    >>> solve(scene, 1.0, "dop853").omega.round(6)
    array([[0.9, 0. , 0. ]])
    """
    return StateTorque(None, function, _takes_attitude(function))


def is_opaque(torque: object) -> bool:
    return isinstance(torque, StateTorque) and torque.tape is None


def has_switches(torque: object) -> bool:
    return isinstance(torque, StateTorque) and bool(torque.tape and torque.tape.n_switches)


def checked_torque(value: object, states: tuple[str, ...] = ()) -> TorqueLaw | StateTorque:
    found: TorqueLaw | StateTorque
    if isinstance(value, (TorqueLaw, StateTorque)):
        found = value
    elif isinstance(value, (list, tuple, np.ndarray)):
        found = TorqueLaw(three_floats("[torque]", value))
    elif callable(value):
        torque = recorded(value, states)
        found = law_of(torque) or torque
    else:
        raise InputError(
            f"[torque] is {kind_of(value)}; it must be three numbers, a TorqueLaw, or a function "
            "of (t, omega) or (t, omega, attitude)"
        )
    own = found.own if isinstance(found, StateTorque) else ()
    if own != states:
        raise InputError(
            f"states: {_listed(states)}, but the torque has rates of {_listed(own)}; "
            f"allowed: {_WITH_STATES}"
        )
    return found


def law_of(torque: StateTorque) -> TorqueLaw | None:
    """Return the torque law equal to a recorded torque, or None; laws have faster methods."""
    tape = torque.tape
    if tape is None or torque.own or tape.inputs - {TIME}:
        return None
    frequencies, waves = {TIME: 1.0}, {}
    for slot, (kind, operands, linear, _) in enumerate(tape.operations, N_INPUTS):
        if linear is not None and not linear.constant and [x for x, _ in linear.terms] == [TIME]:
            ((_, frequencies[slot]),) = linear.terms
        elif kind in ("sine", "cosine") and operands[0] in frequencies:
            waves[slot] = kind, frequencies[operands[0]]
        else:
            return None
    terms = [dict(output.terms) for output in tape.outputs]
    if not {slot for each in terms for slot in each} <= {TIME, *waves}:
        return None

    def amplitude(slot: int) -> list[float]:
        return [each.get(slot, 0.0) for each in terms]

    def those(wanted: str) -> list[tuple[list[float], float]]:
        return [(amplitude(slot), f) for slot, (kind, f) in waves.items() if kind == wanted]

    constant = [output.constant for output in tape.outputs]
    law = TorqueLaw(constant, amplitude(TIME), those("sine"), those("cosine"))
    if torque.parameters or torque.constants:
        object.__setattr__(law, "named", torque)
    return law


def _with_parameters(torque: StateTorque, function: Function, called: Function) -> StateTorque:
    values = {
        name: value
        for name, default in defaults_of(function).items()
        if type(default) is not bool
        if isinstance(value := converted(default), float) and math.isfinite(value)
    }

    def recorded_with(names: Sequence[str]) -> Tape | None:
        n_own = len(torque.own)
        recorder = Recorder(n_inputs=N_INPUTS + n_own + len(names))
        # An exponent is no parameter: its value determines which operations are recorded.
        recorder.has_powers = not names

        def named(time: Symbol, omega: Any, attitude: Any, *inputs: Symbol) -> Any:
            values = dict(zip(names, inputs[n_own:], strict=True))
            return called(time, omega, attitude, *inputs[:n_own], **values)

        try:
            return _recorded_with(recorder, named)
        except InputError:
            return None

    if not values:
        return torque
    names = list(values)
    if recorded_with(names) is None:
        names = [name for name in names if recorded_with([name]) is not None]
    varied = recorded_with(names)
    parameters = tuple((name, values[name]) for name in names)
    return torque if varied is None else replace(torque, parameters=parameters, varied=varied)


def _list_summands(torque: StateTorque | TorqueLaw) -> "tuple[StateTorque | TorqueLaw, ...]":
    if isinstance(torque, TorqueLaw):
        return () if torque.is_zero else (torque,)
    return torque.parts or (torque,)


def _sum(parts: "Sequence[StateTorque | TorqueLaw]") -> StateTorque:
    """Sum torques in a scene file's order, so that a saved scene has the same operations."""
    torques = [each for each in parts if isinstance(each, StateTorque)]
    torques.sort(key=lambda each: bool(each.expression))
    tapes = [each.tape for each in torques if each.tape is not None]
    if len(tapes) < len(torques):
        raise InputError(
            "[torque]: an opaque torque can't be added to another; allowed: one opaque function "
            "that returns the sum"
        )
    if len(parts) == 1:
        return torques[0]
    given = [each for each in parts if isinstance(each, TorqueLaw)]
    frames = [[law for law in given if law.frame == frame] for frame in FRAMES]
    laws = [law for each in frames if not (law := sum(each, TorqueLaw())).is_zero]

    owners = [each for each in torques if each.own]
    if len(owners) > 1:
        raise InputError(
            "[torque]: two summands have states; allowed: one function with all states"
        )

    def total(time: Any, omega: Any, attitude: Any, *own: Any) -> list[Any]:
        given = ((tape, own if each.own else ()) for tape, each in zip(tapes, torques, strict=True))
        values = [torque_of(tape, time, omega, attitude, *states) for tape, states in given]
        rates = [rate for each in values for rate in each[3:]]
        values = [each[:3] for each in values]
        values += [body_torque(law, time, attitude) for law in laws]
        return [*sum(values[1:], values[0]), *rates]

    names, starts = (owners[0].own, owners[0].starts) if owners else ((), ())
    found = replace(replayed(total, names), parts=tuple(parts), starts=starts)
    expressions = [each for each in torques if each.expression]
    terms = [term for each in torques for term in each.terms]
    if len(terms) + len(expressions) < len(torques) or len(expressions) + len(laws) > 1:
        return found
    for each in expressions:
        found = replace(found, expression=each.expression, constants=each.constants)
    return replace(found, terms=(*laws, *terms))


def _takes_attitude(function: object) -> bool:
    if not callable(function):
        raise InputError(f"[torque] is {kind_of(function)}; {_ARGUMENTS}")
    if has_argument(function, "states"):
        raise InputError("[torque]: the function has an argument states; give the scene's states=")
    for name in third_argument(function):
        if name in _CONSTANTS:
            raise InputError(
                f"[torque]: the function has an argument {name} without default, and a third "
                f"argument is the attitude; allowed: constants with defaults, as in {name}=0.1"
            )
    return count_inputs(function, "[torque]", _ARGUMENTS, 2, 3) == 3
