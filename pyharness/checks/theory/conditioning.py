"""Error amplification by Euler's equations, which affects all methods.

The state-transition matrix Phi(t, s) of the linearised equations maps an error of omega at time s
to the resulting error at time t. Under a torque that depends on omega or attitude, the Jacobian
follows from the torque's recorded operations, and Phi includes any attitude of the scene.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from pyharness.engine.methods.linearised import growth, jacobians, propagators, transitions
from pyharness.engine.solve import solve
from pyharness.engine.system.kernel_input import closed_form
from pyharness.engine.system.recorded import inputs_of, outputs_at, system_of
from pyharness.model.basis import Basis
from pyharness.model.dual import with_derivatives
from pyharness.model.elementary import WITH_DERIVATIVE
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import ATTITUDE as _ATTITUDE_SLOTS
from pyharness.model.tape import OMEGA, Functions, Tape, evaluate
from pyharness.model.tape_arrays import OF_NUMPY, table_values
from pyharness.model.trajectory import Array

ROUNDING = 2.0**-53
# Largest number of roundings in a right-hand side of Euler's equations: two in each of A, B, C, two
# in the products, the rest in the sums.
_ROUNDINGS = 8.0
# Rounding error of an attitude (rad): twice that from some twenty roundings of a quaternion.
ATTITUDE = 40.0 * ROUNDING
# Error amplification above which a method's limit is the amplified tolerance.
LIVELY = 1e3
FLOW = Basis(
    "derived",
    "error of omega or attitude: tolerance and rounding errors, with the error amplification",
    "first-order perturbations of the linearised equations (`theory/conditioning.py`)",
)
"""Basis of the limits of `Conditioning`."""
_NODES_PER_RADIAN = 12.0

_Sample = TypeVar("_Sample")


@dataclass(frozen=True)
class Conditioning:
    """The sensitivity of omega at the end of a motion to earlier errors."""

    # Largest factor, at least 1, from an error of omega at any time to the final error.
    amplification: float
    # Final error, divided by `largest`, if every term of the right-hand side, the initial omega and
    # the result have a few rounding errors in the worst direction.
    rounding: float
    storing: float  # mean final error, divided by `largest`, from one rounding of omega
    # Sum of the terms' rounding errors, divided by `largest`, without amplification.
    unamplified: float
    largest: float  # largest abs(omega) until the end (rad/s)

    def limit(self, made: float, steps: float = 0.0) -> float:
        """Return the allowed final error of omega, relative to `largest`.

        `made` is the sum of the steps' errors; `steps` counts uncompensated roundings.
        """
        allowed = made * self.amplification + self.rounding + steps * self.storing
        # NaN allows no error.
        return 0.0 if math.isnan(allowed) else min(2.0, allowed)

    def angle_limit(self, made: float, time: float) -> float:
        """Return an attitude's allowed error (rad) at `time` (s); step errors add up to `made`."""
        # Assume that omega has its largest rounding error at all times.
        turned = self.rounding * (1.0 + math.sqrt(3.0) * self.largest * abs(time))
        return made + turned + ATTITUDE


def conditioning(scene: Scene, time: float) -> Conditioning:
    """Return the sensitivity of omega at `time` (s) to earlier errors.

    Raise InputError if the motion is unbounded, too fast or too sensitive.
    """
    # Near the separatrix a numerical solution is wrong after a few revolutions.
    method = "closed-form" if closed_form(scene) else "taylor"

    def sample(times: Array) -> tuple[float, tuple[Array, bool]]:
        path = solve(scene, times[1:].tolist(), method, 1e-13)
        omega = np.vstack([scene.omega, path.omega])
        with np.errstate(all="ignore"):
            rate = float(np.abs(jacobians(scene, omega)).sum(axis=2).max())
        return rate, (omega, path.has_all_rows)

    if time == 0.0:
        times, (_, (omega, complete)) = np.zeros(2), sample(np.zeros(2))
    else:
        times, (omega, complete) = sampled(sample, time, fewest=50, most=400_000)
    if not complete:
        raise InputError(f"conditioning: the solution grows without bound before t = {time:g} s")
    return along(scene, times, omega)


def along(scene: Scene, times: Array, omega: Array) -> Conditioning:
    """Return the final sensitivity of the solution `omega` (rad/s), shape (n, 3).

    Its `times` (s) begin at 0 and are close together.
    """
    with np.errstate(all="ignore"):
        largest = float(np.abs(omega).max()) or 1.0
        flow = propagators(scene, times, omega)
        return of_flow(flow, times, omega, magnitudes(scene, times, omega), largest)


def sampled(
    sample: Callable[[Array], tuple[float, _Sample]], time: float, fewest: int, most: int
) -> tuple[Array, _Sample]:
    """Return equally spaced times (s) and the results of `sample` at these times.

    The `fewest` to `most` intervals are short enough for the rate (1/s) that `sample` returns.
    """
    count = fewest
    while True:
        times = np.linspace(0.0, time, count + 1)
        rate, found = sample(times)
        wanted = rate * abs(time) * _NODES_PER_RADIAN
        # NaN if the torque is singular, or a product overflows.
        if not wanted <= most:
            raise InputError(
                "conditioning: the motion is too fast for so long a time; use a shorter time"
            )
        if count >= wanted:
            return times, found
        count = math.ceil(wanted)


def of_flow(flow: Array, times: Array, state: Array, source: Array, largest: float) -> Conditioning:
    """Return the final state's sensitivity to earlier errors.

    `flow`, shape (n, m, m), has the state-transition matrix from each time to the last; `source`,
    shape (n, m), has the sums of magnitudes of the derivative's terms.
    """
    steps, sizes = np.diff(times), np.abs(flow)

    def gathered(made: Array) -> Array:
        arriving = (sizes @ made[:, :, None])[:, :, 0]
        return np.asarray((0.5 * (arriving[1:] + arriving[:-1]) * np.abs(steps)[:, None]).sum(0))

    # The first and the last omega are rounded even in a very short time.
    ends = sizes[0] @ np.abs(state[0]) + np.abs(state[-1])
    span = abs(float(times[-1])) or 1.0
    unamplified = float((0.5 * (source[1:] + source[:-1]) * np.abs(steps)[:, None]).sum(0).max())
    found = Conditioning(
        amplification=growth(flow),
        rounding=_ROUNDINGS * ROUNDING * float((gathered(source) + ends).max()) / largest,
        # Divide twice, because `span` times `largest` might underflow.
        storing=ROUNDING * float(gathered(np.abs(state)).max()) / span / largest,
        unamplified=_ROUNDINGS * ROUNDING * (unamplified / largest + 2.0),
        largest=largest,
    )
    if not (math.isfinite(found.amplification) and math.isfinite(found.rounding)):
        raise InputError("conditioning: the error amplification overflows; use a shorter time")
    return found


def magnitudes(scene: Scene, times: Array, omega: Array) -> Array:
    """Return the sums of magnitudes of the terms of Euler's equations (rad/s2), shape (n, 3)."""
    products = np.abs(np.roll(omega, -1, 1) * np.roll(omega, -2, 1))
    products *= np.abs(scene.euler_coefficients)
    law = scene.body_torque
    moments = np.array(scene.moments or (1.0, 1.0, 1.0))
    torque = np.abs(law.constant) + np.abs(law.rate) * np.abs(times)[:, None]
    for amplitude, frequency in law.sines + law.cosines:
        # The added term allows for the rounding error of the angle.
        torque = torque + np.abs(amplitude) * (1.0 + np.abs(frequency * times))[:, None]
    return np.asarray(products + torque / moments)


# Error of a quaternion's component, divided by the error of the angle (rad).
_OF_ANGLE = 0.5


def conditioning_at(scene: Scene, times: Sequence[float]) -> Conditioning:
    """Return the sensitivity of a scene's solution at `times` (s), or raise InputError."""
    if not isinstance(scene.torque, StateTorque):
        return conditioning(scene, times[-1])
    # Because damping may reduce errors, the largest sensitivity at any of the times counts.
    each = [astuple(_of_state(scene, time)) for time in times]
    return Conditioning(*map(max, zip(*each, strict=True)))


def _of_state(scene: Scene, time: float) -> Conditioning:
    tape = system_of(scene)
    slots = OMEGA if scene.attitude is None else (*OMEGA, *_ATTITUDE_SLOTS)
    slopes = with_derivatives(tape, slots)

    def sample(times: Array) -> tuple[float, tuple[Array, Array, Array]]:
        state = _path(scene, times)
        largest = float(np.abs(state[:, :3]).max()) or 1.0
        units = np.array([largest] * 3 + [_OF_ANGLE] * (len(slots) - 3))
        middles = 0.5 * (times[1:] + times[:-1]), 0.5 * (state[1:] + state[:-1])
        matrices = outputs_at(slopes, *middles)[:, len(slots) :].reshape(-1, len(slots), len(slots))
        matrices = matrices * units / units[:, None]
        return float(np.abs(matrices).sum(axis=2).max()), (state, units, matrices)

    times, (state, units, matrices) = sampled(sample, time, fewest=100, most=40_000)
    with np.errstate(all="ignore"):
        flow = transitions(times, matrices)
        found = of_flow(flow, times, state / units, _sources(tape, times, state) / units, 1.0)
    return replace(found, largest=float(units[0]))


def _path(scene: Scene, times: Array) -> Array:
    """Return rows of omega (rad/s) and any attitude at `times` (s), which begin at 0."""
    if times[-1] == 0.0:
        return np.tile([*scene.omega, *(scene.attitude or ())], (len(times), 1))
    attitude = scene.attitude is not None
    path = solve(scene, times[1:].tolist(), "taylor", 1e-13, attitude=attitude)
    if not path.has_all_rows:
        raise InputError(
            f"conditioning: the solution grows without bound before t = {times[-1]:g} s"
        )
    rows = path.omega if path.attitude is None else np.hstack([path.omega, path.attitude])
    return np.vstack([[*scene.omega, *(scene.attitude or ())], rows])


def _sources(tape: Tape, times: Array, state: Array) -> Array:
    """Return bounds on the rounding errors of the derivatives, divided by the unit roundoff."""
    # Each operation adds an error in proportion to its result or, for a sum, to the sum of its
    # terms' magnitudes.
    given = [_Bounded(each, np.zeros(len(times))) for each in inputs_of(times, state)]
    with np.errstate(all="ignore"):
        found = evaluate(tape, given, _BOUNDS)
    # A constant output is a plain number.
    errors = [_bounded(each).error for each in found]
    return np.stack([np.broadcast_to(each, len(times)) for each in errors], axis=1)


class _Bounded:
    """Values, and bounds on their rounding errors, divided by the unit roundoff."""

    def __init__(self, value: Any, error: Any) -> None:
        self.value, self.error = value, error

    def chained(self, value: Any, slope: Any) -> "_Bounded":
        return _Bounded(value, np.abs(slope) * self.error + np.abs(value))

    def __add__(self, other: Any) -> "_Bounded":
        second = _bounded(other)
        size = np.abs(self.value) + np.abs(second.value)
        return _Bounded(self.value + second.value, self.error + second.error + size)

    __radd__ = __add__

    def __mul__(self, other: Any) -> "_Bounded":
        second = _bounded(other)
        value = self.value * second.value
        error = np.abs(self.value) * second.error + np.abs(second.value) * self.error
        return _Bounded(value, error + np.abs(value))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "_Bounded":
        second = _bounded(other)
        value = self.value / second.value
        error = (self.error + np.abs(value) * second.error) / np.abs(second.value)
        return _Bounded(value, error + np.abs(value))

    def __rtruediv__(self, other: float) -> "_Bounded":
        return _bounded(other) / self


def _bounded(value: Any) -> _Bounded:
    return value if isinstance(value, _Bounded) else _Bounded(value, 0.0)


def _selected(condition: Any, first: Any, second: Any) -> _Bounded:
    choose = partial(np.where, _bounded(condition).value > 0.0)
    one, other = _bounded(first), _bounded(second)
    return _Bounded(choose(one.value, other.value), choose(one.error, other.error))


def _bounded_value(kind: str, x: _Bounded) -> _Bounded:
    return x.chained(OF_NUMPY[kind](x.value), WITH_DERIVATIVE[kind].derivative(x.value))


_BOUNDS: Functions[Any] = Functions(
    float,
    lambda x: x.chained(np.sqrt(x.value), 0.5 / np.sqrt(x.value)),
    lambda x: x.chained(np.exp(x.value), np.exp(x.value)),
    lambda x: x.chained(np.tanh(x.value), 1.0 - np.tanh(x.value) ** 2),
    # The reduction of a large angle adds an error.
    lambda x: x.chained(np.sin(x.value), 1.0),
    lambda x: x.chained(np.cos(x.value), 1.0),
    lambda table, time: time.chained(table_values(table, time.value), 0.0),
    {kind: partial(_bounded_value, kind) for kind in WITH_DERIVATIVE},
    lambda x: x.chained(np.where(x.value > 0.0, 1.0, 0.0), 0.0),
    lambda x: x.chained(np.floor(x.value), 0.0),
    _selected,
)
