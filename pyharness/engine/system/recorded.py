"""Conversion of scenes and recorded equations of motion (tapes) to arrays for kernels."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.system.kernel_input import normalized, remainders
from pyharness.engine.system.leaf_text import key, structure
from pyharness.model.attitude import IDENTITY, quaternion_rates
from pyharness.model.codes import Methods, Operations, Places, Statuses, Storage
from pyharness.model.constant_body import with_constant_body
from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.errors import SLIDING, InputError, TimedError
from pyharness.model.extension import COMPLETE, extension
from pyharness.model.principal import PrincipalScene
from pyharness.model.recurrences import n_results
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque, of_law, torque_of
from pyharness.model.symbols import MOST_OPERATIONS, Recorder
from pyharness.model.tape import N_INPUTS, TIME, Linear, Table, Tape, evaluate, float_outputs
from pyharness.model.tape_arrays import ARRAYS
from pyharness.model.trajectory import Array
from pyharness.model.values import Triple

_KINDS = {
    "linear": Operations.LINEAR,
    "product": Operations.PRODUCT,
    "quotient": Operations.QUOTIENT,
    "sqrt": Operations.SQRT,
    "exp": Operations.EXP,
    "tanh": Operations.TANH,
    "sine": Operations.SINE_COSINE,
    "table": Operations.TABLE,
    "switch": Operations.SWITCH,
    "floor": Operations.FLOOR,
    "select": Operations.SELECT,
} | {kind: getattr(Operations, kind.upper()) for kind in WITH_DERIVATIVE}
# The first trial step, in the user's unit of time. It hardly matters, because the series then gives
# a step up to 16 times as long.
LONGEST_TRIAL = 1e3


def inputs_of(times: Array, state: Array) -> list[Array]:
    """Return a tape's inputs, each (n,), from times and states (n, m); missing ones are 0."""
    columns = [times, *state.T]
    return columns + [np.zeros(len(times))] * (N_INPUTS - len(columns))


def outputs_at(tape: Tape, times: Array, state: Array) -> Array:
    """Return a tape's m outputs at n states, (n, m); not finite where singular."""
    with np.errstate(all="ignore"):
        found: Sequence[Any] = evaluate(tape, inputs_of(times, state), ARRAYS)
    # A constant output is a number, without a shape.
    outputs = np.stack([np.broadcast_to(each, len(times)) for each in found], axis=1)
    for row in np.flatnonzero(~np.isfinite(outputs).all(axis=1)):
        with suppress(ZeroDivisionError):
            inputs = inputs_of(times[row : row + 1], state[row : row + 1])
            outputs[row] = float_outputs(tape, [float(each[0]) for each in inputs])
    return outputs


def system_of(scene: Scene, attitude: bool | None = None) -> Tape:
    """Return a scene's recorded equations of motion about principal axes.

    The outputs are derivatives of omega, quaternion (if `attitude`) and `Scene.states`.
    """
    if scene.changing is not None:
        scene = with_constant_body(scene)
    torque = scene.torque if isinstance(scene.torque, StateTorque) else of_law(scene.torque)
    if torque.tape is None:
        raise InputError(
            "an opaque torque can't be solved by series; allowed: the methods dop853, rk45, "
            "radau, lsoda, or a torque that can be recorded"
        )
    if attitude is None:
        attitude = scene.attitude is not None
    body = scene.euler_coefficients, scene.moments or (1.0, 1.0, 1.0)
    return _system(torque.tape, *body, attitude, len(scene.states))


# Recording takes longer than most solutions; many initial states share one system.
@lru_cache(maxsize=64)
def _system(
    tape: Tape, coefficients: Triple, divisors: Triple, attitude: bool, n_states: int
) -> Tape:
    own = 7 if attitude else 3
    most = 2 * len(tape.operations) + MOST_OPERATIONS
    recorder = Recorder(most, max(N_INPUTS, 1 + own + n_states))
    time, *unknowns = recorder.inputs()
    x, y, z, *q = unknowns[: own if n_states else 7]
    states = unknowns[own : own + n_states]
    torque = torque_of(tape, time, (x, y, z), q or IDENTITY, *states)
    # Equations 16-18 of Jacobs 1982.
    rates: list[Any] = [
        coefficient * product + component / moment
        for coefficient, product, component, moment in zip(
            coefficients, (y * z, z * x, x * y), torque[:3], divisors, strict=True
        )
    ]
    if attitude:
        rates += quaternion_rates((x, y, z), q)
    return recorder.tape([*rates, *torque[3:]])


def is_recorded(scene: Scene) -> bool:
    return isinstance(scene.torque, StateTorque) or scene.changing is not None


def slopes_of(scene: Scene) -> Callable[[float, Sequence[float]], list[float]]:
    """Return the right-hand side f(t, state) under a torque that depends on the state.

    It is NaN where the torque is singular.
    """
    torque = scene.torque
    assert isinstance(torque, StateTorque)
    a, b, c = scene.euler_coefficients
    first, second, third = scene.moments or (1.0, 1.0, 1.0)

    def slopes(time: float, state: Sequence[float]) -> list[float]:
        x, y, z = (float(w) for w in state[:3])
        q = [float(w) for w in state[3:]] or IDENTITY
        n1, n2, n3 = torque.at(float(time), (x, y, z), q)
        found = [n1 / first + a * y * z, n2 / second + b * x * z, n3 / third + c * x * y]
        if len(state) > 3:
            found += quaternion_rates((x, y, z), q)
        return found

    return slopes


class Listing(NamedTuple):
    """A tape as lists, with slots and combinations numbered from 1.

    A slot is an input or a result. An operation has a kind of `Operations`, two operands and a
    result. A combination is a constant and pairs of slot and coefficient; the last `n_unknowns` are
    the unknowns' derivatives.
    """

    n_unknowns: int
    n_slots: int
    operations: list[tuple[int, int, int, int]]
    combinations: list[tuple[float, list[tuple[int, float]]]]
    tables: list[Table]


# Index, in a tape's array, of compiled code's address, or its number if built with the package.
_LEAVES = 7


@lru_cache(maxsize=64)
def listing(tape: Tape, n_unknowns: int | None = None) -> Listing:
    """Return a tape as lists; its last `n_unknowns` outputs (default: all) are derivatives.

    Sine and cosine of an angle become one operation.
    """
    places = {slot: slot + 1 for slot in range(tape.n_inputs)}
    n_slots = tape.n_inputs
    operations: list[tuple[int, int, int, int]] = []
    combinations: list[tuple[float, list[tuple[int, float]]]] = []
    frequencies: dict[int, int] = {}  # numbers of combinations proportional to time, by slot
    waves: dict[int, int] = {}
    tables: list[Table] = []

    def combined(linear: Linear) -> int:
        terms = [(places[slot], coefficient) for slot, coefficient in linear.terms]
        combinations.append((linear.constant, terms))
        return len(combinations)

    for number, (kind, operands, linear, table) in enumerate(tape.operations, tape.n_inputs):
        if kind in ("sine", "cosine") and operands[0] in waves:
            places[number] = waves[operands[0]] + (kind == "cosine")
            continue
        code = _KINDS["sine" if kind == "cosine" else kind]
        first, second, *_ = *(places[slot] for slot in operands), 0, 0
        if linear is not None:
            first = combined(linear)
            if not linear.constant and [slot for slot, _ in linear.terms] == [TIME]:
                frequencies[number] = first
        if table is not None:
            tables.append(table)
            first = len(tables)
        if kind == "select":
            # The second combination follows the first.
            second, _ = (combined(Linear(0.0, ((slot, 1.0),))) for slot in operands[1:])
        if code == Operations.SINE_COSINE:
            if operands[0] == TIME and TIME not in frequencies:
                frequencies[TIME] = combined(Linear(0.0, ((TIME, 1.0),)))
            second = frequencies.get(operands[0], 0)
            waves[operands[0]] = n_slots + 1
        operations.append((code, first, second, n_slots + 1))
        places[number] = n_slots + 1 + (kind == "cosine")
        n_slots += n_results(code)
    for output in tape.outputs:
        combined(output)
    return Listing(n_unknowns or len(tape.outputs), n_slots, operations, combinations, tables)


@lru_cache(maxsize=64)
def kernel_tape(tape: Tape, n_unknowns: int | None = None) -> Array:
    """Return a tape as an array in the format of fortran/modern/tape.f90."""
    listed = listing(tape, n_unknowns)
    n_unknowns, n_slots, operations, combinations, tables = listed
    terms = [term for _, each in combinations for term in each]
    starts = np.cumsum([1, *(len(each) for _, each in combinations)])
    # The kernel expects at least one entry, and does not read it.
    breaks = [each.breaks for each in tables] or [np.zeros(1)]
    pieces = [each.pieces.ravel() for each in tables] or [np.zeros(4)]
    counts = [
        n_unknowns, n_slots, len(operations), len(combinations), len(terms),
        len(tables), sum(map(len, breaks)), 0,
    ]  # fmt: skip
    packed = np.concatenate(
        [
            np.array(counts, dtype=float),
            _in_pairs([number for operation in operations for number in operation]),
            _in_pairs(starts),
            _in_pairs([slot for slot, _ in terms]),
            _in_pairs(np.cumsum([1, *(len(each.breaks) for each in tables)])),
            [coefficient for _, coefficient in terms],
            [constant for constant, _ in combinations],
            *breaks,
            *pieces,
        ]
    )
    shape = structure(listed)
    if shape is not None:
        packed[_LEAVES : _LEAVES + 1].view(np.int64)[:] = extension().ready_number(key(shape))
    packed.flags.writeable = False
    return packed


def number_of_leaves(packed: Array) -> int:
    """Return the address or number of the compiled code of a packed tape."""
    at = Places.WAVES + _LEAVES
    return int(packed[at : at + 1].view(np.int64)[0])


# The bits of two 32-bit integers are stored as one float.
def _in_pairs(integers: Sequence[int] | NDArray[np.int64]) -> Array:
    pairs = np.zeros(len(integers) + len(integers) % 2, dtype=np.int32)
    pairs[: len(integers)] = integers
    return pairs.view(np.float64)


def has_ready_leaves(tape: Tape) -> bool:
    """Return whether compiled code for the tape was built with the package."""
    return bool(kernel_tape(tape)[_LEAVES] != 0.0)


def packed_scene(
    scene: Scene, code: int, tolerance: float, effort: float, leaves: int = 0
) -> Array:
    """Return a scene and its method's settings as an array, ordered by `Places`.

    `leaves` is the address of compiled code; 0 if built with the package, or missing.
    """
    if code == Methods.TAPE:
        return packed_tape(system_of(scene), scene.step_size, tolerance, effort, leaves)
    packed = _settings(code, scene.step_size, tolerance, effort)
    coefficients, constant, rate, sines, cosines = normalized(scene)
    packed[Places.N_SINES] = sines.shape[1]
    packed[Places.N_COSINES] = cosines.shape[1]
    packed[Places.COEFFICIENTS : Places.CONSTANT] = coefficients
    packed[Places.CONSTANT : Places.RATE] = constant
    packed[Places.RATE : Places.EFFORT] = rate
    packed[Places.COEFFICIENTS_LOW : Places.MOMENTS] = remainders(scene)
    packed[Places.MOMENTS : Places.MOMENTS_LOW] = scene.moments or (1.0, 1.0, 1.0)
    packed[Places.MOMENTS_LOW : Places.ROUNDED] = scene.moments_low
    packed[Places.ROUNDED] = isinstance(scene, PrincipalScene)
    return np.concatenate([packed, sines.T.ravel(), cosines.T.ravel()])


def packed_tape(
    tape: Tape, step_size: float, tolerance: float, effort: float, leaves: int = 0
) -> Array:
    packed = np.concatenate(
        [_settings(Methods.TAPE, step_size, tolerance, effort), kernel_tape(tape)]
    )
    if leaves:
        packed[Places.WAVES + _LEAVES : Places.WAVES + _LEAVES + 1].view(np.int64)[:] = leaves
    return packed


def _settings(code: int, step_size: float, tolerance: float, effort: float) -> Array:
    packed = np.zeros(Places.WAVES)
    packed[Places.METHOD] = code
    packed[Places.TOLERANCE] = tolerance
    packed[Places.STEP] = step_size
    packed[Places.EFFORT] = effort
    return packed


class Step(NamedTuple):
    """A Taylor step of n unknowns."""

    h: float  # length (s); 0 if even the shortest step exceeds the tolerances
    time: float  # at its end (s)
    terms: Array  # Taylor coefficients times powers of `h`, shape (order + 1, n)
    state: Array  # sum of the terms, shape (n,)
    expansions: int = 0  # number of computed series
    is_switched: bool = False  # whether the step ends where a branch of the torque changes
    is_cut: bool = False  # whether it ends at a break of a table, or at the latest end

    def next_trial(self, trial: float) -> float:
        # The length of a shortened step is no guess for the next one.
        return max(trial, abs(self.h)) if self.is_cut else abs(self.h)


def taylor_step(
    tape: Array,
    t: float,
    state: Array,
    tolerances: Array,  # largest allowed errors of the unknowns, shape (n,)
    relative: float,  # tolerance that determines the order
    trial: float,  # guess of the length (s), positive
    end: float,  # latest end (s)
    is_beyond: bool = False,  # whether to end a few rounding errors beyond a switch or break
) -> Step:
    """Return a step of y' = tape(t, y) from the time `t` and the state, shape (n,).

    It ends at the latest where a switch or a piece of a table changes.
    """
    h, time, terms, last, order, expansions, is_switched, is_cut, status = extension().tape_step(
        tape, t, state, tolerances, relative, trial, end, is_beyond, Storage.PERTURBATION_LENGTH
    )
    if status == Statuses.SLIDING:
        raise TimedError(SLIDING, t)
    if status != COMPLETE:
        h = 0.0
    return Step(h, time, terms[: order + 1], last, expansions, bool(is_switched), bool(is_cut))
