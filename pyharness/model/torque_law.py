"""The torque law: a torque that depends on time alone."""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pyharness.model.array_type import Array
from pyharness.model.attitude import rows_to_body
from pyharness.model.errors import InputError, unknown
from pyharness.model.functions import cosine, sine
from pyharness.model.values import Number, Numbers, Triple, finite, number_list, three

Wave = tuple[Triple, float]  # amplitude per axis, frequency in rad/s
# User input: pairs of three amplitudes and a frequency.
Waves = Iterable[tuple[Numbers, Number]]
FRAMES = ("body", "space")


@dataclass(frozen=True)
class TorqueLaw:
    """A torque law: constant, linear and sinusoidal terms about the axes of the body or of space.

    N(t) = constant + rate t + sum of amplitude sin(frequency t) + sum of amplitude cos(frequency t)

    N is a torque in N m or, for a body specified by Euler's coefficients A, B, C, torque divided by
    moment of inertia, in rad/s2.

    Parameters
    ----------
    constant : three numbers
        The constant term (N m or rad/s2).
    rate : three numbers
        The factor of time (N m/s or rad/s3).
    sines, cosines : iterable of waves
        Each wave is a pair: three amplitudes (N m or rad/s2), and a frequency (rad/s).
    frame : {"body", "space"}
        The axes of the components.

    Raises
    ------
    InputError
        For a vector that is not three finite numbers, an invalid wave, or an unknown frame.

    Examples
    --------
    >>> from pyharness import TorqueLaw
    >>> law = TorqueLaw((1.0, 0.0, 0.0), cosines=[((0.0, 2.0, 0.0), 0.5)])
    >>> law.at(0.0)
    (1.0, 2.0, 0.0)
    """

    constant: Triple = (0.0, 0.0, 0.0)
    rate: Triple = (0.0, 0.0, 0.0)
    sines: tuple[Wave, ...] = ()
    cosines: tuple[Wave, ...] = ()
    frame: str = "body"
    # The `StateTorque` with named parameters from which `law_of` derived the law; None in copies.
    named: Any = field(default=None, init=False, compare=False, repr=False)

    if TYPE_CHECKING:

        def __init__(
            self,
            constant: Numbers = ...,
            rate: Numbers = ...,
            sines: Waves = ...,
            cosines: Waves = ...,
            frame: str = "body",
        ) -> None: ...

    def __post_init__(self) -> None:
        for name in ("constant", "rate"):
            object.__setattr__(self, name, three(f"[torque] {name}", getattr(self, name)))
        for name in ("sines", "cosines"):
            object.__setattr__(self, name, _waves(f"[torque] {name}", getattr(self, name)))
        if not isinstance(self.frame, str) or self.frame not in FRAMES:
            raise unknown("frame", self.frame, FRAMES, "[torque] frame")

    def __add__(self, other: "TorqueLaw | int") -> "TorqueLaw":
        """Return the sum with another law, or with 0 (for ``sum``).

        Raise InputError if the axes differ, or if a sum overflows.
        """
        if type(other) is int and other == 0:
            return self
        if not isinstance(other, TorqueLaw):
            return NotImplemented
        if self.is_zero or other.is_zero:
            return other if self.is_zero else self
        if self.frame != other.frame:
            raise InputError(
                "[torque]: the sum of a law about the axes of the body and a law about the axes of "
                "space is no law; allowed: pyharness.torques.in_space(law) for the second"
            )
        return TorqueLaw(
            [a + b for a, b in zip(self.constant, other.constant, strict=True)],
            [a + b for a, b in zip(self.rate, other.rate, strict=True)],
            self.sines + other.sines,
            self.cosines + other.cosines,
            self.frame,
        )

    __radd__ = __add__

    @property
    def needs_attitude(self) -> bool:
        """Whether the torque about the body axes depends on the attitude."""
        return self.in_space

    @cached_property
    def varies(self) -> bool:
        """Whether N depends on time."""
        waves = self.sines + self.cosines
        return any(self.rate) or any(any(amplitude) for amplitude, _ in waves)

    @cached_property
    def is_zero(self) -> bool:
        """Whether N is zero at all times."""
        return not (self.varies or any(self.constant))

    @property
    def in_space(self) -> bool:
        """Whether the torque is about the axes of space, and not zero."""
        return self.frame == "space" and not self.is_zero

    def at(self, time: float) -> Triple:
        """Return N (N m or rad/s2) at `time` (s); the order of summation is fixed."""
        torque = list(self.constant)
        if self.varies:
            for axis in range(3):
                torque[axis] += self.rate[axis] * time
                for amplitude, frequency in self.sines:
                    torque[axis] += amplitude[axis] * sine(frequency * time)
                for amplitude, frequency in self.cosines:
                    torque[axis] += amplitude[axis] * cosine(frequency * time)
        return torque[0], torque[1], torque[2]


def _waves(where: str, values: object) -> tuple[Wave, ...]:
    allowed = "allowed: a list of waves, each an amplitude of three numbers and a frequency"
    waves = []
    for value in number_list(where, values, allowed):
        wave = list(itertools.islice(number_list(where, value, allowed), 3))
        if len(wave) != 2:
            raise InputError(f"{where}: a wave has an amplitude and a frequency; {allowed}")
        amplitude, frequency = wave
        waves.append(
            (three(f"{where} amplitude", amplitude), finite(f"{where} frequency", frequency))
        )
    return tuple(waves)


def law_value(law: TorqueLaw, time: Any) -> Array:
    """Return a law's components at a time (s), about the axes of `law.frame`."""
    found: list[Any] = [c + r * time for c, r in zip(law.constant, law.rate, strict=True)]
    waves = [(amplitude, np.sin(frequency * time)) for amplitude, frequency in law.sines]
    waves += [(amplitude, np.cos(frequency * time)) for amplitude, frequency in law.cosines]
    for amplitude, wave in waves:
        found = [each + a * wave for each, a in zip(found, amplitude, strict=True)]
    return np.array(found, dtype=object)


def law_integral(law: TorqueLaw, time: Any) -> Array:
    """Return the integral of a law's components from 0 to `time` (s)."""
    square = time * time
    found: list[Any] = [
        c * time + 0.5 * r * square for c, r in zip(law.constant, law.rate, strict=True)
    ]
    for amplitude, frequency in law.sines:
        if frequency:
            # The integral, (1 - cos(f t))/f, without cancellation for small angles.
            half = np.sin(0.5 * frequency * time)
            wave = half * half
            found = [x + 2.0 * a / frequency * wave for x, a in zip(found, amplitude, strict=True)]
    for amplitude, frequency in law.cosines:
        wave = np.sin(frequency * time) if frequency else time
        divisor = frequency or 1.0
        found = [x + a / divisor * wave for x, a in zip(found, amplitude, strict=True)]
    return np.array(found, dtype=object)


def law_derivative(law: TorqueLaw) -> TorqueLaw:
    """Return the time derivative of a law; raise InputError if an amplitude overflows."""
    sines = [([-f * a for a in amplitude], f) for amplitude, f in law.cosines]
    cosines = [([f * a for a in amplitude], f) for amplitude, f in law.sines]
    return TorqueLaw(law.rate, sines=sines, cosines=cosines, frame=law.frame)


def to_body(vector: Any, attitude: Any) -> Array:
    """Return the body components of a vector about the axes of space."""
    u, v, w = vector
    rows = rows_to_body(attitude)
    return np.array([p * u + q * v + s * w for p, q, s in rows], dtype=object)


def body_torque(law: TorqueLaw, time: Any, attitude: Any) -> Array:
    value = law_value(law, time)
    return to_body(value, attitude) if law.in_space else value
