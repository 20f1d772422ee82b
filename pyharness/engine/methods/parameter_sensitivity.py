"""Derivatives of a solution with respect to parameters (sensitivities), by Taylor series.

If a parameter may move a jump of the torque, or the scene has own unknowns (`Scene.states`),
central differences are extrapolated (Ridders 1982).
"""

import itertools
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.engine.methods.closed_form import period_of
from pyharness.engine.system.parameters import (
    ATTITUDE,
    INERTIA_ELEMENTS,
    OMEGA,
    TORQUE,
    initial_state,
    parameters_of,
    torque_with_values,
    varied_equations,
)
from pyharness.engine.system.recorded import kernel_tape
from pyharness.model.array_type import Array
from pyharness.model.attitude import IDENTITY, product
from pyharness.model.errors import InputError, TimedError, WorkLimitError, kind_of, unknown
from pyharness.model.extension import COMPLETE, GAVE_UP, extension
from pyharness.model.scene import ImpossibleBodyWarning, Scene
from pyharness.model.state_torque import has_switches, is_opaque
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import are_several, triple

# Largest tolerance of the derivatives over one period; smallest tolerance of all derivatives.
_OF_PERIOD, _FINEST = 1e-13, 1e-15
# Smallest relative change of omega in a period for which one period is extrapolated.
_VARIES = 1e-2
_METHODS = ("auto", "taylor", "closed-form")
_MOST_COLUMNS = 200
_THREE = (0.0, 0.0, 0.0)  # stands for omega and attitude, which have three columns
# The parameters for which one period of a body without torque is extrapolated. A change of the
# torque changes each period by another amount, other changes all periods alike.
_CONSTANT = "torque.constant"
_PERIODIC = {OMEGA, "moments", "coefficients", "inertia", _CONSTANT}

_FIRST = 0.02  # first change of a parameter for a difference, relative to the parameter
_LEVELS, _RATIO = 13, 2.0
_ENOUGH = 1e-11  # relative estimated error at which no smaller differences are tried
# Largest estimated error, relative to the largest derivative by a parameter.
_ALLOWED = 1e-7
_CERTAIN = 10.0  # least ratio of a difference of one-sided derivatives to its estimated error
_SMALL = 1e-10  # allowed in addition, times the largest state over the size of the parameter

# A function that returns the states at the times, shape (n, m), of a scene.
States = Callable[[Scene], Array]


def checked_names(
    scene: Scene, names: Iterable[str], method: str, attitude: bool
) -> tuple[str, ...]:
    place = "sensitivities"
    if method not in _METHODS:
        raise InputError(f"{place}: the method is {method}; allowed: {', '.join(_METHODS)}")
    allowed = "allowed: names, as in ['omega', 'moments']"
    if not are_several(names):
        raise InputError(f"{place}: {kind_of(names)}; {allowed}")
    if is_opaque(scene.torque):
        raise InputError(f"{place}: the torque is opaque; allowed: a torque that can be recorded")
    values = parameters_of(scene)
    known = [OMEGA, *([ATTITUDE] if attitude else []), *values]
    found: dict[str, None] = {}
    for name in itertools.islice(names, _MOST_COLUMNS + 1):
        if not isinstance(name, str):
            raise InputError(f"{place}: {kind_of(name)}; {allowed}")
        if name == ATTITUDE and not attitude:
            raise InputError(f"{place}: the attitude is not computed; give attitude=True")
        if name not in known:
            raise unknown("parameter", name, known, place)
        if values.get(name, _THREE) is None:
            raise InputError(f"{place}: {name} is the name of two parameters; allowed: other names")
        found[name] = None
    if sum(len(values.get(name) or _THREE) for name in found) > _MOST_COLUMNS:
        raise InputError(f"{place}: more than {_MOST_COLUMNS} values; give fewer names")
    is_smooth = not scene.states and not has_switches(scene.torque)
    if (
        found
        and is_smooth
        and not attitude
        and varied_equations(scene, tuple(found), attitude=False).tape.needs_attitude
    ):
        raise InputError(f"{place}: the torque depends on the attitude; give attitude=True")
    return tuple(found)


def sensitivities_at(
    scene: Scene, found: Trajectory, names: Sequence[str], effort: float, states: States
) -> dict[str, Array]:
    """Return, by name, derivatives of k unknowns at n times by a parameter's m values, (n, k, m).

    `states` returns a changed scene's unknowns.
    """
    if not names:
        return {}
    times, attitude = found.time, found.attitude is not None
    if scene.states or has_switches(scene.torque):
        try:
            middle = states(scene) if times.size else found.y.T
            slopes = {
                name: [
                    _extrapolate(name, *move, states, middle, times) if times.size else middle
                    for move in _moves(scene, name)
                ]
                for name in names
            }
        except WorkLimitError as error:
            raise InputError(f"sensitivities: {error}") from None
        return {name: np.stack(each, 2) for name, each in slopes.items()}
    # Near the separatrix, a large error of omega would lead to the derivatives of another motion.
    tolerance = max(_FINEST, (found.tolerance or 1.0) / max(1.0, found.growth or 1.0))
    # Only closed forms take no evaluations.
    is_closed = not found.evaluations and not attitude and set(names) <= _PERIODIC
    period = 0.0
    # A torque function that is 0 for its parameters may have derivatives that depend on time.
    if is_closed and not getattr(scene.torque, "named", None):
        period = period_of(scene)
        least = _VARIES * math.hypot(*scene.omega)
        if period > 0.0 and not period * np.abs(_slope(scene)).max() > least:
            period = 0.0
    # Extrapolating one period takes as long as an integration over two.
    if 0.0 < 2.0 * period < np.abs(times).max(initial=0.0):
        columns, rows = _by_periods(scene, names, times, period, tolerance, effort)
    else:
        columns, rows, _ = _by_series(scene, names, attitude, times, tolerance, effort)
    return {name: rows[:, :, each] for name, each in columns.items()}


def _by_series(
    scene: Scene, names: Sequence[str], attitude: bool, times: Array, tolerance: float,
    effort: float,
) -> tuple[dict[str, slice], Array, Array]:  # fmt: skip
    """Return columns by parameter, derivatives, (n, 3 or 7, m), and derivatives at time 0."""
    equations = varied_equations(scene, names, attitude)
    state, starts = initial_state(scene, equations)
    packed = kernel_tape(equations.tape, len(state))
    # Forcings become numbers of linear combinations, of which the outputs are the last.
    first = int(packed[3]) - len(equations.tape.outputs)
    forcings = np.where(equations.forcings > 0, equations.forcings + first, 0).astype(np.int32)
    rows = np.empty((len(times), *starts.shape))
    is_before = times < 0.0
    for side in (is_before, ~is_before):
        places = np.flatnonzero(side)
        # Each side is computed from 0 outward.
        places = places[np.argsort(np.abs(times[places]))]
        if places.size:
            own = times[places]
            derivatives, n_rows, status = extension().tape_derivatives(
                packed, state, starts, forcings, own, tolerance, effort
            )
            reached = own[min(n_rows, len(own) - 1)]
            if status == GAVE_UP:
                raise TimedError(
                    "sensitivities exceeded their work limit before t = {time} s; use a shorter "
                    "time, a larger tolerance, or more effort",
                    reached,
                )
            if status != COMPLETE or not np.isfinite(derivatives).all():
                raise TimedError(
                    "sensitivities overflow before t = {time} s; use a shorter time", reached
                )
            rows[places] = derivatives.transpose(2, 0, 1)
    return equations.columns, rows, starts


def _slope(scene: Scene) -> Array:
    """Return the derivative of omega (rad/s2) at time 0 without torque."""
    x, y, z = scene.omega
    if scene.inertia is None:
        return np.array(scene.euler_coefficients) * (y * z, z * x, x * y)
    inertia, omega = np.array(scene.inertia), np.array(scene.omega)
    slope: Array = -np.linalg.solve(inertia, np.cross(omega, inertia @ omega))
    return slope


def _by_periods(
    scene: Scene, names: Sequence[str], times: Array, period: float, tolerance: float, effort: float
) -> tuple[dict[str, slice], Array]:
    """Return columns by parameter, and the derivatives of a periodic omega, (n, 3, m)."""
    # A perturbation of the initial omega changes the period, and thus grows by the same multiple of
    # the slope of omega in every period. Therefore the state-transition matrix of one period is M =
    # I + N, where N has rank 1 and N N = 0. For k periods it is M^k = I + k N (Floquet). The
    # part F that the parameters cause in one period adds up to k F + k (k - 1)/2 N F. For moments,
    # which change the period once, N F is 0.
    whole = np.floor(times / period)
    rest = times - whole * period
    inner, place = np.unique(np.append(np.clip(rest, 0.0, period), period), return_inverse=True)
    # Every period repeats the error of the first.
    tolerance = min(tolerance, _OF_PERIOD)
    columns, rows, starts = _by_series(
        scene,
        (OMEGA, *(x for x in names if x != OMEGA)),
        attitude=False,
        times=inner,
        tolerance=tolerance,
        effort=effort,
    )
    transition, last = rows[:, :, columns[OMEGA]], rows[place[-1]]
    slope = _slope(scene)
    growth = slope @ (last[:, columns[OMEGA]] - np.eye(3)) / (slope @ slope)
    shear = np.outer(slope, growth)
    forced = last - last[:, columns[OMEGA]] @ starts
    drift = np.zeros_like(forced)
    if _CONSTANT in columns:
        drift[:, columns[_CONSTANT]] = shear @ forced[:, columns[_CONSTANT]]
    k = whole[:, None, None]
    change = k * (shear @ starts + forced) + 0.5 * k * (k - 1.0) * drift
    found = transition[place[:-1]] @ change + rows[place[:-1]]
    return {name: columns[name] for name in names}, found


def _extrapolate(
    name: str, moved: Callable[[float], Scene], size: float, states: States, middle: Array,
    times: Array,
) -> Array:  # fmt: skip
    """Return d(states)/d(number), (n, m), by Ridders' method; `moved` changes the number.

    `middle` has the states of the unchanged scene.
    """
    best, least = np.zeros_like(middle), np.inf
    gap, least_sided = best, np.inf  # half the difference of the one-sided derivatives
    largest = np.abs(middle).max()
    rows: dict[int, list[Array]] = {1: [], 2: []}
    failure: InputError | None = None
    for level in range(_LEVELS):
        h = _FIRST * size / _RATIO**level
        try:
            with warnings.catch_warnings(action="ignore", category=ImpossibleBodyWarning):
                after, before = states(moved(h)), states(moved(-h))
        except InputError as error:  # as when the motion slides; a smaller change may succeed
            rows, failure = {1: [], 2: []}, error
            continue
        largest = max(largest, np.abs(after).max())
        # The mean of the one-sided differences, and half of their difference, which tends to 0
        # where the derivative exists.
        first = np.array([after - before, (after - middle) - (middle - before)]) / (2.0 * h)
        for power, row in rows.items():
            # The mean has even powers of h and the other odd ones; both have all powers beside a
            # jump of a higher derivative.
            factor = np.array([1.0, _RATIO ** (1 - power)])[:, None, None]
            found = [first]
            for other in row:
                factor = factor * _RATIO**power
                found.append(found[-1] + (found[-1] - other) / (factor - 1.0))
                steps = np.abs([found[-1] - found[-2], found[-1] - other]).max(axis=(0, 2, 3))
                doubt = max(steps[0], np.abs(found[-1][1]).max())
                if doubt <= least:
                    best, least = found[-1][0], doubt
                if power == 1 and steps.max() <= least_sided:
                    gap, least_sided = found[-1][1], steps.max()
            rows[power] = found
        if least <= _ENOUGH * np.abs(best).max(initial=0.0):
            break
    allowed = _ALLOWED * np.abs(best).max(initial=0.0) + _SMALL * largest / size
    if not least <= allowed:
        if isinstance(failure, WorkLimitError):
            raise failure
        kinks = np.abs(gap).max(axis=1) > allowed + _CERTAIN * least_sided
        if kinks.any():
            raise InputError(
                f"sensitivities: at t = {times[kinks][0]:.6g} s the state has two derivatives by "
                f"{name}, one on each side, as at a switch; allowed: other times, or another {name}"
            )
        raise InputError(
            f"sensitivities: the state does not depend smoothly on {name}; allowed: a torque whose "
            "switches are crossed, and not only touched, or times before"
        )
    return best


def _moves(scene: Scene, name: str) -> Iterator[tuple[Callable[[float], Scene], float]]:
    """Yield, for each of the parameter's values, a function that changes it by h, and its size."""
    if name == ATTITUDE:
        for axis in np.eye(3):
            yield lambda h, axis=axis: _turned(scene, h * axis), 1.0  # type: ignore[misc]
        return
    listed = list(scene.omega) if name == OMEGA else parameters_of(scene)[name]
    assert listed is not None
    if name.startswith(TORQUE) and len(listed) != 1:
        raise InputError(
            f"sensitivities: {name} of a scene with switches or states; allowed: keyword "
            "arguments, constants of expressions, the body and the initial state"
        )
    largest = max(map(abs, listed)) or 1.0
    sizes = [largest] * len(listed)
    if name == "inertia":
        # An element off the diagonal may be a rounding error.
        sizes = [math.sqrt(abs(listed[i] * listed[j])) or largest for i, j in INERTIA_ELEMENTS]
    elif name not in (OMEGA, "coefficients"):
        sizes = [abs(value) or largest for value in listed]
    for k, size in enumerate(sizes):

        def moved(h: float, k: int = k) -> Scene:
            values = [x + h * (i == k) for i, x in enumerate(listed)]
            if name == OMEGA:
                return replace(scene, omega=triple(values))
            if name.startswith(TORQUE):
                changed = torque_with_values(scene.torque, {name.removeprefix(TORQUE): values[0]})
                return replace(scene, torque=changed)
            changes: dict[str, Any] = {name: values}
            if name == "inertia":
                matrix = np.zeros((3, 3))
                for (i, j), x in zip(INERTIA_ELEMENTS, values, strict=True):
                    matrix[i, j] = matrix[j, i] = x
                changes = {name: matrix.tolist()}
            return replace(scene, **changes)

        yield moved, size


def _turned(scene: Scene, turn: Array) -> Scene:
    angle = float(np.linalg.norm(turn))
    half = 0.5 * np.sinc(0.5 * angle / np.pi) * turn
    small = (np.cos(0.5 * angle), *half)
    return replace(scene, attitude=product(scene.attitude or IDENTITY, small))
