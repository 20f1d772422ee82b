"""Tests of the claims: a laboratory and parameters in, a verdict and its numbers out.

Each function is the `test` of entries in `data/claims.toml`, whose `rule` says in words what the
function decides, and whose `parameters` are its keywords. No number is typed in. First those of
one case, then those of several, of what the programs cost, and of what is beyond the listed ones.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pyharness.history.claims.laboratory import (
    COLLOCATION,
    Laboratory,
    distance,
    largest,
    ranges,
    starts,
)
from pyharness.history.family.members import WEIGHTINGS, Member, run
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS, Listing, names_of
from pyharness.model.scene import Scene, Triple
from pyharness.model.trajectory import Trajectory
from pyharness.original.cells import subsets
from pyharness.original.decks import solver_cards
from pyharness.original.operations import operations_per_step
from pyharness.original.programs import run_program
from pyharness.truth.reference import Reference

REPRODUCED = "reproduced"
IN_PART = "reproduced in part"
NOT_REPRODUCED = "not reproduced"
FALSE = "false"
NOT_TESTABLE = "not testable"
UNDECIDED = "undecided"
_OTHERS = WEIGHTINGS[1:]


@dataclass(frozen=True)
class Judged:
    """A verdict with the numbers that it rests on."""

    verdict: str
    numbers: dict[str, float]


def graded(
    numbers: dict[str, float], whole: bool, part: bool = False, otherwise: str = NOT_REPRODUCED
) -> Judged:
    """Return the verdict: reproduced as a whole, in part, or otherwise."""
    return Judged(REPRODUCED if whole else IN_PART if part else otherwise, numbers)


def constant_solution(lab: Laboratory, case: int) -> Judged:
    """Measure how far the solution moves."""
    moved = float(ranges(lab.truth(case)).max())
    return graded({"change over the run (rad/s)": moved}, moved <= 1e-12, otherwise=FALSE)


def known_solution(lab: Laboratory, case: int) -> Judged:
    """Hold the printed solution against the reference."""
    truth = lab.truth(case)
    t = truth.time
    printed = np.column_stack([np.sin(5 * t), np.cos(5 * t), np.full_like(t, 10.0)])
    apart = distance(printed, truth.omega)
    # The phase 5 t is itself rounded.
    allowed = 1e-15 * (1.0 + 5.0 * float(t[-1]))
    return graded({"distance from the reference (rad/s)": apart}, apart <= allowed, False, FALSE)


def omega3_varies(lab: Laboratory, case: int, limit: float) -> Judged:
    """Measure how far the third component moves."""
    moved = float(ranges(lab.truth(case))[2])
    return graded({"range of omega3 (rad/s)": moved}, moved > limit, otherwise=FALSE)


def no_deviation(lab: Laboratory, case: int, limit: float) -> Judged:
    """Hold all programs against the known solution, at the precision of the page."""
    numbers = {f"{name}: largest error (rad/s)": lab.error(name, case) for name in PROGRAMS}
    close = max(numbers.values()) < limit
    for start in starts():
        other = replace(lab, assumptions=replace(lab.assumptions, start=start))
        steps = other.run("runge-kutta", case).steps
        numbers[f"runge-kutta from ({_shown(start)}): steps that it ran"] = float(steps)
    return graded(numbers, close)


def _shown(start: Triple) -> str:
    return ", ".join(f"{x:g}" for x in start)


def coincident(lab: Laboratory, case: int, share: float) -> Judged:
    """Hold collocation against the known solution, on the scale of the graph."""
    numbers = {}
    for program in COLLOCATION:
        error = _share_of_range(lab.run(program, case), lab.truth(case))
        numbers[f"{program}: largest share of a component's range"] = error
    return graded(numbers, max(numbers.values()) <= share)


def error_size(lab: Laboratory, case: int, low: float, high: float) -> Judged:
    """Measure the largest error as a part of the amplitude."""
    amplitude = float(ranges(lab.truth(case)).max()) / 2.0
    numbers = {
        f"{program}: largest error over the amplitude": lab.error(program, case) / amplitude
        for program in COLLOCATION
    }
    return graded(numbers, all(low <= each <= high for each in numbers.values()))


def error_constant(lab: Laboratory, case: int) -> Judged:
    """Hold the error at the end of the run against that at its beginning."""
    truth = lab.truth(case).omega
    numbers = {}
    for program in COLLOCATION:
        errors = np.abs(lab.run(program, case).omega - truth).max(axis=1)
        fifth = len(errors) // 5
        growth = float(errors[-fifth:].max() / errors[:fifth].max())
        numbers[f"{program}: error of the last fifth over that of the first"] = growth
    return graded(numbers, max(numbers.values()) <= 2.0)


def stopped_at(lab: Laboratory, case: int, step: int) -> Judged:
    """Find the step at which the stop test ended the run, and who else stops there."""
    stop = lab.run("runge-kutta", case).stop
    found = math.nan if stop is None else float(stop.step)
    every = [
        Listing("runge-kutta", defects, lab.listing("runge-kutta").readings)
        for defects in subsets(names_of("defect", "runge-kutta"))
    ]
    stops = [run_program(lab.scene(case), each).stop for each in every]
    there = sum(each is not None and each.step == step for each in stops)
    numbers = {
        "stopped at step": found,
        f"of {len(every)} subsets of the defects, stop there": float(there),
    }
    return graded(numbers, found == step, stop is not None)


def growing(lab: Laboratory, case: int) -> Judged:
    """Hold the first component at the end of the run against the solution there."""
    run = lab.run("runge-kutta", case)
    value, solution = float(run.omega[-1, 0]), float(lab.truth(case).omega[run.steps - 1, 0])
    numbers = {"omega1 at the end (rad/s)": value, "solution there (rad/s)": solution}
    return graded(numbers, value > 1.0 and value > solution * 1.001)


def no_error(lab: Laboratory, case: int) -> Judged:
    """Measure what correcting everything gains at the steps that were run."""
    run = lab.run("runge-kutta", case)
    best = Laboratory(False, lab.assumptions).run("runge-kutta", case)
    truth = lab.truth(case).omega[: run.steps]
    gain = distance(run.omega, truth) / distance(best.omega[: run.steps], truth)
    numbers = {"error over that of the corrected program": gain}
    return graded(numbers, gain <= 2.0, gain <= 10.0, FALSE)


def concur(lab: Laboratory, case: int, share: float) -> Judged:
    """Hold the two collocation programs against one another."""
    truth = lab.truth(case)
    two, four = (lab.run(program, case) for program in COLLOCATION)
    n = min(two.steps, four.steps)
    apart = np.abs(two.omega[:n] - four.omega[:n]).max(axis=0)
    complete = two.ended == four.ended == "complete"
    spread = np.maximum(ranges(truth), 1e-12 * largest(truth))
    whole = float(apart.max()) / largest(truth) if complete else math.inf
    detail = float((apart / spread).max()) if complete else math.inf
    numbers = {
        "difference over the largest omega": whole,
        "difference over the range of a component": detail,
        "two-term error (rad/s)": lab.error("two-term", case),
        "four-term error (rad/s)": lab.error("four-term", case),
    }
    return graded(numbers, whole <= share and detail <= 0.1, whole <= share)


def fails(lab: Laboratory, case: int, share: float) -> Judged:
    """See how the Runge-Kutta program ended, and how far from the truth."""
    run = lab.run("runge-kutta", case)
    error = _share_of_range(run, lab.truth(case))
    ended, far = run.ended != "complete", error > share
    numbers = {"steps": float(run.steps), "error over the range of a component": error}
    return graded(numbers, ended and far, ended or far)


def differ(lab: Laboratory, case: int, share: float) -> Judged:
    """Measure the difference of the collocation programs over the largest omega."""
    two, four = (lab.run(program, case).omega for program in COLLOCATION)
    apart = distance(two, four) / largest(lab.truth(case))
    return graded({"difference over the largest omega": apart}, apart > share)


def more_reliable(lab: Laboratory, case: int) -> Judged:
    """Measure the four-term error over the two-term one."""
    ratio = lab.error("four-term", case) / lab.error("two-term", case)
    return graded({"four-term error over two-term error": ratio}, ratio <= 0.5, ratio <= 0.8)


def diverged(lab: Laboratory, case: int) -> Judged:
    """See whether the two-term run left its bounds."""
    run, error = lab.run("two-term", case), lab.error("two-term", case)
    numbers = {"steps": float(run.steps), "largest error (rad/s)": error}
    return graded(numbers, run.ended == "overflow" or error > largest(lab.truth(case)))


def too_fast(lab: Laboratory, case: int, same: float, worse: float) -> Judged:
    """See whether motion or program is to blame: hold the corrected models against each other."""
    numbers = {}
    for start in starts():
        best = Laboratory(False, replace(lab.assumptions, start=start))
        ratio = best.error("two-term", case) / best.error("four-term", case)
        numbers[f"from ({_shown(start)}): corrected two-term error over four-term"] = ratio
    ratios = list(numbers.values())
    return graded(numbers, min(ratios) > worse, max(ratios) > same, FALSE)


def models_concur(lab: Laboratory, case: int, share: float, terms: Sequence[int]) -> Judged:
    """Hold models of several numbers of terms against one another."""
    first, *others = terms
    model = lab.models(case, first)
    numbers = {}
    for n in others:
        apart = distance(lab.models(case, n), model) / largest(lab.truth(case))
        numbers[f"{n} terms against {first}, over the largest omega"] = apart
    return graded(numbers, max(numbers.values()) <= share)


def dynamic(lab: Laboratory, case: int, factor: float) -> Judged:
    """Measure the largest angular acceleration of the four-term run, case by case."""
    rates = {}
    for each in range(1, 8):
        steps = np.diff(lab.run("four-term", each).omega, axis=0) / lab.scene(each).step_size
        rates[each] = float(np.linalg.norm(steps, axis=1).max())
    others = max(rate for each, rate in rates.items() if each != case)
    numbers = {f"case {each}: largest acceleration (rad/s2)": rate for each, rate in rates.items()}
    return graded(numbers, rates[case] >= factor * others)


def superior(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Hold collocation against Runge-Kutta, at the steps that all of them ran."""
    numbers, wins = {}, 0
    for case in cases:
        runs = [lab.run(program, case) for program in PROGRAMS]
        common = min(run.steps for run in runs)
        truth = lab.truth(case).omega
        two, four, third = (distance(run.omega[:common], truth) for run in runs)
        wins += max(two, four) < third
        ratio = max(two, four) / third
        numbers[f"case {case}: error of collocation over that of Runge-Kutta"] = ratio
    numbers["cases won by collocation"] = wins
    return graded(numbers, wins == len(cases), wins > 0, FALSE)


def equation_19(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Hold the program's quotient against the norm of the Jacobian, the most that eq. 19 allows."""
    numbers: dict[str, float] = {}
    for case in cases:
        a, b, c = lab.scene(case).euler_coefficients
        run = lab.run("runge-kutta", case)
        points = np.vstack([lab.truth(case).omega, run.omega])
        norm = max(
            float(np.linalg.norm([[0, a * z, a * y], [b * z, 0, b * x], [c * y, c * x, 0]], 2))
            for x, y, z in points
        )
        if lab.listing("runge-kutta").has("lipschitz-tests-velocity"):
            # The equations of V are linear in V and in omega, with these coefficients.
            assert run.velocity is not None
            norm += float(np.linalg.norm(points, axis=1).max())
            norm += float(np.linalg.norm(run.velocity, axis=1).max())
        ratio = lab.required_constant(case) / norm
        numbers[f"case {case}: largest quotient over norm of the Jacobian"] = ratio
    worst = max(numbers.values())
    return graded(numbers, worst <= 1.05, worst <= 2.0, FALSE)


def higher_powers(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Measure what four terms gain over two."""
    numbers = {}
    for case in cases:
        gain = lab.error("two-term", case) / lab.error("four-term", case)
        numbers[f"case {case}: error of two terms over that of four"] = gain
    most = max(numbers.values())
    return graded(numbers, most <= 2.0, most <= 10.0)


def larger_constant(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Find the constants that all steps need."""
    numbers = {f"case {n}: constant needed (1/s)": lab.required_constant(n) for n in cases}
    return graded(numbers, max(numbers.values()) > facts("cases")["deck"]["lipschitz"])


def guard(lab: Laboratory, cases: Sequence[int], bounded: float) -> Judged:
    """Count the runs of the thesis's cases that the stop test ends: bounded ones, and others."""
    alarms = unbounded = caught = 0
    for case in cases:
        run = lab.run("runge-kutta", case)
        bound = bounded * largest(lab.truth(case))
        alarms += run.stop is not None and float(np.abs(run.omega).max()) <= bound
        free = lab.run("runge-kutta", case, may_stop=False)
        if free.ended == "overflow" or float(np.abs(free.omega).max()) > bound:
            unbounded += 1
            caught += run.stop is not None
    # Each component is 1 / (1 - t): unbounded at t = 1 whatever the method.
    ours = Scene("unbounded", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0), steps=200)
    numbers = {
        "bounded runs stopped": float(alarms),
        "unbounded runs, without the test": float(unbounded),
        "unbounded runs stopped": float(caught),
        "a scene of ours, unbounded at 1 s: stopped": float(
            run_program(ours, lab.listing("runge-kutta")).stop is not None
        ),
    }
    if not (unbounded or alarms):
        return Judged(NOT_TESTABLE, numbers)
    whole = caught == unbounded > 0 and not alarms
    return graded(numbers, whole, caught > 0, FALSE)


def small_step(lab: Laboratory, cases: Sequence[int], exception: int) -> Judged:
    """Measure what a tenth of the step gains the collocation programs."""
    numbers, improved, excepted = {}, [], False
    for program in COLLOCATION:
        for case in cases:
            before, after = lab.error(program, case), lab.error(program, case, parts=10)
            gain = before / after if math.isfinite(before) else float(math.isfinite(after))
            numbers[f"{program}, case {case}: gain"] = gain
            if (program, case) == ("two-term", exception):
                excepted = gain < 2.0
            else:
                improved.append(gain >= 2.0)
    share = sum(improved) / len(improved)
    return graded(numbers, share >= 0.8 and excepted, share >= 0.5)


def small_step_runge_kutta(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Measure what a tenth of the step gains the Runge-Kutta program, without its stop test."""
    numbers = {}
    for case in cases:
        before, after = (lab.error("runge-kutta", case, False, parts) for parts in (1, 10))
        numbers[f"case {case}: gain"] = before / after
    better = sum(gain >= 2.0 for gain in numbers.values())
    return graded(numbers, better == 0, 3 * better <= len(numbers))


def suffices(
    lab: Laboratory, cases: Sequence[int], terms: Sequence[int], share: float, enough: int
) -> Judged:
    """Count the cases in which models of three and four terms stay near the truth."""
    numbers, good = {}, 0
    for case in cases:
        truth = lab.truth(case)
        errors = [lab.error("four-term", case)]
        if not (lab.is_original and lab.scene(case).torque.varies):
            errors.append(distance(lab.models(case, terms[0]), truth.omega))
        error = max(errors) / largest(truth)
        numbers[f"case {case}: error over the largest omega"] = error
        good += error <= share
    numbers["cases within it"] = float(good)
    return graded(numbers, good >= enough, good >= 3)


def execution_time(lab: Laboratory, low: float, high: float) -> Judged:
    """Count the floating-point operations of a step on the cards, with our own LEQT1F."""
    counts = {program: operations_per_step(lab.listing(program)) for program in PROGRAMS}
    numbers, inside = {}, []
    for way, told in (("written", "as written"), ("once", "common terms once")):
        count = {program: float(getattr(each, way)) for program, each in counts.items()}
        for program in PROGRAMS:
            numbers[f"{program}: operations a step, {told}"] = count[program]
        for program in COLLOCATION:
            ratio = count[program] / count["runge-kutta"]
            numbers[f"{program}: over Runge-Kutta, {told}"] = ratio
            inside.append(low <= ratio <= high)
    return graded(numbers, all(inside), any(inside))


def seconds(lab: Laboratory) -> Judged:
    """Count operations: nothing of today's machines tells of that one's seconds."""
    counts = {program: operations_per_step(lab.listing(program)) for program in PROGRAMS}
    numbers = {
        f"{program}: operations in 100 steps": 100.0 * each.written
        for program, each in counts.items()
    }
    return Judged(NOT_TESTABLE, numbers)


def complexity(lab: Laboratory, factors: Sequence[float]) -> Judged:
    """Count the cards of each deck, without a matrix subroutine and with our own LEQT1F."""
    cards = facts("cases")["cards"]
    numbers = {f"{program}: cards": float(n) for program, n in cards.items()}
    numbers["LEQT1F, ours: cards"] = float(solver_cards())
    ratios = []
    for more, told in ((0, "without LEQT1F"), (solver_cards(), "with ours")):
        for program in COLLOCATION:
            ratios.append((cards[program] + more) / cards["runge-kutta"])
            numbers[f"{program}: cards over Runge-Kutta, {told}"] = ratios[-1]
    near = [max(ratios) <= factor for factor in factors]
    if any(near) and not all(near):
        return Judged(UNDECIDED, numbers)
    if not any(near) and min(ratios) <= min(factors):
        return Judged(UNDECIDED, numbers)
    return graded(numbers, all(near))


def others_failed(lab: Laboratory, cases: Sequence[int], terms: Sequence[int]) -> Judged:
    """Try the other weightings on the cases whose solution is known."""
    if lab.is_original:
        return Judged(NOT_TESTABLE, {})
    numbers, useless, worst = {}, False, 0.0
    for case in cases:
        scale = largest(lab.truth(case))
        for n in terms:
            best = _error(lab, case, Member("collocation", n))
            for weighting in _OTHERS:
                error = _error(lab, case, Member(weighting, n))
                numbers[f"case {case}, {weighting}, {n} terms: error (rad/s)"] = error
                useless |= error > scale
                # Errors of rounding are equally good.
                worst = max(worst, error / max(best, 1e-12 * scale))
    return graded(numbers, useless, worst > 10.0)


def computer_error(lab: Laboratory, limit: float) -> Judged:
    """Measure rounding alone: Case 1, which every member solves exactly, at ever smaller steps."""
    if lab.is_original:
        return Judged(NOT_TESTABLE, {})
    numbers = {}
    for parts in (1, 10, 100):
        scene = lab.scene(1, parts)
        for weighting in _OTHERS:
            found = run(scene, Member(weighting, 4)).omega[parts - 1 :: parts]
            error = distance(found, lab.truth(1).omega)
            numbers[f"{weighting}, step {scene.step_size:g}: rounding error (rad/s)"] = error
    return graded(numbers, max(numbers.values()) >= limit, otherwise=FALSE)


def only_collocation(lab: Laboratory, cases: Sequence[int], terms: Sequence[int]) -> Judged:
    """Measure the error of every other weighting over that of collocation."""
    if lab.is_original:
        return Judged(NOT_TESTABLE, {})
    numbers = {}
    for weighting in _OTHERS:
        numbers[f"{weighting}: largest error over that of collocation"] = max(
            _error(lab, case, Member(weighting, n)) / _error(lab, case, Member("collocation", n))
            for case in cases
            for n in terms
        )
    worse = [each > 10.0 for each in numbers.values()]
    return graded(numbers, all(worse), any(worse), FALSE)


def predict_correct(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Hold the corrected programs against one prediction and one correction of the family."""
    best = Laboratory(False, lab.assumptions)
    numbers, same = {}, True
    for case in cases:
        for program, terms in zip(COLLOCATION, (2, 4), strict=True):
            member = run(lab.scene(case), Member("collocation", terms))
            apart = distance(best.run(program, case).omega, member.omega)
            numbers[f"case {case}, {program}: distance from one correction (rad/s)"] = apart
            same &= apart < 1e-11 * largest(lab.truth(case))
        for corrections in (0, 1, 2, 3):
            error = _error(lab, case, Member("collocation", 4, corrections=corrections))
            numbers[f"case {case}, 4 terms, {corrections} corrections: error (rad/s)"] = error
    return graded(numbers, not same, otherwise=FALSE)


def _error(lab: Laboratory, case: int, member: Member) -> float:
    found = run(lab.scene(case), member)
    return math.inf if found.ended == "overflow" else distance(found.omega, lab.truth(case).omega)


def _share_of_range(run: Trajectory, truth: Reference) -> float:
    """Return the largest error of a component that moves, over its range."""
    spread = ranges(truth)
    moving = spread > 1e-12 * largest(truth)
    errors = np.abs(run.omega - truth.omega[: run.steps]).max(axis=0, initial=0.0)
    return float((errors[moving] / spread[moving]).max(initial=0.0))
