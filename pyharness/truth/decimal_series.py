"""Omega, velocity and attitude by Taylor series of equations 13-15 of the thesis, in decimals.

Except in `taylor_series` and `_Equations`, `coefficients` are Taylor coefficients.
"""

from collections.abc import Callable, Sequence
from decimal import Decimal, getcontext
from fractions import Fraction

from pyharness.model.effort import advice
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.state_torque import StateTorque
from pyharness.model.torque_law import TorqueLaw
from pyharness.model.values import checked_effort
from pyharness.truth.decimal_functions import Row, product, sine_cosine, to_decimal, value_at
from pyharness.truth.decimal_switches import Switches
from pyharness.truth.tape_series import TapeSeries, series_products

_MOST_STEPS = 100_000  # some 30 seconds, more if the torque has sines or cosines
# Work limit in steps, some ten seconds, times `effort`. A wave of the torque, or a product of two
# series of a recorded torque, takes a fifth of the work of a step.
_ORDINARY_STEPS = 20_000
# The mean length of the first steps forecasts in a fraction of a second whether the limit will be
# exceeded, even if the motion becomes slower by the factor _PACE_SLACK.
_FIRST_STEPS = 100
_PACE_SLACK = 3.0
# Largest defect of a converged series, divided by the local tolerance. The defect is the step
# times the difference between the series' derivative and the rates at the end of the step.
_MOST_DEFECT = 64
_NEARLY_1 = 1 - Decimal("1e-26")  # a relative change of thousands of rounding errors
_GROWING = Decimal("1.3")
_LEAST = Decimal("1e-330")  # s, below all floats


def taylor_series(
    scene: Scene,
    coefficients: Row,  # A, B and C
    times: Sequence[Decimal],
    velocity: bool,
    order: int,
    tolerance: Decimal,  # local and relative
    effort: float | None,  # factor on a limit of some ten seconds; None: 100 000 steps or fewer
    start: Row | None = None,
) -> list[Row]:
    """Return a row of omega (rad/s), velocity (m/s) and attitude at each of `times` (s).

    The rows end at a singularity of the torque or of the solution.
    """
    equations, limit = _Equations(scene, coefficients, velocity), _Limit(scene, effort)
    tape = equations.tape
    if tape is not None and tape.least_order > order:
        # The caller compares integrations of different orders, which must stay different.
        order = tape.least_order + order // 4
    is_recorded = isinstance(scene.torque, StateTorque) or scene.changing is not None
    at_end = [equations]
    switches = Switches(tape) if tape is not None and tape.has_switches else None
    if is_recorded:
        # The last of `at_end` show the effect of rounding: their state and the terms of their sums
        # are slightly changed, because sums such as 1 - tanh(x) may cancel to 0.
        changes = Decimal(0), Decimal(10) ** (4 - getcontext().prec)
        results = {} if switches is None else switches.results
        at_end = [_Equations(scene, coefficients, velocity, each, results) for each in changes]
    state = [Decimal(w) for w in scene.omega] + [Decimal(0)] * (3 if velocity else 0)
    moving = len(state)
    state += [Decimal(x) for x in scene.attitude or ()]
    state = start or state
    if not times[-1]:
        return [state for _ in times]
    begin = Decimal(0)
    rows: list[Row] = []
    forward = times[-1] >= 0
    step = stops = 0
    is_settled = switches is None
    while True:
        try:
            while switches is not None and not is_settled:
                equations.expand(begin, state, 1, forward)
                is_settled = not switches.settle()
            series = equations.expand(begin, state, order, forward)
        except ArithmeticError:
            # The torque is singular here, or beyond the range of decimal arithmetic.
            return rows
        rest = abs(times[-1] - begin)
        length = _step(series[:moving], tolerance, rest)
        if scene.attitude is not None:
            length = min(length, _step(series[moving:], tolerance, rest, 4))
        # Shortened so that no pulse of the torque is skipped.
        length = length if tape is None else tape.reach(length)
        length = length.copy_sign(times[-1])
        if switches is not None:
            try:
                is_settled = not switches.turns(begin, length)
                length = switches.end(length) if is_settled else length
            except ArithmeticError:  # an operand is infinite
                return rows
            if not is_settled:
                continue
        if begin + length == begin and rest:
            return rows
        limit.check(step, stops, begin, length, rest)
        end = begin + length
        stop = None if tape is None else tape.next_change(begin, forward)
        # The Taylor series of a table is valid until the table changes.
        if stop is not None and abs(stop) <= abs(end):
            end, length = stop, stop - begin
        tried = length
        state = _evaluate(series, length)
        while is_recorded and not _is_continued(at_end, series, state, end, length, tolerance):
            length /= 2
            end = begin + length
            if end == begin or abs(length) < _LEAST:
                return rows
            state = _evaluate(series, length)
        if end == stop:
            stops += 1
        else:
            step += 1
        while len(rows) < len(times) and abs(times[len(rows)]) <= abs(end):
            if tape is not None and tape.crosses_a_branch(times[len(rows)] - begin):
                return rows
            rows.append(_evaluate(series, times[len(rows)] - begin))
        if len(rows) == len(times) or (tape is not None and tape.crosses_a_branch(length)):
            return rows
        begin = end
        if switches is not None:
            switches.step(length == tried and end != stop)
            is_settled = False


class _Limit:
    def __init__(self, scene: Scene, effort: float | None) -> None:
        self._effort = None if effort is None else checked_effort(effort)
        a_step = 5 + _torque_work(scene)
        self._ordinary = _ORDINARY_STEPS * 5.0 / a_step
        self._most = float(_MOST_STEPS) if effort is None else self._ordinary * effort
        if effort is None and isinstance(scene.torque, StateTorque):
            self._most *= 5.0 / a_step
        self._next = max(2, _FIRST_STEPS * 5 // a_step)
        self._before: tuple[int, Decimal] = (0, Decimal(0))

    def check(self, step: int, stops: int, begin: Decimal, length: Decimal, rest: Decimal) -> None:
        """Raise InputError if the number of steps, so far or by forecast, exceeds the limit."""
        # `stops` counts the steps that ended early at a change of a table, `step` all others.
        # `begin`, `length` (of the next step) and `rest` are in s.
        if step + stops >= self._most:
            self._refuse(stops + (self._forecast(step, abs(begin), rest) if step else 0))
        elif step == 0:
            # The first step alone counts only if the limit would be exceeded tenfold.
            if rest > 10 * Decimal(self._most) * abs(length):
                self._refuse(rest / abs(length))
        elif self._effort is not None and 2 * step >= self._next:
            if step >= self._next:
                needed = self._forecast(step, abs(begin), rest)
                # Where omega grows without bound, steps become shorter, and their mean length gives
                # no forecast.
                shrinks = 10 * abs(length) * step < abs(begin)
                if needed > Decimal(_PACE_SLACK * self._most) and not shrinks:
                    self._refuse(needed)
                self._next = 2 * step
            if 2 * step - self._next in (0, 1):
                self._before = step, abs(begin)

    def _forecast(self, step: int, begin: Decimal, rest: Decimal) -> Decimal:
        # `begin` (s) is the time after `step` steps, `rest` (s) the remaining time. The mean length
        # of a step is assumed to remain. If the number of steps grew with a power of time above
        # _GROWING, it is extrapolated with this power, at most 3.
        step_before, begin_before = self._before
        power = Decimal(1)
        if 0 < step_before < step:
            growth = (Decimal(step) / step_before).ln() / (begin / begin_before).ln()
            if growth > _GROWING:
                power = min(growth, Decimal(3))
        return step * (1 + rest / begin) ** power

    def _refuse(self, needed: Decimal | int) -> None:
        steps = float(min(Decimal("1e300"), Decimal(needed)))
        instead = "use a shorter time, slower motion or slower torques"
        if self._effort is not None:
            instead = advice(instead, self._effort, steps / self._ordinary)
        raise InputError(
            f"reference: more than {self._most:.0f} Taylor steps would be needed, some "
            f"{steps:.2g}; {instead}"
        )


def _torque_work(scene: Scene) -> int:
    """Return the torque's work, in fifths of a step without torque."""
    if isinstance(scene.torque, StateTorque) and scene.torque.tape is not None:
        return series_products(scene.torque.tape)
    law = _law_of(scene)
    return len(law.sines) + len(law.cosines)


def _law_of(scene: Scene) -> TorqueLaw:
    if scene.changing is not None and isinstance(scene.torque, TorqueLaw):
        return scene.torque
    return scene.body_torque


def _step(coefficients: list[Row], tolerance: Decimal, rest: Decimal, leading: int = 3) -> Decimal:
    """Return a step (s), at most `rest`, whose last two Taylor terms are small."""
    # The terms are at most `tolerance` times the largest of the first `leading` unknowns or, if
    # these are 0, times one of four Taylor terms, of which the first is not 0.
    order = len(coefficients[0]) - 1
    begun = next((j for j in range(order - 1) if _size(coefficients, j, leading)), None)
    length = rest
    for k in (order - 1, order):
        size = _size(coefficients, k)
        if size and begun is not None:
            lengths = [
                # The root needs few digits, but Decimal's range of exponents.
                ((tolerance * before / size).ln() / (k - j)).exp()
                for j in range(begun, 1 if begun == 0 else begun + 4)
                if (before := _size(coefficients, j, leading))
            ]
            length = min(length, max(lengths))
    return length


def _size(coefficients: list[Row], k: int, unknowns: int | None = None) -> Decimal:
    return max(abs(series[k]) for series in coefficients[:unknowns])


def _evaluate(coefficients: list[Row], t: Decimal) -> Row:
    return [value_at(row, t) for row in coefficients]


def _is_continued(
    equations: Sequence["_Equations"],
    series: list[Row],
    state: Row,
    end: Decimal,
    length: Decimal,
    tolerance: Decimal,
) -> bool:
    """Return whether the rates at a step's end agree with the series' derivative."""
    # A pulse of the torque that is invisible at the beginning of the step makes them disagree. The
    # last of the `equations` shows the effect of rounding.
    slopes = _evaluate([[k * x for k, x in enumerate(row)][1:] for row in series], length)

    def rates(which: _Equations, factor: Decimal) -> Row:
        # If a table changes at the end of the step, its earlier piece applies.
        moved = [factor * x for x in state]
        return [row[1] for row in which.expand(factor * end, moved, 1, length < 0)[:3]]

    def largest_difference(first: Row, second: Row) -> Decimal:
        return max(abs(length * (x - y)) for x, y in zip(first, second, strict=True))

    scale = max(abs(x) for x in (*state[:3], *(row[0] for row in series[:3])))
    try:
        found = rates(equations[0], Decimal(1))
        defect = largest_difference(found, slopes[:3]) - _MOST_DEFECT * tolerance * scale
        # Rounding errors of the time, of the state and of the torque are no defect.
        return defect <= 0 or defect <= largest_difference(found, rates(equations[-1], _NEARLY_1))
    except ArithmeticError:
        return False


def divisors(scene: Scene) -> tuple[Fraction, Fraction, Fraction]:
    """Return the exact moments (kg m2), or 1 for a body with coefficients."""
    return scene.exact_moments or (Fraction(1), Fraction(1), Fraction(1))


class _Equations:
    """The equations of one scene as recurrences of Taylor coefficients.

    `TapeSeries` explains `change` and `results`.
    """

    def __init__(
        self,
        scene: Scene,
        coefficients: Row,  # A, B and C; unused if the inertia changes
        velocity: bool,
        change: Decimal = Decimal(0),
        results: dict[int, Decimal] | None = None,
    ) -> None:
        self._abc = coefficients
        self.tape = self._law = None
        if isinstance(scene.torque, StateTorque) and scene.torque.tape is not None:
            self.tape = TapeSeries(scene.torque.tape, change, results)
        else:
            self._law = _law_of(scene)
        self._changing = scene.changing
        # With a changing inertia, the torque is not divided by moments.
        exact = divisors(scene) if scene.changing is None else (Fraction(1),) * 3
        self._moments = list(map(to_decimal, exact))
        self._velocity, self._attitude = velocity, scene.attitude is not None
        self._acceleration = [Decimal(force) / Decimal(scene.masses[0]) for force in scene.forces]

    def expand(self, time: Decimal, state: Row, order: int, forward: bool) -> list[Row]:
        """Return all unknowns' Taylor coefficients to `order`.

        At a break of a table, `forward` selects its later piece.
        """
        series = [[x] for x in state]
        torque = self._torque_series(time, order, series, forward)
        elements = [] if self._changing is None else self._changing.elements
        inertia = [[_moved(each, time) for each in row] for row in elements]
        momentum: list[Row] = [[], [], []]
        for k in range(order):
            # Reversed once for all Cauchy products.
            backward = [list(reversed(each)) for each in series]
            if inertia:
                for each, row in zip(momentum, inertia, strict=True):
                    each.append(sum(map(product, row, backward), Decimal(0)))
                rates = _rates_by_momentum(torque(k), momentum, inertia, series, backward)
            else:
                rates = [
                    self._abc[i] * product(series[(i + 1) % 3], backward[(i + 2) % 3]) + push
                    for i, push in enumerate(torque(k))
                ]
            if self._velocity:
                # dV/dt = F/m - omega x V, with force F and mass m.
                for i in range(3):
                    j, m = (i + 1) % 3, (i + 2) % 3
                    rate = product(series[3 + j], backward[m])
                    rate -= product(series[3 + m], backward[j])
                    rates.append(rate + (self._acceleration[i] if k == 0 else 0))
            if self._attitude:
                rates += _attitude_rates(series[-4:], backward[:3])
            for each, rate in zip(series, rates, strict=True):
                each.append(rate / (k + 1))
        return series

    def _torque_series(
        self, time: Decimal, order: int, series: list[Row], forward: bool
    ) -> Callable[[int], Row]:
        """Return a function for coefficient k of torque over moments, k = 0, 1, ... in order."""
        if self.tape is not None:
            tape, moments = self.tape, self._moments
            tape.begin(time, series[:3], series[-4:] if self._attitude else [], forward)
            return lambda k: [x / moment for x, moment in zip(tape.next(), moments, strict=True)]
        terms = self._law_series(time, order)
        return lambda k: [each[k] for each in terms]

    def _law_series(self, time: Decimal, order: int) -> list[Row]:
        """Return coefficients 0 to `order` - 1 of a torque law over the moments, by axis."""
        law = self._law
        assert law is not None
        series = [
            [Decimal(constant) + Decimal(rate) * time, Decimal(rate), *[Decimal(0)] * (order - 2)]
            for constant, rate in zip(law.constant, law.rate, strict=True)
        ]
        waves = [(wave, 0) for wave in law.sines] + [(wave, 1) for wave in law.cosines]
        for (amplitude, frequency), quarter in waves:
            rate = Decimal(frequency)
            sine, cosine = sine_cosine(rate * time)
            # Derivatives 0 to 3 of sin are sin, cos, -sin, -cos; of cos, the last three and sin.
            cycle = [sine, cosine, -sine, -cosine]
            factor = Decimal(1)
            for k in range(order):
                term = cycle[(k + quarter) % 4] * factor
                for axis in range(3):
                    series[axis][k] += Decimal(amplitude[axis]) * term
                factor = factor * rate / (k + 1)
        return [
            [term / moment for term in terms]
            for terms, moment in zip(series, self._moments, strict=True)
        ]


def _moved(polynomial: Sequence[float], time: Decimal) -> Row:
    """Return the Taylor coefficients around `time` of a polynomial around 0."""
    row = [Decimal(c) for c in polynomial]
    # Repeated Horner's scheme.
    for first in range(len(row) - 1):
        for k in range(len(row) - 2, first - 1, -1):
            row[k] += time * row[k + 1]
    return row


def _rates_by_momentum(
    torque: Row,
    momentum: list[Row],
    inertia: list[list[Row]],
    series: list[Row],
    backward: list[Row],
) -> Row:
    """Return coefficient k of omega', from L' = N - omega x L, momentum L, torque N."""
    # `torque` is coefficient k of N. `momentum` (L = I omega), `series` (omega) and `inertia` (I)
    # have coefficients 0 to k; `backward` is `series` reversed.
    right = []
    for i in range(3):
        j, m = (i + 1) % 3, (i + 2) % 3
        push = torque[i] - product(series[j], momentum[m][::-1])
        push += product(series[m], momentum[j][::-1])
        # Coefficient k of L' is k + 1 times coefficient k + 1 of L. In this, coefficient k + 1 of
        # omega occurs only in the product with coefficient 0 of I.
        others = sum(
            (product(each[1:], omega) for each, omega in zip(inertia[i], backward, strict=False)),
            Decimal(0),
        )
        right.append(push - len(backward[i]) * others)
    first, second, third = ([each[0] if each else Decimal(0) for each in row] for row in inertia)
    # Cramer's rule may lose digits, but more remain than binary64 has.
    determinant = _triple(first, second, third)
    return [
        _triple(right, second, third) / determinant,
        _triple(first, right, third) / determinant,
        _triple(first, second, right) / determinant,
    ]


def _triple(x: Row, y: Row, z: Row) -> Decimal:
    return (
        x[0] * (y[1] * z[2] - y[2] * z[1])
        + x[1] * (y[2] * z[0] - y[0] * z[2])
        + x[2] * (y[0] * z[1] - y[1] * z[0])
    )


def _attitude_rates(q: list[Row], omega: list[Row]) -> Row:
    """Return coefficient k of q (0, omega)/2; `omega` has coefficients k to 0."""
    (a, b, c, d), (x, y, z) = q, omega
    return [
        (-product(b, x) - product(c, y) - product(d, z)) / 2,
        (product(a, x) + product(c, z) - product(d, y)) / 2,
        (product(a, y) + product(d, x) - product(b, z)) / 2,
        (product(a, z) + product(b, y) - product(c, x)) / 2,
    ]
