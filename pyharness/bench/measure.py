"""Run time against error, for our and third-party solvers, in one process.

The result of a call with each setting, from coarse to fine, is compared with the reference. Batches
of all calls are then timed in interleaved rounds, so that other work of the machine affects all
alike; the median time counts.
"""

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter

import numpy as np

from pyharness.bench.contenders import Maker, SceneContender
from pyharness.bench.loop import Call, Say, timed
from pyharness.checks.compare.candidates import End, Ready, not_finite
from pyharness.checks.compare.timing import Clock, ended_after, silenced
from pyharness.model.attitude import IDENTITY, angle_between
from pyharness.model.errors import InputError
from pyharness.model.progress import Progress, no_progress
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array
from pyharness.truth.bounded import ErrorBound, bound_of, joined
from pyharness.truth.reference import Reference, reference

TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
HORIZON, LONG_HORIZON = 3.0, 100.0  # end times T, s
_CASES, _LONG_CASES = (2, 3, 4, 5, 6, 7), (3, 4)
# Cases with attitude. In Case 6 the reference would need too many steps until the long end time.
_TURNING_CASES, _LONG_TURNING_CASES = (1, *_CASES), (1, 2, 3, 4, 5, 7)

_LONGEST_CALL = 1.0  # s; settings whose calls take longer are left out
# Longest time (s) to prepare and try a setting: at a coarse tolerance a solver may never end.
_LONGEST_FIRST = 30.0
# Longest time (s) of all first calls of a contender on a workload.
_BUDGET = {"tolerance": 1.0, "steps": 0.15, "none": 1.0}
_LARGEST_STEPS = 1 << 22  # largest number of steps of a call
_FAILURES = 12  # after so many successive settings without a result, finer ones are left out
# Factor on the work limit of the proved error bound, whose time is short beside the measurement.
_PROOF_EFFORT = 10.0
_ROUNDS = 9
_BATCH = 1e-3  # s; calls faster than this are batched


@dataclass(frozen=True)
class Workload:
    """A scene and its end time."""

    # Number of a case or random scene, or name of a torque term. A case number is followed by `L`
    # if T = 100 s (`3L`), or by T if T is neither 3 nor 100 s.
    label: str
    scene: Scene
    horizon: float  # end time T, s
    # For scenes that are not cases: kinds, solution, error amplification, number of revolutions.
    kinds: tuple[str, ...] = ()
    truth: Reference | None = None
    growth: float = 0.0
    turns: float = 0.0
    # Errors are relative to this angular velocity (rad/s) or, if larger, to the largest component
    # of the true omega at T.
    scale: float = 0.0

    @property
    def place(self) -> str:
        return f"{'scene' if self.kinds else 'case'} {self.label}"

    @property
    def group(self) -> str:
        """The name of the group over which ratios are averaged."""
        if self.horizon != HORIZON and self.scene.attitude is None:
            return f"T = {self.horizon:g}"
        return f"{'torque-free' if self.scene.torque.is_zero else 'torque'}, T = {self.horizon:g}"


@dataclass(frozen=True)
class Row:
    """The run time and error of a contender with a setting on a workload."""

    workload: Workload
    method: str
    kind: str  # "tolerance", "steps" or "none"
    setting: float | None  # None if the contender has no setting
    seconds: float | None  # median, s; None if the call failed
    # The larger of the errors at T of omega (relative as in `Workload.scale`) and attitude (rad);
    # None if the call failed.
    error: float | None
    evaluations: int | None  # number of right-hand sides in a call, if counted
    note: str = ""
    # Time (s) to prepare the call, including compilation.
    preparing: float = field(default=0.0, compare=False)


@dataclass(frozen=True)
class Refusal:
    workload: Workload
    method: str
    setting: float | None
    reason: str


@dataclass(frozen=True)
class Finding:
    workloads: list[Workload]
    rows: list[Row]
    refused: list[Refusal]
    # Time (s) of all preparations, by case number (or label) and contender.
    preparation: dict[tuple[int | str, str], float]
    # Error estimate of the reference, relative as in `Row.error`, by the workload's label.
    doubt: dict[str, float]
    # Bound on the reference's error, proved if possible, by the workload's label.
    bounds: dict[str, ErrorBound] = field(default_factory=dict)

    @property
    def attitude(self) -> bool:
        return any(load.scene.attitude is not None for load in self.workloads)


def workloads(
    case: int | None = None, horizon: float | None = None, attitude: bool = False
) -> list[Workload]:
    """Return cases of Table 1 as workloads, by default to 3 s, and some also to 100 s."""
    usual, long = (_TURNING_CASES, _LONG_TURNING_CASES) if attitude else (_CASES, _LONG_CASES)
    cases = usual if case is None else (case,)
    asked = [(n, HORIZON if horizon is None else horizon) for n in cases]
    if horizon is None:
        asked += [(n, LONG_HORIZON) for n in cases if n in long]
    marks = {HORIZON: "", LONG_HORIZON: "L"}
    start = IDENTITY if attitude else None
    scenes = {n: replace(case_scene(n), attitude=start) for n in cases}
    return [Workload(f"{n}{marks.get(t, f' T={t:g}')}", scenes[n], t) for n, t in asked]


def measure(
    loads: Sequence[Workload],
    contenders: Sequence[SceneContender],
    progress: Progress = no_progress,
    clock: Clock | None = None,
) -> Finding:
    clock = clock or perf_counter
    found = Finding(list(loads), [], [], {}, {})
    makers: dict[tuple[int | str, str], Maker] = {}

    def calls(load: Workload, say: Say) -> Iterator[Call[Row]]:
        say("reference")
        truth = load.truth or reference(load.scene, [load.horizon], precise=True)
        size = float(np.abs(truth.omega).max(initial=0.0)) or 1.0
        doubt = max(truth.estimate / size, truth.angle_estimate)
        found.doubt[load.label] = max(doubt, found.doubt.get(load.label, 0.0))
        bound = bound_of(load.scene, truth, before_rounding=True, effort=_PROOF_EFFORT)
        bound = bound.over(size).larger
        before = found.bounds.get(load.label)
        found.bounds[load.label] = bound if before is None else joined([before, bound])
        place = load.scene.case or load.label
        if load.kinds and not any(known == place for known, _ in makers):
            makers.clear()  # earlier scenes do not occur again
        for contender in contenders:
            refused = partial(Refusal, load, contender.name, None)
            if load.scene.attitude is not None and not contender.attitude:
                found.refused.append(refused("does not compute attitudes"))
                continue
            say(contender.name)
            key = (place, contender.name)
            # Compile only once for all end times of a scene.
            begin = clock()
            try:
                if key not in makers:
                    makers[key] = contender.prepare(load.scene)
            except InputError as error:
                found.refused.append(refused(str(error)))
                continue
            spent = clock() - begin
            first, more = _first_calls(load, contender, makers[key], truth, found.refused, clock)
            found.preparation[key] = found.preparation.get(key, 0.0) + spent + more
            for ready, row in first:
                run = None if row.error is None else ready.run
                yield Call(run, clock, partial(replace, row))

    found.rows.extend(timed(loads, calls, progress, _BATCH, _ROUNDS))
    return found


def error_of(end: End, truth: Reference, scale: float = 0.0) -> float | None:
    """Return the larger error of omega (relative) and attitude (rad), or None without a result."""
    error = relative_error(end.omega, truth, scale)
    if error is None or truth.attitude is None:
        return error
    if end.attitude is None or not np.isfinite(end.attitude).all() or not end.attitude.any():
        return None
    # Normalise, because integrators do not preserve the norm; divide first, so that no square
    # overflows or underflows.
    attitude = end.attitude / np.abs(end.attitude).max()
    attitude /= np.linalg.norm(attitude)
    return max(error, float(angle_between(attitude[None], truth.attitude)[0]))


def relative_error(omega: Array, truth: Reference, scale: float = 0.0) -> float | None:
    """Return omega's error relative to the larger of `scale` (rad/s) and true omega, or None."""
    if len(truth.omega) == 0:
        return None
    # Near the true solution this difference is exact, so that the reference's digits beyond
    # binary64, the `remainder`, matter.
    difference = omega - truth.omega[0]
    if truth.remainder is not None:
        difference -= truth.remainder[0]
    size = max(float(np.abs(truth.omega[0]).max()), scale) or 1.0
    error = float(np.abs(difference).max()) / size
    return error if math.isfinite(error) else None


def ladder(contender: SceneContender, scene: Scene, horizon: float) -> Iterator[float]:
    """Yield a contender's settings, tolerances or numbers of steps, from coarse to fine."""
    if contender.settings:
        yield from contender.settings
        return
    # In the largest step the body rotates by at most 16 rad about an axis, at the initial omega; no
    # method works with larger steps. The torque's frequencies are ignored, because a fast torque
    # may be too weak to require small steps.
    phase = max(map(abs, scene.omega)) * horizon / 16.0
    steps = 1 << max(1, math.ceil(math.log2(max(1.0, phase))))
    while steps <= _LARGEST_STEPS:
        yield float(steps)
        if contender.order > 2:
            yield float(steps * 3 // 2)
        steps *= 2


def _first_calls(
    load: Workload, contender: SceneContender, make: Maker, truth: Reference,
    refused: list[Refusal], clock: Clock,
) -> tuple[list[tuple[Ready, Row]], float]:  # fmt: skip
    """Return a contender's calls on a workload, and the time (s) to prepare them."""
    entries: list[tuple[Ready, Row]] = []
    errors: list[float | None] = []
    spent = preparing = last = before = 0.0
    for setting in ladder(contender, load.scene, load.horizon):
        named = None if contender.setting == "none" else setting
        # Extrapolate the time from the last two calls, of which one may have been interrupted.
        expected = last * min(4.0, max(1.0, last / before)) if before else last
        hopeless = ""
        if expected > _LONGEST_CALL or spent + expected > _BUDGET[contender.setting]:
            hopeless = f"a call would take about {expected:.2g} s"
        elif len(errors) >= _FAILURES and set(errors[-_FAILURES:]) == {None}:
            hopeless = f"{_FAILURES} settings in a row came to nothing"
        if hopeless:
            reason = f"and finer: left out, {hopeless}"
            refused.append(Refusal(load, contender.name, setting, reason))
            break
        try:
            begin = clock()
            with silenced(), ended_after(_LONGEST_FIRST):
                warnings.simplefilter("error", UserWarning)
                ready = make(load.horizon, setting)
                ready.run()
                middle = clock()
                result = ready.run()
                first = clock() - middle
                end = ready.read(result)
        except InputError as refusal:
            refused.append(Refusal(load, contender.name, named, str(refusal)))
            continue
        except (UserWarning, ValueError, ArithmeticError, RuntimeError) as failure:
            reason = f"{type(failure).__name__}: {' '.join(str(failure).split())}"
            refused.append(Refusal(load, contender.name, setting, reason))
            continue
        own = max(0.0, middle - begin - first)
        preparing += own
        spent += first
        before, last = last, first
        error = error_of(end, truth, load.scale)
        if error is None and end.has_result:
            end = not_finite()
        errors.append(error)
        counted = None if error is None else end.evaluations
        note = "" if end.ended == "complete" else end.ended
        name, kind = contender.name, contender.setting
        entries.append((ready, Row(load, name, kind, named, None, error, counted, note, own)))
        if kind == "steps" and _at_rounding(errors):
            break
    return entries, preparing


def _at_rounding(errors: Sequence[float | None]) -> bool:
    known = [error for error in errors if error is not None]
    return len(known) > 3 and min(known[-3:]) >= min(known[:-3]) and min(known) < 1e-10
