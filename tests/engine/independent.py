"""`python -m tests.engine.independent COUNT SEED`: solutions against another implementation.

Random scenes with torques that depend on the state are solved by the methods `auto` and `taylor`,
and by the decimal reference. They are compared with an implementation that shares no code with
pyharness: right-hand sides that are written as formulas in mpmath's arithmetic, and the
extrapolation method of Gragg, Bulirsch and Stoer with 34 digits (Hairer, Norsett and Wanner 1993,
Solving Ordinary Differential Equations I, section II.9). An error is relative to the largest
component of omega, or an angle (rad). It may be the tolerance plus 4e-15 times the error
amplification that the kernel reports; for the reference, the tolerance is 0. The exit status is 1
if an error is larger.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, NamedTuple

import numpy as np
from mpmath import mp, mpf

from pyharness import InputError, solve
from pyharness.truth.reference import reference
from tests.engine.independent_terms import Drawn, draw, exact

DIGITS = 34
# Local error of a step, relative to the state.
_LOCAL = mpf(10) ** -25
_MOST_COLUMNS, _FEWEST_COLUMNS = 18, 6
# Limits on the evaluations of a right-hand side, some four seconds, and on the growth of omega.
_MOST_EVALUATIONS, _MOST_GROWTH = 12_000, 1e4
# Error that is allowed for rounding, over the error amplification; it is judged up to _CALM.
ALLOWED, _CALM = 4e-15, 1e6

State = Any  # an array of mpmath's numbers, or of another kind
Slopes = Callable[[Any, State], State]


class Truth(NamedTuple):
    """The solution at the requested times in mpmath's numbers, and the largest |omega| (rad/s)."""

    rows: list[State]
    largest: Any


@dataclass
class Result:
    """The errors of one scene over their limits, by the name of the method."""

    drawn: Drawn
    ratios: dict[str, float] = field(default_factory=dict)
    errors: dict[str, float] = field(default_factory=dict)
    growth: float = 0.0
    # Error of the reference before rounding, over the error amplification, for an exact scene.
    last_digits: float | None = None
    note: str = ""  # the reason why the scene was not compared


def integrated(drawn: Drawn) -> Truth | None:
    """Return the solution of a scene by extrapolation; None if a limit is exceeded."""
    with mp.workdps(DIGITS):
        state = exact([*drawn.scene.omega, *(drawn.scene.attitude or (1, 0, 0, 0))])
        largest, rows = abs(state[:3]).max(), []
        begin, evaluations = mpf(0), 0
        most, length = _MOST_GROWTH * largest, mpf(drawn.times[-1]) / 4
        for stop, is_row in _stops(drawn):
            middle = (begin + stop) / 2

            def slopes(t: Any, y: State, middle: Any = middle) -> State:
                return drawn.slopes(t, y, middle)

            while begin != stop:
                last = abs(length) * mpf("1.0001") >= abs(stop - begin)
                tried = stop - begin if last else length
                found, columns = step_of(slopes, begin, state, tried, most)
                evaluations += columns * columns + 1
                if columns <= 10 and not last:
                    length = tried * mpf("1.4")
                elif columns > 14:
                    length = tried * (mpf("0.5") if found is None else mpf("0.8"))
                if found is not None:
                    begin, state = stop if last else begin + tried, found
                    largest = max(largest, abs(state[:3]).max())
                if evaluations > _MOST_EVALUATIONS or largest > most:
                    return None
            if is_row:
                rows.append(state)
        return Truth(rows, largest)


def _stops(drawn: Drawn) -> Iterator[tuple[Any, bool]]:
    """Yield each time at which the integration stops, and whether a result is requested there."""
    end = drawn.times[-1]
    inner = {b for b in drawn.breaks if 0.0 < b / end < 1.0}
    for each in sorted({*inner, *drawn.times}, key=abs):
        yield mpf(each), each in drawn.times


def step_of(
    slopes: Slopes, t: Any, state: State, length: Any, most: Any, local: Any = _LOCAL
) -> tuple[State | None, int]:
    """Return the state after a step, and the number of columns of the extrapolation.

    The state is None if the extrapolation does not converge, or if an omega exceeds `most` (rad/s).
    """
    first = slopes(t, state)
    before: list[State] = []
    for k in range(1, _MOST_COLUMNS + 1):
        h = length / (2 * k)
        old, new = state, state + h * first
        for m in range(1, 2 * k):
            old, new = new, old + 2 * h * slopes(t + m * h, new)
            # The sine of a number that grows without bound would take mpmath for ever.
            if not all(abs(new[:3]) <= most):
                return None, _MOST_COLUMNS
        row = [new]
        for j, each in enumerate(before, 1):
            square = (k - j) * (k - j)
            row.append(row[-1] + (row[-1] - each) * square / (k * k - square))
        if k >= _FEWEST_COLUMNS and abs(row[-1] - row[-2]).max() <= local * abs(row[-1]).max():
            return row[-1], k
        before = row
    return None, _MOST_COLUMNS


def error_of(truth: Truth, omega: State, attitude: State | None) -> float:
    """Return the largest error of omega over the largest |omega|, or of the attitude (rad)."""
    with mp.workdps(DIGITS):
        true = np.array(truth.rows)
        errors = [*(abs(omega - true[:, :3]) / truth.largest).flat]
        for row, q in zip([] if attitude is None else attitude, true[:, 3:], strict=False):
            errors.append(2 * min(mp.sqrt(((row - sign * q) ** 2).sum()) for sign in (1, -1)))
        return float(max(errors))


def compared(drawn: Drawn) -> Result:
    """Return the errors of all methods for one scene."""
    result = Result(drawn)
    truth = integrated(drawn)
    if truth is None:
        result.note = "omega grows too much, or mpmath needs too many evaluations"
        return result
    scene, tolerance = drawn.scene, drawn.tolerance
    turning = scene.attitude is not None
    for method in ("taylor", "auto", "reference"):
        allowed = 0.0 if method == "reference" else tolerance
        try:
            found = solve(scene, drawn.times, method, allowed or 1e-12, attitude=turning)
        except InputError as refusal:
            result.note = f"{method}: {refusal}"
            continue
        if method == "taylor":
            result.growth = found.growth or 0.0
        if len(found.time) < len(drawn.times) or result.growth > _CALM:
            result.note = f"{method}: {found.ended}, error amplification {result.growth:.2g}"
            continue
        error = error_of(truth, found.omega, found.attitude)
        result.errors[method] = error
        result.ratios[method] = error / (allowed + ALLOWED * max(1.0, result.growth))
    if drawn.is_exact and result.ratios:
        result.last_digits = _error_of_all_digits(drawn, truth) / max(1.0, result.growth)
    return result


def _error_of_all_digits(drawn: Drawn, truth: Truth) -> float:
    """Return the error of the reference's omega before it is rounded to binary64."""
    found: Any = reference(drawn.scene, drawn.times, precise=True)
    with mp.workdps(DIGITS):
        return error_of(truth, exact(found.omega) + exact(found.remainder), None)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare as many scenes as requested, and print the largest ratios and all violations."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("count", type=int, help="number of scenes")
    parser.add_argument("seed", help="text from which the scenes are drawn")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    options = parser.parse_args(arguments)
    begin = time.perf_counter()
    results = []
    for number in range(options.first, options.first + options.count):
        result = compared(draw(Random(f"independent {options.seed} {number}")))
        results.append((number, result))
        name = f"{number}: {result.drawn.scene.name}"
        if result.note:
            print(f"{name}: not compared: {result.note}", flush=True)
        for method, ratio in result.ratios.items():
            if not ratio <= 1.0:
                print(
                    f"{name}: {method}: error {result.errors[method]:.3g}, ratio {ratio:.3g}, "
                    f"tolerance {result.drawn.tolerance:.1g}, error amplification "
                    f"{result.growth:.3g}",
                    flush=True,
                )
    ratios = [(ratio, n, name) for n, each in results for name, ratio in each.ratios.items()]
    for method in ("taylor", "auto", "reference"):
        ratio, number, _ = max((each for each in ratios if each[2] == method), default=(0.0, 0, ""))
        print(f"{method}: largest ratio of an error to its limit {ratio:.3g}, scene {number}")
    last = [each.last_digits for _, each in results if each.last_digits is not None]
    agree = sum(error < 1e-20 for error in last)
    print(
        f"reference before rounding, over the error amplification: {agree} of {len(last)} scenes "
        f"without rounded constants below 1e-20, largest {max(last, default=0.0):.2g}"
    )
    violations = sum(not ratio <= 1.0 for ratio, _, _ in ratios)
    judged = sum(bool(each.ratios) for _, each in results)
    print(
        f"{options.count} scenes of seed {options.seed}: {judged} compared, {violations} "
        f"violations, {time.perf_counter() - begin:.0f} s"
    )
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
