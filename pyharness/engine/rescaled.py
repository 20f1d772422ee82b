"""Rescaled time: conversion of scenes and trajectories to another unit of time.

Products of two components of omega underflow below 1e-154 rad/s and overflow above 1e154 rad/s. A
method that forms them therefore receives the scene in a unit of time in which omega is near 1. The
ratio of the units is a power of two, so that no number is rounded.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pyharness.engine.scaled_tape import MULTIPLE, scaled_tape
from pyharness.engine.steps import transformed_steps
from pyharness.model.array_type import Array
from pyharness.model.attitude import IDENTITY
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import Tape
from pyharness.model.trajectory import Trajectory

_SAMPLES = 9  # times at which a torque of the state is evaluated
# From the inverse of this omega to this omega (rad/s), products of components of different size
# keep their digits.
_LARGE = 2.0**300


def scaled(scene: Scene, factor: float) -> Scene:
    """Return the scene with rescaled time, whose solution is factor * omega(factor * t).

    Raise InputError if the torque depends on the state and can't be rescaled, or if the inertia
    changes with time.
    """
    is_constant = scene.changing is None
    tape = _tape(scene.torque, factor) if isinstance(scene.torque, StateTorque) else None
    if is_constant and tape is not None:
        first, second, third = (factor * each for each in scene.omega)
        torque = StateTorque(tape, None, scene.torque.needs_attitude)
        step = scene.step_size / factor
        return replace(scene, omega=(first, second, third), torque=torque, step_size=step)
    law = scene.law

    def times(values: Triple, power: int) -> Triple:
        # The square of the factor may overflow.
        for _ in range(power):
            first, second, third = values
            values = first * factor, second * factor, third * factor
        return values

    return replace(
        scene,
        omega=times(scene.omega, 1),
        torque=replace(
            law,
            constant=times(law.constant, 2),
            rate=times(law.rate, 3),
            sines=tuple((times(a, 2), f * factor) for a, f in law.sines),
            cosines=tuple((times(a, 2), f * factor) for a, f in law.cosines),
        ),
        step_size=scene.step_size / factor,
    )


def is_ordinary(omega: Triple) -> bool:
    """Return whether products of components of omega (rad/s) neither overflow nor underflow."""
    return 1.0 / _LARGE <= max(map(abs, omega)) <= _LARGE


def has_ordinary_rows(found: Trajectory) -> bool:
    """Return whether a trajectory has all rows, and no omega above 2**300 rad/s."""
    return found.has_all_rows and float(np.abs(found.omega).max(initial=0.0)) <= _LARGE


def rescaling_factor(scene: Scene, time: float) -> float:
    """Return the factor, a power of 2, that brings omega near 1 rad/s.

    It allows for the omega that the torque may cause until `time` (s); for a torque of the state,
    this is an estimate. It is 1 if no rescaling is needed or possible, as for an opaque torque.
    """
    if is_ordinary(scene.omega):
        return 1.0
    state_torque = scene.torque if isinstance(scene.torque, StateTorque) else None
    by_torque = omega_by_torque if state_torque is None else _omega_by_state_torque
    largest = max(max(map(abs, scene.omega)), by_torque(scene, time))
    if not (0.0 < largest < math.inf) or 1.0 / _LARGE <= largest <= _LARGE:
        return 1.0
    # With a larger exponent the factor would overflow or underflow.
    exponent = max(-1000, min(1000, math.frexp(largest)[1]))
    if state_torque is not None:
        exponent -= exponent % MULTIPLE
    factor = math.ldexp(1.0, -exponent)
    if state_torque is not None:
        is_short = 0.0 < abs(time) / factor < sys.float_info.min
        fits = math.isfinite(abs(time) / factor) and not is_short
        return factor if fits and _tape(state_torque, factor) is not None else 1.0
    return factor if _fits(scene, time, factor) else 1.0


def omega_by_torque(scene: Scene, time: float) -> float:
    """Return a bound of omega (rad/s) from rest until `time` (s), without gyroscopic torques."""
    law, span = scene.law, abs(time)
    moments = scene.moments or (1.0, 1.0, 1.0)
    if law.in_space:
        # Any body axis may become parallel to the torque.
        moments = (min(moments),) * 3
    largest = 0.0
    for axis, moment in enumerate(moments):
        impulse = abs(law.constant[axis]) * span + 0.5 * abs(law.rate[axis]) * span * span
        for amplitude, frequency in law.sines:
            f = abs(frequency)
            impulse += abs(amplitude[axis]) * span * min(0.5 * f * span, 2.0 / max(f * span, 1.0))
        for amplitude, frequency in law.cosines:
            f = abs(frequency)
            impulse += abs(amplitude[axis]) * span * min(1.0, 1.0 / max(f * span, 1.0))
        omega = impulse / moment
        largest = max(largest, omega if math.isfinite(omega) else math.inf)
    return largest


def _omega_by_state_torque(scene: Scene, time: float) -> float:
    """Return an estimate of |omega| (rad/s) by a torque of the state until `time` (s)."""
    torque, moments = scene.torque, scene.moments or (1.0, 1.0, 1.0)
    assert isinstance(torque, StateTorque)
    if torque.tape is None:
        return 0.0
    rates = [
        abs(each / moment)
        for n in range(_SAMPLES)
        for each, moment in zip(
            torque.at(time * n / (_SAMPLES - 1), scene.omega, scene.attitude or IDENTITY),
            moments,
            strict=True,
        )
    ]
    omega = max(filter(math.isfinite, rates), default=0.0) * abs(time)
    return omega if math.isfinite(omega) else 0.0


def _tape(torque: StateTorque, factor: float) -> Tape | None:
    return torque.tape and scaled_tape(torque.tape, math.frexp(factor)[1] - 1)


def _fits(scene: Scene, time: float, factor: float) -> bool:
    """Return whether rescaled times and torques are finite, and times not subnormal."""
    law = scene.law
    waves = law.sines + law.cosines
    sizes = [abs(x) * factor * factor for a in (law.constant, *(a for a, _ in waves)) for x in a]
    sizes += [abs(x) * factor * factor * factor for x in law.rate]
    sizes += [abs(f) * factor for _, f in waves]
    sizes += [scene.step_size / factor * scene.steps]
    faster = abs(time) / factor
    short = sizes[-1] < sys.float_info.min or 0.0 < faster < sys.float_info.min
    return all(map(math.isfinite, (*sizes, faster))) and not short


def unscaled(trajectory: Trajectory, times: Sequence[float], factor: float) -> Trajectory:
    """Return a trajectory of rescaled time in rad/s and s, without rows that overflow."""
    with np.errstate(over="ignore"):
        omega = trajectory.omega / factor
    finite = np.isfinite(omega).all(axis=1)
    count = len(omega) if finite.all() else int(np.argmin(finite))
    time = np.array(times[:count], dtype=float)
    attitude = trajectory.attitude if trajectory.attitude is None else trajectory.attitude[:count]
    found = replace(
        trajectory, time=time, recorded_time=time, omega=omega[:count], attitude=attitude,
        sol=transformed_steps(trajectory.sol, lambda states: _slower(states, factor), factor),
    )  # fmt: skip
    if count == len(trajectory.omega):
        return found
    return replace(found, ended="overflow", error=None, growth=None, sol=None)


def _slower(states: Array, factor: float) -> Array:
    return np.column_stack([states[:, :3] / factor, states[:, 3:]])
