"""The reference: the true solution of a scene, with the error that it may have.

Known solutions where there are any (sphere; symmetric body without torque), otherwise the
Taylor series of equations 13-15 in decimal arithmetic. It shares no code with the methods it
judges: exact coefficients, other arithmetic, other steps.
"""

import decimal
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from operator import mul

import numpy as np

from pyharness.model.effort import advice, checked_effort, waves
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.decimal_functions import sine_cosine

DIGITS = 40
# Order and tolerance (relative to the solution, per step) of the two series that are compared.
_QUICK = ((20, Decimal("1e-19")), (24, Decimal("1e-22")))
_PRECISE = ((32, Decimal("1e-31")), (37, Decimal("1e-35")))
MOST_STEPS = 100_000
# Of a series where an effort is given: some ten seconds. A wave costs a fifth of a step.
_ORDINARY_STEPS = 20_000
# After so many, a small part of a second, their pace tells whether the rest is out of reach; the
# motion may become slower by so much.
_FIRST_STEPS = 100
_PACE_SLACK = 3.0
# A power of time with which steps grow, above what they only happen to.
_GROWING = Decimal("1.3")
_HALF_ULP = 2.0**-53

Row = list[Decimal]


@dataclass(frozen=True, eq=False)
class Reference:
    """The true solution in binary64.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s; where the solution leaves every bound, the rows end before.
    omega : ndarray, shape (n, 3)
        rad/s.
    velocity : ndarray, shape (n, 3), or None
        m/s, from the deck's masses and forces.
    source : str
        What it is.
    estimate : float
        Estimated error of any omega before rounding (rad/s).
    remainder : ndarray, shape (n, 3), or None
        What rounding took from omega (rad/s): `omega` and it together have twice the digits.
    """

    time: Array
    omega: Array
    velocity: Array | None
    source: str
    estimate: float
    remainder: Array | None = None

    @property
    def error(self) -> float:
        """Bound of the error of any omega: the estimate, and half a unit in the last place."""
        largest = float(np.max(np.abs(self.omega), initial=0.0))
        return self.estimate + _HALF_ULP * largest


def reference(
    scene: Scene,
    times: Sequence[float],
    velocity: bool = False,
    precise: bool = False,
    most_steps: int = MOST_STEPS,
    effort: float | None = None,
) -> Reference:
    """Return the true solution of `scene` at `times`.

    Parameters
    ----------
    scene : Scene
        What to solve; its step size plays no part.
    times : sequence of float, shape (n,)
        Strictly monotonic from 0 (s), forward or backward; the first may be 0.
    velocity : bool
        Whether the velocity is wanted too.
    precise : bool
        Whether the series should be good to 1e-25 before rounding, where the motion itself
        allows it, and not only to more digits than binary64 has.
    most_steps : int
        Of a series; each takes about a third of a millisecond, some more with waves.
    effort : float, optional
        In place of `most_steps`: a factor on some ten seconds of work, beyond which the pace of
        the first steps ends the rest.

    Returns
    -------
    Reference
        Its `estimate` is the largest difference of two series of different order and step.

    Raises
    ------
    InputError
        Where the times do not lead away from 0, or the series needs too many steps.
    """
    away = [abs(t) for t in times]
    one_side = min(times) >= 0.0 or max(times) <= 0.0
    if not (one_side and all(t1 < t2 for t1, t2 in itertools.pairwise(away))):
        raise InputError("reference: times must lead away from 0, strictly, on one side")
    with decimal.localcontext() as context:
        context.prec = DIGITS
        context.Emax, context.Emin = decimal.MAX_EMAX, decimal.MIN_EMIN
        exact = [Decimal(t) for t in times]
        known = known_solution(scene, exact)
        if known is not None and not velocity:
            largest = max(abs(x) for row in known for x in (*row, *map(Decimal, scene.omega)))
            estimate = min(Decimal(1), largest).scaleb(3 - DIGITS)
            return _rounded(times, known, None, "known solution", estimate)
        coarse, fine = _PRECISE if precise else _QUICK
        first = _series(scene, exact, False, *coarse, _Limit(scene, most_steps, effort))
        second = _series(scene, exact, velocity, *fine, _Limit(scene, most_steps, effort))
        rows = min(len(first), len(second))
        omega = [row[:3] for row in second[:rows]]
        estimate = _largest_difference(first[:rows], omega)
        speed = [row[3:] for row in second[:rows]] if velocity else None
        source = f"Taylor series in {DIGITS}-digit arithmetic"
        if known is not None:
            estimate = max(estimate, _largest_difference(known[:rows], omega))
            omega, source = known[:rows], "known solution"
        return _rounded(times[:rows], omega, speed, source, estimate)


def known_solution(scene: Scene, times: Sequence[Decimal]) -> list[Row] | None:
    """Return the closed form of a sphere, or of a symmetric body without torque; else None.

    To as many decimals as the arithmetic has digits: a phase of 1e41 radians needs 41 more.
    """
    with decimal.localcontext() as context:
        context.prec += _digits_before_the_point(scene, max(map(abs, times)))
        return _known_rows(scene, times)


def _digits_before_the_point(scene: Scene, time: Decimal) -> int:
    """Return those of the largest number on the way to a known solution, or some more."""
    law = scene.torque
    omega = max(Decimal(abs(w)) for w in scene.omega)
    rate = max(map(abs, exact_coefficients(scene))) * omega
    sizes = [omega, rate * time]
    least = min(map(Decimal, scene.moments or (1,)))
    pushes = [(law.constant, time), (law.rate, time * time)]
    for amplitude, frequency in law.sines + law.cosines:
        turns = Decimal(abs(frequency))
        sizes.append(turns * time)
        pushes.append((amplitude, 1 / turns if turns else time))
    sizes += [Decimal(max(map(abs, push))) * length / least for push, length in pushes]
    return max(0, max(sizes).adjusted() + 1)


def _known_rows(scene: Scene, times: Sequence[Decimal]) -> list[Row] | None:
    coefficients = exact_coefficients(scene)
    if not any(coefficients):
        return [_sphere(scene, t) for t in times]
    if not scene.torque.is_zero:
        return None
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        # The coefficients of the other two axes are opposite: they turn in a circle.
        if coefficients[axis] == 0 and coefficients[j] == -coefficients[k]:
            omega = [Decimal(w) for w in scene.omega]
            rate = coefficients[j] * omega[axis]
            rows = []
            for t in times:
                sine, cosine = sine_cosine(rate * t)
                row = list(omega)
                row[j] = omega[j] * cosine + omega[k] * sine
                row[k] = omega[k] * cosine - omega[j] * sine
                rows.append(row)
            return rows
    return None


def _sphere(scene: Scene, t: Decimal) -> Row:
    """Return omega(0) and the integral of the normalized torque."""
    torque = scene.torque
    row = []
    for axis in range(3):
        moment = Decimal(1) if scene.moments is None else Decimal(scene.moments[axis])
        total = Decimal(torque.constant[axis]) * t + Decimal(torque.rate[axis]) * t * t / 2
        for amplitude, frequency in torque.sines:
            if frequency:
                # 1 - cosine would have few digits where the angle is small.
                sine, _ = sine_cosine(Decimal(frequency) * t / 2)
                total += Decimal(amplitude[axis]) * 2 * sine * sine / Decimal(frequency)
        for amplitude, frequency in torque.cosines:
            sine, _ = sine_cosine(Decimal(frequency) * t)
            rate = Decimal(frequency)
            total += Decimal(amplitude[axis]) * (sine / rate if frequency else t)
        row.append(Decimal(scene.omega[axis]) + total / moment)
    return row


def _series(
    scene: Scene,
    times: Sequence[Decimal],
    velocity: bool,
    order: int,
    tolerance: Decimal,
    limit: "_Limit",
) -> list[Row]:
    """Return omega (and velocity) at `times` by Taylor steps; fewer rows where it blows up."""
    equations = _Equations(scene, velocity)
    state = [Decimal(w) for w in scene.omega] + [Decimal(0)] * (3 if velocity else 0)
    begin = Decimal(0)
    rows: list[Row] = []
    step = 0
    while True:
        coefficients = equations.expand(begin, state, order)
        rest = abs(times[-1] - begin)
        length = _step(coefficients, tolerance, rest).copy_sign(times[-1])
        if begin + length == begin and rest:
            return rows
        limit.check(step, begin, length, rest)
        while len(rows) < len(times) and abs(times[len(rows)]) <= abs(begin + length):
            rows.append(_evaluate(coefficients, times[len(rows)] - begin))
        if len(rows) == len(times):
            return rows
        state = _evaluate(coefficients, length)
        begin += length
        step += 1


class _Limit:
    """How many steps a series may take, and the forecast of how many it needs."""

    def __init__(self, scene: Scene, most_steps: int, effort: float | None) -> None:
        self._effort = None if effort is None else checked_effort(effort)
        self._ordinary = _ORDINARY_STEPS * 5.0 / (5 + waves(scene))
        self._most = most_steps if effort is None else self._ordinary * effort
        self._next = max(2, _FIRST_STEPS * 5 // (5 + waves(scene)))
        self._before: tuple[int, Decimal] = (0, Decimal(0))

    def check(self, step: int, begin: Decimal, length: Decimal, rest: Decimal) -> None:
        """Raise InputError before a step, where it or the rest of them would be too many."""
        if step == 0:
            # From the first step alone, but for what is hopeless, no one can tell.
            if rest > 10 * Decimal(self._most) * abs(length):
                self._refuse(rest / abs(length))
        elif step >= self._most:
            self._refuse(self._forecast(step, abs(begin), rest))
        elif self._effort is not None and 2 * step >= self._next:
            if step >= self._next:
                needed = self._forecast(step, abs(begin), rest)
                # Steps that shrink end at an omega without bound; their mean says nothing.
                shrinks = 10 * abs(length) * step < abs(begin)
                if needed > Decimal(_PACE_SLACK * self._most) and not shrinks:
                    self._refuse(needed)
                self._next = 2 * step
            if 2 * step - self._next in (0, 1):
                self._before = step, abs(begin)

    def _forecast(self, step: int, begin: Decimal, rest: Decimal) -> Decimal:
        """Return the steps to the end: as many a second as so far, or more as the motion grows."""
        step_before, begin_before = self._before
        power = Decimal(1)
        if 0 < step_before < step:
            growth = (Decimal(step) / step_before).ln() / (begin / begin_before).ln()
            if growth > _GROWING:
                power = min(growth, Decimal(3))
        return step * (1 + rest / begin) ** power

    def _refuse(self, needed: Decimal) -> None:
        steps = float(min(Decimal("1e300"), needed))
        instead = "take a shorter time, slower motion or slower torques"
        if self._effort is not None:
            instead = advice(instead, self._effort, steps / self._ordinary)
        raise InputError(
            f"reference: more than {self._most:.0f} Taylor steps would be needed, some "
            f"{steps:.2g}; {instead}"
        )


def _step(coefficients: list[Row], tolerance: Decimal, rest: Decimal) -> Decimal:
    """Return the step for which the last two terms of every series are small beside omega.

    Of a body at rest, beside what the first terms make of it until then.
    """
    order = len(coefficients[0]) - 1
    begun = next((j for j in range(order - 1) if _size(coefficients, j, 3)), None)
    length = rest
    for k in (order - 1, order):
        size = _size(coefficients, k)
        if size and begun is not None:
            lengths = [
                # The root needs few digits; the exponent range is Decimal's.
                ((tolerance * before / size).ln() / (k - j)).exp()
                for j in range(begun, 1 if begun == 0 else begun + 4)
                if (before := _size(coefficients, j, 3))
            ]
            length = min(length, max(lengths))
    return length


def _size(coefficients: list[Row], k: int, unknowns: int | None = None) -> Decimal:
    """Return the largest coefficient k of the first so many unknowns, of all by default."""
    return max(abs(series[k]) for series in coefficients[:unknowns])


def _evaluate(coefficients: list[Row], t: Decimal) -> Row:
    values = []
    for series in coefficients:
        total = Decimal(0)
        for coefficient in reversed(series):
            total = total * t + coefficient
        values.append(total)
    return values


class _Equations:
    """Equations 13-15, and dV/dt = F/m - omega x V, as recurrences of Taylor coefficients."""

    def __init__(self, scene: Scene, velocity: bool) -> None:
        self._abc = exact_coefficients(scene)
        self._torque = scene.torque
        self._moments = [Decimal(i) for i in scene.moments or (1, 1, 1)]
        self._velocity = velocity
        self._acceleration = [
            Decimal(f) / Decimal(m) for f, m in zip(scene.forces, scene.masses, strict=True)
        ]

    def expand(self, time: Decimal, state: Row, order: int) -> list[Row]:
        """Return the Taylor coefficients 0 ... order of every unknown around `time`."""
        series = [[x] for x in state]
        torque = self._torque_series(time, order)
        for k in range(order):
            # Cauchy products of the coefficients 0 ... k.
            backward = [list(reversed(each)) for each in series]
            rates = [
                self._abc[i] * _product(series[(i + 1) % 3], backward[(i + 2) % 3]) + torque[i][k]
                for i in range(3)
            ]
            if self._velocity:
                for i in range(3):
                    j, m = (i + 1) % 3, (i + 2) % 3
                    rate = _product(series[3 + j], backward[m])
                    rate -= _product(series[3 + m], backward[j])
                    rates.append(rate + (self._acceleration[i] if k == 0 else 0))
            for each, rate in zip(series, rates, strict=True):
                each.append(rate / (k + 1))
        return series

    def _torque_series(self, time: Decimal, order: int) -> list[Row]:
        """Return the Taylor coefficients of the normalized torque around `time`."""
        series = [[Decimal(0)] * order for _ in range(3)]
        law = self._torque
        for axis in range(3):
            series[axis][0] += Decimal(law.constant[axis]) + Decimal(law.rate[axis]) * time
            series[axis][1] += Decimal(law.rate[axis])
        waves = [(wave, 0) for wave in law.sines] + [(wave, 1) for wave in law.cosines]
        for (amplitude, frequency), quarter in waves:
            rate = Decimal(frequency)
            sine, cosine = sine_cosine(rate * time)
            # Derivatives of sin run sin, cos, -sin, -cos; those of cos start one later.
            cycle = [sine, cosine, -sine, -cosine]
            factor = Decimal(1)
            for k in range(order):
                term = cycle[(k + quarter) % 4] * factor
                for axis in range(3):
                    series[axis][k] += Decimal(amplitude[axis]) * term
                factor = factor * rate / (k + 1)
        for axis, moment in enumerate(self._moments):
            series[axis] = [each / moment for each in series[axis]]
        return series


def _product(x: Row, reversed_y: Row) -> Decimal:
    return sum(map(mul, x, reversed_y), Decimal(0))


def exact_coefficients(scene: Scene) -> Row:
    """Return A, B, C, exact to the digits of the arithmetic."""
    if scene.coefficients is not None:
        return [Decimal(x) for x in scene.coefficients]
    assert scene.moments is not None
    i1, i2, i3 = (Decimal(x) for x in scene.moments)
    return [(i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3]


def _largest_difference(first: Sequence[Row], second: Sequence[Row]) -> Decimal:
    return max(
        (abs(x - y) for p, q in zip(first, second, strict=True) for x, y in zip(p, q, strict=True)),
        default=Decimal(0),
    )


def _rounded(
    times: Sequence[float],
    omega: Sequence[Row],
    velocity: Sequence[Row] | None,
    source: str,
    estimate: Decimal,
) -> Reference:
    def array(rows: Sequence[Row]) -> Array:
        return np.array([[float(x) for x in row] for row in rows]).reshape(-1, 3)

    return Reference(
        time=np.array(times, dtype=float),
        omega=array(omega),
        velocity=None if velocity is None else array(velocity),
        source=source,
        estimate=float(estimate) if estimate < Decimal(math.inf) else math.inf,
        remainder=array([[x - Decimal(float(x)) for x in row] for row in omega]),
    )
