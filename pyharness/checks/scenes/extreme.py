"""Extreme scenes with end times, in five groups."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from typing import NamedTuple

from pyharness.engine.problem.rescaled import scaled
from pyharness.model.attitude import Quaternion, unit_quaternion
from pyharness.model.scene import Scene, Triple
from pyharness.model.scene_file import case_scene


class Circumstance(NamedTuple):
    """A named extreme scene with its end time (s)."""

    name: str
    scene: Scene
    time: float


def speed(scene: Scene, largest: float) -> float:
    """Return a bound (1/s) on torque-free abs(omega') / `largest`, if abs(omega) <= `largest`."""
    return max(map(abs, scene.euler_coefficients)) * largest


def in_steps(scene: Scene, time: float) -> Scene:
    """Return the scene in steps of about 0.002 / `speed` until `time` (s): 10 to 20 000 of them."""
    rate = speed(scene, max(map(abs, scene.omega)))
    count = max(10, min(20_000, math.ceil(rate * abs(time) / 0.002)))
    return replace(scene, step_size=abs(time) / count, steps=count)


def _stepped(name: str, scene: Scene, time: float) -> Circumstance:
    return Circumstance(name, in_steps(scene, time), time)


# Moments for motions near the separatrix. As A = C = 1/2 are exact in binary64, equal perturbations
# about axes 1 and 3 start on the separatrix, where the body flips only once.
MIDDLE_AXIS = (6.0, 5.0, 2.0)
_A, _B = 0.5, 0.8
_FLIPS = 5


def quarter(disturbance: float) -> float:
    """Return a quarter of the period (s) of the motion from omega = (`disturbance`, 1, 0) rad/s."""
    # The complete elliptic integral K(k) divided by the frequency, by the arithmetic-geometric mean
    mean, other = math.sqrt(_A * _A + _A * _B * disturbance**2), math.sqrt(_A * _B) * disturbance
    while mean - other > 1e-9 * mean:
        mean, other = 0.5 * (mean + other), math.sqrt(mean * other)
    return 0.5 * math.pi / mean


def _separatrix() -> Iterator[Circumstance]:
    """Yield rotations about the middle axis, perturbed by 1e-1 to 1e-15 rad/s."""
    # In a flip, omega about the middle axis changes its sign. Motions end before the first flip, in
    # it, or in the fifth; those named "on" start on the separatrix.
    for d in (10.0**-k for k in range(1, 16)):
        beside, on = (d, 1.0, 0.0), (d, 1.0, d)
        flip = quarter(d)
        # In the middle of a flip omega changes fastest, and errors are largest.
        for name, omega, time in (
            ("early", beside, min(14.0, 0.75 * flip)),
            ("flip", beside, flip),
            ("flips", beside, (2.0 * _FLIPS - 1.0) * flip),
            ("on", on, flip),
        ):
            scene = Scene(f"middle axis, {name}, {d:.0e}", omega, moments=MIDDLE_AXIS)
            yield _stepped(f"{name}-{d:.0e}", scene, time)


# 1 - 1e-16 is rounded to the largest number below 1.
_DIFFERENCES = (*(10.0**-k for k in range(1, 17)), 0.0)
SYMMETRIC_START = (0.3, 0.9, -0.7)
_SHORT, LONG = 20.0, 1e6  # s


def _near_symmetry() -> Iterator[Circumstance]:
    for difference in _DIFFERENCES:
        near = 1.0 - difference
        size = f"{difference:.0e}" if difference else "equal"
        for name, moments, time in (
            ("small-pair", (1.5, 1.0, near), _SHORT),
            ("large-pair", (1.0, near, 0.6), _SHORT),
            ("large-pair-long", (1.0, near, 0.6), LONG),
            # Near a sphere omega changes slowly; the end times give equal changes of its phase.
            ("sphere", (1.0, near, 1.0 - 2.0 * difference), _SHORT / (difference or 1.0)),
        ):
            scene = Scene(f"near symmetry, {name}, {size}", SYMMETRIC_START, moments=moments)
            yield _stepped(f"{name}-{size}", scene, time)


_SHAPED = (0.3, 1.0, -0.6)
_RADIANS = 20.0
# Each moment occurs about each axis, in even and odd permutations.
_ORDERS = ((0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2))
_NEEDLE, _PLATE = (1.0, 1.0 - 2.0**-41, 1e-12), (5.0, 3.0, 2.0)
_BODIES: dict[str, Triple] = {
    # Large moments of uneven bodies differ by about half of the largest possible difference.
    "needle": (1.0, 1.0, 1e-12),
    "uneven-needle": _NEEDLE,
    "coin": (1.0, 1e12, 1e12),
    "uneven-coin": (1.0, 1e12, 1e12 - 0.5),
    # I1 = I2 + I3, exactly.
    "plate": _PLATE,
    "round-plate": (2.0, 1.0, 1.0),
    "strip": (1.0 + 2.0**-40, 1.0, 2.0**-40),
    "broad-strip": (1e12 + 1.0, 1e12, 1.0),
    # The largest moment exceeds the sum of the other two.
    "impossible": (200.0, 10.0, 20.0),
    "impossible-equal": (1.0, 1.0, 1e3),
    "impossible-three": (1e3, 1.0, 1e-3),
}


def _shapes() -> Iterator[Circumstance]:
    """Yield needles, coins, plates and impossible bodies with permuted axes, and Case 6."""
    for name, moments in _BODIES.items():
        for axes in _ORDERS:
            first, second, third = (moments[axis] for axis in axes)
            order = "".join(str(axis + 1) for axis in axes)
            scene = Scene(f"{name} {order}", _SHAPED, moments=(first, second, third))
            a, b, c = map(math.sqrt, map(abs, scene.euler_coefficients))
            # Frequencies (rad/s) of small motions about the axes; the fastest advances by _RADIANS.
            rates = zip((b * c, c * a, a * b), scene.omega, strict=True)
            time = _RADIANS / max(w * abs(own) for w, own in rates)
            yield _stepped(f"{name}-{order}", scene, time)
    # The only scene with a torque; it has no closed form.
    yield Circumstance("case-6", case_scene(6), 1.0)


ORDINARY = Scene("scales", (0.5, 1.0, -0.7), moments=(40.0, 30.0, 20.0))
ORDINARY_TIME = 15.0  # s
_TENS = (-300, -250, -200, -160, -150, -100, -50, 0, 50, 100, 150, 200, 300)
TWOS = (-996, -500, -100, 100, 498, 996)


def _scales() -> Iterator[Circumstance]:
    scene = in_steps(ORDINARY, ORDINARY_TIME)
    named = [(f"1e{power}", float(f"1e{power}")) for power in _TENS]
    named += [(f"2^{power}", math.ldexp(1.0, power)) for power in TWOS]
    for name, factor in named:
        yield Circumstance(name, replace(scaled(scene, factor), name=name), ORDINARY_TIME / factor)


POINTED: Quaternion = unit_quaternion("attitude", (0.5, -0.1, 0.7, 0.5))[0]


def _attitude() -> Iterator[Circumstance]:
    for name, scene, time in _separatrix():
        yield Circumstance(f"separatrix-{name}", replace(scene, attitude=POINTED), time)
    for k, sign in product(range(1, 17, 3), (1.0, -1.0)):
        moments = (3.0, 3.0 * (1.0 + sign * 10.0**-k), 2.0)
        scene = Scene("", _SHAPED, moments, attitude=POINTED)
        yield _stepped(f"symmetry-{sign * 10.0**-k:.0e}", scene, _SHORT)
    for name, moments, omega in (
        ("symmetric", (3.0, 3.0, 2.0), _SHAPED),
        ("sphere", (3.0, 3.0, 3.0), _SHAPED),
        ("steady", (3.0, 2.5, 2.0), (0.0, -1.0, 0.0)),
        ("rest", (3.0, 2.5, 2.0), (0.0, 0.0, 0.0)),
        ("needle", _NEEDLE, _SHAPED),
        ("plate", _PLATE, _SHAPED),
    ):
        yield _stepped(name, Scene(name, omega, moments, attitude=POINTED), _SHORT)


EXTREMES: dict[str, Callable[[], Iterator[Circumstance]]] = {
    "separatrix": _separatrix,
    "near-symmetry": _near_symmetry,
    "shapes": _shapes,
    "scales": _scales,
    "attitude": _attitude,
}
"""Functions that yield the extreme scenes of each group."""
