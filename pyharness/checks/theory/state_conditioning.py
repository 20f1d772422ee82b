"""Error amplification under a torque that depends on omega and attitude.

The state-transition matrix includes the attitude; its derivative follows from the tape, the
recorded operations of the equations. Errors of omega are divided by the largest |omega|; errors of
the attitude are angles (rad).
"""

from collections.abc import Sequence
from dataclasses import astuple, replace
from typing import Any

import numpy as np

from pyharness.checks.theory.conditioning import Conditioning, conditioning, of_flow, sampled
from pyharness.engine.linearised import transitions
from pyharness.engine.recorded import inputs_of, outputs_at, system
from pyharness.engine.solve import solve
from pyharness.model.dual import with_derivatives
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import ATTITUDE, OMEGA, Functions, Tape, evaluate
from pyharness.model.tape_arrays import table_values
from pyharness.model.trajectory import Array

_FEWEST_NODES = 100
_MOST_NODES = 40_000
# A component of the quaternion is half an angle (rad).
_OF_ANGLE = 0.5


def conditioning_at(scene: Scene, times: Sequence[float]) -> Conditioning:
    """Return the sensitivity of a scene's solution at `times` (s) to earlier errors.

    Under a torque law it is the sensitivity at the last time; else the largest at any of the times,
    because damping may reduce errors. Raise InputError if the torque is opaque, if the solution
    grows without bound, or if it would be needed at too many times.
    """
    if not isinstance(scene.torque, StateTorque):
        return conditioning(scene, times[-1])
    each = [astuple(_of_state(scene, time)) for time in times]
    return Conditioning(*map(max, zip(*each, strict=True)))


def _of_state(scene: Scene, time: float) -> Conditioning:
    tape = system(scene)
    slots = OMEGA if scene.attitude is None else (*OMEGA, *ATTITUDE)
    slopes = with_derivatives(tape, slots)

    def sample(times: Array) -> tuple[float, tuple[Array, Array, Array]]:
        state = _path(scene, times)
        largest = float(np.abs(state[:, :3]).max()) or 1.0
        units = np.array([largest] * 3 + [_OF_ANGLE] * (len(slots) - 3))
        middles = 0.5 * (times[1:] + times[:-1]), 0.5 * (state[1:] + state[:-1])
        matrices = outputs_at(slopes, *middles)[:, len(slots) :].reshape(-1, len(slots), len(slots))
        matrices = matrices * units / units[:, None]
        return float(np.abs(matrices).sum(axis=2).max()), (state, units, matrices)

    times, (state, units, matrices) = sampled(sample, time, _FEWEST_NODES, _MOST_NODES)
    with np.errstate(all="ignore"):
        flow = transitions(times, matrices)
        found = of_flow(flow, times, state / units, _sources(tape, times, state) / units, 1.0)
    return replace(found, largest=float(units[0]))


def _path(scene: Scene, times: Array) -> Array:
    """Return omega and the scene's attitude at `times` (s), which begin at 0."""
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
    """Return bounds on the rounding errors of the equations (1/s), over the unit roundoff.

    By running error analysis each operation adds the error of its result; in a sum the magnitudes
    of all terms count.
    """
    given = [_Bounded(each, np.zeros(len(times))) for each in inputs_of(times, state)]
    with np.errstate(all="ignore"):
        found = evaluate(tape, given, _BOUNDS)
    # An output that is a constant is a number.
    errors = [_bounded(each).error for each in found]
    return np.stack([np.broadcast_to(each, len(times)) for each in errors], axis=1)


class _Bounded:
    """Values, and bounds on their rounding errors over the unit roundoff."""

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
    is_first, one, other = _bounded(condition).value > 0.0, _bounded(first), _bounded(second)
    return _Bounded(
        np.where(is_first, one.value, other.value), np.where(is_first, one.error, other.error)
    )


_BOUNDS: Functions[Any] = Functions(
    float,
    lambda x: x.chained(np.sqrt(x.value), 0.5 / np.sqrt(x.value)),
    lambda x: x.chained(np.exp(x.value), np.exp(x.value)),
    lambda x: x.chained(np.tanh(x.value), 1.0 - np.tanh(x.value) ** 2),
    # The reduction of a large angle adds an error.
    lambda x: x.chained(np.sin(x.value), 1.0),
    lambda x: x.chained(np.cos(x.value), 1.0),
    lambda table, time: time.chained(table_values(table, time.value), 0.0),
    lambda x: x.chained(np.log(x.value), 1.0 / x.value),
    lambda x: x.chained(np.arctan(x.value), 1.0 / (1.0 + x.value**2)),
    lambda x: x.chained(np.arcsin(x.value), 1.0 / np.sqrt(1.0 - x.value**2)),
    lambda x: x.chained(np.where(x.value > 0.0, 1.0, 0.0), 0.0),
    lambda x: x.chained(np.floor(x.value), 0.0),
    _selected,
)
