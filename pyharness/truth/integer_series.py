"""A second reference, by Taylor series in integer arithmetic.

It shares no code with `truth/reference.py`. Numbers are integers over 2**BITS, in units in which
the last time is 1 and the largest omega about 1. The torque's sines and cosines are further
unknowns, so that no library functions are needed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import mul

import numpy as np

from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

BITS = 160
_ORDER = 36
_LAST = 60  # most bits of the last Taylor terms of a step, which are then below 2**-100 units
_CLOCK = 64  # steps are multiples of 2**-64 of the last requested time
_MOST_STEPS = 20_000  # a step takes a third of a millisecond
# The guessed unit of omega is accepted if the largest omega is 2**-_BELOW to 2**_ABOVE units.
_ABOVE, _BELOW = 8, 24
_MOST_GUESSES = 16
_LEAST_POWER = -1200  # numbers below 2**_LEAST_POWER are 0 in binary64
_INSIDE = 24  # nodes in each step at which the path is evaluated

Series = list[int]


@dataclass(frozen=True, eq=False)
class Path:
    """The solution of a scene at requested times, and at many times between."""

    time: Array  # shape (n,); as requested, s
    omega: Array  # shape (n, 3); rounded to binary64, rad/s
    nodes: Array  # shape (m,); closely spaced times from 0 to the last requested one, s
    way: Array  # shape (m, 3); omega at the nodes, in binary64 arithmetic, rad/s


class _OtherUnitError(Exception):
    """Signal that the unit of omega must be multiplied by 2 to the power of the argument."""


def integer_series(scene: Scene, times: Sequence[float]) -> Path:
    """Return a scene's solution at `times` (s).

    Before rounding, errors are some 1e-29 of the largest omega, times the error amplification.
    """
    size = _guess(scene, abs(Fraction(times[-1])))
    power = size.numerator.bit_length() - size.denominator.bit_length() if size else 0
    for _ in range(_MOST_GUESSES):
        try:
            return _integrate(scene, times, power)
        except _OtherUnitError as other:
            power += other.args[0]
    raise InputError("integer series: omega grows without bound")


def _guess(scene: Scene, span: Fraction) -> Fraction:
    law = scene.body_torque
    found = [abs(Fraction(w)) for w in scene.omega]
    for axis, moment in enumerate(scene.moments or (1.0, 1.0, 1.0)):
        push = abs(Fraction(law.constant[axis])) + abs(Fraction(law.rate[axis])) * span
        push += sum(abs(Fraction(amplitude[axis])) for amplitude, _ in law.sines + law.cosines)
        found.append(push * span / Fraction(moment))
    return max(found)


def _integrate(scene: Scene, times: Sequence[float], power: int) -> Path:
    """Return the solution; raise _OtherUnitError if 2**power rad/s is a bad unit of omega."""
    span = Fraction(times[-1])
    wanted = [Fraction(t) / span for t in times]
    equations = _Equations(scene, span, Fraction(2) ** power)
    state = equations.start
    whole = 1 << _CLOCK
    begin, length = 0, whole
    rows: list[list[Fraction]] = []
    nodes, way = [np.zeros(1)], [np.array([scene.omega])]
    inside = np.arange(1, _INSIDE + 1) / _INSIDE
    powers = inside[:, None] ** np.arange(_ORDER + 1)
    largest = max(map(abs, state[:3]))
    for _ in range(_MOST_STEPS):
        length = min(length, whole - begin)
        while True:
            terms = equations.expand(state, begin, length)
            last = max(abs(term) for each in terms for term in each[-4:])
            excess = (last.bit_length() - _LAST) / _ORDER
            if excess <= 0.0 or length == 1:
                break
            length = max(1, int(length * 2.0 ** (-excess - 0.05)))
        if length == 1 < whole - begin:
            raise InputError("integer series: omega grows without bound")
        while len(rows) < len(times) and wanted[len(rows)] * whole <= begin + length:
            part = (wanted[len(rows)] * whole - begin) / length
            rows.append([_evaluate(each, part) for each in terms[:3]])
        state = [sum(each) for each in terms]
        dense = powers @ (np.array([list(map(float, each)) for each in terms[:3]]) * 2.0**-BITS).T
        largest = max(largest, *map(abs, state[:3]), int(np.abs(dense).max() * 2.0**BITS))
        with np.errstate(over="ignore"):
            way.append(np.ldexp(dense, power))
        nodes.append((begin + inside * length) / whole * times[-1])
        begin += length
        beside = largest.bit_length() - BITS
        if beside > _ABOVE:
            raise _OtherUnitError(beside)
        if begin == whole:
            if beside < -_BELOW and (largest or equations.acts) and power > _LEAST_POWER:
                raise _OtherUnitError(beside)
            unit = Fraction(2) ** power
            try:
                omega = np.array([[float(x * unit) for x in row] for row in rows])
            except OverflowError:
                raise InputError("integer series: omega overflows") from None
            return Path(np.array(times, dtype=float), omega, np.hstack(nodes), np.vstack(way))
        length = int(length * 2.0 ** min(1.0, -excess - 0.02)) or 1
    raise InputError(f"integer series: more than {_MOST_STEPS} steps would be needed")


def _evaluate(terms: Series, part: Fraction) -> Fraction:
    """Return a series at the fraction `part` of a step; `terms` are its terms at the end."""
    fixed = _fixed(part)
    total = 0
    for term in reversed(terms):
        total = (total * fixed >> BITS) + term
    return Fraction(total, 1 << BITS)


def _fixed(value: Fraction) -> int:
    return (value.numerator << BITS) // value.denominator


def exact_body(scene: Scene) -> tuple[list[Fraction], list[Fraction]]:
    """Return exact moments (kg m2), or ones for a body with coefficients, and exact A, B, C."""
    moments = list(scene.exact_moments or (Fraction(1),) * 3)
    if scene.coefficients is not None:
        return moments, [Fraction(x) for x in scene.coefficients]
    return moments, [(moments[i - 2] - moments[i - 1]) / moments[i] for i in range(3)]


class _Equations:
    """Equations 13-15 of the thesis as recurrences of Taylor terms.

    The units of time and omega are `span` (s) and `unit` (rad/s).
    """

    def __init__(self, scene: Scene, span: Fraction, unit: Fraction) -> None:
        law = scene.body_torque
        moments, products = exact_body(scene)
        push = [span / (moment * unit) for moment in moments]
        self._products = [_fixed(x * span * unit) for x in products]
        self._constant = [_fixed(Fraction(x) * p) for x, p in zip(law.constant, push, strict=True)]
        self._rate = [_fixed(Fraction(x) * p * span) for x, p in zip(law.rate, push, strict=True)]
        # Each frequency has two unknowns, a sine and a cosine. If the angle at the last time is
        # below 1 rad, the sine is divided by this angle: a small sine has few digits in fixed
        # point, and a large amplitude would magnify its error. An entry has the factors of the
        # cosine in the sine's derivative, of the sine in the cosine's derivative and, by axis, of
        # the sine and of the cosine in torque over moment.
        self._waves = []
        for frequency in {abs(f) for _, f in law.sines + law.cosines}:
            angle = Fraction(frequency) * span
            slow = abs(angle) < 1
            sines, cosines = [Fraction(0)] * 3, [Fraction(0)] * 3
            for amplitude, f in law.sines:
                if abs(f) == frequency:
                    sign = -1 if f < 0.0 else 1
                    sines = [x + sign * Fraction(a) for x, a in zip(sines, amplitude, strict=True)]
            for amplitude, f in law.cosines:
                if abs(f) == frequency:
                    cosines = [x + Fraction(a) for x, a in zip(cosines, amplitude, strict=True)]
            wave = (
                _fixed(Fraction(1) if slow else angle),
                _fixed(-angle * angle if slow else -angle),
                [_fixed(x * p * (angle if slow else 1)) for x, p in zip(sines, push, strict=True)],
                [_fixed(x * p) for x, p in zip(cosines, push, strict=True)],
            )
            self._waves.append(wave)
        self.acts = not law.is_zero
        self.start = [_fixed(Fraction(w) / unit) for w in scene.omega]
        self.start += [0, 1 << BITS] * len(self._waves)

    def expand(self, state: Series, begin: int, length: int) -> list[Series]:
        """Return all unknowns' Taylor terms in a step: coefficient k times power k of the step."""

        # `begin` and `length` are in units of 2**-64 of the last time.
        def stepped(x: int) -> int:
            return x * length >> _CLOCK

        factors = list(map(stepped, self._products))
        series = [[x] for x in state]
        torques = [
            [stepped(m + (r * begin >> _CLOCK)), stepped(stepped(r))]
            for m, r in zip(self._constant, self._rate, strict=True)
        ]
        torques = [each + [0] * (_ORDER - 2) for each in torques]
        for n, (to_sine, to_cosine, on_sines, on_cosines) in enumerate(self._waves):
            sine, cosine = series[3 + 2 * n], series[4 + 2 * n]
            forth, back = stepped(to_sine), stepped(to_cosine)
            for k in range(_ORDER):
                sine.append((forth * cosine[k] >> BITS) // (k + 1))
                cosine.append((back * sine[k] >> BITS) // (k + 1))
            for m, on_sine, on_cosine in zip(torques, on_sines, on_cosines, strict=True):
                if on_sine or on_cosine:
                    s, t = stepped(on_sine), stepped(on_cosine)
                    for k in range(_ORDER):
                        m[k] += (s * sine[k] + t * cosine[k]) >> BITS
        x, y, z = series[:3]
        for k in range(_ORDER):
            y_backward, z_backward = y[::-1], z[::-1]
            products = (
                sum(map(mul, y, z_backward)),
                sum(map(mul, x, z_backward)),
                sum(map(mul, x, y_backward)),
            )
            for each, factor, total, m in zip((x, y, z), factors, products, torques, strict=True):
                each.append(((factor * total >> 2 * BITS) + m[k]) // (k + 1))
        return series
