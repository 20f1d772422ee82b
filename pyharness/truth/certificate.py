"""Proofs by Taylor steps in integer arithmetic, and the certificates that state them.

The bounds of a step are those of the checker (`certificate_checker`), which does not trust this
module: a certificate has the steps and their balls, and the checker verifies each of them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from pyharness.model.effort import advice, checked_effort
from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, no_progress
from pyharness.model.scene import Scene
from pyharness.model.torque_law import TorqueLaw, Wave
from pyharness.truth.certificate_checker import FORMAT, SCALE_BITS, NotProvedError, System
from pyharness.truth.enclosed import Balls, Enclosure, largest_radius, row_of
from pyharness.truth.scales import scales_of
from pyharness.truth.times import check_order

_TUBE_BITS = 30  # a tube is at least 2**-30 of the solution thick
_GUARD_BITS = 16
_LENGTH_BITS = 20
_MOST_STEPS = 20_000  # some twenty seconds
_MOST_ATTEMPTS = 6
# After this share of the time, the growth of the radius is extrapolated; the digits that it takes
# may be exceeded by some more.
_EARLY, _MORE = 0.05, 4.0
_WORDS = "Taylor steps in integer arithmetic"


@dataclass(frozen=True)
class _Step:
    length: int
    tube: int
    radius: int
    middle: list[int]


@dataclass(frozen=True)
class Proof:
    """An enclosure at requested times, and its certificate as a dictionary for JSON."""

    enclosure: Enclosure
    certificate: dict[str, Any]


class _AmplifiedError(Exception):
    """The errors grow so much that the run needs this number of digits more."""

    def __init__(self, digits: float) -> None:
        super().__init__()
        self.digits = digits


def has_certificate(scene: Scene) -> bool:
    """Return whether a scene has constant principal moments and a torque law about body axes."""
    constant = scene.changing is None and scene.inertia is None
    return constant and isinstance(scene.torque, TorqueLaw) and not scene.torque.in_space


def prove(
    scene: Scene,
    times: Sequence[float],
    digits: int = 30,
    effort: float = 1.0,
    progress: Progress = no_progress,
) -> Proof:
    """Return balls that contain omega at `times` (s), and a certificate of them.

    The times have one sign, and each is farther from 0 than the one before. The radius of a ball is
    at most 10**-digits rad/s, times the largest component of omega if it exceeds 1 rad/s. `effort`
    is a factor on the limit of the number of steps, and `progress` is called after each step. Raise
    InputError if the scene has no certificate, if omega grows without bound, or if the work limit
    is exceeded.
    """
    if not has_certificate(scene):
        raise InputError(
            "a certificate is for constant moments or coefficients and a torque law about the axes "
            "of the body; allowed for other scenes: prove without --certificate"
        )
    check_order(times, "prove")
    record = _scene_record(scene)
    limit = _MOST_STEPS * checked_effort(effort)
    wanted = float(digits)
    for _ in range(_MOST_ATTEMPTS):
        run = _Run(record, times, wanted, digits)
        try:
            steps = run.steps(limit, effort, progress)
        except _AmplifiedError as error:
            wanted += error.digits
            continue
        omega = run.balls(steps)
        excess = largest_radius(omega, digits)
        if excess <= 1:
            found = Enclosure(tuple(times), tuple(omega), _WORDS, len(steps))
            return Proof(found, run.certificate(steps, omega))
        wanted += _decades(excess) + 1.0
    raise InputError(f"prove: the motion amplifies errors too much for {digits} digits; use fewer")


def _decades(x: Fraction) -> float:
    return (x.numerator.bit_length() - x.denominator.bit_length() + 1) * math.log10(2.0)


def _scene_record(scene: Scene) -> dict[str, Any]:
    law = scene.law
    body = "moments" if scene.coefficients is None else "coefficients"

    def waves(given: Sequence[Wave]) -> list[list[Any]]:
        return [[list(amplitude), frequency] for amplitude, frequency in given]

    return {
        "name": scene.name,
        # The moments of a principal scene have more digits than a binary64 number.
        body: [
            float(x) if Fraction(float(x)) == x else str(x)
            for x in scene.exact_moments or scene.coefficients or ()
        ],
        "omega": list(scene.omega),
        "torque": {
            "constant": list(law.constant),
            "rate": list(law.rate),
            "sines": waves(law.sines),
            "cosines": waves(law.cosines),
        },
    }


class _Run:
    """An integration of one scene with one accuracy."""

    def __init__(
        self, record: dict[str, Any], times: Sequence[float], digits: float, goal: int
    ) -> None:
        self._record, self._times = record, [Fraction(t) for t in times]
        self._digits, self._goal = digits, goal
        # More terms make fewer steps and a smaller certificate; too many cost time.
        self._order = max(16, round(min(1.6 * digits, digits + 40.0)))
        self._clock = max(_LENGTH_BITS + 12, *(t.denominator.bit_length() for t in self._times))
        needed = math.ceil(digits / math.log10(2.0)) + _GUARD_BITS
        self._fine = needed + _GUARD_BITS + self._order.bit_length()
        self._bits = max(self._clock, self._fine)
        self._most = self._bits - needed  # bits of the last terms
        self._system = System(record, self._bits, self._clock, [1, 1, 1])
        coefficients = [Fraction(terms[0], common) for common, terms in self._system.rows]
        self._system.scales = [round(x * (1 << SCALE_BITS)) for x in scales_of(coefficients)]

    @property
    def _start(self) -> list[int]:
        return [int(Fraction(x) * (1 << self._bits)) for x in self._record["omega"]]

    def steps(self, limit: float, effort: float, progress: Progress) -> list[_Step]:
        """Return the steps from time 0 to the last requested time."""
        system, clock = self._system, self._clock
        middle, waves = self._start, [0, 1 << self._bits] * len(system.frequencies)
        radius, wave_radius, time = system.norm([1, 1, 1]), 0, 0
        found: list[_Step] = []
        ends = [int(t * (1 << clock)) for t in self._times]
        length, side = 1 << clock, -1 if ends[-1] < 0 else 1
        for end in ends:
            while time != end:
                if len(found) >= limit:
                    share = max(abs(time / ends[-1]), 1e-3)
                    instead = advice("use a shorter time", effort, effort / share)
                    raise InputError(f"prove: more than {limit:.0f} steps; {instead}")
                h = side * min(length, abs(end - time))
                while True:
                    expansion = system.expand([*middle, *waves], time, h, self._order)
                    last = max(abs(x) for each in expansion[0] for x in each[-2:])
                    excess = (last.bit_length() - self._most) / self._order
                    if excess <= 0.0:
                        tube = self._tube(radius, expansion, h)
                        try:
                            radii = system.radii(radius, wave_radius, expansion, tube, h)
                            break
                        except NotProvedError:
                            h = int(h / 2)
                    else:
                        h = int(h * 2.0 ** (-excess - 0.05))
                    if abs(h) <= 1:
                        at = time / 2.0**clock
                        raise InputError(f"prove: no proof is found beyond t = {at:.6g} s")
                after = [sum(each) for each in expansion[0]]
                middle, waves, time = after[:3], after[3:], time + h
                # The checker adds the distance from the stated middle, which is 0, rounded up.
                radius, wave_radius = radii[0] + system.norm([0, 0, 0]), radii[1]
                found.append(_Step(h, tube, radius, middle))
                length = max(1, int(abs(h) * 2.0 ** min(1.0, -excess - 0.02)))
                self._check_growth(radius, abs(time / ends[-1]))
                progress(abs(time * 100 // ends[-1]), 100, f"t = {time / 2.0**clock:.4g} s")
        return found

    def _check_growth(self, radius: int, share: float) -> None:
        """Raise _AmplifiedError if the radius grows too fast, after a `share` of the last time."""
        spare = self._digits - self._goal + 3.0
        lost = (radius.bit_length() - self._bits) * math.log10(2.0) + self._digits
        if share > _EARLY and lost / share > spare + _MORE:
            raise _AmplifiedError(lost / share - spare + _MORE)

    def _tube(self, radius: int, expansion: Any, h: int) -> int:
        """Return the radius of a tube that is larger than the error of an ordinary step."""
        series, residuals, wave_residual = expansion
        system = self._system
        thick: int = max(max(map(abs, each)) for each in series[:3]) >> _TUBE_BITS
        source: int = radius + system.norm(residuals) + (system.forced(h) * wave_residual >> 64)
        return 8 * source + thick + 8

    def balls(self, steps: Sequence[_Step]) -> list[Balls]:
        """Return the balls of omega at each requested time."""
        unit = 1 << self._bits
        largest = max(self._system.scales)
        states = {Fraction(0): (self._start, self._system.norm([1, 1, 1]))}
        time = 0
        for step in steps:
            time += step.length
            states[Fraction(time, 1 << self._clock)] = (step.middle, step.radius)
        found = []
        for middle, radius in (states[t] for t in self._times):
            size = Fraction(radius * largest, unit << SCALE_BITS)
            found.append(Balls(tuple(Fraction(x, unit) for x in middle), size))
        return found

    def certificate(self, steps: Sequence[_Step], omega: Sequence[Balls]) -> dict[str, Any]:
        """Return the certificate of the balls at all requested times but 0."""
        rows = zip(self._times, omega, strict=True)
        return {
            "format": FORMAT,
            "scene": self._record,
            "bits": self._bits,
            "clock": self._clock,
            "order": self._order,
            "scales": list(self._system.scales),
            "steps": [[x.length, x.tube, x.radius, x.middle] for x in steps],
            "rows": [row_of(float(t), balls) for t, balls in rows if t],
        }
