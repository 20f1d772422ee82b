"""Rules of the claims that depend on the initial omega (the start), for one start or many.

A bench supplies runs and solutions: it is a `Laboratory` for one start, or `Starts` for n starts.
Its arrays have the shape (..., steps, 3), where ... is the shape of the starts, () or (n,). A rule
returns a `Grade`: numbers of the shape ..., and flags that say from which starts the claim is
reproduced as a whole, or in part. Unless a docstring says otherwise, an error is the largest error
of any component of omega over the steps that the program ran, against the reference solution.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pyharness.model.listing import PROGRAMS
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array

COLLOCATION = ("two-term", "four-term")
Flags = NDArray[np.bool_]


class Runs(NamedTuple):
    """The runs of a program on one case, from one start (initial omega) or many.

    In shapes, ... is the shape of the starts, () or (n,). `omega` (rad/s), shape (..., steps, 3),
    is NaN where a run has no row. `steps` is the number of rows of each run. `complete` and
    `overflow` state for each run whether it was completed, and whether it overflowed.
    """

    omega: Array
    steps: NDArray[Any]
    complete: Flags | np.bool_
    overflow: Flags | np.bool_


class Grade(NamedTuple):
    """The result of a test of one claim of the thesis, from one start (initial omega) or many.

    `numbers` has the computed numbers by description. The flags `whole` and `part` state for each
    start whether the claim is reproduced as a whole, and whether it is reproduced in part.
    """

    numbers: Mapping[str, Any]
    whole: Any
    part: Any = False


class Bench(Protocol):
    """The interface from which a test of a claim obtains runs and reference solutions of cases.

    The runs are from one start (initial omega) or many. The step size of a run is divided by the
    factor `parts`; the rows of omega are still at the steps of the case. Without `may_stop` the
    stop test of the Runge-Kutta program is skipped.
    """

    def scene(self, case: int, parts: int = 1) -> Scene:
        """Return the scene of a case, with its step size divided by `parts`.

        A scene is a body with its initial omega, torque, step size and number of steps. The runs of
        this `Bench` may start from other initial omegas than that of the scene.
        """

    def runs(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> Runs:
        """Run a program on a case of the thesis from every start, which is an initial omega.

        The step size is divided by `parts`. Without `may_stop` the stop test of the Runge-Kutta
        program is skipped.
        """

    def solution(self, case: int) -> Array:
        """Return the reference omega (rad/s) of a case at its steps, shape (..., steps, 3).

        Here ... is the shape of the starts (initial omegas): () for one start, or (n,).
        """

    def error(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> Any:
        """Return the largest error of any omega component (rad/s) in a case, for each start.

        A start is an initial omega. The errors are those of `largest_error`. `parts` divides the
        step size. Without `may_stop` the stop test of the Runge-Kutta program is skipped.
        """

    def models(self, case: int, terms: int) -> Array:
        """Return omega (rad/s) of the collocation model whose trial functions have `terms` terms.

        The shape is (..., steps, 3), where ... is the shape of the starts (initial omegas): () for
        one start, or (n,). Omega is NaN from an overflow on.
        """


def omega3_varies(bench: Bench, case: int, limit: float) -> Grade:
    """Grade the claim of the thesis that omega3 varies in a case.

    The claim is reproduced if the range of omega3 over the run exceeds `limit` (rad/s). The range
    is the largest minus the smallest value of the reference solution, which `bench` supplies.
    """
    moved = spread_of(bench.solution(case))[..., 2]
    return Grade({"range of omega3 (rad/s)": moved}, moved > limit)


def no_deviation(bench: Bench, case: int, limit: float) -> Grade:
    """Grade the claim that all three programs coincide with the known solution of a case.

    The claim is reproduced if the largest error of omega of every program is below `limit` (rad/s),
    half a unit of the last printed digit. `bench` supplies the runs and the reference solutions.
    """
    numbers = {f"{name}: largest error (rad/s)": bench.error(name, case) for name in PROGRAMS}
    return Grade(numbers, _most(numbers) < limit)


def concur(bench: Bench, case: int, share: float) -> Grade:
    """Grade the claim that the two-term and the four-term program agree in a case.

    The claim is reproduced in part if both runs are complete and their omegas differ by at most the
    fraction `share` of the largest reference omega. It is reproduced as a whole if they also differ
    in each component by at most a tenth of the component's range (largest minus smallest value).
    `bench` supplies the runs and the reference solutions.
    """
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
    """Grade the claim that the Runge-Kutta program fails in a case.

    Two conditions are tested: the run ended early, and the error of an omega component exceeds the
    fraction `share` of the component's range (largest minus smallest value). The claim is
    reproduced if both are true, and reproduced in part if only one is true. `bench` supplies the
    runs and the reference solutions.
    """
    runs = bench.runs("runge-kutta", case)
    error = share_of_range(runs.omega, bench.solution(case))
    ended, far = ~runs.complete, error > share
    numbers = {"steps": runs.steps, "error over the range of a component": error}
    return Grade(numbers, ended & far, ended | far)


def diverged(bench: Bench, case: int) -> Grade:
    """Grade the claim that the run of the two-term collocation program diverged in a case.

    The claim is reproduced if the run overflowed, or if its largest error of omega exceeds the
    largest omega of the reference solution. `bench` supplies the runs and the reference solutions.
    """
    runs, error = bench.runs("two-term", case), bench.error("two-term", case)
    numbers = {"steps": runs.steps, "largest error (rad/s)": error}
    return Grade(numbers, runs.overflow | (error > largest_of(bench.solution(case))))


def models_concur(bench: Bench, case: int, share: float, terms: Sequence[int]) -> Grade:
    """Grade the claim that collocation models with different numbers of terms agree in a case.

    `terms` has the number of terms of each model. The claim is reproduced if all other models
    differ from the first one in omega by at most the fraction `share` of the largest reference
    omega. `bench` supplies the models and the reference solution.
    """
    first, *others = terms
    model, largest = bench.models(case, first), largest_of(bench.solution(case))
    numbers = {}
    for n in others:
        other = bench.models(case, n)
        # A run that overflowed agrees with no other run.
        lost = ~(np.isfinite(other) & np.isfinite(model)).all(axis=(-1, -2))
        apart = np.where(lost, np.inf, _farthest(other, model).max(axis=-1)) / largest
        numbers[f"{n} terms against {first}, over the largest omega"] = apart
    return Grade(numbers, _most(numbers) <= share)


def dynamic(bench: Bench, case: int, factor: float) -> Grade:
    """Grade the claim that the motion of a case is the liveliest of all seven cases.

    The liveliest motion has the largest angular acceleration. The claim is reproduced if the
    largest angular acceleration of the case's four-term run is at least `factor` times the largest
    one in every other case. `bench` supplies the runs.
    """
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
    """Grade the claim that collocation improves with a tenth of the step size, with one exception.

    The exception is the two-term program in the case `exception`. A run improves if its largest
    error of omega falls at least to half. A run that overflows with the full step size does not
    count as improved. The claim is reproduced if at least four fifths of the other pairs of program
    and case improve, and the exception does not. It is reproduced in part if at least half of the
    other pairs improve.
    `bench` supplies the runs and the reference solutions of all `cases`.
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
    """Grade the claim that the Runge-Kutta program does not improve with a tenth of the step size.

    A run improves if its largest error of omega falls at least to half. The claim is reproduced if
    none of the `cases` improves, and in part if at most a third of them do. The runs are without
    the stop test. `bench` supplies the runs and the reference solutions.
    """
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
    """Return the largest error of any omega component (rad/s), one number for each start.

    A start is an initial omega of the runs that `bench` supplies. Only rows at the steps of the
    case count; the error is infinite after an overflow. `parts` divides the step size. Without
    `may_stop` the stop test of the Runge-Kutta program is skipped.
    """
    runs = bench.runs(program, case, may_stop, parts)
    error = _farthest(runs.omega, bench.solution(case)).max(axis=-1)
    return np.where(runs.overflow, np.inf, error)


def share_of_range(omega: Array, truth: Array) -> Array:
    """Return the largest ratio of the error of an omega component to the component's range.

    Components that do not vary are left out. The range is the largest minus the smallest value of
    the reference omega. `omega` is the result of a run, and `truth` the reference omega of its
    case, both of the shape (..., steps, 3). The result has the shape (...), with one number for
    each start (initial omega).
    """
    spread = spread_of(truth)
    moving = spread > 1e-12 * largest_of(truth)[..., None]
    with np.errstate(all="ignore"):
        shares = np.where(moving, _farthest(omega, truth) / spread, 0.0)
    return np.asarray(shares.max(axis=-1))


def spread_of(omega: Array) -> Array:
    """Return the range of each omega component over the steps (rad/s), shape (..., 3).

    The range is the largest minus the smallest value. `omega` has the shape (..., steps, 3).
    """
    return np.moveaxis(np.ptp(_by_component(omega), axis=-1), 0, -1)


def largest_of(omega: Array) -> Array:
    """Return the largest magnitude of any omega component over the steps (rad/s), shape (...).

    `omega` has the shape (..., steps, 3).
    """
    return np.asarray(np.abs(omega).max(axis=(-1, -2)))


def _farthest(first: Array, second: Array) -> Array:
    """Return the largest difference of each omega component over the steps (rad/s), shape (..., 3).

    `first` and `second` have the shape (..., steps, 3). Steps at which an omega is NaN, because a
    run has no row there, do not count.
    """
    with np.errstate(all="ignore"):
        apart = _by_component(first - second)
        np.abs(apart, out=apart)
        return np.moveaxis(np.fmax.reduce(apart, axis=-1, initial=0.0), 0, -1)


def _by_component(omega: Array) -> Array:
    """Return omega, shape (..., steps, 3), as a contiguous array of the shape (3, ..., steps).

    NumPy computes maxima over the steps of this array ten times as fast as of the original array.
    """
    return np.ascontiguousarray(np.moveaxis(omega, -1, 0))


def _most(numbers: Mapping[Any, Any]) -> Any:
    first, *others = numbers.values()
    for other in others:
        first = np.maximum(first, other)
    return first
