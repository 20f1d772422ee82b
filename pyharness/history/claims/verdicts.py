"""Tests of the thesis's claims about one case.

Each function is the `test` of claims in `data/claims.toml`, where `rule` describes the decision and
`parameters` are the keyword arguments. `lab` runs the original or the corrected programs; `case` is
a number in Table 1. Errors are defined in `rules`.
"""

from dataclasses import dataclass, replace

import numpy as np

from pyharness.history.claims import rules
from pyharness.history.claims.laboratory import Laboratory, distance, largest, start_text, starts
from pyharness.history.claims.rules import COLLOCATION
from pyharness.model.listing import Listing, names_of
from pyharness.thesis.cells import subsets

REPRODUCED = "reproduced"
IN_PART = "reproduced in part"
NOT_REPRODUCED = "not reproduced"
FALSE = "false"
NOT_TESTABLE = "not testable"
UNDECIDED = "undecided"


@dataclass(frozen=True)
class Judged:
    """The verdict on a claim, and the computed numbers by description."""

    verdict: str
    numbers: dict[str, float]


def graded(
    numbers: dict[str, float], whole: bool, part: bool = False, otherwise: str = NOT_REPRODUCED
) -> Judged:
    return Judged(REPRODUCED if whole else IN_PART if part else otherwise, numbers)


def judged(grade: rules.Grade, otherwise: str = NOT_REPRODUCED) -> Judged:
    numbers = {name: float(each) for name, each in grade.numbers.items()}
    return graded(numbers, bool(grade.whole), bool(grade.part), otherwise)


def constant_solution(lab: Laboratory, case: int) -> Judged:
    moved = float(rules.spread_of(lab.truth(case).omega).max())
    return graded({"change over the run (rad/s)": moved}, moved <= 1e-12, otherwise=FALSE)


def known_solution(lab: Laboratory, case: int) -> Judged:
    truth = lab.truth(case)
    t = truth.time
    printed = np.column_stack([np.sin(5 * t), np.cos(5 * t), np.full_like(t, 10.0)])
    apart = distance(printed, truth.omega)
    # The bound grows with t, because the phase 5 t is rounded.
    allowed = 1e-15 * (1.0 + 5.0 * float(t[-1]))
    return graded({"distance from the reference (rad/s)": apart}, apart <= allowed, False, FALSE)


def omega3_varies(lab: Laboratory, case: int, limit: float) -> Judged:
    return judged(rules.omega3_varies(lab, case, limit), FALSE)


def no_deviation(lab: Laboratory, case: int, limit: float) -> Judged:
    """Judge whether all three programs coincide with a case's known solution within `limit`."""
    found = judged(rules.no_deviation(lab, case, limit))
    for start in starts():
        other = replace(lab, assumptions=replace(lab.assumptions, start=start))
        steps = other.run("runge-kutta", case).steps
        found.numbers[f"runge-kutta from ({start_text(start)}): steps that it ran"] = float(steps)
    return found


def coincident(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge whether collocation coincides with the known solution on the scale of the graph."""
    numbers = {}
    for program in COLLOCATION:
        runs, truth = lab.runs(program, case), lab.solution(case)
        error = float(rules.share_of_range(runs.omega, truth))
        numbers[f"{program}: largest share of a component's range"] = error
    return graded(numbers, max(numbers.values()) <= share)


def error_size(lab: Laboratory, case: int, low: float, high: float) -> Judged:
    amplitude = _amplitude(lab, case)
    numbers = {
        f"{program}: largest error over the amplitude": lab.error(program, case) / amplitude
        for program in COLLOCATION
    }
    return graded(numbers, all(low <= each <= high for each in numbers.values()))


def poor(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge whether the Runge-Kutta error exceeds `share` of the amplitude."""
    found = lab.error("runge-kutta", case) / _amplitude(lab, case)
    return graded({"largest error over the amplitude": found}, found > share)


def _amplitude(lab: Laboratory, case: int) -> float:
    # Half the largest range of the components of the reference omega.
    return float(rules.spread_of(lab.truth(case).omega).max()) / 2.0


def error_constant(lab: Laboratory, case: int) -> Judged:
    truth = lab.truth(case).omega
    numbers = {}
    for program in COLLOCATION:
        errors = np.abs(lab.run(program, case).omega - truth).max(axis=1)
        fifth = len(errors) // 5
        growth = float(errors[-fifth:].max() / errors[:fifth].max())
        numbers[f"{program}: error of the last fifth over that of the first"] = growth
    return graded(numbers, max(numbers.values()) <= 2.0)


def stopped_at(lab: Laboratory, case: int, step: int) -> Judged:
    """Judge whether the stop test ended the Runge-Kutta run at `step`."""
    stop = lab.run("runge-kutta", case).stop
    # Find the subsets of defects with which the run also stops at `step`.
    name, readings = "runge-kutta", lab.listing("runge-kutta").readings
    every = [Listing(name, each, readings) for each in subsets(names_of("defect", name))]
    there = []
    for each in every:
        other = lab.run_on(lab.scene(case), each).stop
        if other is not None and other.step == step:
            mended = sorted(Listing.original(each.program).defects - each.defects)
            there.append(f"original but for {', '.join(mended)}" if mended else "original")
    numbers = {} if stop is None else {"stopped at step": float(stop.step)}
    numbers[f"of {len(every)} subsets of the defects, stop there"] = float(len(there))
    numbers |= {f"stops there: {each}": float(step) for each in there}
    if stop is None:
        numbers["steps that it ran"] = float(lab.run("runge-kutta", case).steps)
    return graded(numbers, stop is not None and stop.step == step, stop is not None)


def growing(lab: Laboratory, case: int) -> Judged:
    """Judge whether the last omega1 of Runge-Kutta is larger than the true omega1."""
    run = lab.run("runge-kutta", case)
    value, solution = float(run.omega[-1, 0]), float(lab.truth(case).omega[run.steps - 1, 0])
    numbers = {"omega1 at the end (rad/s)": value, "solution there (rad/s)": solution}
    return graded(numbers, value > 1.0 and value > solution * 1.001)


def search(lab: Laboratory, case: int) -> Judged:
    """Return "not testable" for the claim that the author searched Runge-Kutta for a fault."""
    run = lab.run("runge-kutta", case)
    best = Laboratory(False, lab.assumptions).run("runge-kutta", case)
    truth = lab.truth(case).omega[: run.steps]
    gain = distance(run.omega, truth) / distance(best.omega[: run.steps], truth)
    return Judged(NOT_TESTABLE, {"error over that of the corrected program": gain})


def differ(lab: Laboratory, case: int, share: float) -> Judged:
    """Judge whether the collocation programs differ by over `share` of the largest omega."""
    two, four = (lab.run(program, case).omega for program in COLLOCATION)
    apart = distance(two, four) / largest(lab.truth(case))
    return graded({"difference over the largest omega": apart}, apart > share)


def more_reliable(lab: Laboratory, case: int) -> Judged:
    ratio = lab.error("four-term", case) / lab.error("two-term", case)
    return graded({"four-term error over two-term error": ratio}, ratio <= 0.5, ratio <= 0.8)


def too_fast(lab: Laboratory, case: int, same: float, worse: float) -> Judged:
    """Judge whether the two-term error is due to a motion too fast for two terms.

    The corrected two-term error divided by the four-term error must exceed `worse` from all starts
    or, for a claim reproduced in part, `same` from any.
    """
    numbers = {}
    for start in starts():
        best = Laboratory(False, replace(lab.assumptions, start=start))
        ratio = best.error("two-term", case) / best.error("four-term", case)
        numbers[f"from ({start_text(start)}): corrected two-term error over four-term"] = ratio
    ratios = list(numbers.values())
    return graded(numbers, min(ratios) > worse, max(ratios) > same, FALSE)
