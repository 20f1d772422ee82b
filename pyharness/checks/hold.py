"""Checks of methods against a scene's true solution, within bounds derived beforehand.

Errors of the thesis's programs are reported without a bound. `auto`, `quick` and methods without a
tolerance run as prepared solvers.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache, partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.compare.candidates import (
    Candidate,
    End,
    method_candidate,
    prepared_candidate,
    unstopped,
)
from pyharness.checks.judge import (
    MOST,
    MethodRun,
    Policy,
    Truth,
    allowed,
    judge,
    linear,
    of_end,
    reference_truth,
)
from pyharness.checks.scenes.extreme import EXTREMES, Circumstance, speed
from pyharness.checks.stress import LISTINGS, named
from pyharness.checks.theory.conditioning import ROUNDING, Conditioning, conditioning
from pyharness.checks.theory.schemes import SCHEMES, Series, constant
from pyharness.checks.tolerances import affordable
from pyharness.engine.plan.registry import FIXED_STEP, GAUSS, PREPARED, REGISTRY, SCIPY_METHODS
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.basis import Basis
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import reference

STEPS = Basis(
    "derived",
    "error of omega, energy and momentum: promised errors of all steps, and rounding errors, with "
    "the error amplification",
    "the tolerance, or a majorant series for fixed steps (`checks/hold.py`); first-order "
    "perturbations (`theory/conditioning.py`)",
)
"""Basis of limits from the steps' promised errors."""


# Methods that run at two tolerances: a medium one, and one near the finest, where rounding shows.
OURS = ("closed-form", "taylor", "gauss-2", "gauss-4", "gauss-8")
ALL = (*PREPARED, *SCIPY_METHODS)
_SERIES = ("taylor", "auto", "prepared-auto")
_TOO_MANY_RADIANS = 1e8  # phase of a torque wave beyond which a Taylor series may refuse
_ROWS = 10  # rows of a program's run compared with the true solution
FORMS = ("closed-form", "auto")


@cache
def _series(name: str) -> tuple[float, ...]:
    """Return a method's y after a step of y' = y**2, y(0) = 1, as a power series in the step."""
    # With A = B = C = 1 and equal components, each of Euler's equations is y' = y**2.
    ones = np.ones(3)
    equal = Scene("equal", (1.0, 1.0, 1.0), coefficients=(1.0, 1.0, 1.0))
    found = SCHEMES[name].scheme(Series(equal), constant(ones))[:, 0]
    return tuple(found.tolist())


def truth_of(scene: Scene, time: float, flow: Conditioning | None = None) -> Truth:
    """Return the true omega at `time` (s), by elliptic functions if torque-free."""
    flow = flow or conditioning(scene, time)
    if not _is_free(scene):
        return reference_truth(scene, [time], flow=flow)
    exact = torque_free(scene, time)
    held = torque_free(scene, time, rounded=True)
    data = max(float(abs(x - y)) for x, y in zip(exact, held, strict=True)) / flow.largest
    omega = np.array([[float(x) for x in exact]])
    error = ROUNDING * float(np.abs(omega).max())
    return Truth(np.array([time]), omega, error, flow, data=data, exact=True)


def _is_free(scene: Scene) -> bool:
    return scene.torque.is_zero and scene.moments is not None


# Returns the checks of a method from the true solution, a tolerance (None for the scene's step
# size) and the checks' name.
Judged = Callable[[Truth, float | None, Name], Iterable[Check]]


def check_all(
    suite: str,
    checks: Callable[[Name, float], Iterable[Attempt]] | None = None,
    has_programs: Callable[[Circumstance], bool] = lambda each: True,
) -> Iterator[Attempt]:
    for each in EXTREMES[suite]():
        name = named(suite, "", each.name, scene=each.scene)
        yield from (checks or check_methods)(name, each.time)
        if has_programs(each):
            yield from describe_programs(name)


def check_methods(
    name: Name,
    time: float,
    methods: Sequence[str] = ALL,
    truth: Callable[[Scene, float], Truth] = truth_of,
    tolerances: Callable[[str, Scene, float], Sequence[float | None]] | None = None,
    judged: Judged | None = None,
) -> Iterator[Attempt]:
    """Yield checks of each method's error at `time` (s) in the scene of `name`.

    The default limits are from `DERIVED`.
    """
    scene = scene_of(name)
    known = cache(partial(truth, scene, time))

    def settings(name: Name) -> Iterator[Attempt]:
        tried_at = tolerances or partial(affordable, flow=known().flow)
        for tolerance in tried_at(name.subject, scene, time):
            setting = "steps" if tolerance is None else f"{tolerance:.0e}"
            make = partial(judged or _judged, known(), tolerance)
            yield Attempt(replace(name, setting=setting), make)

    for method in methods:
        yield Attempt(replace(name, subject=method), settings)


def run_method(name: str, scene: Scene, time: float, tolerance: float | None) -> End:
    """Return the state at `time` (s); without a tolerance, by the scene's step size."""
    if name in ("auto", "quick") or tolerance is None:
        return prepared_candidate(name, tolerance or 1.0).end(scene, time)
    return method_candidate(name, tolerance).end(scene, time)


def _steps(scene: Scene, time: float) -> int:
    return max(1, math.ceil(abs(time) / scene.step_size * (1.0 - 1e-6)))


def refusable(tried: MethodRun, truth: Truth, why: str) -> bool:
    """Return whether the method in `tried` may refuse its scene."""
    method, scene = tried.method, tried.scene
    if method == "closed-form":
        return closed_form(scene) is None
    waves = scene.law.sines + scene.law.cosines
    radians = max((abs(frequency * truth.end) for _, frequency in waves), default=0.0)
    return method == "quick" or (method in _SERIES and radians > _TOO_MANY_RADIANS)


def _derived(truth: Truth, tried: MethodRun) -> float | None:
    """Return the limit of the relative error, or None if the steps' errors have no bound."""
    made = promised_sum(tried, truth)
    if truth.exact and tried.method in FORMS:
        # A closed form has no steps, only the rounding of A, B and C.
        return min(MOST, (made or 0.0) + truth.data + truth.relative_error)
    if made is None:
        # For a fixed step, no bound is known for Gauss collocation, or under a torque.
        return None
    growth, steps = truth.flow.amplification, _roundings(tried, truth)
    return linear(allowed(truth, made, growth, steps=steps))


DERIVED = Policy(_derived, STEPS, refusable)
"""Policy whose limit is a method's promised error plus rounding, amplified by the flow."""


def _roundings(tried: MethodRun, truth: Truth) -> float:
    """Return the number of uncompensated roundings of omega, estimated for SciPy's methods."""
    method, answer = tried.method, tried.answer
    if tried.tolerance is None:
        return 0.0 if method in GAUSS else float(_steps(tried.scene, truth.end))
    if method in SCIPY_METHODS:
        return (answer.evaluations or 0) / (1 if method == "lsoda" else 6)
    return float(answer.steps) if method in ("auto", "quick") else 0.0


def _judged(truth: Truth, tolerance: float | None, name: Name) -> Iterator[Check]:
    method, scene = name.subject, scene_of(name)
    ask = partial(run_method, method, scene, truth.end, tolerance)
    tried = MethodRun(method, tolerance, scene, lambda: of_end(method, ask()))
    yield judge(name.with_quantity("error"), tried, truth, DERIVED)
    answer = tried.answer
    if truth.exact and answer.is_whole and not answer.refusal:
        # Errors of energy and momentum are not amplified, so they always have a limit.
        made = promised_sum(tried, truth)
        lost = truth.flow.unamplified + _roundings(tried, truth) * ROUNDING
        if made is None:
            # In each step omega, its sums and the last iteration are rounded.
            lost += 4.0 * ROUNDING * _steps(scene, truth.end)
        total = (made or 0.0) + lost
        # The result of `conserved` is at most the error of omega.
        limit = DERIVED.limit(truth, tried)
        most = min(math.inf if limit is None else limit, total + total * total)
        found = conserved(scene, answer.omega[-1], truth.flow.largest)
        yield name.with_quantity("drift").bounded(found, most, DERIVED.basis)


def scene_of(name: Name) -> Scene:
    assert name.scene is not None
    return name.scene


def promised_sum(tried: MethodRun, truth: Truth) -> float | None:
    """Return a bound on the sum of the steps' errors, relative to the largest omega, or None."""
    method = tried.method
    if method not in FIXED_STEP or not truth.exact:
        return tried.tolerance
    steps = _steps(tried.scene, truth.end)
    angle = speed(tried.scene, truth.flow.largest) * abs(truth.end) / steps
    if angle >= 0.5:
        return math.inf
    order = REGISTRY[method].order
    own = sum(c * angle**k for k, c in enumerate(_series(method)) if k > order)
    return steps * (angle ** (order + 1) / (1.0 - angle) + own)


def conserved(scene: Scene, omega: np.ndarray, largest: float) -> float:
    """Return the least error of `omega`, relative to `largest`, that explains the drifts."""
    # The drifts are changes of energy and squared angular momentum since time 0.
    assert scene.moments is not None
    if not np.isfinite(omega).all():
        return math.inf
    # An error e changes a sum of q w**2, with q the moment or its square, by at most 2 e times the
    # sum of q abs(w).
    worst = Fraction(0)
    big = Fraction(largest)
    for power in (1, 2):
        weights = np.array([Fraction(moment) ** power for moment in scene.moments])
        before, after = np.vectorize(Fraction, otypes=[object])([scene.omega, omega])
        change = abs(weights @ after**2 - weights @ before**2)
        slope = max(weights @ abs(before), weights @ abs(after))
        if change:
            worst = max(worst, change / (2 * slope * big))
    return float(worst)


def describe_programs(name: Name) -> Iterator[Attempt]:
    """Yield the programs' largest relative errors, without limits."""
    scene = scene_of(name)
    every = max(1, scene.steps // _ROWS)
    rows = slice(every - 1, None, every)

    @cache
    def wanted() -> Array:
        times = scene.times()[rows]
        if _is_free(scene):
            return np.array([[float(x) for x in torque_free(scene, t)] for t in times])
        return reference(scene, times).omega

    def describe(candidate: Candidate, name: Name) -> Check:
        run = candidate.rows(scene)
        scale = float(np.abs(wanted()).max(initial=max(map(abs, scene.omega)))) or 1.0
        error = apart(run.omega[rows], wanted()) / scale if len(run.omega[rows]) else None
        note = "" if run.ended == "complete" else f"{run.ended} after {run.steps} steps"
        return name.described(error, note)

    for listing in LISTINGS:
        own = replace(name, subject=listing.program, setting=listing.label)
        yield Attempt(own, partial(describe, unstopped(listing)))


def apart(found: Array, wanted: Array) -> float:
    """Return the largest absolute difference over the rows that both arrays have."""
    n = min(len(found), len(wanted))
    return float(np.abs(found[:n] - wanted[:n]).max(initial=0.0))
