"""Rules of the claims that depend on the initial omega (the start), for one start or many.

A bench supplies runs and solutions: a `Laboratory` for one start, `Starts` for n starts. `parts`
divides the step size; results are at the undivided steps. Arrays of omega have the shape (steps, 3)
or (n, steps, 3), values of a `Grade` the shape () or (n,). `data/claims.toml` describes each rule.

An error is the largest deviation of a component of omega from the reference over the completed
steps.
"""

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pyharness.model.listing import PROGRAMS
from pyharness.model.trajectory import Array

if TYPE_CHECKING:
    from pyharness.history.claims.laboratory import Laboratory
    from pyharness.history.claims.over_starts import Starts

Bench: TypeAlias = "Laboratory | Starts"

COLLOCATION = ("two-term", "four-term")
Flags = NDArray[np.bool_]


class Runs(NamedTuple):
    """The runs of a program in a case; `omega` (rad/s) is NaN at steps without a result."""

    omega: Array
    steps: NDArray[Any]
    complete: Flags | np.bool_
    overflow: Flags | np.bool_


class Grade(NamedTuple):
    """The result of a claim's test: numbers, and whether the claim holds, in whole or in part."""

    numbers: Mapping[str, Any]
    whole: Any
    part: Any = False


def omega3_varies(bench: Bench, case: int, limit: float) -> Grade:
    """Test whether the range of omega3 in a case exceeds `limit` (rad/s)."""
    moved = spread_of(bench.solution(case))[..., 2]
    return Grade({"range of omega3 (rad/s)": moved}, moved > limit)


def no_deviation(bench: Bench, case: int, limit: float) -> Grade:
    """Test whether errors in a case are below `limit` (rad/s)."""
    numbers = {f"{name}: largest error (rad/s)": bench.error(name, case) for name in PROGRAMS}
    return Grade(numbers, _most(numbers) < limit)


def concur(bench: Bench, case: int, share: float) -> Grade:
    """Test whether the omegas of both collocation programs agree within `share` of the largest."""
    truth = bench.solution(case)
    two, four = (bench.runs(program, case) for program in COLLOCATION)
    apart = _farthest(two.omega, four.omega)
    complete = two.complete & four.complete
    largest = largest_of(truth)
    spread = np.maximum(spread_of(truth), 1e-12 * largest[..., None])
    whole = np.where(complete, apart.max(axis=-1) / largest, np.inf)
    detail = np.where(complete, (apart / spread).max(axis=-1), np.inf)
    numbers = {
        "difference over the largest omega": whole,
        "difference over the range of a component": detail,
        "two-term error (rad/s)": bench.error("two-term", case),
        "four-term error (rad/s)": bench.error("four-term", case),
    }
    return Grade(numbers, (whole <= share) & (detail <= 0.1), whole <= share)


def fails(bench: Bench, case: int, share: float) -> Grade:
    """Test whether Runge-Kutta ends early with an error above `share` of a component's range."""
    runs = bench.runs("runge-kutta", case)
    error = share_of_range(runs.omega, bench.solution(case))
    ended, far = ~runs.complete, error > share
    numbers = {"steps": runs.steps, "error over the range of a component": error}
    return Grade(numbers, ended & far, ended | far)


def diverged(bench: Bench, case: int) -> Grade:
    runs, error = bench.runs("two-term", case), bench.error("two-term", case)
    numbers = {"steps": runs.steps, "largest error (rad/s)": error}
    return Grade(numbers, runs.overflow | (error > largest_of(bench.solution(case))))


def models_concur(bench: Bench, case: int, share: float, terms: Sequence[int]) -> Grade:
    first, *others = terms
    model, largest = bench.models(case, first), largest_of(bench.solution(case))
    numbers = {}
    for n in others:
        other = bench.models(case, n)
        # A run that overflows agrees with none.
        lost = ~(np.isfinite(other) & np.isfinite(model)).all(axis=(-1, -2))
        apart = np.where(lost, np.inf, _farthest(other, model).max(axis=-1)) / largest
        numbers[f"{n} terms against {first}, over the largest omega"] = apart
    return Grade(numbers, _most(numbers) <= share)


def dynamic(bench: Bench, case: int, factor: float) -> Grade:
    """Test whether a case has at least `factor` times the acceleration of any other."""
    rates = {}
    for each in range(1, 8):
        omega = bench.runs("four-term", each).omega
        with np.errstate(all="ignore"):
            changes = np.diff(omega, axis=-2) / bench.scene(each).step_size
            lengths = np.linalg.norm(changes, axis=-1)
        rates[each] = np.fmax.reduce(lengths, axis=-1, initial=0.0)
    others = _most({each: rate for each, rate in rates.items() if each != case})
    numbers = {f"case {each}: largest acceleration (rad/s2)": rate for each, rate in rates.items()}
    return Grade(numbers, rates[case] >= factor * others)


def small_step(bench: Bench, cases: Sequence[int], exception: int) -> Grade:
    """Test whether a tenth of the step size improves collocation.

    The two-term program must not improve in case `exception`.
    """
    numbers, improved, excepted = {}, [], np.False_
    for program in COLLOCATION:
        for case in cases:
            before = np.asarray(bench.error(program, case))
            after = np.asarray(bench.error(program, case, parts=10))
            with np.errstate(all="ignore"):
                gain = np.where(np.isfinite(before), before / after, np.isfinite(after))
            numbers[f"{program}, case {case}: gain"] = gain
            if (program, case) == ("two-term", exception):
                excepted = gain < 2.0
            else:
                improved.append(gain >= 2.0)
    share = sum(each.astype(float) for each in improved) / len(improved)
    return Grade(numbers, (share >= 0.8) & excepted, share >= 0.5)


def small_step_runge_kutta(bench: Bench, cases: Sequence[int]) -> Grade:
    """Judge that Runge-Kutta without the stop test is no better at a tenth of the step size."""
    numbers = {}
    for case in cases:
        before, after = (
            np.asarray(bench.error("runge-kutta", case, False, parts)) for parts in (1, 10)
        )
        with np.errstate(all="ignore"):
            numbers[f"case {case}: gain"] = before / after
    better = sum((gain >= 2.0).astype(int) for gain in numbers.values())
    return Grade(numbers, better == 0, 3 * better <= len(numbers))


def largest_error(
    bench: Bench, program: str, case: int, may_stop: bool = True, parts: int = 1
) -> Array:
    """Return the largest error (rad/s) for each start, infinite after an overflow."""
    runs = bench.runs(program, case, may_stop, parts)
    error = _farthest(runs.omega, bench.solution(case)).max(axis=-1)
    return np.where(runs.overflow, np.inf, error)


def share_of_range(omega: Array, truth: Array) -> Array:
    """Return the largest ratio of error to range among the varying components of omega."""
    spread = spread_of(truth)
    moving = spread > 1e-12 * largest_of(truth)[..., None]
    with np.errstate(all="ignore"):
        shares = np.where(moving, _farthest(omega, truth) / spread, 0.0)
    return np.asarray(shares.max(axis=-1))


def spread_of(omega: Array) -> Array:
    """Return the range (rad/s) of each component of omega over the steps, shape (..., 3)."""
    return np.moveaxis(np.ptp(_by_component(omega), axis=-1), 0, -1)


def largest_of(omega: Array) -> Array:
    """Return the largest magnitude (rad/s) of omega's components over the steps."""
    return np.asarray(np.abs(omega).max(axis=(-1, -2)))


def _farthest(first: Array, second: Array) -> Array:
    """Return the largest difference (rad/s) of each component over common steps, (..., 3)."""
    with np.errstate(all="ignore"):
        apart = _by_component(first - second)
        np.abs(apart, out=apart)
        return np.moveaxis(np.fmax.reduce(apart, axis=-1, initial=0.0), 0, -1)


def _by_component(omega: Array) -> Array:
    """Return omega as a contiguous array (3, ..., steps), whose maxima are ten times as fast."""
    return np.ascontiguousarray(np.moveaxis(omega, -1, 0))


def _most(numbers: Mapping[Any, Any]) -> Any:
    return functools.reduce(np.maximum, numbers.values())
