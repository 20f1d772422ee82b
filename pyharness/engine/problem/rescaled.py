"""Conversion of scenes and trajectories to another unit of time.

Products of two components of omega underflow below 1e-154 rad/s and overflow above 1e154 rad/s.
Methods that form products receive omega near 1, in a unit of time that is a power of two, so that
no number is rounded.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.attitude import IDENTITY
from pyharness.model.errors import TimedError
from pyharness.model.fields import ROWS
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.tape import N_INPUTS, OMEGA, TIME, Linear, Operation, Table, Tape
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import triple

if TYPE_CHECKING:
    from pyharness.engine.plan.registry import Method

# The exponents of rescaled time are multiples of this number, so that nested square roots have
# whole exponents.
_MULTIPLE = 16
_SAMPLES = 9  # times at which a torque that depends on the state is evaluated
# Omega (rad/s) up to which, and above whose inverse, products of components keep their digits.
_LARGE = 2.0**300
# Relative change of omega by terms of a torque that may underflow in rescaled time.
_NEGLIGIBLE = 2.0**-60


def scaled(scene: Scene, factor: float) -> Scene:
    """Return the scene whose solution is factor * omega(factor * t)."""
    torque = scene.torque
    tape = _tape(torque, factor) if isinstance(torque, StateTorque) else None
    if tape is not None and scene.changing is None:
        torque = StateTorque(tape, None, torque.needs_attitude)
    else:
        torque = _scaled_law(scene.law, factor)
    step_size = scene.step_size / factor
    return replace(scene, omega=_times(scene.omega, factor, 1), torque=torque, step_size=step_size)


def _scaled_law(law: TorqueLaw, factor: float) -> TorqueLaw:
    return replace(
        law, constant=_times(law.constant, factor, 2), rate=_times(law.rate, factor, 3),
        sines=tuple((_times(a, factor, 2), f * factor) for a, f in law.sines),
        cosines=tuple((_times(a, factor, 2), f * factor) for a, f in law.cosines),
    )  # fmt: skip


def _times(values: Triple, factor: float, power: int) -> Triple:
    # The square of the factor may overflow.
    for _ in range(power):
        first, second, third = values
        values = first * factor, second * factor, third * factor
    return values


def is_ordinary(omega: Triple) -> bool:
    """Return whether products of components of omega (rad/s) neither overflow nor underflow."""
    return 1.0 / _LARGE <= max(map(abs, omega)) <= _LARGE


def integrate(
    method: "Method", scene: Scene, times: list[float], tolerance: float, effort: float, *more: bool
) -> Trajectory:
    """Return the trajectory on one side of time 0, computed in a suitable unit of time."""
    if is_ordinary(scene.omega):
        return method.solve(scene, times, tolerance, effort, *more)
    if not method.is_fixed_step:
        # The method ignores the step size, which might not be finite in the new unit.
        scene = replace(scene, step_size=abs(times[-1]) or 1.0, steps=1)
    factor = 1.0 if method.any_scale or scene.states else rescaling_factor(scene, times[-1])
    if factor == 1.0:
        return method.solve(scene, times, tolerance, effort, *more)
    faster = [t / factor for t in times]
    try:
        found = method.solve(scaled(scene, factor), faster, tolerance, effort, *more)
    except TimedError as refusal:
        raise refusal.slower(factor) from refusal.__cause__
    largest = float(np.abs(found.omega).max(initial=0.0))
    if isinstance(scene.torque, StateTorque) and not (found.has_all_rows and largest <= _LARGE):
        # The torque causes a larger omega than estimated.
        return method.solve(scene, times, tolerance, effort, *more)
    return unscaled(found, times, factor)


def rescaling_factor(scene: Scene, time: float) -> float:
    """Return the power of 2 that brings omega near 1 rad/s; 1 if unnecessary or impossible."""
    if is_ordinary(scene.omega):
        return 1.0
    torque = scene.torque if isinstance(scene.torque, StateTorque) else None
    # A bound on omega at `time` from rest, or an estimate if the torque depends on the state.
    by_torque = omega_by_torque if torque is None else _omega_by_state_torque
    largest = max(max(map(abs, scene.omega)), by_torque(scene, time))
    if not (0.0 < largest < math.inf) or 1.0 / _LARGE <= largest <= _LARGE:
        return 1.0
    # With a larger exponent the factor would overflow or underflow.
    exponent = max(-1000, min(1000, math.frexp(largest)[1]))
    if torque is not None:
        exponent -= exponent % _MULTIPLE
    factor = math.ldexp(1.0, -exponent)
    # Times and torques must be finite, and times not subnormal.
    sizes, shortest = [abs(time) / factor], math.inf
    if torque is None:
        law, shortest = scene.law, scene.step_size / factor * scene.steps
        waves = law.sines + law.cosines
        vectors = law.constant, *(a for a, _ in waves)
        sizes += [abs(x) * factor * factor for vector in vectors for x in vector]
        sizes += [abs(x) * factor * factor * factor for x in law.rate]
        sizes += [*(abs(f) * factor for _, f in waves), shortest]
    is_short = shortest < sys.float_info.min or 0.0 < sizes[0] < sys.float_info.min
    fits = all(map(math.isfinite, sizes)) and not is_short
    if fits and torque is None:
        lost = replace(scene, torque=_underflowing(scene.law, factor))
        fits = omega_by_torque(lost, time) * factor <= _NEGLIGIBLE
    return factor if fits and (torque is None or _tape(torque, factor) is not None) else 1.0


def _underflowing(law: TorqueLaw, factor: float) -> TorqueLaw:
    """Return the terms of a law that rescaling rounds."""
    back = _scaled_law(_scaled_law(law, factor), 1.0 / factor)

    def rounded(given: Triple, found: Triple) -> Triple:
        return triple(x if x != y else 0.0 for x, y in zip(given, found, strict=True))

    def waves(given: tuple[Wave, ...], found: tuple[Wave, ...]) -> tuple[Wave, ...]:
        pairs = zip(given, found, strict=True)
        return tuple((a if f != g else rounded(a, b), f) for (a, f), (b, g) in pairs)

    return replace(
        law, constant=rounded(law.constant, back.constant), rate=rounded(law.rate, back.rate),
        sines=waves(law.sines, back.sines), cosines=waves(law.cosines, back.cosines),
    )  # fmt: skip


def omega_by_torque(scene: Scene, time: float) -> float:
    """Return a bound on omega's components (rad/s) from rest to `time` (s).

    Gyroscopic terms are omitted.
    """
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
    torque, moments = scene.torque, scene.moments or (1.0, 1.0, 1.0)
    assert isinstance(torque, StateTorque)
    if torque.tape is None:
        return 0.0
    rates = []
    for n in range(_SAMPLES):
        state = scene.omega, scene.attitude or IDENTITY
        torques = torque.at(time * n / (_SAMPLES - 1), *state)
        rates += [abs(each / moment) for each, moment in zip(torques, moments, strict=True)]
    omega = max(filter(math.isfinite, rates), default=0.0) * abs(time)
    return omega if math.isfinite(omega) else 0.0


def _tape(torque: StateTorque, factor: float) -> Tape | None:
    return torque.tape and scaled_tape(torque.tape, math.frexp(factor)[1] - 1)


@lru_cache(maxsize=64)
def scaled_tape(tape: Tape, exponent: int) -> Tape | None:
    """Return a torque's recorded operations in the unit of time 2**exponent s.

    The result is None if a number would be rounded.
    """
    # Slot n becomes slot `places[n]`, times 2**`exponents[n]`.
    operations: list[Operation] = []
    places = list(range(N_INPUTS))
    exponents = [exponent if slot in OMEGA else 0 for slot in places]
    exponents[TIME] = -exponent
    combinations: dict[int, Linear] = {TIME: Linear(0.0, ((TIME, 1.0),))}

    def combine(linear: Linear, power: int) -> Linear:
        terms = tuple(
            (places[slot], float(_scaled(np.float64(factor), power - exponents[slot])))
            for slot, factor in linear.terms
        )
        return Linear(float(_scaled(np.float64(linear.constant), power)), terms)

    def append(operation: Operation) -> int:
        operations.append(operation)
        return N_INPUTS + len(operations) - 1

    def copy_slot(slot: int, power: int) -> int:
        if exponents[slot] == power:
            return places[slot]
        # The kernel recognises waves by linear combinations of time alone.
        linear = combinations.get(slot, Linear(0.0, ((slot, 1.0),)))
        return append(Operation("linear", (), combine(linear, power)))

    try:
        for kind, operands, linear, table in tape.operations:
            powers, power = [exponents[slot] for slot in operands], 0
            if linear is not None:
                combinations[len(places)] = linear
                own = {exponents[slot] for slot, _ in linear.terms}
                power = 0 if linear.constant or not own else min(own, key=abs)
                found = Operation(kind, (), combine(linear, power))
            elif table is not None:
                pieces = _scaled(table.pieces, exponent * np.arange(4))
                found = Operation(kind, (), None, Table(_scaled(table.breaks, -exponent), pieces))
            elif kind in ("product", "quotient", "sqrt", "switch"):
                found = Operation(kind, tuple(places[slot] for slot in operands))
                if kind == "sqrt":
                    power, odd = divmod(powers[0], 2)
                    if odd:
                        return None  # the exponent of the root is not a whole number
                elif kind != "switch":
                    power = powers[0] + (powers[1] if kind == "product" else -powers[1])
            elif kind == "select":
                power = powers[1]
                other = copy_slot(operands[2], power)
                found = Operation(kind, (places[operands[0]], places[operands[1]], other))
            else:
                found = Operation(kind, tuple(copy_slot(slot, 0) for slot in operands))
            places.append(append(found))
            exponents.append(power)
        return Tape(tuple(operations), tuple(combine(each, 2 * exponent) for each in tape.outputs))
    except ArithmeticError:
        return None


def _scaled(values: Any, exponents: Any) -> Any:
    with np.errstate(all="ignore"):
        found = np.ldexp(values, exponents)
        if not np.array_equal(np.ldexp(found, -exponents), values):
            raise ArithmeticError("the product underflows or overflows")
    return found


def unscaled(trajectory: Trajectory, times: Sequence[float], factor: float) -> Trajectory:
    """Return a rescaled trajectory in rad/s and s, up to the first overflow."""
    with np.errstate(over="ignore"):
        rows = {
            name: _in_rad_s(each, factor, ROWS[name].rates if name in ROWS else 0)
            for name, each in trajectory.with_rows().items()
        }
    finite: Any = np.isfinite(rows["omega"]).all(axis=1)
    count = len(finite) if finite.all() else int(np.argmin(finite))
    time = np.array(times[:count], dtype=float)
    found = replace(
        trajectory,
        **{name: each[:count] for name, each in rows.items()}
        | {"time": time, "recorded_time": time},
        sol=trajectory.sol and trajectory.sol.transform(
            lambda x: np.column_stack([x[:, :3] / factor, x[:, 3:]]), factor
        ),
    )  # fmt: skip
    if count == len(trajectory.omega):
        return found
    return replace(found, ended="overflow", error=None, growth=None, sol=None)


def _in_rad_s(values: Any, factor: float, rates: int) -> Any:
    # A power of the factor may overflow.
    for _ in range(rates):
        values = values / factor
    return values
