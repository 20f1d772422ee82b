"""Tests of the claims of V.1 and V.2: a laboratory and parameters in, a verdict out.

Each function is the `test` of entries in `data/claims.toml`, whose `rule` says in words what the
function decides. Numbers are returned with the verdict, and nothing is typed in.
"""

import math
from typing import Any

import numpy as np

from pyharness.history.claims.laboratory import (
    COLLOCATION,
    Laboratory,
    distance,
    largest,
    ranges,
)
from pyharness.history.claims.verdicts import FALSE, NOT_REPRODUCED, REPRODUCED, Judged, graded
from pyharness.original.programs import PROGRAM_REGISTRY


def constant_solution(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure how far the solution moves."""
    moved = float(ranges(lab.truth(given["case"])).max())
    verdict = FALSE if moved > 1e-12 else REPRODUCED
    return Judged(verdict, {"change over the run (rad/s)": moved})


def known_solution(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold the printed solution against the reference."""
    truth = lab.truth(given["case"])
    t = truth.time
    printed = np.column_stack([np.sin(5 * t), np.cos(5 * t), np.full_like(t, 10.0)])
    apart = distance(printed, truth.omega)
    # The phase 5 t is itself rounded.
    allowed = 1e-15 * (1.0 + 5.0 * float(t[-1]))
    return Judged(
        REPRODUCED if apart <= allowed else FALSE, {"distance from the reference (rad/s)": apart}
    )


def no_deviation(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold all programs against the known solution, at the precision of the page."""
    numbers = {
        f"{name}: largest error (rad/s)": lab.error(name, given["case"])
        for name in PROGRAM_REGISTRY
    }
    close = max(numbers.values()) < given["limit"]
    return Judged(REPRODUCED if close else NOT_REPRODUCED, numbers)


def coincident(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold collocation against the known solution, on the scale of the graph."""
    truth = lab.truth(given["case"])
    spread = ranges(truth)
    moving = spread > 0.0
    numbers = {}
    for program in COLLOCATION:
        run = lab.run(program, given["case"])
        shares = np.abs(run.omega - truth.omega).max(axis=0)[moving] / spread[moving]
        numbers[f"{program}: largest share of a component's range"] = float(shares.max())
    close = max(numbers.values()) <= given["share"]
    return Judged(REPRODUCED if close else NOT_REPRODUCED, numbers)


def error_size(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure the largest error as a part of the amplitude."""
    truth = lab.truth(given["case"])
    amplitude = float(ranges(truth).max()) / 2.0
    numbers = {
        f"{program}: largest error over the amplitude": lab.error(program, given["case"])
        / amplitude
        for program in COLLOCATION
    }
    inside = all(given["low"] <= each <= given["high"] for each in numbers.values())
    return Judged(REPRODUCED if inside else NOT_REPRODUCED, numbers)


def error_constant(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold the error at the end of the run against that at its beginning."""
    truth = lab.truth(given["case"]).omega
    numbers = {}
    for program in COLLOCATION:
        errors = np.abs(lab.run(program, given["case"]).omega - truth).max(axis=1)
        fifth = len(errors) // 5
        growth = float(errors[-fifth:].max() / errors[:fifth].max())
        numbers[f"{program}: error of the last fifth over that of the first"] = growth
    return Judged(REPRODUCED if max(numbers.values()) <= 2.0 else NOT_REPRODUCED, numbers)


def stopped_at(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Find the step at which the stop test ended the run."""
    stop = lab.run("runge-kutta", given["case"]).stop
    step = math.nan if stop is None else float(stop.step)
    verdict = graded(step == given["step"], stop is not None)
    return Judged(verdict, {"stopped at step": step})


def growing(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold the first component at the end of the run against the solution there."""
    run = lab.run("runge-kutta", given["case"])
    value, solution = (
        float(run.omega[-1, 0]),
        float(lab.truth(given["case"]).omega[run.steps - 1, 0]),
    )
    beyond = value > 1.0 and value > solution * 1.001
    numbers = {"omega1 at the end (rad/s)": value, "solution there (rad/s)": solution}
    return Judged(REPRODUCED if beyond else NOT_REPRODUCED, numbers)


def no_error(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure what correcting everything gains at the steps that were run."""
    case = given["case"]
    run = lab.run("runge-kutta", case)
    best = Laboratory(False, lab.assumptions).run("runge-kutta", case)
    truth = lab.truth(case).omega[: run.steps]
    gain = distance(run.omega, truth) / distance(best.omega[: run.steps], truth)
    verdict = FALSE if gain > 10.0 else graded(gain <= 2.0, True)
    return Judged(verdict, {"error over that of the corrected program": gain})


def omega3_varies(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure how far the third component moves."""
    moved = float(ranges(lab.truth(given["case"]))[2])
    verdict = REPRODUCED if moved > given["limit"] else FALSE
    return Judged(verdict, {"range of omega3 (rad/s)": moved})


def concur(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold the two collocation programs against one another."""
    truth = lab.truth(given["case"])
    two, four = (lab.run(program, given["case"]) for program in COLLOCATION)
    n = min(two.steps, four.steps)
    apart = np.abs(two.omega[:n] - four.omega[:n]).max(axis=0)
    complete = two.ended == four.ended == "complete"
    spread = np.maximum(ranges(truth), 1e-12 * largest(truth))
    share = float(apart.max()) / largest(truth) if complete else math.inf
    detail = float((apart / spread).max()) if complete else math.inf
    numbers = {
        "difference over the largest omega": share,
        "difference over the range of a component": detail,
        "two-term error (rad/s)": lab.error("two-term", given["case"]),
        "four-term error (rad/s)": lab.error("four-term", given["case"]),
    }
    whole = share <= given["share"] and detail <= 0.1
    return Judged(graded(whole, share <= given["share"]), numbers)


def fails(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """See how the Runge-Kutta program ended, and how far from the truth."""
    case = given["case"]
    run, truth = lab.run("runge-kutta", case), lab.truth(case)
    spread = ranges(truth)
    moving = spread > 1e-12 * largest(truth)
    errors = np.abs(run.omega - truth.omega[: run.steps]).max(axis=0, initial=0.0)
    share = float((errors[moving] / spread[moving]).max(initial=0.0))
    ended, far = run.ended != "complete", share > given["share"]
    numbers = {"steps": float(run.steps), "error over the range of a component": share}
    return Judged(graded(ended and far, ended or far), numbers)


def differ(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure the difference of the collocation programs over the largest omega."""
    two, four = (lab.run(program, given["case"]) for program in COLLOCATION)
    share = distance(two.omega, four.omega) / largest(lab.truth(given["case"]))
    verdict = REPRODUCED if share > given["share"] else NOT_REPRODUCED
    return Judged(verdict, {"difference over the largest omega": share})


def more_reliable(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure the four-term error over the two-term one."""
    ratio = lab.error("four-term", given["case"]) / lab.error("two-term", given["case"])
    verdict = graded(ratio <= 0.5, ratio <= 0.8)
    return Judged(verdict, {"four-term error over two-term error": ratio})


def diverged(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """See whether the two-term run left its bounds."""
    run = lab.run("two-term", given["case"])
    error = lab.error("two-term", given["case"])
    gone = run.ended == "overflow" or error > largest(lab.truth(given["case"]))
    numbers = {"steps": float(run.steps), "largest error (rad/s)": error}
    return Judged(REPRODUCED if gone else NOT_REPRODUCED, numbers)


def too_fast(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """See whether motion or program is to blame: run the corrected model at the same step."""
    best = Laboratory(False, lab.assumptions)
    share = best.error("two-term", given["case"]) / largest(lab.truth(given["case"]))
    verdict = FALSE if share <= given["share"] else REPRODUCED
    return Judged(verdict, {"corrected two-term error over the largest omega": share})


def models_concur(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Hold models of several numbers of terms against one another."""
    models = {n: lab.models(given["case"], n) for n in given["terms"]}
    scale = largest(lab.truth(given["case"]))
    first, *others = given["terms"]
    numbers = {
        f"{n} terms against {first}, over the largest omega": distance(models[n], models[first])
        / scale
        for n in others
    }
    close = max(numbers.values()) <= given["share"]
    return Judged(REPRODUCED if close else NOT_REPRODUCED, numbers)


def dynamic(lab: Laboratory, given: dict[str, Any]) -> Judged:
    """Measure the largest angular acceleration of the four-term run, case by case."""
    rates = {}
    for case in range(1, 8):
        run = lab.run("four-term", case)
        steps = np.diff(run.omega, axis=0) / lab.scene(case).step_size
        rates[case] = float(np.linalg.norm(steps, axis=1).max())
    others = max(rate for case, rate in rates.items() if case != given["case"])
    liveliest = rates[given["case"]] >= given["factor"] * others
    numbers = {f"case {case}: largest acceleration (rad/s2)": rate for case, rate in rates.items()}
    return Judged(REPRODUCED if liveliest else NOT_REPRODUCED, numbers)
