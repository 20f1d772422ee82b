"""Waves of a torque law that have the same frequency, added up without rounding.

Each amplitude is divided by a moment and rounded by itself. Where two waves nearly cancel, their
roundings are left: amplitudes that differ by 1e-10 would leave six digits of the torque. Added
first, exactly, they leave all digits, and fewer waves are less work.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction

from pyharness.model.errors import InputError
from pyharness.model.inertia import Exact
from pyharness.model.scene import Scene, TorqueLaw, Wave
from pyharness.model.values import Triple

ExactWave = tuple[Exact, float]

_ZERO = (Fraction(0), Fraction(0), Fraction(0))


@dataclass(frozen=True)
class ExactLaw:
    """A torque law whose waves of one frequency are one, its numbers without rounding."""

    constant: Exact
    rate: Exact
    sines: tuple[ExactWave, ...]
    cosines: tuple[ExactWave, ...]
    frame: str

    def turned(self, turn: Callable[[Exact], Exact]) -> "ExactLaw":
        """Return the law with every vector turned."""

        def waves(each: tuple[ExactWave, ...]) -> tuple[ExactWave, ...]:
            return tuple((turn(amplitude), frequency) for amplitude, frequency in each)

        return ExactLaw(
            turn(self.constant), turn(self.rate), waves(self.sines), waves(self.cosines), self.frame
        )

    def rounded(self) -> TorqueLaw:
        """Return the law in floats, each number rounded once.

        InputError where a sum of amplitudes is beyond the range of numbers.
        """

        def waves(each: tuple[ExactWave, ...]) -> tuple[Wave, ...]:
            return tuple((_rounded(amplitude), frequency) for amplitude, frequency in each)

        return TorqueLaw(
            _rounded(self.constant),
            _rounded(self.rate),
            waves(self.sines),
            waves(self.cosines),
            self.frame,
        )


def merged(law: TorqueLaw) -> TorqueLaw:
    """Return the law with one wave for each frequency; a law of which that is true is not changed.

    Sines of opposite frequencies are one, with opposite signs, and cosines with the same sign. A
    cosine of frequency 0 is part of the constant, and a sine of frequency 0 is nothing.
    """
    return exact_law(law).rounded() if is_mergeable(law) else law


def is_mergeable(law: TorqueLaw) -> bool:
    """Whether two waves of a law are of one frequency, or one is of frequency 0."""
    for waves in (law.sines, law.cosines):
        counts = Counter(abs(frequency) for _, frequency in waves)
        if 0.0 in counts or any(count > 1 for count in counts.values()):
            return True
    return False


def exact_law(law: TorqueLaw) -> ExactLaw:
    """Return a torque law with one wave for each frequency, without rounding."""
    constant = _exact(law.constant)
    cosines = _summed(law.cosines, even=True)
    # A cosine of frequency 0 is 1 at all times, whereas a sine is 0.
    for amplitude, frequency in cosines:
        if frequency == 0.0:
            constant = _sum(constant, amplitude)
    return ExactLaw(
        constant,
        _exact(law.rate),
        tuple(wave for wave in _summed(law.sines, even=False) if wave[1] != 0.0),
        tuple(wave for wave in cosines if wave[1] != 0.0),
        law.frame,
    )


def _summed(waves: Iterable[Wave], even: bool) -> list[ExactWave]:
    """Return a wave for each frequency, but none whose amplitude vanishes; `even`: cosines."""
    found: dict[float, tuple[float, Exact]] = {}
    for amplitude, frequency in waves:
        exact = _exact(amplitude)
        first, total = found.get(abs(frequency), (frequency, _ZERO))
        if not even and first != frequency:
            exact = -exact[0], -exact[1], -exact[2]
        found[abs(frequency)] = first, _sum(total, exact)
    return [(total, frequency) for frequency, total in found.values() if any(total)]


def _exact(values: Triple) -> Exact:
    first, second, third = map(Fraction, values)
    return first, second, third


def _sum(x: Exact, y: Exact) -> Exact:
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


def _rounded(values: Exact) -> Triple:
    try:
        first, second, third = map(float, values)
    except OverflowError:
        raise InputError(
            "[torque]: waves of one frequency have a sum beyond the range of numbers; allowed: "
            f"amplitudes up to {math.ldexp(1.0, 1023):.2g} N m together"
        ) from None
    return first, second, third


def with_merged_waves(scene: Scene) -> Scene:
    """Return a scene whose torque has one wave for each frequency."""
    law = merged(scene.torque)
    return scene if law is scene.torque else replace(scene, torque=law)
