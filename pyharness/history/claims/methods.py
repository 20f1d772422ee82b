"""Tests of the thesis's claims about several cases.

Arguments and verdicts are as in `verdicts`. The thesis prints no programs for weightings other than
collocation, so that tests of other weightings return "not testable" for the original programs.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pyharness.history.claims import rules
from pyharness.history.claims.laboratory import LITERALS, Laboratory, by_literals, distance, largest
from pyharness.history.claims.rules import COLLOCATION
from pyharness.history.claims.verdicts import FALSE, NOT_TESTABLE, UNDECIDED, Judged, graded, judged
from pyharness.history.family import WEIGHTINGS, Member, run
from pyharness.history.lost import integrate
from pyharness.model.facts import facts
from pyharness.model.listing import PROGRAMS
from pyharness.model.scene import Scene
from pyharness.thesis.cells import subsets
from pyharness.thesis.decks import deck_text, solver_cards
from pyharness.thesis.in_word import WORDS, scene_in
from pyharness.thesis.operations import operations_per_step

_OTHERS = WEIGHTINGS[1:]


def superior(lab: Laboratory, cases: Sequence[int], shown: Sequence[int]) -> Judged:
    """Judge whether collocation is superior to Runge-Kutta; cases in `shown` are only reported."""
    numbers, wins = {}, 0
    for case in (*cases, *shown):
        runs = [lab.run(program, case) for program in PROGRAMS]
        common = min(run.steps for run in runs)
        truth = lab.truth(case).omega
        two, four, third = (distance(run.omega[:common], truth) for run in runs)
        wins += case in cases and max(two, four) < third
        ratio = max(two, four) / third
        numbers[f"case {case}: larger error of collocation over that of Runge-Kutta"] = ratio
    numbers[f"of {len(cases)} cases, won by collocation"] = wins
    return graded(numbers, wins == len(cases), wins > 0, FALSE)


def equation_19(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Judge whether the stop test applies the Lipschitz condition, eq. 19.

    No quotient may exceed the largest norm of the Jacobian.
    """
    numbers: dict[str, float] = {}
    for case in cases:
        a, b, c = lab.scene(case).euler_coefficients
        run = lab.run("runge-kutta", case)
        points = np.vstack([lab.truth(case).omega, run.omega])
        matrices = ([[0, a * z, a * y], [b * z, 0, b * x], [c * y, c * x, 0]] for x, y, z in points)
        # Quotients of exact differential equations do not exceed this norm.
        norm = max(float(np.linalg.norm(matrix, 2)) for matrix in matrices)
        if lab.listing("runge-kutta").has("lipschitz-tests-velocity"):
            # Add the norms of the derivatives of the equations for V, which are bilinear in V and
            # omega.
            assert run.velocity is not None
            norm += float(np.linalg.norm(points, axis=1).max())
            norm += float(np.linalg.norm(run.velocity, axis=1).max())
        ratio = lab.required_constant(case) / norm
        numbers[f"case {case}: largest quotient over norm of the Jacobian"] = ratio
    worst = max(numbers.values())
    return graded(numbers, worst <= 1.05, worst <= 2.0, FALSE)


def higher_powers(lab: Laboratory, cases: Sequence[int], terms: Sequence[int]) -> Judged:
    """Judge whether more than four terms hardly reduce the error of collocation."""
    numbers = {}
    for case in cases:
        truth = lab.truth(case).omega
        four, *more = (float(np.abs(lab.models(case, n) - truth).max()) for n in (4, *terms))
        for n, error in zip(terms, more, strict=True):
            # After an overflow the gain counts as 0.
            gain = four / error if math.isfinite(error) else 0.0
            numbers[f"case {case}: error of four terms over that of {n}"] = gain
    most = max(numbers.values())
    return graded(numbers, most <= 2.0, most <= 10.0)


def larger_constant(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Judge whether a case needs a larger Lipschitz constant than that on the cards."""
    numbers = {f"case {n}: constant needed (1/s)": lab.required_constant(n) for n in cases}
    return graded(numbers, max(numbers.values()) > facts("cases")["deck"]["lipschitz"])


def guard(lab: Laboratory, cases: Sequence[int], bounded: float) -> Judged:
    """Judge whether the stop test ends all unbounded runs, and no others.

    Unbounded runs exceed `bounded` times the largest reference omega.
    """
    alarms = unbounded = caught = 0
    for case in cases:
        run = lab.run("runge-kutta", case)
        bound = bounded * largest(lab.truth(case))
        alarms += run.stop is not None and float(np.abs(run.omega).max()) <= bound
        free = lab.run("runge-kutta", case, may_stop=False)
        if free.ended == "overflow" or float(np.abs(free.omega).max()) > bound:
            unbounded += 1
            caught += run.stop is not None
    # Every component is 1 / (1 - t), unbounded at t = 1 s.
    ours = Scene("unbounded", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0), steps=200)
    own = lab.run_on(ours, lab.listing("runge-kutta"))
    numbers = {
        "bounded runs stopped": float(alarms),
        "unbounded runs, without the test": float(unbounded),
        "unbounded runs stopped": float(caught),
        "our own scene, unbounded at 1 s: stopped": float(own.stop is not None),
    }
    if not (unbounded or alarms):
        return Judged(NOT_TESTABLE, numbers)
    whole = caught == unbounded > 0 and not alarms
    return graded(numbers, whole, caught > 0, FALSE)


def small_step(lab: Laboratory, cases: Sequence[int], exception: int) -> Judged:
    """Judge whether a tenth of the step size improves collocation.

    The two-term program must not improve in case `exception`.
    """
    found = judged(rules.small_step(lab, cases, exception))
    if lab.is_original:
        constant = [case for case in cases if not lab.scene(case).torque.varies]
        found.numbers.update(_by_literals(lab, constant))
    return found


def _by_literals(lab: Laboratory, cases: Sequence[int]) -> dict[str, float]:
    """Return how many cases at least halve the error if some `LITERALS` are divided by ten."""
    scenes = tuple(lab.scene(case) for case in cases)
    numbers = {}
    for program, terms in zip(COLLOCATION, (2, 4), strict=True):
        before = [lab.error(program, case) for case in cases]
        for changed in subsets(LITERALS):
            omegas = by_literals(scenes, terms, changed, 10)
            better = 0
            for case, old, omega in zip(cases, before, omegas, strict=True):
                new = float(np.abs(omega - lab.truth(case).omega).max())
                better += new <= old / 2.0 or (math.isinf(old) and math.isfinite(new))
            told = ", ".join(name for name in LITERALS if name in changed) or "none"
            numbers[f"{program}, .001 in {told}: of {len(cases)} cases improve"] = float(better)
    return numbers


def suffices(
    lab: Laboratory, cases: Sequence[int], terms: Sequence[int], share: float, enough: int
) -> Judged:
    """Judge whether three or four terms suffice for most problems.

    In `enough` cases, errors must be at most `share` times the largest omega.
    """
    numbers, good = {}, 0
    for case in cases:
        truth = lab.truth(case)
        errors = [lab.error("four-term", case)]
        # `models` of original programs need a constant torque.
        if not (lab.is_original and lab.scene(case).torque.varies):
            errors.append(distance(lab.models(case, terms[0]), truth.omega))
        error = max(errors) / largest(truth)
        numbers[f"case {case}: error over the largest omega"] = error
        good += error <= share
    numbers["cases within it"] = float(good)
    return graded(numbers, good >= enough, good >= 3)


def execution_time(
    lab: Laboratory, low: float, high: float, unit_times: Mapping[str, int]
) -> Judged:
    """Judge whether collocation takes about twice the time of Runge-Kutta.

    `unit_times` are the operations' times; `low` and `high` limit the ratio of times.
    """
    listings = {program: lab.listing(program) for program in PROGRAMS}
    counts = {name: operations_per_step(each) for name, each in listings.items()}
    times = {name: operations_per_step(each, unit_times) for name, each in listings.items()}
    numbers, inside = {}, []
    for way, told in (("written", "as written"), ("once", "common terms once")):
        for program in PROGRAMS:
            numbers[f"{program}: operations a step, {told}"] = float(getattr(counts[program], way))
        for program in COLLOCATION:
            ratio, by_time = (
                getattr(each[program], way) / getattr(each["runge-kutta"], way)
                for each in (counts, times)
            )
            numbers[f"{program}: over Runge-Kutta, {told}"] = ratio
            numbers[f"{program}: time over Runge-Kutta, {told}"] = by_time
            inside.append(low <= by_time <= high)
    return graded(numbers, all(inside), any(inside))


def seconds(lab: Laboratory) -> Judged:
    """Return "not testable" for claims on run times, with the numbers of operations."""
    counts = {program: operations_per_step(lab.listing(program)).written for program in PROGRAMS}
    numbers = {f"{program}: operations in 100 steps": 100.0 * n for program, n in counts.items()}
    return Judged(NOT_TESTABLE, numbers)


def complexity(lab: Laboratory, factors: Sequence[float]) -> Judged:
    """Judge whether the three programs have about the same number of cards.

    `factors` are alternative limits on the ratio to the number of Runge-Kutta.
    """
    cards = {each: deck_text(lab.listing(each)).count("\n") for each in PROGRAMS}
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
                # The bound on `best` makes errors at the level of rounding count as equal.
                worst = max(worst, error / max(best, 1e-12 * scale))
    return graded(numbers, useless, worst > 10.0)


def computer_error(
    lab: Laboratory, limit: float, words: Sequence[str], cases: Sequence[int]
) -> Judged:
    """Judge whether weightings other than collocation fail because of rounding errors.

    The claim holds if a rounding error reaches `limit` (rad/s).
    """
    if lab.is_original:
        return Judged(NOT_TESTABLE, {})
    numbers = {}
    # Case 1 has only rounding errors.
    for parts in (1, 10, 100):
        scene = lab.scene(1, parts)
        for weighting in _OTHERS:
            found = run(scene, Member(weighting, 4)).omega[parts - 1 :: parts]
            error = distance(found, lab.truth(1).omega)
            numbers[f"{weighting}, step {scene.step_size:g}: rounding error (rad/s)"] = error
    for weighting in _OTHERS:
        floats = {case: integrate(lab.scene(case), weighting) for case in cases}
        for word in words:
            numbers[f"{weighting} in {word}: apart from binary64 (rad/s)"] = max(
                distance(integrate(scene_in(lab.scene(case), WORDS[word]), weighting), floats[case])
                for case in cases
            )
    return graded(numbers, max(numbers.values()) >= limit, otherwise=FALSE)


def only_collocation(lab: Laboratory, cases: Sequence[int], terms: Sequence[int]) -> Judged:
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


def all_succeed(
    lab: Laboratory, cases: Sequence[int], terms: Sequence[int], share: float
) -> Judged:
    if lab.is_original:
        return Judged(NOT_TESTABLE, {})
    numbers = {
        f"{weighting}: largest error over the largest omega": max(
            _error(lab, case, Member(weighting, n)) / largest(lab.truth(case))
            for case in cases
            for n in terms
        )
        for weighting in WEIGHTINGS
    }
    good = [each <= share for each in numbers.values()]
    return graded(numbers, all(good), any(good), FALSE)


def predict_correct(lab: Laboratory, cases: Sequence[int]) -> Judged:
    """Return "not testable" for the predict-correct technique, which the thesis only recommends."""
    best = Laboratory(False, lab.assumptions)
    numbers = {}
    for case in cases:
        for program, terms in zip(COLLOCATION, (2, 4), strict=True):
            member = run(lab.scene(case), Member("collocation", terms))
            apart = distance(best.run(program, case).omega, member.omega)
            numbers[f"case {case}, {program}: distance from one correction (rad/s)"] = apart
        for corrections in (0, 1, 2, 3):
            error = _error(lab, case, Member("collocation", 4, corrections=corrections))
            numbers[f"case {case}, 4 terms, {corrections} corrections: error (rad/s)"] = error
    return Judged(NOT_TESTABLE, numbers)


def _error(lab: Laboratory, case: int, member: Member) -> float:
    found = run(lab.scene(case), member)
    return math.inf if found.ended == "overflow" else distance(found.omega, lab.truth(case).omega)
