"""Step sizes from 1 to 1e-6 s: truncation, rounding, where they cross, where runs diverge."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from pyharness.compare.candidates import unstopped
from pyharness.compare.checks import Check, bounded, described, may_hold, selected
from pyharness.methods.fixed_step import fixed_step
from pyharness.methods.registry import FIXED_STEP
from pyharness.model.listing import PROGRAMS, Listing, corrected, original
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.original.linear_solver import SINGULAR
from pyharness.stress.divergence import divergence, smallest_divergent
from pyharness.stress.run import Outcome, Trial, replay
from pyharness.theory.amplification import amplification
from pyharness.theory.collocation_matrices import PARTS, singular_below
from pyharness.theory.schemes import SCHEMES
from pyharness.theory.step_errors import Forecaster, Path, path
from pyharness.truth.reference import reference

NAME = "step-size"
CASES = (2, 3, 4, 5, 6)
TIME = 1.0
SMALLEST = 1e-6
# Half a decade apart.
COUNTS = tuple(round(10.0 ** (k / 2.0)) for k in range(13))
# Where runs diverge is looked for over a long time, down to a step that leaves them no excuse.
_LONG, _SMALLEST_LONG = 100.0, 2e-3
_SPINNING = (2, 3, 4)
# Nothing of order above 4 has truncation left at a step that shows rounding.
_CROSSING_ORDERS = (2, 4)
_COMPENSATED = "gauss"


def run(only: Sequence[str]) -> Iterator[Outcome]:
    """Run every method in every case with every step."""
    for name in SCHEMES:
        if not may_hold(f"{NAME}/{name}", only):
            continue
        for case in CASES:
            if not may_hold(f"{NAME}/{name}/case-{case}", only):
                continue
            if name in PROGRAMS:
                for listing in (original(name), corrected(name)):
                    prefix = f"{NAME}/{name}/case-{case}/{listing.label}"
                    yield from _steps(prefix, name, case, listing, only)
                    yield from _divergence(prefix, name, case, listing, only)
            else:
                prefix = f"{NAME}/{name}/case-{case}"
                yield from _steps(prefix, name, case, None, only)
                yield from _divergence(prefix, name, case, None, only)


def _steps(
    prefix: str, name: str, case: int, listing: Listing | None, only: Sequence[str]
) -> Iterator[Outcome]:
    """Hold the error at the end against its bound, for every step; then where it is least."""
    before = listing is not None and listing.label == "original"
    errors = {}
    crosses = f"{prefix}/crossing"
    wants_crossing = (
        not before
        and SCHEMES[name].order in _CROSSING_ORDERS
        and not name.startswith(_COMPENSATED)
        and selected(crosses, only)
    )
    for count in COUNTS:
        id = f"{prefix}/{TIME / count:.0e}"
        if not (wants_crossing or selected(id, only)):
            continue
        scene = replace(case_scene(case), step_size=TIME / count, steps=count)
        error, note = _error(scene, name, case, listing)
        errors[count] = error
        if not selected(id, only):
            continue
        if before:
            yield Outcome(described(id, error, replay(id), note), scene)
            continue
        forecast = _forecaster(case, name).at(count)
        foretold = f"truncation {forecast.truncation:.1e}, rounding below {forecast.rounding:.0e}"
        note = f"{foretold}{', ' if note else ''}{note}"
        if math.isfinite(forecast.bound):
            yield Outcome(bounded(id, error, forecast.bound, replay(id), note), scene)
        else:
            note = f"step too large to foretell; {note}"
            yield Outcome(described(id, error, replay(id), note), scene)
    if wants_crossing:
        yield Outcome(_crossing(crosses, name, case, errors))


def _crossing(id: str, name: str, case: int, errors: dict[int, float]) -> Check:
    """Hold the step below which truncation no longer rules against that foretold.

    It rules where the error is that of truncation, within a factor of 2.
    """
    forecaster = _forecaster(case, name)
    smallest = SMALLEST
    if name in PARTS:
        # At smaller ones the matrix is declared singular.
        smallest = max(smallest, math.nextafter(singular_below(name), 1.0))
    counts = [count for count in COUNTS if TIME / count >= smallest]
    ruled = [c for c in counts if 0.5 < errors[c] / forecaster.at(c).truncation < 2.0]
    found = TIME / max(ruled, default=1)
    if found > TIME / counts[-1]:
        # Somewhere on the way to the next one.
        found /= 10.0**0.25
    foretold = forecaster.crossing(smallest)
    # Half a decade from one step to the next; rounding may be a tenth or ten times as large.
    limit = 0.25 + 1.0 / (SCHEMES[name].order + 0.5)
    best = min(counts, key=errors.__getitem__)
    note = (
        f"truncation down to {found:.1e} s, foretold {foretold:.1e} s; "
        f"least error {errors[best]:.1e} at {TIME / best:.0e} s"
    )
    return bounded(id, abs(math.log10(found / foretold)), limit, replay(id), note)


def _error(scene: Scene, name: str, case: int, listing: Listing | None) -> tuple[float, str]:
    """Return the error at the end over the largest omega, and what else was seen."""
    largest = _path(case).flow.largest
    note = ""
    if listing is not None:
        run = unstopped(listing).rows(scene)
        if run.ended != "complete":
            return math.inf, f"{run.ended} after {run.steps} steps"
        omega = run.omega[-1]
        singular = 0 if run.ier is None else int((run.ier == SINGULAR).sum())
        note = f"IER = 129 in {singular} of {run.steps} steps" if singular else ""
    else:
        omega = _end(scene, name)
    return float(np.abs(omega - _truth(case)).max()) / largest, note


def _end(scene: Scene, name: str) -> Array:
    """Return what a modern method with a fixed step gives at the end; NaN after an overflow."""
    if name in FIXED_STEP:
        rows = fixed_step(name)(scene, [TIME], 1.0).omega
        return rows[-1] if len(rows) else np.full(3, math.nan)
    from pyharness.methods.problem import normalized
    from pyharness.model.extension import COMPLETE, extension

    stages = int(name.partition("-")[2])
    rows, _, _, status, _ = extension().gauss_solution(
        *normalized(scene), scene.omega, [TIME], stages, scene.step_size
    )
    return np.asarray(rows[:, 0]) if status == COMPLETE else np.full(3, math.nan)


def _divergence(
    prefix: str, name: str, case: int, listing: Listing | None, only: Sequence[str]
) -> Iterator[Outcome]:
    """Say with which steps a run diverges, and where theory knows, hold it to that."""
    id = f"{prefix}/diverges"
    if name.startswith("gauss") or not selected(id, only):
        return
    scene = case_scene(case)
    if listing is None:
        runner = partial(_rows, name)
        scheme = corrected("runge-kutta" if SCHEMES[name].order == 4 else "two-term")
    else:
        runner = partial(_program, listing)
        scheme = listing
    if case not in _SPINNING:
        found = smallest_divergent(scene, TIME, runner, SMALLEST * 1e2)
        yield Outcome(described(id, found, replay(id), _from(found, TIME)), scene)
        return
    seen = divergence(scene, _LONG, amplification(scheme), runner, _SMALLEST_LONG)
    apart = abs(seen.found / seen.foretold - 1.0)
    note = f"{_from(seen.found, _LONG)}, foretold from {seen.foretold:.4g} s"
    # Linear theory knows nothing of points that move, unless the equations are linear.
    knows = listing is None or listing.label == "corrected" or (name in PARTS and case == 2)
    if knows:
        yield Outcome(bounded(id, apart, seen.limit, replay(id), note), scene)
    else:
        yield Outcome(described(id, seen.found, replay(id), note), scene)


def _from(found: float, time: float) -> str:
    if found == 0.0:
        return f"leaves twice the bound within {time:g} s with every step"
    if math.isinf(found):
        return f"stays within {time:g} s with every step"
    return f"leaves twice the bound within {time:g} s from {found:.4g} s"


def _rows(name: str, scene: Scene) -> Trajectory:
    return fixed_step(name)(scene, scene.times(), 1.0)


def _program(listing: Listing, scene: Scene) -> Trajectory:
    return unstopped(listing).rows(scene)


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
    NAME,
    "steps from 1 to 1e-6 s over 1 s, and from 2e-3 s over 100 s until runs diverge",
    "what each step misses, as a power series of the step worked out from the scheme alone, "
    "carried to the end by the linearised flow, twice that for what it changes itself; a few "
    "roundings of each step carried likewise; divergence where the amplification matrix doubles "
    "a wobble",
    run,
)
