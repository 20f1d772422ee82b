"""Tests of the claims about the programs over several cases; see `claim_tests_cases`."""

import math
from typing import Any

import numpy as np

from pyharness.history.claims.laboratory import (
    COLLOCATION,
    Laboratory,
    distance,
    largest,
    required_constant,
)
from pyharness.history.claims.verdicts import FALSE, NOT_REPRODUCED, REPRODUCED, Judged, graded
from pyharness.model.facts import facts
from pyharness.model.scene import Scene
from pyharness.original.programs import PROGRAM_REGISTRY


def superior(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold collocation against Runge-Kutta, at the steps that all of them ran."""
    numbers, wins = {}, 0
    for case in given["cases"]:
        runs = [lab.run(program, case) for program in (*COLLOCATION, "runge-kutta")]
        common = min(run.steps for run in runs)
        truth = lab.truth(case).omega
        two, four, third = (distance(run.omega[:common], truth) for run in runs)
        wins += max(two, four) < third
        numbers[f"case {case}: error of collocation over that of Runge-Kutta"] = (
            max(two, four) / third
        )
    numbers["cases won by collocation"] = wins
    return Judged(graded(wins == len(given["cases"]), wins > 0, FALSE), numbers)


def equation_19(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold the program's quotient against the norm of the Jacobian, the most that eq. 19 allows."""
    numbers: dict[str, float] = {}
    for case in given["cases"]:
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
        ratio = required_constant(lab, case) / norm
        numbers[f"case {case}: largest quotient over norm of the Jacobian"] = ratio
    worst = max(numbers.values())
    return Judged(graded(worst <= 1.05, worst <= 2.0, FALSE), numbers)


def higher_powers(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure what four terms gain over two."""
    gains = {
        f"case {case}: error of two terms over that of four": lab.error("two-term", case)
        / lab.error("four-term", case)
        for case in given["cases"]
    }
    most = max(gains.values())
    return Judged(graded(most <= 2.0, most <= 10.0), gains)


def larger_constant(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Find the constants that all steps need."""
    numbers = {
        f"case {case}: constant needed (1/s)": required_constant(lab, case)
        for case in given["cases"]
    }
    above = any(each > facts("cases")["deck"]["lipschitz"] for each in numbers.values())
    return Judged(REPRODUCED if above else NOT_REPRODUCED, numbers)


def guard(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Count the runs that the stop test ends: bounded ones, and one that is not."""
    alarms = 0
    for case in given["cases"]:
        run = lab.run("runge-kutta", case)
        bound = given["bounded"] * largest(lab.truth(case))
        alarms += run.stop is not None and float(np.abs(run.omega).max()) <= bound
    # Each component is 1 / (1 - t): unbounded at t = 1 whatever the method.
    unbounded = Scene("unbounded", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0), steps=200)
    run = PROGRAM_REGISTRY["runge-kutta"].run(unbounded, lab.listing("runge-kutta"))
    caught = run.stop is not None
    numbers = {"bounded runs stopped": float(alarms), "unbounded run stopped": float(caught)}
    return Judged(graded(caught and not alarms, caught, FALSE), numbers)


def small_step(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure what a tenth of the step gains the collocation programs."""
    numbers, improved, exception = {}, [], False
    for program in COLLOCATION:
        for case in given["cases"]:
            before, after = lab.error(program, case), lab.error(program, case, parts=10)
            gain = before / after if math.isfinite(before) else float(math.isfinite(after))
            numbers[f"{program}, case {case}: gain"] = gain
            if (program, case) == ("two-term", given["exception"]):
                exception = gain < 2.0
            else:
                improved.append(gain >= 2.0)
    share = sum(improved) / len(improved)
    return Judged(graded(share >= 0.8 and exception, share >= 0.5), numbers)


def small_step_runge_kutta(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure what a tenth of the step gains the Runge-Kutta program, without its stop test."""
    numbers = {
        f"case {case}: gain": lab.error("runge-kutta", case, may_stop=False)
        / lab.error("runge-kutta", case, may_stop=False, parts=10)
        for case in given["cases"]
    }
    better = sum(gain >= 2.0 for gain in numbers.values())
    return Judged(graded(better == 0, 3 * better <= len(numbers)), numbers)


def suffices(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Count the cases in which models of three and four terms stay near the truth."""
    numbers, good = {}, 0
    for case in given["cases"]:
        truth = lab.truth(case)
        errors = [lab.error("four-term", case)]
        if not (lab.is_original and lab.scene(case).torque.varies):
            errors.append(distance(lab.models(case, 3), truth.omega))
        share = max(errors) / largest(truth)
        numbers[f"case {case}: error over the largest omega"] = share
        good += share <= given["share"]
    numbers["cases within it"] = float(good)
    return Judged(graded(good >= given["enough"], good >= 3), numbers)
