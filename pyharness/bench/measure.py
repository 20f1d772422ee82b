"""The benchmark: run time against error, ours and other people's, in one process and one run.

Every contender is called with a ladder of settings, each call from time 0 to T: to omega, and of a
scene with an attitude to both. First all are made, called once and judged against the reference;
then they are timed in rounds, a batch of each in turn, so that what else the machine does hits all
alike. The median counts.
"""

import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from pyharness.bench.contenders import Maker, SceneContender
from pyharness.compare.candidates import End, Ready, not_finite
from pyharness.compare.timing import seconds, silenced
from pyharness.model.attitude import IDENTITY, angle_between
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array
from pyharness.truth.reference import Reference, reference

TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
HORIZON, LONG_HORIZON = 3.0, 100.0
_CASES, _LONG_CASES = (2, 3, 4, 5, 6, 7), (3, 4)
# With attitude; in Case 6 the reference would need too many steps.
_TURNING_CASES, _LONG_TURNING_CASES = (1, *_CASES), (1, 2, 3, 4, 5, 7)

_LONGEST_CALL = 1.0  # s
# Seconds for the first calls of a contender in one case, by what is varied.
_BUDGET = {"tolerance": 1.0, "steps": 0.15, "none": 1.0}
_LARGEST_STEPS = 1 << 22
_FAILURES = 12
_ROUNDS = 9
_BATCH = 1e-3  # s; calls faster than this are batched


@dataclass(frozen=True)
class Workload:
    """A scene and how far to go."""

    label: str  # `5` for Case 5 to T = 3, `3L` for Case 3 to T = 100; of a random scene its number
    scene: Scene
    horizon: float  # T, s
    # Of a random scene: its kinds, the solution, growth of small differences, turns of the body.
    kinds: tuple[str, ...] = ()
    truth: Reference | None = None
    growth: float = 0.0
    turns: float = 0.0

    @property
    def place(self) -> str:
        """What it is called in a sentence."""
        return f"{'scene' if self.kinds else 'case'} {self.label}"

    @property
    def group(self) -> str:
        """What its ratios are averaged with."""
        if self.horizon != HORIZON and self.scene.attitude is None:
            return f"T = {self.horizon:g}"
        return f"{'torque-free' if self.scene.torque.is_zero else 'torque'}, T = {self.horizon:g}"


@dataclass(frozen=True)
class Row:
    """A contender with one setting."""

    workload: Workload
    method: str  # name of the contender
    kind: str  # what the setting is: tolerance, steps, none
    setting: float | None
    seconds: float | None  # median time of a call; None where it failed
    # Of omega at T, over the largest component there, or the attitude's (rad) where it is larger;
    # None where it failed.
    error: float | None
    evaluations: int | None  # right-hand sides of a call, where they can be counted
    note: str = ""  # why it failed


@dataclass(frozen=True)
class Refusal:
    """A setting that was not run, or a contender that was not (setting None), and why."""

    workload: Workload
    method: str
    setting: float | None
    reason: str


@dataclass(frozen=True)
class Finding:
    """What a run of the benchmark found."""

    workloads: list[Workload]
    rows: list[Row]
    refused: list[Refusal]
    preparation: dict[tuple[int | str, str], float]  # s, by (case or random scene, method)
    doubt: dict[str, float]  # error that the reference may have, as that of a row, by label

    @property
    def attitude(self) -> bool:
        """Whether the attitude was asked for."""
        return any(load.scene.attitude is not None for load in self.workloads)


def workloads(
    case: int | None = None, horizon: float | None = None, attitude: bool = False
) -> list[Workload]:
    """Return what is integrated: Cases 2 to 7, Cases 3 and 4 also for long; or what is asked.

    With `attitude` all cases, from the axes of space, and for long all but Case 6.
    """
    usual, long = (_TURNING_CASES, _LONG_TURNING_CASES) if attitude else (_CASES, _LONG_CASES)
    cases = usual if case is None else (case,)
    asked = [(n, HORIZON if horizon is None else horizon) for n in cases]
    if horizon is None:
        asked += [(n, LONG_HORIZON) for n in cases if n in long]
    marks = {HORIZON: "", LONG_HORIZON: "L"}
    start = IDENTITY if attitude else None
    return [
        Workload(f"{n}{marks.get(t, f' T={t:g}')}", replace(case_scene(n), attitude=start), t)
        for n, t in asked
    ]


def measure(
    loads: Sequence[Workload],
    contenders: Sequence[SceneContender],
    say: Callable[[str], None] = lambda _: None,
) -> Finding:
    """Run the benchmark; `say` is told how far it is."""
    found = Finding(list(loads), [], [], {}, {})
    makers: dict[tuple[int | str, str], Maker] = {}
    for number, load in enumerate(loads, 1):
        place = f"{load.place} ({number} of {len(loads)})"

        def tell(text: str, place: str = place) -> None:
            say(f"{place}: {text}")

        tell("reference")
        truth = load.truth or reference(load.scene, [load.horizon], precise=True)
        size = float(np.abs(truth.omega).max(initial=0.0)) or 1.0
        found.doubt[load.label] = max(truth.estimate / size, truth.angle_estimate)
        entries: list[tuple[Ready, Row]] = []
        if load.kinds:
            makers.clear()  # no random scene comes twice
        for contender in contenders:
            if load.scene.attitude is not None and not contender.attitude:
                found.refused.append(Refusal(load, contender.name, None, "carries no attitude"))
                continue
            tell(contender.name)
            key = (load.scene.case or load.label, contender.name)
            # Compiled code is kept for the same scene with another horizon.
            begin = perf_counter()
            try:
                if key not in makers:
                    makers[key] = contender.prepare(load.scene)
            except InputError as error:
                found.refused.append(Refusal(load, contender.name, None, str(error)))
                continue
            spent = perf_counter() - begin
            first, more = _first_calls(load, contender, makers[key], truth, found.refused)
            found.preparation[key] = found.preparation.get(key, 0.0) + spent + more
            entries += first
        running = [ready.run for ready, row in entries if row.error is not None]
        times = iter(seconds(running, _BATCH, _ROUNDS, tell))
        for _, row in entries:
            median = None if row.error is None else next(times)
            found.rows.append(replace(row, seconds=median))
    return found


def error_of(end: End, truth: Reference) -> float | None:
    """Return the relative error of omega, or the attitude's (rad) where it is larger; None if none.

    Of a truth with an attitude both count, and who has none has no error.
    """
    error = relative_error(end.omega, truth)
    if error is None or truth.attitude is None:
        return error
    if end.attitude is None or not np.isfinite(end.attitude).all() or not end.attitude.any():
        return None
    # Whatever its length, which integrators do not keep; scaled first, for its square is a number.
    attitude = end.attitude / np.abs(end.attitude).max()
    attitude /= np.linalg.norm(attitude)
    return max(error, float(angle_between(attitude[None], truth.attitude)[0]))


def relative_error(omega: Array, truth: Reference) -> float | None:
    """Return the largest error of omega over the largest component of the truth; None if none."""
    if len(truth.omega) == 0:
        return None
    # Near the truth the difference is exact: what the reference has beyond binary64 then counts.
    difference = omega - truth.omega[0]
    if truth.remainder is not None:
        difference -= truth.remainder[0]
    size = float(np.abs(truth.omega[0]).max()) or 1.0
    error = float(np.abs(difference).max()) / size
    return error if math.isfinite(error) else None


def ladder(contender: SceneContender, scene: Scene, horizon: float) -> Iterator[float]:
    """Yield settings from coarse to fine; numbers of steps by factors of 3/2 and 4/3."""
    if contender.settings:
        yield from contender.settings
        return
    # A step for 16 radians of the first motion is too few for anyone. A fast torque does not
    # count: it may be too faint to need its own steps.
    phase = max(map(abs, scene.omega)) * horizon / 16.0
    steps = 1 << max(1, math.ceil(math.log2(max(1.0, phase))))
    while steps <= _LARGEST_STEPS:
        yield float(steps)
        # A low order needs many steps: coarser rungs find its place as well.
        if contender.order > 2:
            yield float(steps * 3 // 2)
        steps *= 2


def _first_calls(
    load: Workload, contender: SceneContender, make: Maker, truth: Reference, refused: list[Refusal]
) -> tuple[list[tuple[Ready, Row]], float]:
    """Return what will be timed, and the seconds that making and first calls took beyond it."""
    entries: list[tuple[Ready, Row]] = []
    errors: list[float | None] = []
    spent = preparing = last = before = 0.0
    for setting in ladder(contender, load.scene, load.horizon):
        named = None if contender.setting == "none" else setting
        # Bounded: one call may have been interrupted.
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
            begin = perf_counter()
            with silenced():
                warnings.simplefilter("error", UserWarning)
                ready = make(load.horizon, setting)
                ready.run()
                middle = perf_counter()
                result = ready.run()
                first = perf_counter() - middle
                end = ready.read(result)
        except InputError as refusal:
            refused.append(Refusal(load, contender.name, named, str(refusal)))
            continue
        except (UserWarning, ValueError, ArithmeticError, RuntimeError) as failure:
            reason = f"{type(failure).__name__}: {' '.join(str(failure).split())}"
            refused.append(Refusal(load, contender.name, setting, reason))
            continue
        preparing += max(0.0, middle - begin - first)
        spent += first
        before, last = last, first
        error = error_of(end, truth)
        if error is None and end.has_result:
            end = not_finite()
        errors.append(error)
        counted = None if error is None else end.evaluations
        note = "" if end.ended == "complete" else end.ended
        name, kind = contender.name, contender.setting
        entries.append((ready, Row(load, name, kind, named, None, error, counted, note)))
        if kind == "steps" and _at_rounding(errors):
            break
    return entries, preparing


def _at_rounding(errors: Sequence[float | None]) -> bool:
    """Whether smaller steps no longer help: three times in a row nothing was gained."""
    known = [error for error in errors if error is not None]
    return len(known) > 3 and min(known[-3:]) >= min(known[:-3]) and min(known) < 1e-10
