"""Trial of step sizes from 1 to 1e-6 s: truncation and rounding errors, and divergence."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.compare.candidates import method_candidate, unstopped
from pyharness.checks.disturbances import DOUBLING, Runner, divergence, smallest_divergent
from pyharness.checks.hold import run_method
from pyharness.checks.stress import LISTINGS, Trial, named
from pyharness.checks.theory.amplification import amplification
from pyharness.checks.theory.collocation_matrices import PARTS, singular_below
from pyharness.checks.theory.schemes import SCHEMES
from pyharness.checks.theory.step_errors import FORECAST, Forecaster, Path, path
from pyharness.model.basis import Basis
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array
from pyharness.thesis.linear_solver import SINGULAR
from pyharness.truth.reference import reference

CASES = (2, 3, 4, 5, 6)
TIME = 1.0
SMALLEST = 1e-6
# Numbers of steps in `TIME` (s), half a decade apart.
COUNTS = tuple(round(10.0 ** (k / 2.0)) for k in range(13))
# Time (s) of a longer search for divergence, and its smallest step size (s).
_LONG, _SMALLEST_LONG = 100.0, 2e-3
_SPINNING = (2, 3, 4)
# By order, a program that amplifies small perturbations alike.
_ALIKE = {2: "two-term", 4: "runge-kutta"}
_CROSSING = Basis(
    "derived",
    "step size at which truncation and rounding errors are equal",
    "the predicted errors, if rounding is within a factor of ten of its prediction "
    "(`checks/trials/step_size.py`)",
)


def _attempts() -> Iterator[Attempt]:
    for name in SCHEMES:
        listings: list[Listing | None] = [each for each in LISTINGS if each.program == name]
        for case in CASES:
            for listing in listings or [None]:
                label = listing.label if listing else ""
                place = named("step-size", name, f"case-{case}", label)
                yield Attempt(place, partial(_of_case, case, listing))


def _of_case(case: int, listing: Listing | None, place: Name) -> Iterator[Attempt]:
    before = listing is not None and listing.label == "original"
    method, place = place.subject, replace(place, scene=case_scene(case))
    scenes = {n: replace(case_scene(case), step_size=TIME / n, steps=n) for n in COUNTS}
    error = cache(lambda count: _error(scenes[count], method, case, listing))

    def predicted(count: int, name: Name) -> Check:
        found, note = error(count)
        if before:
            return name.described(found, note)
        due = _forecaster(case, method).predict(count)
        said = f"truncation {due.truncation:.1e}, rounding below {due.rounding:.0e}"
        note = f"{said}{', ' if note else ''}{note}"
        if math.isfinite(due.bound):
            return name.bounded(found, due.bound, FORECAST, note)
        return name.described(found, f"step too large to foretell; {note}")

    for count, scene in scenes.items():
        own = replace(place, quantity=f"{TIME / count:.0e}", scene=scene)
        yield Attempt(own, partial(predicted, count))
    gauss = method.startswith("gauss")
    if gauss or SCHEMES[method].order not in _ALIKE:
        # Methods of higher order have only rounding errors where rounding is visible.
        return
    if not before:
        crossing = partial(_crossing, method, case, lambda count: error(count)[0])
        yield Attempt(replace(place, quantity="crossing", scene=None), crossing)
    yield Attempt(place.with_quantity("diverges"), partial(_divergence, case, listing))


def _crossing(method: str, case: int, error: Callable[[int], float], name: Name) -> Check:
    """Return the check of the smallest step size at which the truncation error dominates."""
    forecaster = _forecaster(case, method)
    smallest = SMALLEST
    if method in PARTS:
        # For smaller steps LEQT1F reports a singular matrix.
        smallest = max(smallest, math.nextafter(singular_below(method), 1.0))
    counts = [count for count in COUNTS if TIME / count >= smallest]
    ruled = [c for c in counts if 0.5 < error(c) / forecaster.predict(c).truncation < 2.0]
    found = TIME / max(ruled, default=1)
    if found > TIME / counts[-1]:
        # Take the geometric mean of this step size and the next smaller one.
        found /= 10.0**0.25
    predicted = forecaster.crossing(smallest)
    # Allow for the half decade between step sizes, and for ten times the predicted rounding.
    limit = 0.25 + 1.0 / (SCHEMES[method].order + 0.5)
    best = min(counts, key=error)
    note = (
        f"truncation down to {found:.1e} s, predicted {predicted:.1e} s; "
        f"least error {error(best):.1e} at {TIME / best:.0e} s"
    )
    return name.bounded(abs(math.log10(found / predicted)), limit, _CROSSING, note)


def _error(scene: Scene, name: str, case: int, listing: Listing | None) -> tuple[float, str]:
    """Return the final relative error of omega, infinite if the run is incomplete, and a note."""
    largest = _path(case).flow.largest

    def error(omega: Array) -> float:
        return float(np.abs(omega - _truth(case)).max()) / largest

    if listing is None:
        return error(run_method(name, scene, TIME, None).omega), ""
    run = unstopped(listing).rows(scene)
    if run.ended != "complete":
        return math.inf, f"{run.ended} after {run.steps} steps"
    singular = 0 if run.ier is None else int((run.ier == SINGULAR).sum())
    note = f"IER = 129 in {singular} of {run.steps} steps" if singular else ""
    return error(run.omega[-1]), note


def _divergence(case: int, listing: Listing | None, name: Name) -> Check:
    scene, method = case_scene(case), name.subject
    scheme = listing or Listing.corrected(_ALIKE[SCHEMES[method].order])
    runner: Runner = (unstopped(listing) if listing else method_candidate(method, 1.0)).rows
    if case not in _SPINNING:
        found = smallest_divergent(scene, TIME, runner, SMALLEST * 1e2)
        return name.described(found, _from(found, TIME))
    matrix = amplification(scheme)
    found, predicted, limit = divergence(scene, _LONG, matrix, runner, _SMALLEST_LONG)
    note = f"{_from(found, _LONG)}, predicted from {predicted:.4g} s"
    # Linear theory holds for moving collocation points only if the equations are linear.
    if listing is None or listing.label == "corrected" or (method in PARTS and case == 2):
        return name.bounded(abs(found / predicted - 1.0), limit, DOUBLING, note)
    return name.described(found, note)


def _from(found: float, time: float) -> str:
    if found == 0.0:
        return f"leaves twice the bound within {time:g} s with every step"
    if math.isinf(found):
        return f"stays within {time:g} s with every step"
    return f"leaves twice the bound within {time:g} s from {found:.4g} s"


@cache
def _path(case: int) -> Path:
    return path(case_scene(case), TIME)


@cache
def _truth(case: int) -> Array:
    return np.asarray(reference(case_scene(case), [TIME], precise=True).omega[0])


@cache
def _forecaster(case: int, name: str) -> Forecaster:
    return Forecaster(_path(case), name)


TRIAL = Trial(
    "step-size",
    "steps from 1 to 1e-6 s over 1 s, and from 2e-3 s over 100 s until runs diverge",
    "Twice the local error of each step (because the equations are nonlinear), a power series in "
    "the step derived from the scheme alone, plus a few rounding errors of each step, both "
    "propagated to the end by the linearised equations. Divergence is expected where the "
    "amplification matrix doubles a perturbation.",
    lambda only: _attempts(),
)
