"""How much work is done without being asked for: every limit, and the one option that lifts it.

A limit counts work, steps times waves and the like, so that a method gives up after some ten
seconds. `effort` is a factor on all of them.
"""

import math
from collections.abc import Sequence
from typing import Protocol

from pyharness.model.errors import InputError, unknown
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import Number, number

_SLACK = 2.0  # of a forecast: the pace so far is not that of the rest
_ROUNDING = 1.0 + 1e-9  # of an effort that was advised
_UNFORESEEN = 10.0  # where there is no forecast
# Steps of a program without waves, some 30 s of the slowest, and what a wave costs of such a step.
# Another word is that of a twin; words by name are of the compiled programs.
_LIMITS = {
    "fortran": (1e8, 1.0),
    "python": (5e5, 0.05),
    "another word": (5e4, 0.3),
    "binary32": (2e5, 0.1),
    "binary128": (2e5, 10.0),  # its sine is our own
}
# The same of the compiled programs on many bodies, a step of each counted.
_MOST_STEPS_OF_ALL = 1e9


class Integrator(Protocol):
    """What turns a scene into rows at times that run away from 0."""

    def __call__(
        self, scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0, /
    ) -> Trajectory:
        """Solve, or raise InputError."""


def checked_effort(effort: Number) -> float:
    """Return the factor; InputError where it is no finite number above 0."""
    value = number("effort", effort)
    if not 0.0 < value < math.inf:
        raise InputError(f"effort: {value:g}; allowed: a finite number above 0")
    return value


def advice(instead: str, effort: float, needed: float | None = None) -> str:
    """Return how a message ends where a limit ended the work: what would help `instead`.

    `effort` is the factor on the limit, `needed` what it should have been, as far as can be told.
    """
    factor = suggested(effort, needed)
    return f"{instead}, or allow more work: --effort {factor} (effort={factor} in Python)"


def suggested(effort: float, needed: float | None = None) -> str:
    """Return a factor that should do: two digits, rounded up."""
    factor = max(_SLACK * needed, effort) if needed else _UNFORESEEN * effort
    factor = min(1e300, factor)
    digit = 10.0 ** (math.floor(math.log10(factor)) - 1)
    rounded = math.ceil(factor / digit) * digit
    return f"{rounded:.0f}" if 10.0 <= rounded < 1e15 else f"{rounded:.2g}"


def waves(scene: Scene) -> int:
    """Return the number of waves in a torque, which every step has to sum up."""
    return len(scene.torque.sines) + len(scene.torque.cosines)


def check_steps(scene: Scene, program: str, implementation: str, effort: float) -> None:
    """Refuse a scene that takes a program longer than anyone waits who was not asked."""
    if implementation not in _LIMITS:
        raise unknown("implementation", implementation, _LIMITS)
    most, a_wave = _LIMITS[implementation]
    needed = scene.steps * (1.0 + a_wave * waves(scene)) / most
    if needed <= checked_effort(effort) * _ROUNDING:
        return
    raise InputError(
        f"{program} ({implementation}): {_load(scene)} would take too long; "
        + advice("take fewer steps", effort, needed / _SLACK)
    )


def check_bodies(scene: Scene, program: str, bodies: int, effort: Number) -> None:
    """Refuse so many bodies that their steps take longer than anyone waits who was not asked."""
    cost = 1.0 + _LIMITS["fortran"][1] * waves(scene)
    needed = bodies * scene.steps * cost / _MOST_STEPS_OF_ALL
    factor = checked_effort(effort)
    if needed > factor * _ROUNDING:
        raise InputError(
            f"{program}: {_load(scene)} of {bodies} bodies would take too long; "
            + advice("take fewer", factor, needed / _SLACK)
        )


def _load(scene: Scene) -> str:
    load = f"{scene.steps} steps"
    if waves(scene):
        load += f" with {waves(scene)} waves of torque"
    return load
