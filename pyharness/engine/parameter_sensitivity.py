"""Sensitivities: the derivatives of a solution with respect to parameters, by Taylor series."""

import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from pyharness.engine.closed_form import period_of
from pyharness.engine.differences import States, slopes_by_differences
from pyharness.engine.parameters import (
    ATTITUDE,
    OMEGA,
    initial_state,
    parameters_of,
    varied_equations,
)
from pyharness.engine.recorded import kernel_tape
from pyharness.model.array_type import Array
from pyharness.model.errors import InputError, TimedError, kind_of, unknown
from pyharness.model.extension import COMPLETE, GAVE_UP, extension
from pyharness.model.scene import Scene
from pyharness.model.state_torque import has_switches, is_opaque
from pyharness.model.tape import Tape
from pyharness.model.trajectory import Trajectory

# Largest tolerance of the derivatives of one period, and smallest tolerance of any.
_OF_PERIOD, _FINEST = 1e-13, 1e-15
# Smallest relative change of omega in a period at which the derivatives of one period are used.
_VARIES = 1e-2
_METHODS = ("auto", "taylor", "closed-form")
_MOST_COLUMNS = 200
_THREE = (0.0, 0.0, 0.0)  # stands for omega and attitude, which have three columns
# The parameters whose equations are periodic for a body without torque. All but the torque change
# the period once; a torque changes it with time.
_CONSTANT = "torque.constant"
_PERIODIC = {OMEGA, "moments", "coefficients", "inertia", _CONSTANT}


def checked_names(
    scene: Scene, names: Iterable[str], method: str, attitude: bool
) -> tuple[str, ...]:
    """Return the names of parameters without repetitions.

    Raise InputError if a name is unknown, or its sensitivities can't be computed.
    """
    place = "sensitivities"
    if method not in _METHODS:
        raise InputError(f"{place}: the method is {method}; allowed: {', '.join(_METHODS)}")
    allowed = "allowed: names, as in ['omega', 'moments']"
    if isinstance(names, str) or not isinstance(names, Iterable):
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
        and varied_equations(scene, tuple(found), False).tape.needs_attitude
    ):
        raise InputError(f"{place}: the torque depends on the attitude; give attitude=True")
    return tuple(found)


def sensitivities_at(
    scene: Scene,
    found: Trajectory,
    names: Sequence[str],
    tolerance: float,
    effort: float,
    states: States,
) -> dict[str, Array]:
    """Return the derivatives with respect to each parameter, (n, k, m) for k unknowns, m values.

    `states` returns the unknowns of a changed scene at the times. `tolerance` is relative to the
    largest derivative in a column so far. Raise InputError if the work limit is exceeded, or a
    derivative overflows.
    """
    if not names:
        return {}
    times, attitude = found.time, found.attitude is not None
    if scene.states or has_switches(scene.torque):
        return slopes_by_differences(scene, names, states)
    # Near the separatrix, a large error of omega would lead to the derivatives of another motion.
    tolerance = max(_FINEST, tolerance / max(1.0, found.growth or 1.0))
    # Closed forms alone take no evaluations.
    is_closed = not found.evaluations and not attitude and set(names) <= _PERIODIC
    period = _period(scene) if is_closed else 0.0
    # The calculation from one period takes as long as an integration over two.
    if 0.0 < 2.0 * period < np.abs(times).max(initial=0.0):
        columns, rows = _by_periods(scene, names, times, period, tolerance, effort)
    else:
        columns, rows, _ = _by_series(scene, names, attitude, times, tolerance, effort)
    return {name: rows[:, :, each] for name, each in columns.items()}


def _by_series(
    scene: Scene, names: Sequence[str], attitude: bool, times: Array, tolerance: float,
    effort: float,
) -> tuple[dict[str, slice], Array, Array]:  # fmt: skip
    """Return the columns by name, the derivatives, (n, 3 or 7, m), and those at time 0."""
    equations = varied_equations(scene, names, attitude)
    state, starts = initial_state(scene, equations)
    packed, forcings = _packed(equations.tape, len(state), equations.forcings)
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
            _check(status, n_rows, own, derivatives)
            rows[places] = derivatives.transpose(2, 0, 1)
    return equations.columns, rows, starts


def _period(scene: Scene) -> float:
    """Return the period of omega (s), or 0 if there is none, or omega is nearly constant."""
    # The derivatives of a function that is 0 by its parameters may depend on time.
    period = 0.0 if getattr(scene.torque, "named", None) else period_of(scene)
    largest = math.hypot(*scene.omega)
    return period if period * np.abs(_slope(scene)).max() > _VARIES * largest else 0.0


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
    """Return the columns by name, and the derivatives of a periodic omega, (n, 3, m)."""
    # A perturbation of the initial omega changes the period, and thus grows by the same multiple of
    # the slope of omega in every period. Therefore the state-transition matrix of one period is M =
    # I + N, where N has rank 1 and N N = 0, and that of k periods M^k = I + k N (Floquet). The part
    # F that the parameters cause in one period adds up to k F + k (k - 1)/2 N F. For moments, which
    # change the period once, N F is 0.
    whole = np.floor(times / period)
    rest = times - whole * period
    inner, place = np.unique(np.append(np.clip(rest, 0.0, period), period), return_inverse=True)
    # Every period repeats the error of the first.
    tolerance = min(tolerance, _OF_PERIOD)
    columns, rows, starts = _by_series(
        scene, (OMEGA, *(x for x in names if x != OMEGA)), False, inner, tolerance, effort
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


def _packed(
    tape: Tape, n_unknowns: int, forcings: NDArray[np.int32]
) -> tuple[Array, NDArray[np.int32]]:
    """Return a tape as the kernel's array, and `forcings` as numbers of its combinations."""
    packed = kernel_tape(tape, n_unknowns)
    # The outputs are the last combinations, which the array counts here.
    first = int(packed[3]) - len(tape.outputs)
    return packed, np.where(forcings > 0, forcings + first, 0).astype(np.int32)


def _check(status: int, n_rows: int, times: Array, derivatives: Array) -> None:
    time = times[min(n_rows, len(times) - 1)]
    if status == GAVE_UP:
        raise TimedError(
            "sensitivities exceeded their work limit before t = {time} s; use a shorter time, a "
            "larger tolerance, or more effort",
            time,
        )
    if status != COMPLETE or not np.isfinite(derivatives).all():
        raise TimedError("sensitivities overflow before t = {time} s; use a shorter time", time)
