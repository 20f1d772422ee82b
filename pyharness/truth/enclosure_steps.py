"""Proved enclosures of the solution of any scene with a recorded torque, by Taylor steps.

In each step a polynomial p approximates the solution of y' = f(t, y). Any p is allowed, as its
residual p' - f(t, p) is bounded on the whole step in ball (interval) arithmetic.

The unknowns form blocks, such as omega and attitude. The norms of the blocks of y - p form the
vector r, which obeys r' <= M r + d, where d bounds the norms of the residual's blocks. On its
diagonal, M bounds the logarithmic norms of the diagonal blocks of the Jacobian of f near p;
elsewhere, the norms of the other blocks. Since no element of M is negative, r(h) <= exp(h M) (r(0)
+ h d) after a step h. For one block this is theorem I.10.6 of Hairer, Norsett and Wanner 1993.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from fractions import Fraction
from itertools import pairwise
from typing import Any

from flint import acb, arb, arb_mat, arb_series, ctx

from pyharness.model.attitude import IDENTITY, quaternion_rates
from pyharness.model.changing import rates_of_inertia
from pyharness.model.dual import Dual
from pyharness.model.effort import ProofWork
from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, no_progress
from pyharness.model.scene import Scene
from pyharness.model.state_torque import of_law
from pyharness.model.tape import Tape, evaluate
from pyharness.model.torque_law import TorqueLaw
from pyharness.truth.balls import ball, balls, functions_at
from pyharness.truth.decimal_functions import value_at
from pyharness.truth.enclosed import Balls, Enclosure, largest_radius, scales_of
from pyharness.truth.integer_series import exact_body

# The right-hand side f(t, y): derivatives of all unknowns at a time (s) and a state.
Rates = Callable[[Any, Sequence[Any]], list[Any]]

# Radii, in units of the step, of the circles on which Cauchy's estimate bounds the rest of a
# power series.
_CIRCLES = (8, 4, 2)
_SHORTEST = Fraction(1, 2**400)
# Least ratio of the thickness of the tube around p, in which the Jacobian is bounded, to p.
_TUBE = 2.0**-30
_LEAST_TUBE = 2.0**-200
_LENGTH_BITS = 24
# Limit of the work (about ms) of all attempts. A step needs _OPERATION times the order's square for
# each operation of the right-hand side.
_MOST_WORK, _OPERATION = 10_000, 7.5e-4
_MOST_ATTEMPTS = 6
_GUARD_DIGITS = 12


def enclose_steps(
    scene: Scene,
    times: Sequence[float],
    digits: int,
    velocity: bool = False,
    transition: bool = False,
    effort: float = 1.0,
    progress: Progress = no_progress,
) -> Enclosure:
    """Return balls that contain the solution of a scene at `times` (s).

    The arguments, and the errors raised, are as in `enclosure.enclose`.
    """
    wanted, work = float(digits + 2), ProofWork(_MOST_WORK, effort)
    for _ in range(_MOST_ATTEMPTS):
        bits = math.ceil((wanted + _GUARD_DIGITS) * math.log2(10.0))
        with ctx.workprec(bits), ExitStack() as afterwards:
            # The steps change python-flint's global length of power series.
            afterwards.callback(setattr, ctx, "cap", ctx.cap)
            proof = _Proof(Equations(scene, velocity, transition), wanted, times[-1] >= 0.0)
            cost = _OPERATION * proof.order**2 * proof.equations.n_operations
            found, steps, share = [], 0, 0.0
            work.begin()
            for time in map(Fraction, times):
                while proof.time != time and not proof.is_lost:
                    work.check(share)
                    proof.step(time)
                    steps += 1
                    work.steps += 1
                    work.done += cost
                    at = abs(float(proof.time) / times[-1])
                    share = max(at, share)
                    progress(int(at * 100), 100, f"t = {float(proof.time):.4g} s")
                if proof.is_lost:
                    break
                found.append(proof.balls(scene.attitude is not None))
        if len(found) < len(times):
            # Further steps would be short and slow.
            wanted *= 2.0
            continue
        excess = largest_radius([each[0] for each in found], digits)
        if excess <= 1:
            omega, *others = zip(*found, strict=True)
            names = ["attitude"] * (scene.attitude is not None)
            names += ["velocity"] * velocity + ["transition"] * transition
            more = dict(zip(names, others, strict=True))
            return Enclosure(tuple(times), omega, "Taylor steps in ball arithmetic", steps, **more)
        wanted += math.log10(float(min(excess, Fraction(10) ** 300))) + 1.0
    raise InputError(f"prove: the motion amplifies errors too much for {digits} digits; use fewer")


class Equations:
    """The equations of motion of a scene, with exact coefficients.

    `blocks` are slices of the unknowns, `scales` the units of their errors.
    """

    # The unknowns are omega (rad/s), the scene's quaternion, the velocity (m/s) and, by rows, the
    # derivatives of omega and quaternion with respect to omega at time 0.

    def __init__(self, scene: Scene, velocity: bool, transition: bool) -> None:
        tapes = _tapes(scene)
        if any(each.needs_attitude for each in tapes) and scene.attitude is None:
            raise InputError(
                "a torque that depends on the attitude needs it; give the scene an attitude"
            )
        self._tapes, self._scene = tapes, scene
        self._velocity, self._transition = velocity, transition
        self._turning = 3 if scene.attitude is None else 7
        self.start = [Fraction(x) for x in (*scene.omega, *(scene.attitude or ()))]
        sizes = [3, *([4] if self._turning == 7 else [])]
        if velocity:
            self.start += [Fraction(0)] * 3
            sizes.append(3)
        if transition:
            self.start += [Fraction(i == j) for i in range(self._turning) for j in range(3)]
            sizes.append(3 * self._turning)
        ends = [sum(sizes[:k]) for k in range(len(sizes) + 1)]
        self.blocks = [slice(*each) for each in pairwise(ends)]
        self.breaks = [t for each in tapes for t in each.breaks]
        self._principal: list[Any] | None = None
        self._moments = [arb(1)] * 3
        self.scales = [1.0] * len(self.start)
        if scene.changing is None and scene.inertia is None:
            moments, coefficients = exact_body(scene)
            self._moments = list(map(ball, moments))
            self._principal = list(map(ball, coefficients))
            self.scales[:3] = scales_of(coefficients)
        elif scene.inertia is not None:
            self._inertia = [[arb(x) for x in row] for row in scene.inertia]
        # About as many operations as take the time of a right-hand side.
        count = (9 if self._principal else 25) + 16 * (scene.attitude is not None)
        count += sum(len(each.operations) for each in tapes)
        self.n_operations = count * (8 if transition else 1)
        self._push = [arb(force) / arb(scene.masses[0]) for force in scene.forces]

    def at(self, begin: Fraction, forward: bool) -> Rates:
        """Return the right-hand side for a step from `begin` (s), forward or backward in time."""
        functions = functions_at(begin, forward)

        def rates(time: Any, state: Sequence[Any]) -> list[Any]:
            omega, rest = list(state[:3]), list(state[3:])
            q, rest = (rest[:4], rest[4:]) if self._turning == 7 else ([], rest)
            v, rest = (rest[:3], rest[3:]) if self._velocity else ([], rest)
            slopes: list[Any] = []
            if self._transition:
                inner = [Dual(x, rest[3 * k : 3 * k + 3]) for k, x in enumerate((*omega, *q))]
                moved = self._evaluate(time, inner[:3], inner[3:], functions)
                found = [each.value for each in moved]
                slopes = [slope for each in moved for slope in each.slopes]
            else:
                found = self._evaluate(time, omega, q, functions)
            if v:
                (x, y, z), (a, b, c) = omega, v
                cross = (b * z - c * y, c * x - a * z, a * y - b * x)
                found += [p + push for p, push in zip(cross, self._push, strict=True)]
            return found + slopes

        return rates

    def _evaluate(self, time: Any, omega: list[Any], q: list[Any], functions: Any) -> list[Any]:
        inputs = [time, *omega, *(q or IDENTITY)]
        parts = [evaluate(each, inputs, functions) for each in self._tapes]
        torque = [sum(each[1:], each[0]) for each in zip(*parts, strict=True)]
        x, y, z = omega
        if self._principal is not None:
            products = (y * z, z * x, x * y)
            terms = zip(self._principal, products, torque, self._moments, strict=True)
            found = [a * product + n / moment for a, product, n, moment in terms]
        elif self._scene.inertia is not None:
            found = rates_of_inertia(self._inertia, omega, torque)
        else:
            found = self._changing_rates(time, omega, torque)
        return found + (list(quaternion_rates((x, y, z), q)) if q else [])

    def _changing_rates(self, time: Any, omega: list[Any], torque: list[Any]) -> list[Any]:
        changing = self._scene.changing
        assert changing is not None
        matrix = changing.matrix(Dual(time, [arb(1)]))
        # Constant elements are floats, whose quotients Python would round.
        values = [[x.value if isinstance(x, Dual) else arb(x) for x in row] for row in matrix]
        pushed = [
            n
            - sum(
                (x.slopes[0] * w for x, w in zip(row, omega, strict=True) if isinstance(x, Dual)),
                arb(0),
            )
            for n, row in zip(torque, matrix, strict=True)
        ]
        return rates_of_inertia(values, omega, pushed)


def _tapes(scene: Scene) -> list[Tape]:
    """Return tapes whose exact sum is the torque; a sum within a tape would be rounded."""
    law = scene.torque
    if isinstance(law, TorqueLaw):
        laws = [TorqueLaw(law.constant, law.rate, frame=law.frame)]
        laws += [TorqueLaw(sines=[wave], frame=law.frame) for wave in law.sines]
        laws += [TorqueLaw(cosines=[wave], frame=law.frame) for wave in law.cosines]
        tapes = [of_law(each).tape for each in laws]
    else:
        tapes = [law.tape]
    found = [each for each in tapes if each is not None]
    if not found:
        raise InputError(
            "an opaque torque can't be enclosed; allowed: a torque that can be recorded"
        )
    return found


class _NoStepError(Exception):
    """Signal that a step is too long for a proof."""


def _upper(x: Any) -> Any:
    """Return a ball's exact upper end, or raise _NoStepError if it is not finite."""
    end = arb(x).upper()
    if not end.is_finite():
        raise _NoStepError
    return end.mid() + end.rad()


def _terms(x: Any, count: int) -> list[Any]:
    found = x.coeffs() if isinstance(x, arb_series) else [arb(x)]
    return [*found, *[arb(0)] * (count - len(found))][:count]


def _expanded(rates: Rates, begin: Any, middle: Sequence[Any], order: int) -> list[list[Any]]:
    """Return Taylor coefficients 0 to `order` as exact balls; each Picard iteration adds one."""
    found = [[x] for x in middle]
    for k in range(order):
        ctx.cap = k + 1
        slopes = rates(arb_series([begin, 1]), [arb_series(x) for x in found])
        for terms, slope in zip(found, slopes, strict=True):
            terms.append((_terms(slope, k + 1)[k] / (k + 1)).mid())
    return found


class _Proof:
    def __init__(self, equations: Equations, digits: float, forward: bool) -> None:
        self.equations, self.forward = equations, forward
        self.order = max(16, math.ceil(0.9 * digits))
        self.digits = digits
        self.blocks = equations.blocks
        self.scales = [arb(x) for x in equations.scales]
        self.breaks = [Fraction(x) for x in equations.breaks]
        # With few digits the precision is below binary64, so that these balls may be inexact.
        start = [ball(x) for x in equations.start]
        rounding = [x - x.mid() for x in start]
        self.time = Fraction(0)
        # Exact balls of the middles of the unknowns; exact radii of the blocks in scaled units.
        self.middle = [x.mid() for x in start]
        self.radii = [self.norm(rounding, block) for block in self.blocks]

    def norm(self, errors: Sequence[Any], block: slice) -> Any:
        parts = zip(errors[block], self.scales[block], strict=True)
        return _upper(sum((_upper(abs(x) / s) ** 2 for x, s in parts), arb(0)).sqrt())

    @property
    def is_lost(self) -> bool:
        """Whether the radius of omega exceeds omega and 1 rad/s."""
        sizes = zip(self.middle[:3], self.scales, strict=False)
        return all(bool(self.radii[0] > max(1, abs(x) / s)) for x, s in sizes)

    def balls(self, attitude: bool) -> list[Balls]:
        """Return the balls of each block of unknowns; with `attitude`, block 1 is normalised."""
        found = []
        for n, (block, radius) in enumerate(zip(self.blocks, self.radii, strict=True)):
            pairs = zip(self.middle[block], self.scales[block], strict=True)
            row = [x + arb(0, _upper(radius * s)) for x, s in pairs]
            if attitude and n == 1:
                length = sum((x * x for x in row), arb(0)).sqrt()
                row = [x / length for x in row]
            found.append(balls(row))
        return found

    def step(self, last: Fraction) -> None:
        side = 1 if self.forward else -1
        rates = self.equations.at(self.time, self.forward)
        begin = ball(self.time)
        terms = _expanded(rates, begin, self.middle, self.order)
        length = self._length(terms)
        ends = [last, *(t for t in self.breaks if (t - self.time) * side > 0)]
        while length > _SHORTEST:
            end = min((self.time + side * length, *ends), key=lambda t: (t - self.time) * side)
            try:
                radii = self._radii(rates, terms, end - self.time)
            except (_NoStepError, ZeroDivisionError):
                length /= 2
                continue
            found = [value_at(each, ball(end - self.time)) for each in terms]
            rounding = [x - x.mid() for x in found]
            self.time, self.middle = end, [x.mid() for x in found]
            self.radii = [
                _upper(r + self.norm(rounding, block))
                for r, block in zip(radii, self.blocks, strict=True)
            ]
            return
        raise InputError(f"prove: no enclosure is found beyond t = {float(self.time):.6g} s")

    def _length(self, terms: list[list[Any]]) -> Fraction:
        """Return a step (s) at which the last Taylor terms are about the tolerance."""
        least = 40.0  # binary logarithm of the longest step
        for block in self.blocks:
            size = max(0.0, *(_log2(each[0]) for each in terms[block]))
            wanted = size - self.digits * math.log2(10.0)
            for k in (self.order - 1, self.order):
                last = max(_log2(each[k]) for each in terms[block])
                least = min(least, (wanted - last) / k)
        exponent = math.floor(least)
        mantissa = round(2.0 ** (least - exponent + _LENGTH_BITS))
        return Fraction(mantissa, 2**_LENGTH_BITS) * Fraction(2) ** exponent

    def _radii(self, rates: Rates, terms: list[list[Any]], h: Fraction) -> list[Any]:
        """Return bounds on the error of each block during a step `h` (s)."""
        length, begin = abs(ball(h)), ball(self.time)
        sizes = [[abs(x) * length**k for k, x in enumerate(each)] for each in terms]
        half = [_upper(sum(each[1:], arb(0)) / 2) for each in sizes]
        middles = [each[0] + value_at([arb(0), *each[1:]], ball(h)) / 2 for each in terms]
        residuals = self._residuals(rates, terms, h)
        tubes = [
            _upper(2 * r + self.norm([each[0] for each in terms], block) * _TUBE + _LEAST_TUBE)
            for r, block in zip(self.radii, self.blocks, strict=True)
        ]
        inputs = []
        for block, tube in zip(self.blocks, tubes, strict=True):
            for x, r, s in zip(middles[block], half[block], self.scales[block], strict=True):
                inputs.append(x + arb(0, _upper(r + tube * s)))
        time = begin + ball(h) / 2 + arb(0, _upper(length / 2))
        matrix = self._growth(rates, time, inputs) * length
        count = len(self.blocks)
        pushed = arb_mat(
            count, 1, [r + d * length for r, d in zip(self.radii, residuals, strict=True)]
        )
        found = (matrix.exp() * pushed).entries()
        radii = [_upper(x) for x in found]
        if not all(r < tube for r, tube in zip(radii, tubes, strict=True)):
            raise _NoStepError
        return radii

    def _residuals(self, rates: Rates, terms: list[list[Any]], h: Fraction) -> list[Any]:
        count = 2 * self.order + 2
        length, begin = abs(ball(h)), ball(self.time)
        ctx.cap = count
        found = rates(arb_series([begin, 1]), [arb_series(each) for each in terms])
        rests = self._rests(rates, terms, h, count)
        bounds = []
        for slope, each, rest in zip(found, terms, rests, strict=True):
            series = _terms(slope, count)
            for k in range(1, len(each)):
                series[k - 1] -= k * each[k]
            total = value_at([abs(x) for x in series], length)
            bounds.append(_upper(total + rest))
        return [self.norm(bounds, block) for block in self.blocks]

    def _rests(self, rates: Rates, terms: list[list[Any]], h: Fraction, count: int) -> list[Any]:
        """Return bounds on the sums of the Taylor terms of f(t, p) from number `count` on."""
        # If a rate is at most B on a complex disc whose radius is c steps, its term k is at most B
        # c**-k at the end of the step (Cauchy's estimate). The bounds are geometric series.
        length = abs(ball(h))
        candidates = []
        for circle in _CIRCLES:
            around = length * circle
            inputs = []
            for each in terms:
                radius = _upper(value_at([arb(0), *(abs(x) for x in each[1:])], around))
                inputs.append(acb(arb(each[0], radius), arb(0, radius)))
            # A square contains the disc.
            radius = _upper(around)
            centre = ball(self.time)
            found = rates(acb(centre + arb(0, radius), arb(0, radius)), inputs)
            sizes = [arb(acb(x).abs_upper()) for x in found]
            if all(x.is_finite() for x in sizes):
                ratio = arb(1) / circle
                candidates.append([x * ratio**count / (1 - ratio) for x in sizes])
        if not candidates:
            raise _NoStepError
        return min(candidates, key=lambda rests: sum(map(float, rests)))

    def _growth(self, rates: Rates, time: Any, inputs: list[Any]) -> Any:
        """Return the matrix M (1/s): norms and logarithmic norms of the Jacobian's blocks."""
        count = len(inputs)
        unit = [[arb(int(i == j)) for j in range(count)] for i in range(count)]
        found = rates(time, [Dual(x, row) for x, row in zip(inputs, unit, strict=True)])
        side = 1 if self.forward else -1
        jacobian = [
            [side * x * t / s for x, t in zip(each.slopes, self.scales, strict=True)]
            if isinstance(each, Dual)
            else [arb(0)] * count
            for each, s in zip(found, self.scales, strict=True)
        ]

        def growth(block: slice, other: slice) -> Any:
            part = [line[other] for line in jacobian[block]]
            return _log_norm(part) if block == other else _norm(part)

        return arb_mat([[growth(block, other) for other in self.blocks] for block in self.blocks])


def _log_norm(part: list[list[Any]]) -> Any:
    """Return a bound, at least 0, on a matrix's logarithmic norm, by Gershgorin's circles."""
    largest = arb(0)
    for i, row in enumerate(part):
        others = sum((_upper(abs(x + part[j][i]) / 2) for j, x in enumerate(row) if j != i), arb(0))
        end = _upper(row[i] + others)
        if end > largest:
            largest = end
    return largest


def _norm(part: list[list[Any]]) -> Any:
    return _upper(sum((_upper(abs(x)) ** 2 for row in part for x in row), arb(0)).sqrt())


def _log2(x: Any) -> float:
    middle = abs(x.mid())
    return float(middle.log()) / math.log(2.0) if middle > 0 else -math.inf
