"""Proved enclosures of omega by Taylor steps in integer arithmetic, and their certificates.

`certificate_checker` explains a step's error bound, and verifies certificates independently.
"""

import math
from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from pyharness.model.effort import ProofWork
from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, no_progress
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw
from pyharness.truth.certificate_checker import (
    FORMAT,
    MOST_BITS,
    SCALE_BITS,
    Expansion,
    NotProvedError,
    System,
)
from pyharness.truth.enclosed import Balls, Enclosure, largest_radius, row_of, scales_of
from pyharness.truth.reference import check_order

_TUBE_BITS = 30  # the radius of a tube is at least 2**-30 of the solution
_GUARD_BITS = 16
_LENGTH_BITS = 20
_SHARE_BITS = 20  # the last terms are at most 2**-20 of the radius, or as large as the digits allow
_TOLERATED = 3  # bits by which the last terms may exceed this limit
# Limit of the work (about ms) of all attempts. An expansion needs _EXPANSION and, for each product,
# _PRODUCT, or more if its mean number of bits is not much smaller than _BITS_OF_PRODUCT.
_MOST_WORK, _EXPANSION, _PRODUCT, _BITS_OF_PRODUCT = 10_000, 0.25, 3e-4, 250
_PRODUCTS_OF_WAVE = 6  # for each term of the series
_MOST_ATTEMPTS = 6
# After the fraction _EARLY of the time, the growth of the radius is extrapolated to the end. If
# digits will be missing, the proof begins again with these and _MORE further digits.
_EARLY, _MORE = 0.05, 1.5
_WORDS = "Taylor steps in integer arithmetic"


@dataclass(frozen=True)
class Proof:
    enclosure: Enclosure
    _run: "_Run"

    @cached_property
    def certificate(self) -> dict[str, Any]:
        return self._run.certificate()


class _AmplifiedError(Exception):
    """Signal that amplified errors require further digits; the argument is their number."""


def has_certificate(scene: Scene) -> bool:
    constant = scene.changing is None and scene.inertia is None
    return constant and isinstance(scene.torque, TorqueLaw) and not scene.torque.in_space


def prove(
    scene: Scene,
    times: Sequence[float],
    digits: int = 30,
    effort: float = 1.0,  # factor on the work limit
    progress: Progress = no_progress,
) -> Proof:
    """Return balls that contain omega at `times` (s) to `digits` digits, and a certificate.

    Raise InputError if no proof is found.
    """
    if not has_certificate(scene):
        raise InputError(
            "a certificate is for constant moments or coefficients and a torque law about the axes "
            "of the body; allowed for other scenes: prove without --certificate"
        )
    check_order(times, "prove")
    record = _scene_record(scene)
    wanted, work = float(digits), ProofWork(_MOST_WORK, effort)
    for attempt in range(_MOST_ATTEMPTS):
        run = _Run(record, times, wanted, digits, work)
        try:
            # The last attempt is not stopped early, and reports how far a proof reaches.
            last = attempt == _MOST_ATTEMPTS - 1
            run.prove(progress, 1.0 if last else _EARLY)
        except _AmplifiedError as error:
            wanted += error.args[0]
            continue
        excess = largest_radius(run.omega, digits)
        if excess <= 1:
            found = Enclosure(tuple(times), tuple(run.omega), _WORDS, len(run.steps))
            return Proof(found, run)
        bits = excess.numerator.bit_length() - excess.denominator.bit_length() + 1
        wanted += bits * math.log10(2.0) + 1.0
    raise _many_digits(digits)


def _many_digits(digits: int) -> InputError:
    return InputError(f"prove: the motion amplifies errors too much for {digits} digits; use fewer")


def _scene_record(scene: Scene) -> dict[str, Any]:
    law = scene.law
    body = "moments" if scene.coefficients is None else "coefficients"
    waves = {
        name: [[list(amplitude), frequency] for amplitude, frequency in getattr(law, name)]
        for name in ("sines", "cosines")
    }
    return {
        "name": scene.name,
        # The moments of a `PrincipalScene` have more digits than a binary64 number.
        body: [
            float(x) if Fraction(float(x)) == x else str(x)
            for x in scene.exact_moments or scene.coefficients or ()
        ],
        "omega": list(scene.omega),
        "torque": {"constant": list(law.constant), "rate": list(law.rate), **waves},
    }


class _Run:
    def __init__(
        self,
        record: dict[str, Any],
        times: Sequence[float],
        digits: float,
        goal: int,
        work: ProofWork,
    ) -> None:
        self._record, self._times = record, [Fraction(t) for t in times]
        self._goal, self._work = goal, work
        # More terms give fewer steps and a smaller certificate, but cost time.
        self._order = max(16, round(min(1.6 * digits, digits + 40.0)))
        self._clock = max(_LENGTH_BITS + 12, self._times[-1].denominator.bit_length())
        needed = math.ceil(digits / math.log10(2.0)) + _GUARD_BITS
        self._bits = max(self._clock, needed + _GUARD_BITS + self._order.bit_length())
        if self._bits > MOST_BITS:
            raise _many_digits(goal)
        self._most = self._bits - needed  # bits of the last terms
        rows = System(record, self._bits, self._clock, [1, 1, 1]).rows
        scales = scales_of([Fraction(terms[0], common) for common, terms in rows])
        whole = [round(x * (1 << SCALE_BITS)) for x in scales]
        self._system = System(record, self._bits, self._clock, whole)
        # By step: the fraction of the last time, and the logarithm of the amplification so far.
        self._amplified: list[tuple[float, float]] = [(0.0, 0.0)]
        self.steps: list[list[Any]] = []  # length, tube, radius and middle of each
        self.omega: list[Balls] = []

    def prove(self, progress: Progress, early: float) -> None:
        """Compute all steps; raise _AmplifiedError if errors grow too fast after part `early`."""
        system, clock = self._system, self._clock
        middle = [int(Fraction(x) * (1 << self._bits)) for x in self._record["omega"]]
        waves = [0, 1 << self._bits] * len(system.frequencies)
        radius, wave_radius, time = system.norm([1, 1, 1]), 0, 0
        self._add_balls([[x] for x in middle], radius, 0, 0)
        end = int(self._times[-1] * (1 << clock))
        length, side = 1 << clock, -1 if end < 0 else 1
        self._work.begin()
        while time != end:
            self._work.check(abs(time / end))
            h = side * min(length, abs(end - time))
            # Residuals much smaller than the present radius would only cost time.
            most, longer = max(self._most, radius.bit_length() - _SHARE_BITS), 1.0
            while True:
                expansion = system.expand([*middle, *waves], time, h, self._order)
                self._work.done += self._work_of(expansion)
                last = max(abs(x) for each in expansion[0] for x in each[-2:])
                excess = (last.bit_length() - most) / self._order
                if excess <= _TOLERATED / self._order:
                    source, tube = self._tube(radius, wave_radius, expansion, h)
                    try:
                        radii = system.radii(radius, wave_radius, expansion, tube, h)
                        break
                    except NotProvedError:
                        h, longer = int(h / 2), 0.1
                else:
                    h = int(h * 2.0 ** (-excess - 0.05))
                if abs(h) <= 1:
                    at = time / (1 << clock)
                    raise InputError(f"prove: no proof is found beyond t = {at:.6g} s")
            self._add_balls(expansion[0], radii[0], time, h)
            after = [sum(each) for each in expansion[0]]
            middle, waves, time = after[:3], after[3:], time + h
            more = self._expected_excess(radii[0], source, middle, time / end)
            if early < time / end < 1.0 and more > 0.0:
                raise _AmplifiedError(more + _MORE)
            # The checker adds the distance from the stated middle: 0, rounded up.
            radius, wave_radius = radii[0] + system.norm([0, 0, 0]), radii[1]
            self.steps.append([h, tube, radius, middle])
            self._work.steps += 1
            length = max(1, int(abs(h) * 2.0 ** min(longer, -excess)))
            progress(abs(time * 100 // end), 100, f"t = {time / (1 << clock):.4g} s")

    def _work_of(self, expansion: Expansion) -> float:
        order, n_waves = self._order, len(self._system.frequencies)
        bits = sum(x.bit_length() for each in expansion[0][:3] for x in each) / (3 * order)
        products = order * (order + _PRODUCTS_OF_WAVE * n_waves)
        return _EXPANSION + products * _PRODUCT * (1.0 + (bits / _BITS_OF_PRODUCT) ** 2)

    def _expected_excess(
        self, radius: int, source: int, middle: Sequence[int], share: float
    ) -> float:
        amplified = self._amplified
        total = amplified[-1][1] + math.log10(radius) - math.log10(source)
        amplified.append((share, total))
        # The mean rate since half the present time is extrapolated.
        then, before = amplified[bisect(amplified, (share / 2.0, 0.0))]
        rate = (total - before) / (share - then) if share > then else 0.0
        unit = max(1 << self._bits, *map(abs, middle))
        return math.log10(radius) - math.log10(unit) + self._goal + rate * (1.0 - share)

    def _tube(self, radius: int, wave_radius: int, expansion: Expansion, h: int) -> tuple[int, int]:
        """Return a bound on a step's error without amplification, and the radius of its tube."""
        series, residuals, wave_residual = expansion
        forced = self._system.forced(h) * (wave_radius + wave_residual) >> 64
        source = radius + self._system.norm(residuals) + forced
        thick: int = max(max(map(abs, each)) for each in series[:3]) >> _TUBE_BITS
        return source, 8 * source + thick + 8

    def _add_balls(self, series: list[list[int]], radius: int, time: int, h: int) -> None:
        """Add balls at the requested times in a step, or at its beginning if h is 0."""
        unit = 1 << self._bits
        for t in self._times[len(self.omega) :]:
            passed = t * (1 << self._clock) - time
            if abs(passed) > abs(h):
                break
            middle, size = self._system.ball(series, passed / (h or 1), radius)
            self.omega.append(Balls(tuple(Fraction(x, unit) for x in middle), size / unit))

    def certificate(self) -> dict[str, Any]:
        rows = zip(self._times, self.omega, strict=True)
        return {
            "format": FORMAT,
            "scene": self._record,
            "bits": self._bits,
            "clock": self._clock,
            "order": self._order,
            "scales": list(self._system.scales),
            "steps": self.steps,
            "rows": [row_of(float(t), balls) for t, balls in rows if t],
        }
