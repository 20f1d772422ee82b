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
    """The verdict on one claim, and the computed numbers that support it, by description."""

    verdict: str
    numbers: dict[str, float]


def graded(
    numbers: dict[str, float], whole: bool, part: bool = False, otherwise: str = NOT_REPRODUCED
) -> Judged:
    """Return the verdict "reproduced" if `whole`, "reproduced in part" if `part`, else `otherwise`.

    `numbers` are the computed numbers that support the verdict, by description.
    """
    return Judged(REPRODUCED if whole else IN_PART if part else otherwise, numbers)


def judged(grade: rules.Grade, otherwise: str = NOT_REPRODUCED) -> Judged:
    """Return the verdict that corresponds to the grade of a rule for one initial omega.

    `otherwise` is the verdict if the claim is reproduced neither as a whole nor in part.
    """
    numbers = {name: float(each) for name, each in grade.numbers.items()}
    return graded(numbers, bool(grade.whole), bool(grade.part), otherwise)


def constant_solution(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the solution of a case is constant.

    The verdict is "reproduced" if every omega component of the reference solution, which `lab`
    computes, varies by at most 1e-12 rad/s; otherwise "false".
    """
    moved = float(ranges(lab.truth(case)).max())
    return graded({"change over the run (rad/s)": moved}, moved <= 1e-12, otherwise=FALSE)


def known_solution(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the solution of a case is (sin 5t, cos 5t, 10), as the thesis prints.

    The printed solution is compared with the reference solution, which `lab` computes. The verdict
    is "reproduced" if no component differs by more than 1e-15 (1 + 5 t) rad/s, where t (s) is the
    end of the run; otherwise it is "false".
    """
    truth = lab.truth(case)
    t = truth.time
    printed = np.column_stack([np.sin(5 * t), np.cos(5 * t), np.full_like(t, 10.0)])
    apart = distance(printed, truth.omega)
    # The phase 5 t is itself rounded, so the bound grows with t.
    allowed = 1e-15 * (1.0 + 5.0 * float(t[-1]))
    return graded({"distance from the reference (rad/s)": apart}, apart <= allowed, False, FALSE)


def omega3_varies(lab: Laboratory, case: int, limit: float) -> Judged:
    """Judge the claim that omega3 varies.

    The verdict is "reproduced" if the range of omega3 over the run exceeds `limit` (rad/s),
    otherwise "false". The range is of the reference solution, which `lab` computes.
    """
    return judged(rules.omega3_varies(lab, case, limit), FALSE)


def no_deviation(lab: Laboratory, case: int, limit: float) -> Judged:
    """Judge the claim that all three programs coincide with the known solution.

    The verdict is "reproduced" if the error of every program in `lab` is below `limit` (rad/s),
    half a unit of the last printed digit. An error is the largest error of any omega component
    against the reference solution. The numbers also show how many steps the Runge-Kutta program
    runs from each initial omega in `starts`.
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

    The error of each component of omega that varies is divided by the component's range. The
    verdict is "reproduced" if the largest ratio is at most `share` for both collocation programs in
    `lab`.
    """
    numbers = {}
    for program in COLLOCATION:
        runs, truth = lab.runs(program, case), lab.solution(case)
        error = float(rules.share_of_range(runs.omega, truth))
        numbers[f"{program}: largest share of a component's range"] = error
    return graded(numbers, max(numbers.values()) <= share)


def error_size(lab: Laboratory, case: int, low: float, high: float) -> Judged:
    """Judge the claim that the collocation errors, over the amplitude, are from `low` to `high`.

    The verdict is "reproduced" if this is so for both collocation programs in `lab`. An error is
    the largest error of any omega component against the reference solution. The amplitude is half
    the largest range of a component of the reference omega.
    """
    amplitude = float(ranges(lab.truth(case)).max()) / 2.0
    numbers = {
        f"{program}: largest error over the amplitude": lab.error(program, case) / amplitude
        for program in COLLOCATION
    }
    return graded(numbers, all(low <= each <= high for each in numbers.values()))


def poor(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that the Runge-Kutta results are poor.

    The verdict is "reproduced" if the error of the Runge-Kutta program in `lab` exceeds the
    fraction `share` of the amplitude. An error is the largest error of any omega component against
    the reference solution. The amplitude is half the largest range of a component of the reference
    omega.
    """
    amplitude = float(ranges(lab.truth(case)).max()) / 2.0
    found = lab.error("runge-kutta", case) / amplitude
    return graded({"largest error over the amplitude": found}, found > share)


def error_constant(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the error of collocation does not grow during the run.

    The largest errors of omega in the last and in the first fifth of the steps are compared. The
    verdict is "reproduced" if, for both collocation programs in `lab`, the error in the last fifth
    is at most twice the error in the first fifth.
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

    The verdict is "reproduced" if the test ended the run of `lab` at this step, and "reproduced in
    part" if at another step. The numbers also name the subsets of the program's defects with which
    the test ends the run at `step`.
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
    """Judge the claim that omega1 of the Runge-Kutta program grows beyond the sine.

    Two conditions are tested on omega1 at the end of the run of `lab`. It must exceed 1 rad/s, and
    it must exceed omega1 of the reference solution at that time by more than a thousandth. The
    verdict is "reproduced" if both hold.
    """
    run = lab.run("runge-kutta", case)
    value, solution = float(run.omega[-1, 0]), float(lab.truth(case).omega[run.steps - 1, 0])
    numbers = {"omega1 at the end (rad/s)": value, "solution there (rad/s)": solution}
    return graded(numbers, value > 1.0 and value > solution * 1.001)


def search(lab: Laboratory, case: int) -> Judged:
    """Return the Runge-Kutta error divided by the error of the corrected Runge-Kutta program.

    Both errors are the largest of any omega component, over the steps that the run of `lab` has.
    The claim is about a search for a mistake, which no run can test. The verdict is therefore
    always "not testable".
    """
    run = lab.run("runge-kutta", case)
    best = Laboratory(False, lab.assumptions).run("runge-kutta", case)
    truth = lab.truth(case).omega[: run.steps]
    gain = distance(run.omega, truth) / distance(best.omega[: run.steps], truth)
    return Judged(NOT_TESTABLE, {"error over that of the corrected program": gain})


def concur(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that the two collocation programs agree, by the rule `rules.concur`.

    `lab` runs the programs. `share` is the largest difference that counts as agreement, as a
    fraction of the largest omega.
    """
    return judged(rules.concur(lab, case, share))


def fails(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that the Runge-Kutta program fails, by the rule `rules.fails`.

    `lab` runs the program. `share` is the error that the program must exceed, as a fraction of a
    component's range.
    """
    return judged(rules.fails(lab, case, share))


def differ(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge the claim that the two-term and the four-term program differ.

    The verdict is "reproduced" if the omegas of the two runs of `lab` differ by more than the
    fraction `share` of the largest reference omega.
    """
    two, four = (lab.run(program, case).omega for program in COLLOCATION)
    apart = distance(two, four) / largest(lab.truth(case))
    return graded({"difference over the largest omega": apart}, apart > share)


def more_reliable(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the four-term program is more accurate than the two-term program.

    The errors are those of the runs of `lab`. The verdict is "reproduced" if the four-term error is
    at most 0.5 of the two-term error, and "reproduced in part" if at most 0.8. An error is the
    largest error of any omega component against the reference solution.
    """
    ratio = lab.error("four-term", case) / lab.error("two-term", case)
    return graded({"four-term error over two-term error": ratio}, ratio <= 0.5, ratio <= 0.8)


def diverged(lab: Laboratory, case: int) -> Judged:
    """Judge the claim that the two-term run of `lab` diverged, by the rule `rules.diverged`."""
    return judged(rules.diverged(lab, case))


def too_fast(lab: Laboratory, case: int, same: float, worse: float) -> Judged:
    """Judge the claim that the two-term error has its cause in a motion too fast for two terms.

    The corrected programs run from each initial omega in `starts`, otherwise under the assumptions
    of `lab`. The verdict is "reproduced" if the two-term error is more than `worse` times the
    four-term error from every start. It is "reproduced in part" if the two-term error is more than
    `same` times the four-term error from some start, otherwise "false". An error is the largest
    error of any omega component against the reference solution.
    """
    numbers = {}
    for start in starts():
        best = Laboratory(False, replace(lab.assumptions, start=start))
        ratio = best.error("two-term", case) / best.error("four-term", case)
        numbers[f"from ({_shown(start)}): corrected two-term error over four-term"] = ratio
    ratios = list(numbers.values())
    return graded(numbers, min(ratios) > worse, max(ratios) > same, FALSE)


def models_concur(lab: Laboratory, case: int, share: float, terms: Sequence[int]) -> Judged:
    """Judge the claim that collocation models agree, by the rule `rules.models_concur`.

    `lab` computes the models. `terms` are their numbers of terms, and `share` is the largest
    difference that counts as agreement, as a fraction of the largest omega.
    """
    return judged(rules.models_concur(lab, case, share, terms))


def dynamic(lab: Laboratory, case: int, factor: float) -> Judged:
    """Judge the claim that the motion of a case is the liveliest, by the rule `rules.dynamic`.

    In the four-term runs of `lab`, its largest angular acceleration must be at least `factor` times
    the largest angular acceleration in every other case.
    """
    return judged(rules.dynamic(lab, case, factor))
