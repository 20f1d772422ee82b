"""Parameters of a scene, and parameter derivatives of its equations of motion."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyharness.model.array_type import Array
from pyharness.model.attitude import IDENTITY, product, quaternion_rates
from pyharness.model.changing import Changing, rates_of_changing, rates_of_inertia
from pyharness.model.constant_body import rates_about_body_axes
from pyharness.model.dual import with_parameters
from pyharness.model.errors import InputError
from pyharness.model.expressions import components
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque, replayed, torque_of
from pyharness.model.symbols import MOST_OPERATIONS, SYMBOLS, Recorder
from pyharness.model.tape import N_INPUTS, Linear, Operation, Tape, evaluate
from pyharness.model.torque_law import TorqueLaw, body_torque
from pyharness.model.values import Matrix, Triple

OMEGA, ATTITUDE = "omega", "attitude"
TORQUE = "torque."  # prefix of the names of torque parameters
# The elements of an inertia matrix that are parameters, in this order.
INERTIA_ELEMENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


# A scene's moments, coefficients, inertia matrix and changing inertia.
_Body = tuple[Triple | None, Triple | None, Matrix | None, Changing | None]


class VariedEquations(NamedTuple):
    """The equations of motion of a scene, and their parameter derivatives."""

    tape: Tape  # its outputs are the derivatives of the n rates, then the rates
    # (n, m): number, from 1, of the output d(rate i)/d(value j); 0 if this derivative is zero
    forcings: NDArray[np.int32]
    columns: dict[str, slice]  # the columns j of each parameter


def parameters_of(scene: Scene) -> dict[str, list[float] | None]:
    """Return parameters of body and torque by name; None if summands of a torque share it."""
    found: dict[str, list[float] | None] = {}
    if scene.moments is not None:
        found["moments"] = list(scene.moments)
    if scene.coefficients is not None:
        found["coefficients"] = list(scene.coefficients)
    if scene.inertia is not None:
        found["inertia"] = [scene.inertia[i][j] for i, j in INERTIA_ELEMENTS]
    for part in _list_summands(scene.torque):
        own = _parameters_of(part)
        found |= {name: None if name in found else values for name, values in own.items()}
    return found


def varied_equations(scene: Scene, names: Sequence[str], attitude: bool) -> VariedEquations:
    body = scene.moments, scene.coefficients, scene.inertia, scene.changing
    known = parameters_of(scene)
    values = tuple((name, tuple(known.get(name) or ())) for name in names)
    return _equations(body, tuple(_list_summands(scene.torque)), values, attitude)


def check_values(scene: Scene, names: Iterable[str]) -> None:
    known = {
        name.removeprefix(TORQUE): values
        for name, values in parameters_of(scene).items()
        if name.startswith(TORQUE) and (values is None or len(values) == 1)
    }
    for name in names:
        if not isinstance(name, str) or known.get(name) is None:
            allowed = ", ".join(each for each, values in known.items() if values) or "none here"
            raise InputError(
                f"parameters: {name!r}; allowed: keyword arguments of the torque's function with "
                f"numbers as defaults, and constants of its expressions: {allowed}"
            )


def torque_with_values(torque: StateTorque | TorqueLaw, values: Mapping[str, float]) -> StateTorque:
    try:
        parts = [_with_values(each, values) for each in _list_summands(torque)]
    except ArithmeticError as error:
        raise InputError(f"parameters: the torque is not defined: {error}") from None
    found = sum(parts[1:], parts[0])
    assert isinstance(found, StateTorque)
    return found


def _with_values(part: StateTorque | TorqueLaw, values: Mapping[str, float]) -> Any:
    if isinstance(part, TorqueLaw) or not dict(part.constants + part.parameters).keys() & values:
        return part
    given = {f"{TORQUE}{name}": [float(value)] for name, value in values.items()}
    constants, parameters = (
        tuple((name, float(values.get(name, value))) for name, value in pairs)
        for pairs in (part.constants, part.parameters)
    )
    found = replayed(lambda t, omega, q, *own: _torque(part, t, omega, q, given, own), part.own)
    return replace(
        found, expression=part.expression, constants=constants, parameters=parameters,
        varied=part.varied, starts=part.starts,
    )  # fmt: skip


class BatchBody(NamedTuple):
    """The body of a batch: constants, or `n_data` inputs of its equations of motion."""

    changing: Changing | None = None
    coefficients: Triple | None = None
    reciprocals: Triple | None = None  # of the moments
    inertia: Matrix | None = None
    # 6: A, B, C and reciprocals; 21: A, B, C, the principal axes and the inverse inertia
    n_data: int = 0


@lru_cache(maxsize=16)
def tape_of_bodies(
    torque: StateTorque | TorqueLaw, body: BatchBody, names: tuple[tuple[str, int], ...],
    attitude: bool, states: tuple[str, ...] = (),
) -> tuple[Tape, Tape]:  # fmt: skip
    """Return the equations of motion, with the body's data and the torque's parameters as inputs.

    `names` are parameters with numbers of values. The second tape has constants in place of these
    inputs: its first operations.
    """
    own = 7 if attitude else 3
    first = max(N_INPUTS, 1 + own + len(states))
    counts = [count for _, count in names]
    recorder = Recorder(n_inputs=first + body.n_data + sum(counts))
    time, *inputs = recorder.inputs()
    omega, q = np.array(inputs[:3], dtype=object), inputs[3:7] if attitude else list(IDENTITY)
    data = inputs[first - 1 : first - 1 + body.n_data]
    rest = iter(inputs[first - 1 + body.n_data :])
    given = {f"{TORQUE}{name}": [next(rest) for _ in range(count)] for name, count in names}
    values = inputs[own : own + len(states)]
    parts = [
        _torque(part, time, omega, q, given, values if getattr(part, "own", ()) else ())
        for part in _list_summands(torque)
    ]
    total = sum(np.array(part[:3], dtype=object) for part in parts)
    own_rates = [
        sum(each) for each in zip(*(part[3:] for part in parts if len(part) > 3), strict=True)
    ]
    rates = list(_rates_of_batch(body, data, time, omega, total))
    if attitude:
        rates += quaternion_rates((omega[0], omega[1], omega[2]), q)
    tape = recorder.tape([*rates, *own_rates])
    constants = (Operation("linear", (), Linear(0.0, ())),) * (tape.n_inputs - first)
    if not constants:
        return tape, tape
    return tape, replace(tape, operations=constants + tape.operations, n_inputs=first)


def _rates_of_batch(
    body: BatchBody, data: Sequence[Any], time: Any, omega: Any, torque: Any
) -> Sequence[Any]:
    if body.changing is not None:
        return rates_of_changing(body.changing, time, omega, torque)
    if body.inertia is not None:
        return list(rates_about_body_axes(body.inertia, omega, torque))
    x, y, z = omega
    if body.n_data > 6:
        axes, inverse = (np.reshape(each, (3, 3)) for each in (data[3:12], data[12:]))
        x, y, z = omega @ axes
        return list(axes @ (np.array(data[:3]) * [y * z, z * x, x * y]) + inverse @ torque)
    coefficients, reciprocals = body.coefficients or data[:3], body.reciprocals or data[3:6]
    products = y * z, z * x, x * y
    return [
        a * product_ + component * reciprocal
        for a, product_, component, reciprocal in zip(
            coefficients, products, torque, reciprocals, strict=True
        )
    ]


def initial_state(scene: Scene, equations: VariedEquations) -> tuple[Array, Array]:
    """Return the initial state, (n,), and its derivatives with respect to m values, (n, m)."""
    n, m = equations.forcings.shape
    start = scene.attitude or IDENTITY
    state = np.array([*scene.omega, *start])[:n]
    slopes = np.zeros((n, m), order="F")
    for name, columns in equations.columns.items():
        if name == OMEGA:
            slopes[:3, columns] = np.eye(3)
        elif name == ATTITUDE:
            turns = [product(start, (0.0, *axis)) for axis in np.eye(3)]
            slopes[3:, columns] = 0.5 * np.array(turns).T
    return state, slopes


@lru_cache(maxsize=64)
def _equations(
    body: _Body,
    torque: tuple[TorqueLaw | StateTorque, ...],
    values: tuple[tuple[str, tuple[float, ...]], ...],
    attitude: bool,
) -> VariedEquations:
    # The initial omega and attitude have three columns each, but no values here.
    n = 7 if attitude else 3
    flat = [each for _, listed in values for each in listed]
    recorder = Recorder(
        2 * MOST_OPERATIONS, N_INPUTS + len(flat), "sensitivities", "fewer parameters"
    )
    time, *inputs = recorder.inputs()
    state, rest = inputs[: N_INPUTS - 1], iter(inputs[N_INPUTS - 1 :])
    omega, q = np.array(state[:3], dtype=object), state[3:]
    given = {name: [next(rest) for _ in listed] for name, listed in values if listed}
    # A constant that is not finite is refused.
    with np.errstate(all="ignore"):
        total = sum(_torque(part, time, omega, q, given) for part in torque)
        rates = list(_rates(body, time, omega, total, given))
        if attitude:
            rates += quaternion_rates((omega[0], omega[1], omega[2]), q)
        tape = with_parameters(recorder.tape(rates), flat)
    # The derivatives of one rate with respect to all parameters are adjacent outputs.
    forcings, columns = [], {}
    parameter = first = 0
    for name, listed in values:
        m = len(listed) or 3
        outputs = np.zeros((n, m), dtype=np.int32)
        if listed:
            outputs += len(flat) * np.arange(n)[:, None] + np.arange(parameter, parameter + m) + 1
            is_zero = [[not any(tape.outputs[k - 1]) for k in row] for row in outputs.tolist()]
            outputs[is_zero] = 0
        forcings.append(outputs)
        columns[name] = slice(first, first + m)
        parameter += len(listed)
        first += m
    return VariedEquations(tape, np.asfortranarray(np.hstack(forcings)), columns)


def _list_summands(torque: StateTorque | TorqueLaw) -> Sequence[StateTorque | TorqueLaw]:
    parts = (torque,) if isinstance(torque, TorqueLaw) else torque.parts or (torque,)
    return [getattr(part, "named", None) or part for part in parts]


def _parameters_of(part: StateTorque | TorqueLaw) -> dict[str, list[float]]:
    if isinstance(part, StateTorque):
        pairs = (*part.constants, *part.parameters)
        return {f"torque.{name}": [value] for name, value in pairs}
    found = {"torque.constant": list(part.constant), "torque.rate": list(part.rate)}
    for name in ("sines", "cosines"):
        if waves := getattr(part, name):
            found[f"torque.{name}"] = [x for amplitude, f in waves for x in (*amplitude, f)]
    return found


def _torque(
    part: TorqueLaw | StateTorque, time: Any, omega: Any, q: Any, given: Mapping[str, list[Any]],
    own: Sequence[Any] = (),
) -> Any:  # fmt: skip
    if isinstance(part, TorqueLaw):
        law: Any = SimpleNamespace(in_space=part.frame == "space")
        for name in ("constant", "rate"):
            setattr(law, name, given.get(f"torque.{name}", getattr(part, name)))
        for name in ("sines", "cosines"):
            values = given.get(f"torque.{name}")
            waves = getattr(part, name)
            if values is not None:
                waves = [(values[k : k + 3], values[k + 3]) for k in range(0, len(values), 4)]
            setattr(law, name, waves)
        return body_torque(law, time, q)
    if any(f"torque.{name}" in given for name, _ in part.constants):
        constants = {name: given.get(f"torque.{name}", [x])[0] for name, x in part.constants}
        return _of_expression(part, (time, *omega, *q), own, constants)
    others = [(f"torque.{name}", value) for name, value in part.parameters]
    if part.varied is not None and any(name in given for name, _ in others):
        numbers = [given.get(name, [value])[0] for name, value in others]
        inputs = [time, *omega, *q, *own, *numbers]
        return np.array(evaluate(part.varied, inputs, SYMBOLS), dtype=object)
    assert part.tape is not None
    return torque_of(part.tape, time, omega, q, *own)


def _of_expression(
    torque: StateTorque, inputs: Sequence[Any], own: Sequence[Any], constants: Mapping[str, Any]
) -> Any:
    places = [f"[torque] expression {k}" for k in (1, 2, 3)]
    places += [f"[states.{name}] rate" for name in torque.own]
    texts = dict(zip(places, torque.expression, strict=True))
    values = {**dict(zip(torque.own, own, strict=True)), **constants}
    return np.array(components(texts, inputs, values), dtype=object)


def varied_expression(torque: StateTorque) -> Tape:
    """Return the torque of a scene file's expressions, with its constants as further inputs."""
    first = N_INPUTS + len(torque.own)
    recorder = Recorder(MOST_OPERATIONS, first + len(torque.constants))
    inputs = list(recorder.inputs())
    constants = dict(zip(dict(torque.constants), inputs[first:], strict=True))
    given = inputs[:N_INPUTS], inputs[N_INPUTS:first]
    return recorder.tape(list(_of_expression(torque, *given, constants)))


def _rates(
    body: _Body, time: Any, omega: Any, torque: Any, given: Mapping[str, list[Any]]
) -> Sequence[Any]:
    own, coefficients, inertia, changing = body
    if changing is not None:
        return rates_of_changing(changing, time, omega, torque)
    x, y, z = omega
    if inertia is not None:
        if "inertia" not in given:
            return list(rates_about_body_axes(inertia, omega, torque))
        matrix = [list(row) for row in inertia]
        for (i, j), value in zip(INERTIA_ELEMENTS, given["inertia"], strict=True):
            matrix[i][j] = matrix[j][i] = value
        return rates_of_inertia(matrix, omega, torque)
    products = y * z, z * x, x * y
    if own is None:
        factors = given.get("coefficients", coefficients)
        assert factors is not None
        return [c * p + n for c, p, n in zip(factors, products, torque, strict=True)]
    a, b, c = given.get("moments", own)
    differences = b - c, c - a, a - b
    return [
        (difference / moment) * p + n / moment
        for difference, moment, p, n in zip(differences, (a, b, c), products, torque, strict=True)
    ]
