"""Tests of the claims that reach beyond the listed programs; see `claim_tests_cases`."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pyharness.history.claims.laboratory import COLLOCATION, Laboratory, distance, largest
from pyharness.history.claims.verdicts import (
    FALSE,
    IN_PART,
    NOT_REPRODUCED,
    NOT_TESTABLE,
    REPRODUCED,
    Judged,
    graded,
)
from pyharness.history.family.members import Member, run
from pyharness.model.facts import facts
from pyharness.original.counting import operations_per_step

_OTHERS = ("subdomain", "galerkin", "least-squares")


def others_failed(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Try the other weightings on the cases whose solution is known."""
    if lab.is_original:
        return Judged(NOT_TESTABLE, {})
    numbers, useless, worst = {}, False, 0.0
    for case in given["cases"]:
        truth = lab.truth(case)
        for terms in given["terms"]:
            best = _error(lab, case, Member("collocation", terms))
            for weighting in _OTHERS:
                error = _error(lab, case, Member(weighting, terms))
                numbers[f"case {case}, {weighting}, {terms} terms: error (rad/s)"] = error
                useless |= error > largest(truth)
                # Errors of rounding are equally good.
                worst = max(worst, error / max(best, 1e-12 * largest(truth)))
    if useless:
        return Judged(REPRODUCED, numbers)
    return Judged(NOT_REPRODUCED if worst <= 10.0 else IN_PART, numbers)


def computer_error(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure rounding alone: Case 1, which every member solves exactly, at ever smaller steps."""
    if lab.is_original:
        return Judged(NOT_TESTABLE, {})
    numbers = {}
    for parts in (1, 10, 100):
        scene = lab.scene(1)
        finer = replace(scene, step_size=scene.step_size / parts, steps=scene.steps * parts)
        for weighting in _OTHERS:
            found = run(finer, Member(weighting, 4)).omega[parts - 1 :: parts]
            error = distance(found, lab.truth(1).omega)
            numbers[f"{weighting}, step {finer.step_size:g}: rounding error (rad/s)"] = error
    small = max(numbers.values()) < given["limit"]
    return Judged(FALSE if small else REPRODUCED, numbers)


def only_collocation(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure the error of every other weighting over that of collocation."""
    if lab.is_original:
        return Judged(NOT_TESTABLE, {})
    numbers = {}
    for weighting in _OTHERS:
        ratios = [
            _error(lab, case, Member(weighting, terms))
            / _error(lab, case, Member("collocation", terms))
            for case in given["cases"]
            for terms in given["terms"]
        ]
        numbers[f"{weighting}: largest error over that of collocation"] = max(ratios)
    worse = [each > 10.0 for each in numbers.values()]
    return Judged(graded(all(worse), any(worse), FALSE), numbers)


def predict_correct(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold the corrected programs against one prediction and one correction of the family."""
    best = Laboratory(False, lab.assumptions)
    numbers, same = {}, True
    for case in given["cases"]:
        truth = lab.truth(case)
        for program, terms in zip(COLLOCATION, (2, 4), strict=True):
            member = run(lab.scene(case), Member("collocation", terms, corrections=1))
            apart = distance(best.run(program, case).omega, member.omega)
            numbers[f"case {case}, {program}: distance from one correction (rad/s)"] = apart
            same &= apart < 1e-11 * largest(truth)
        for corrections in (0, 1, 2, 3):
            error = _error(lab, case, Member("collocation", 4, corrections=corrections))
            numbers[f"case {case}, 4 terms, {corrections} corrections: error (rad/s)"] = error
    return Judged(FALSE if same else REPRODUCED, numbers)


def execution_time(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Count the floating-point operations of a step in the twins."""
    counts = {
        program: operations_per_step(lab.listing(program))
        for program in (*COLLOCATION, "runge-kutta")
    }
    numbers = {f"{program}: operations a step": float(n) for program, n in counts.items()}
    inside = []
    for program in COLLOCATION:
        ratio = counts[program] / counts["runge-kutta"]
        numbers[f"{program}: over Runge-Kutta"] = ratio
        inside.append(given["low"] <= ratio <= given["high"])
    return Judged(graded(all(inside), any(inside)), numbers)


def seconds(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Count operations: nothing of today's machines tells of that one's seconds."""
    numbers = {
        f"{program}: operations in 100 steps": 100.0 * operations_per_step(lab.listing(program))
        for program in (*COLLOCATION, "runge-kutta")
    }
    return Judged(NOT_TESTABLE, numbers)


def complexity(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Count the cards of each deck."""
    cards = {program: float(n) for program, n in facts("cases")["cards"].items()}
    ratios = {program: cards[program] / cards["runge-kutta"] for program in COLLOCATION}
    near = [ratio <= given["factor"] for ratio in ratios.values()]
    numbers = {f"{program}: cards": n for program, n in cards.items()}
    return Judged(graded(all(near), any(near)), numbers)


def _error(lab: Laboratory, case: int, member: Member) -> float:
    found = run(lab.scene(case), member)
    truth = lab.truth(case)
    if len(found.omega) < len(truth.omega):
        return math.inf
    return float(np.abs(found.omega - truth.omega).max())
