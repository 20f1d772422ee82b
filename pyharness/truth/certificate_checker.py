"""Check a certificate: a proof that balls contain the solution of Euler's equations.

The program needs only Python's standard library, and computes with integers. Its arguments are
files of certificates; it prints what they prove. The exit status is 1 unless all certificates hold.

The equations are y' = f(t, y) for the angular velocity omega, and for the sines and cosines of the
torque. In a step h, a polynomial p(s), s from 0 to 1, approximates the solution: the Taylor series
with coefficients rounded down. Any polynomial is allowed, as the proof bounds its residual d = p' -
h f(p).

The error e = y - p obeys |e|' <= h mu |e| + |d| (Dahlquist 1958), where mu bounds the logarithmic
norm of the Jacobian of f in a tube around p. The resulting bound on |e|, the radius of the step,
holds while |e| is less than the tube's radius. If the bound itself is less than the tube's radius,
it holds on the whole step, because |e| is continuous.

A number y is stored as the integer y 2**bits, a time t (s) as t 2**clock. The norm of an error of
omega is sqrt(sum (e_i / scale_i)**2), with scales in units of 2**-20.
"""

import json
import re
import sys
from collections.abc import Sequence
from fractions import Fraction
from itertools import accumulate
from math import isfinite, isqrt, lcm
from operator import mul
from typing import Any

FORMAT = "pyharness-certificate-2"
MOST_BITS = 12_000
LONG, LARGEST = re.compile("[-+.0-9eE/]{4301}"), 1 << 28  # a number, characters of a file
SCALE_BITS = 20
UNIT = 1 << 64  # growth factors of errors are integers over this number

Expansion = tuple[list[list[int]], list[int], int]


class NotProvedError(ValueError):
    """Signal that a certificate does not prove what it states."""


def over(numerator: int, denominator: int) -> int:
    """Return the quotient of integers, rounded up; the denominator is positive."""
    return -(-numerator // denominator)


class System:
    """Euler's equations of a scene, with integer coefficients: equations 13-15 of the thesis."""

    # They are D y_i' = P y_j y_k + C + R t + sum over f of (S s_f + G c_f), with i, j, k in cyclic
    # order. Each frequency f of the torque adds the unknowns s_f (sine) and c_f (cosine), with
    # s_f' = f c_f and c_f' = -f s_f. An entry of `rows` is D and a list: P, C, R, each S and G.

    def __init__(self, scene: dict[str, Any], bits: int, clock: int, scales: Sequence[int]) -> None:
        self.bits, self.clock, self.scales = bits, clock, scales
        torque, moments = scene["torque"], [Fraction(1)] * 3
        if "coefficients" in scene:
            factors = [Fraction(x) for x in scene["coefficients"]]
        else:
            moments = [Fraction(x) for x in scene["moments"]]
            factors = [(moments[i - 2] - moments[i - 1]) / moments[i] for i in range(3)]
        waves = [(*wave, 0) for wave in torque["sines"]] + [(*w, 1) for w in torque["cosines"]]
        self.frequencies = sorted({Fraction(frequency) for _, frequency, _ in waves})
        self.rows = []
        for i, moment in enumerate(moments):
            pushes = [Fraction(torque[each][i]) for each in ("constant", "rate")]
            pushes += [Fraction(0)] * (2 * len(self.frequencies))
            for amplitude, frequency, kind in waves:
                place = 2 + 2 * self.frequencies.index(Fraction(frequency)) + kind
                pushes[place] += Fraction(amplitude[i])
            terms = [factors[i], *(push / moment for push in pushes)]
            common = lcm(*(each.denominator for each in terms))
            self.rows.append((common, [int(each * common) for each in terms]))
        # The symmetric part of the Jacobian by omega is a sum of one matrix for each component,
        # whose norm is a factor times this component.
        parts = [Fraction(p, d) / s**2 for (d, (p, *_)), s in zip(self.rows, scales, strict=True)]
        pairs = ((1, 2), (2, 0), (0, 1))
        self.factors = [abs(parts[i] + parts[j]) * scales[i] * scales[j] / 2 for i, j in pairs]

    def expand(self, state: Sequence[int], time: int, h: int, order: int) -> Expansion:
        """Return a step's Taylor series, and residual bounds of omega and waves."""
        series, bits, clock, wave_residual = [[x] for x in state], self.bits, self.clock, 0
        # Coefficient k is rounded down by less than 1, which changes the residual by less than k.
        rounding = order * (order + 1) // 2
        for n, frequency in enumerate(self.frequencies):
            sine, cosine = series[3 + 2 * n], series[4 + 2 * n]
            turn, scale = h * frequency.numerator, frequency.denominator << clock
            for k in range(1, order + 1):
                sine.append(turn * cosine[-1] // (scale * k))
                cosine.append(-turn * sine[-2] // (scale * k))
            omitted = over(abs(turn) * (abs(sine[-1]) + abs(cosine[-1])), scale)
            wave_residual += omitted + 2 * rounding
        pushes = []
        for _, (_, constant, rate, *amplitudes) in self.rows:
            # The shifts are exact, because `bits` is at least `clock`.
            start = (constant << bits) + (rate * time << bits - clock)
            push = [start, rate * h << bits - clock] + [0] * (order - 1)
            for amplitude, wave in zip(amplitudes, series[3:], strict=True):
                push = [p + amplitude * x for p, x in zip(push, wave, strict=True)]
            pushes.append(push)
        omega, residuals = series[:3], []
        for k in range(1, order + 1):
            sums = [sum(map(mul, omega[i - 2], reversed(omega[i - 1]))) for i in range(3)]
            for i, (common, (factor, *_)) in enumerate(self.rows):
                rate = h * (factor * sums[i] + (pushes[i][k - 1] << bits))
                omega[i].append((rate >> bits + clock) // (common * k))
        for i, (common, (factor, *_)) in enumerate(self.rows):
            # Products of the coefficients n and m with n + m >= order are omitted.
            ends = accumulate(map(abs, reversed(omega[i - 1])))
            omitted = abs(factor) * sum(map(mul, map(abs, omega[i - 2]), ends))
            omitted += abs(pushes[i][order]) << bits
            residuals.append(rounding + over(abs(h) * omitted, common << bits + clock))
        return series, residuals, wave_residual

    def norm(self, errors: Sequence[int]) -> int:
        """Return a bound on the norm of three errors of omega."""
        parts = [over(abs(x) << SCALE_BITS, s) for x, s in zip(errors, self.scales, strict=True)]
        return isqrt(sum(x * x for x in parts)) + 1

    def forced(self, h: int) -> int:
        """Return a bound on h times the norm of d(omega')/d(sines, cosines), times UNIT."""
        total = 0
        for (common, (_, _, _, *amplitudes)), scale in zip(self.rows, self.scales, strict=True):
            push = sum(map(abs, amplitudes)) * abs(h) << SCALE_BITS
            total += over(push * UNIT, common * scale << self.clock)
        return total

    def growth(self, series: Sequence[Sequence[int]], tube: int, h: int) -> int:
        """Return a bound on h times the logarithmic norm of d(omega')/d(omega), times UNIT."""
        growth = 0
        for factor, each, scale in zip(self.factors, series, self.scales, strict=False):
            # The mean is a sharper bound, which is not worth its time for a small factor.
            size = mean(each) if factor * 1000 > max(self.factors) else sum(map(abs, each))
            most = abs(h) * factor.numerator * (size + over(tube * scale, 1 << SCALE_BITS))
            growth += over(most * UNIT, factor.denominator << self.bits + self.clock)
        return growth

    def radii(
        self, radius: int, wave_radius: int, expansion: Expansion, tube: int, h: int
    ) -> tuple[int, int]:
        """Return error bounds of omega and waves, or raise NotProvedError."""
        series, residuals, wave_residual = expansion
        growth = self.growth(series, tube, h)
        if growth > 2 * UNIT:
            raise NotProvedError("errors grow too much in it")
        # The equations of the waves only rotate their errors.
        wave_radius += wave_residual
        source = radius + self.norm(residuals) + over(self.forced(h) * wave_radius, UNIT)
        radius = over(source * exponential(growth), UNIT)
        if radius >= tube:
            raise NotProvedError("the solution may leave the tube")
        return radius, wave_radius

    def ball(
        self, series: Sequence[list[int]], place: Fraction, radius: int
    ) -> tuple[list[int], Fraction]:
        """Return centre and radius of the ball of omega, times 2**bits, at a fraction of a step."""
        middle, (n, d) = [0, 0, 0], place.as_integer_ratio()
        for i, each in enumerate(series[:3]):
            for x in reversed(each):
                # Each of these quotients is rounded down by less than 1.
                middle[i] = x + middle[i] * n // d
        return middle, Fraction(radius * max(self.scales), 1 << SCALE_BITS) + len(series[0])


def mean(polynomial: Sequence[int]) -> int:
    """Return a bound on the mean absolute value of a polynomial on [0, 1]."""
    # The mean absolute value of the first terms is at most their root mean square.
    head, total = polynomial[:12], 0
    for k in range(2 * len(head) - 1):
        part = head[max(0, k + 1 - len(head)) : k + 1]
        total += over(sum(map(mul, part, reversed(part))), k + 1)
    return isqrt(total) + 1 + sum(map(abs, polynomial[12:]))


def exponential(x: int) -> int:
    """Return a bound on exp(x), x from 0 to 2; both are times UNIT."""
    total = term = UNIT
    for k in range(1, 20):
        term = over(term * x, k * UNIT)
        total += term
    return total + term  # the rest of the series is less than its last term


# The form of a certificate. A tuple stands for a list of the same length, a list for a list of any
# length, a set for the allowed types. Numbers that binary64 would round are texts.
NUMBER = re.compile("-?[0-9]+([./][0-9]+)?")
WHOLE, REAL, TEXT, EXACT = {int}, {int, float}, {str, NUMBER}, {int, float, NUMBER}
THREE, WAVES = (REAL,) * 3, [((REAL,) * 3, REAL)]
TORQUE = {"constant": THREE, "rate": THREE, "sines": WAVES, "cosines": WAVES}
SCENE = {"name": TEXT, "omega": THREE, "torque": TORQUE}
FORM: Any = {"format": TEXT, "bits": WHOLE, "clock": WHOLE, "order": WHOLE, "scales": (WHOLE,) * 3}
FORM |= {"steps": [(WHOLE, WHOLE, WHOLE, (WHOLE,) * 3)]}
FORM |= {"rows": [{"time": REAL, "omega": ({NUMBER},) * 3, "radius": REAL}]}


def fits(value: Any, form: Any) -> bool:
    """Return whether a part of a certificate has the keys, lengths and types of `form`."""
    if type(form) is dict:
        same = type(value) is dict and {*value} == {*form}
        return same and all(fits(value[key], form[key]) for key in form)
    if type(form) is set:
        kind = NUMBER if type(value) is str and NUMBER.fullmatch(value) else type(value)
        return kind in form and (kind is not float or isfinite(value))
    parts = form * len(value) if type(form) is list and type(value) is list else form
    return type(value) is list and len(value) == len(parts) and all(map(fits, value, parts))


def check(certificate: dict[str, Any]) -> int:
    """Return a certificate's number of steps; raise NotProvedError if it does not hold."""
    scene = certificate["scene"]
    body = "coefficients" if "coefficients" in scene else "moments"
    if not fits(certificate, {**FORM, "scene": {**SCENE, body: (EXACT,) * 3}}):
        raise NotProvedError("a key, or the length or type of a value, is not allowed")
    bits, clock, order, scales = (certificate[x] for x in ("bits", "clock", "order", "scales"))
    rows, least = [*certificate["rows"]], min(*scales, *map(Fraction, scene.get("moments", [1])))
    ranged = 0 < clock <= bits <= MOST_BITS and 1 < order <= bits and least > 0
    if not (ranged and rows and certificate["format"] == FORMAT):
        raise NotProvedError("its format or a number is not allowed, or it has no rows")
    system, unit = System(scene, bits, clock, scales), 1 << bits
    middle = [int(Fraction(x) * unit) for x in scene["omega"]]
    waves = [0, unit] * len(system.frequencies)
    radius, wave_radius, time = system.norm([1, 1, 1]), 0, 0
    for number, (h, tube, stated, after) in enumerate(certificate["steps"], 1):
        try:
            expansion = system.expand([*middle, *waves], time, h, order)
            radius, wave_radius = system.radii(radius, wave_radius, expansion, tube, h)
            while rows and 0 <= (place := (Fraction(rows[0]["time"]) * 2**clock - time) / h) <= 1:
                row, (center, size) = rows.pop(0), system.ball(expansion[0], place, radius)
                away = max(abs(Fraction(row["omega"][i]) * unit - x) for i, x in enumerate(center))
                if away + size > Fraction(row["radius"]) * unit:
                    raise NotProvedError(f"row at {row['time']} s does not contain the solution")
            ends = [sum(each) for each in expansion[0]]
            moved = [x - y for x, y in zip(ends[:3], after, strict=True)]
            if radius + system.norm(moved) > stated:
                raise NotProvedError("its ball does not contain the solution")
            middle, waves, radius, time = after, ends[3:], stated, time + h
        except NotProvedError as problem:
            raise NotProvedError(f"step {number}: {problem}") from None
    if rows:
        raise NotProvedError(f"no step contains {rows[0]['time']} s")
    return len(certificate["steps"])


def check_file(name: str, text: str | None = None) -> tuple[dict[str, Any] | None, str]:
    """Return the certificate in a file, or in `text`, and ""; if it fails, None and the reason."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        return dict(pairs) if len(dict(pairs)) == len(pairs) else {"a key occurs twice": None}

    try:
        if text is None:
            with open(name, encoding="ascii") as file:
                text = file.read(LARGEST)
        if LONG.search(text):
            raise NotProvedError("a number has more than 4300 characters")
        check(found := json.loads(text, object_pairs_hook=unique))
        return found, ""
    except Exception as why:
        return None, f"{type(why).__name__}: {why}"


def main(names: Sequence[str]) -> int:
    found = [(name, *check_file(name)) for name in names]
    for name, proved, why in found:
        lines = [f"not proved: {why}"]
        if proved is not None:
            lines = [f"proved, {len(proved['steps'])} steps; omega within the radius, in rad/s:"]
            lines += map(json.dumps, (proved["scene"], *proved["rows"]))
        print(f"{name}:", "\n  ".join(lines))
    return int(any(proved is None for _, proved, _ in found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
