"""Tests of the thesis's claims about one case; each test returns a verdict with its numbers.

Each function is the `test` of one or more claims in `data/claims.toml`. The `rule` of the claim
describes how the function decides, and the `parameters` of the claim are the keyword arguments.
`lab` is a laboratory, which runs the programs under the chosen assumptions, and `case` is the
number of a case of Table 1. All numbers of a verdict are computed by the test. The tests over
several cases are in `methods`.

Unless a docstring says otherwise, an error is the largest error of any component of omega against
the reference solution, over the steps that the program ran. A claim that fails has the verdict "not
reproduced".
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pyharness.history.claims import rules
from pyharness.history.claims.laboratory import Laboratory, distance, largest, ranges, starts
from pyharness.history.claims.rules import COLLOCATION
from pyharness.model.listing import Listing, names_of
from pyharness.model.scene import Triple
from pyharness.original.cells import subsets

REPRODUCED = "reproduced"
IN_PART = "reproduced in part"
NOT_REPRODUCED = "not reproduced"
FALSE = "false"
NOT_TESTABLE = "not testable"
UNDECIDED = "undecided"


@dataclass(frozen=True)
class Judged:
    """The verdict on one claim of the thesis, and the computed numbers that support it.

    `numbers` maps a description of each number to its value.
    """

    verdict: str
    numbers: dict[str, float]


def graded(
    numbers: dict[str, float], whole: bool, part: bool = False, otherwise: str = NOT_REPRODUCED
) -> Judged:
    """Return the verdict "reproduced" if `whole`, "reproduced in part" if `part`, else `otherwise`.

    The verdict is on a claim of the thesis. `numbers` are the computed numbers that support it, by
    description; the result has them too.
    """
    return Judged(REPRODUCED if whole else IN_PART if part else otherwise, numbers)


def judged(grade: rules.Grade, otherwise: str = NOT_REPRODUCED) -> Judged:
    """Return the verdict on a claim of the thesis, from the result `grade` of its test.

    The test was made for one initial omega. `otherwise` is the verdict if the claim is reproduced
    neither as a whole nor in part.
    """
    numbers = {name: float(each) for name, each in grade.numbers.items()}
    return graded(numbers, bool(grade.whole), bool(grade.part), otherwise)


def constant_solution(lab: Laboratory, case: int) -> Judged:
    """Judge the claim of the thesis that the solution of a case is constant.

    The verdict is "reproduced" if every omega component of the reference solution, which `lab`
    computes, varies by at most 1e-12 rad/s; otherwise "false".
    """
    moved = float(ranges(lab.truth(case)).max())
    return graded({"change over the run (rad/s)": moved}, moved <= 1e-12, otherwise=FALSE)


def known_solution(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the solution of a case is (sin 5t, cos 5t, 10), as the thesis prints.

    This printed omega (rad/s) is compared with the reference solution, which `lab` computes. The
    verdict is "reproduced" if no component differs by more than 1e-15 (1 + 5 t) rad/s; otherwise it
    is "false". Here t (s) is the end of the run.
    """
    truth = lab.truth(case)
    t = truth.time
    printed = np.column_stack([np.sin(5 * t), np.cos(5 * t), np.full_like(t, 10.0)])
    apart = distance(printed, truth.omega)
    # The phase 5 t is itself rounded, so the bound grows with t.
    allowed = 1e-15 * (1.0 + 5.0 * float(t[-1]))
    return graded({"distance from the reference (rad/s)": apart}, apart <= allowed, False, FALSE)


def omega3_varies(lab: Laboratory, case: int, limit: float) -> Judged:
    """Judge the claim of the thesis that omega3 varies in a case.

    The verdict is "reproduced" if the range of omega3 over the run exceeds `limit` (rad/s),
    otherwise "false". The range is the largest minus the smallest value of the reference solution,
    which `lab` computes.
    """
    return judged(rules.omega3_varies(lab, case, limit), FALSE)


def no_deviation(lab: Laboratory, case: int, limit: float) -> Judged:
    """Judge the claim that all three programs coincide with the known solution of a case.

    The verdict is "reproduced" if the error of every program in `lab` is below `limit` (rad/s),
    half a unit of the last printed digit. An error is the largest error of any omega component
    against the reference solution. The numbers that support the verdict also show how many steps
    the Runge-Kutta program runs from each initial omega in `starts`.
    """
    found = judged(rules.no_deviation(lab, case, limit))
    for start in starts():
        other = replace(lab, assumptions=replace(lab.assumptions, start=start))
        steps = other.run("runge-kutta", case).steps
        found.numbers[f"runge-kutta from ({_shown(start)}): steps that it ran"] = float(steps)
    return found


def _shown(start: Triple) -> str:
    return ", ".join(f"{x:g}" for x in start)


def coincident(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that collocation coincides with the known solution on the thesis's graph.

    `lab` runs both collocation programs on case `case`. The error of each component of omega that
    varies is divided by the component's range, its largest minus its smallest value. The verdict is
    "reproduced" if no ratio exceeds `share`, else "not reproduced".
    """
    numbers = {}
    for program in COLLOCATION:
        runs, truth = lab.runs(program, case), lab.solution(case)
        error = float(rules.share_of_range(runs.omega, truth))
        numbers[f"{program}: largest share of a component's range"] = error
    return graded(numbers, max(numbers.values()) <= share)


def error_size(lab: Laboratory, case: int, low: float, high: float) -> Judged:
    """Judge the claim that collocation errors, divided by the amplitude, are from `low` to `high`.

    `lab` runs both collocation programs on case `case`. The verdict is "reproduced" if this is true
    for both, else "not reproduced". An error is the largest error of any omega component against
    the reference solution. The amplitude is half the largest range (largest minus smallest value)
    of a component of the reference omega.
    """
    amplitude = float(ranges(lab.truth(case)).max()) / 2.0
    numbers = {
        f"{program}: largest error over the amplitude": lab.error(program, case) / amplitude
        for program in COLLOCATION
    }
    return graded(numbers, all(low <= each <= high for each in numbers.values()))


def poor(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that the results of the Runge-Kutta program are poor.

    `lab` runs the program on case `case`. The verdict is "reproduced" if its error exceeds the
    fraction `share` of the amplitude, else "not reproduced". The error is the largest error of any
    omega component against the reference solution. The amplitude is half the largest range (largest
    minus smallest value) of a component of the reference omega.
    """
    amplitude = float(ranges(lab.truth(case)).max()) / 2.0
    found = lab.error("runge-kutta", case) / amplitude
    return graded({"largest error over the amplitude": found}, found > share)


def error_constant(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the error of collocation does not grow during the run.

    `lab` runs both collocation programs on case `case`. The largest error of omega in the last
    fifth of the steps is compared with the largest error in the first fifth. The verdict is
    "reproduced" if it is at most twice as large for both programs, else "not reproduced".
    """
    truth = lab.truth(case).omega
    numbers = {}
    for program in COLLOCATION:
        errors = np.abs(lab.run(program, case).omega - truth).max(axis=1)
        fifth = len(errors) // 5
        growth = float(errors[-fifth:].max() / errors[:fifth].max())
        numbers[f"{program}: error of the last fifth over that of the first"] = growth
    return graded(numbers, max(numbers.values()) <= 2.0)


def stopped_at(lab: Laboratory, case: int, step: int) -> Judged:
    """Judge the claim that the stop test ended the Runge-Kutta run at step number `step`.

    The stop test, a Lipschitz test, is part of the program, which `lab` runs on case `case`. The
    verdict is "reproduced" if it ended the run at this step, "reproduced in part" if at another
    step, else "not reproduced". The program is also run with every subset of its defects, the
    mistakes of the printed program. The result, a `Judged`, lists as evidence the subsets with
    which the test ends the run at `step`.
    """
    stop = lab.run("runge-kutta", case).stop
    found = math.nan if stop is None else float(stop.step)
    every = [
        Listing("runge-kutta", defects, lab.listing("runge-kutta").readings)
        for defects in subsets(names_of("defect", "runge-kutta"))
    ]
    there = []
    for each in every:
        other = lab.run_on(lab.scene(case), each).stop
        if other is not None and other.step == step:
            mended = sorted(Listing.original(each.program).defects - each.defects)
            there.append(f"original but for {', '.join(mended)}" if mended else "original")
    numbers = {
        "stopped at step": found,
        f"of {len(every)} subsets of the defects, stop there": float(len(there)),
        **{f"stops there: {each}": float(step) for each in there},
    }
    if stop is None:
        numbers["steps that it ran"] = float(lab.run("runge-kutta", case).steps)
        del numbers["stopped at step"]
    return graded(numbers, found == step, stop is not None)


def growing(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that omega1 of the Runge-Kutta program grows beyond the sine of the solution.

    `lab` runs the program on case `case`. Two conditions are tested on omega1 at the end of the
    run. It must exceed 1 rad/s, the amplitude of the sine. It must also exceed omega1 of the
    reference solution at that time by more than a thousandth of this value. The verdict is
    "reproduced" if both conditions hold, else "not reproduced".
    """
    run = lab.run("runge-kutta", case)
    value, solution = float(run.omega[-1, 0]), float(lab.truth(case).omega[run.steps - 1, 0])
    numbers = {"omega1 at the end (rad/s)": value, "solution there (rad/s)": solution}
    return graded(numbers, value > 1.0 and value > solution * 1.001)


def search(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that a search for an error in the Runge-Kutta program found none.

    No run can test whether the author's search found an error, so that the verdict is always "not
    testable". With it one number is returned: the error of the program, divided by the error of the
    corrected program. Both errors are the largest of any omega component in case `case`, over the
    steps that the program's run on this case completed.
    """
    run = lab.run("runge-kutta", case)
    best = Laboratory(False, lab.assumptions).run("runge-kutta", case)
    truth = lab.truth(case).omega[: run.steps]
    gain = distance(run.omega, truth) / distance(best.omega[: run.steps], truth)
    return Judged(NOT_TESTABLE, {"error over that of the corrected program": gain})


def concur(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that the two collocation programs agree, by the rule `rules.concur`.

    `lab` runs the programs on case `case`. The verdict is "reproduced in part" if both runs are
    complete and their omegas differ by at most the fraction `share` of the largest omega. It is
    "reproduced" if each component also differs by at most a tenth of its range, which is the
    largest minus the smallest value. Otherwise it is "not reproduced".
    """
    return judged(rules.concur(lab, case, share))


def fails(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that the Runge-Kutta program fails, by the rule `rules.fails`.

    `lab` runs the program on case `case`. Two conditions are tested: the run ended early, and the
    error of an omega component exceeds the fraction `share` of the component's range. The verdict
    is "reproduced" if both are true, "reproduced in part" if only one is true, else "not
    reproduced".
    """
    return judged(rules.fails(lab, case, share))


def differ(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that the results of the two-term and the four-term program differ.

    `lab` runs both programs on case `case`. The verdict is "reproduced" if their omegas differ by
    more than the fraction `share` of the largest reference omega, else "not reproduced".
    """
    two, four = (lab.run(program, case).omega for program in COLLOCATION)
    apart = distance(two, four) / largest(lab.truth(case))
    return graded({"difference over the largest omega": apart}, apart > share)


def more_reliable(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the four-term program is more accurate than the two-term program.

    `lab` runs both programs on case `case`. The verdict is "reproduced" if the four-term error is
    at most 0.5 times the two-term error, "reproduced in part" if at most 0.8 times, else "not
    reproduced". An error is the largest error of any omega component against the reference
    solution.
    """
    ratio = lab.error("four-term", case) / lab.error("two-term", case)
    return graded({"four-term error over two-term error": ratio}, ratio <= 0.5, ratio <= 0.8)


def diverged(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the run of the two-term program diverged, by the rule `rules.diverged`.

    `lab` runs the program on case `case`. The verdict is "reproduced" if the run overflowed, or if
    its largest error of omega exceeds the largest omega of the reference solution, else "not
    reproduced".
    """
    return judged(rules.diverged(lab, case))


def too_fast(lab: Laboratory, case: int, same: float, worse: float) -> Judged:
    """Judge the claim that the two-term error has its cause in a motion too fast for two terms.

    The thesis gives no initial omega for some cases. Therefore the corrected programs run on case
    `case` from several: all that the thesis shows anywhere, and one of our own (see `starts`).
    All other assumptions are those of `lab`. The verdict is "reproduced" if the two-term error is
    more than `worse` times the four-term error from every initial omega. It is "reproduced in part"
    if the two-term error is more than `same` times the four-term error from at least one initial
    omega, else "false". An error is the largest error of any omega component against the reference
    solution.
    """
    numbers = {}
    for start in starts():
        best = Laboratory(False, replace(lab.assumptions, start=start))
        ratio = best.error("two-term", case) / best.error("four-term", case)
        numbers[f"from ({_shown(start)}): corrected two-term error over four-term"] = ratio
    ratios = list(numbers.values())
    return graded(numbers, min(ratios) > worse, max(ratios) > same, FALSE)


def models_concur(lab: Laboratory, case: int, share: float, terms: Sequence[int]) -> Judged:
    """Judge the claim that collocation models with different numbers of terms agree.

    `lab` computes the models for case `case`, and `terms` are their numbers of terms. By the rule
    `rules.models_concur` the verdict is "reproduced" if each model differs from the first one by at
    most the fraction `share` of the largest omega, else "not reproduced".
    """
    return judged(rules.models_concur(lab, case, share, terms))


def dynamic(lab: Laboratory, case: int, factor: float) -> Judged:
    """Judge the claim that the motion of case `case` is the liveliest in Table 1 of the thesis.

    `lab` runs the four-term program on each case. By the rule `rules.dynamic` the verdict is
    "reproduced" if the largest angular acceleration of the case is at least `factor` times the
    largest angular acceleration of every other case.
    """
    return judged(rules.dynamic(lab, case, factor))
