"""Limits of the work of a computation: some ten seconds, times `effort`."""

import math
from collections.abc import Sequence
from typing import Protocol

from pyharness.model.errors import InputError, unknown
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Trajectory
from pyharness.model.values import Number, checked_effort

_SLACK = 2.0  # safety factor on the estimated effort, which may be too low
_ROUNDING = 1.0 + 1e-9  # tolerates the rounding of an effort that a message suggested
_UNFORESEEN = 10.0  # factor on the present effort if the needed effort is not estimated
# By implementation: the largest number of steps without waves of the torque (some 30 s for the
# slowest program), and the work for a wave, in steps. "another word" is a Python program in an
# arithmetic other than binary64; "binary32" and "binary128" are compiled.
_LIMITS = {
    "fortran": (1e8, 1.0),
    "python": (5e5, 0.05),
    "another word": (5e4, 0.3),
    "binary32": (2e5, 0.1),
    "binary128": (2e5, 10.0),  # our own sine function is slow
}
# Largest number of steps of a compiled program, summed over many bodies.
_MOST_STEPS_OF_ALL = 1e9


class Integrator(Protocol):
    def __call__(
        self, scene: Scene, times: Sequence[float], tolerance: float, effort: float = 1.0, /
    ) -> Trajectory:
        """Return the trajectory at `times` (s), all on one side of 0, in order away from 0."""


def advice(instead: str, effort: float, needed: float | None = None) -> str:
    """Return the advice of a message on the work limit: `instead`, or a larger effort."""
    factor = suggested(effort, needed)
    return f"{instead}, or allow more work: --effort {factor} (effort={factor} in Python)"


def suggested(effort: float, needed: float | None = None) -> str:
    """Return a sufficient effort as text: twice `needed`, or ten times the present effort."""
    factor = max(_SLACK * needed, effort) if needed else _UNFORESEEN * effort
    factor = min(1e300, factor)
    digit = 10.0 ** (math.floor(math.log10(factor)) - 1)
    rounded = math.ceil(factor / digit) * digit
    return f"{rounded:.0f}" if 10.0 <= rounded < 1e15 else f"{rounded:.2g}"


class ProofWork:
    """The work of all attempts at a proof, and its limit."""

    def __init__(self, most: float, effort: float) -> None:
        self._effort, self._limit = effort, most * checked_effort(effort)
        self.done, self.steps, self._earlier = 0.0, 0, 0.0

    def begin(self) -> None:
        """Begin another attempt."""
        self._earlier = self.done

    def check(self, share: float) -> None:
        """Raise InputError beyond the limit; this attempt has reached `share` of the time."""
        if self.done < self._limit:
            return
        needed = None
        if share > 0.0:
            total = self._earlier + (self.done - self._earlier) / max(share, 1e-3)
            needed = self._effort * total / self._limit
        instead = advice("use a shorter time", self._effort, needed)
        raise InputError(f"prove: more than {self.steps} steps; {instead}")


def waves(scene: Scene) -> int:
    if isinstance(scene.torque, StateTorque):
        return 0
    return len(scene.law.sines) + len(scene.law.cosines)


def check_steps(scene: Scene, program: str, implementation: str, effort: float) -> None:
    if implementation not in _LIMITS:
        raise unknown("implementation", implementation, _LIMITS)
    most, a_wave = _LIMITS[implementation]
    needed = scene.steps * (1.0 + a_wave * waves(scene)) / most
    _check_work(scene, f"{program} ({implementation})", "", "use fewer steps", needed, effort)


def check_bodies(scene: Scene, program: str, bodies: int, effort: Number) -> None:
    cost = 1.0 + _LIMITS["fortran"][1] * waves(scene)
    needed = bodies * scene.steps * cost / _MOST_STEPS_OF_ALL
    _check_work(scene, program, f" of {bodies} bodies", "use fewer", needed, effort)


def _check_work(
    scene: Scene, what: str, of: str, instead: str, needed: float, effort: Number
) -> None:
    factor = checked_effort(effort)
    if needed > factor * _ROUNDING:
        count = waves(scene)
        load = f"{scene.steps} steps" + (f" with {count} waves of torque" if count else "")
        raise InputError(
            f"{what}: {load}{of} would take too long; {advice(instead, factor, needed / _SLACK)}"
        )
