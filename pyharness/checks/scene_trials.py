"""Stress trials of a user's scene against the reference and against transformed scenes.

The torque may be any whose arithmetic can be recorded.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from pyharness.checks.check import BITS, REFUSED, Attempt, Attempts, Check, Name
from pyharness.checks.judge import MethodRun, Truth, by_rows, judge, reference_truth
from pyharness.checks.methods import in_few_steps, order_if_seen
from pyharness.checks.random_methods import TORQUE_POLICY
from pyharness.checks.stress import Trial, named
from pyharness.checks.theory.conditioning import FLOW, conditioning_at
from pyharness.checks.tolerances import MIDDLING
from pyharness.checks.trials.threads import BOUND, THREADS, TITLE, Job, different
from pyharness.engine.plan.registry import (
    FIXED_STEP,
    GAUSS,
    METHODS,
    SCIPY_METHODS,
    check_attitude,
    check_torque,
)
from pyharness.engine.problem.rotated import axes_of, restarted_at, rotated
from pyharness.engine.solve import solve
from pyharness.engine.system.kernel_input import closed_form
from pyharness.engine.system.recorded import system_of
from pyharness.model.attitude import angle_between, product, quaternion_of_axes
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene, Triple
from pyharness.model.state_torque import StateTorque
from pyharness.model.trajectory import Array
from pyharness.truth.reference import reference

_METHODS = ("auto", "taylor", "gauss-4", "gauss-8", *SCIPY_METHODS)
# Methods that run at their finest tolerance too; others would take too long.
_FINE = ("auto", "taylor", "closed-form")
_PARTS = (0.125, 0.25, 0.5, 1.0)  # fractions of the last time
_CUT = 0.37  # fraction of the last time at which a motion is divided
_REPEATS = 4

Attempting = Callable[[Scene, Name], Attempts]
# Omega (rad/s), shape (3,), and attitude, shape (4,), or None.
State = tuple[Array, Array | None]


def scene_trials(scene: Scene, options: str) -> dict[str, Trial]:
    """Return a scene's trials by name; the command that repeats them ends with `options`."""
    if isinstance(scene.torque, StateTorque):
        system_of(scene)  # raises InputError for an opaque torque
        if scene.torque.needs_attitude and scene.attitude is None:
            raise InputError(
                "the torque depends on the attitude, and the scene has none; give [initial] "
                "attitude"
            )
    else:
        # Gauss collocation computes no attitude under a torque law.
        scene = replace(scene, attitude=None)
    made: dict[str, tuple[str, str, Attempting]] = {
        "length": (
            "errors after an eighth, a quarter, half and all of the scene's time",
            "The tolerance, plus 2e-15 K where K is the error amplification. The tolerance is "
            "multiplied by K if K exceeds 1000.",
            _length,
        ),
        "step-size": (
            "order of the methods with a fixed step",
            "The measured order may be .2 smaller than the theoretical one. The order is not "
            "judged if the torque has a table.",
            _step_size,
        ),
        "invariance": (
            "motions forward and back, in two pieces, and with permuted axes",
            "The tolerance and rounding errors of each solution, amplified by the rest of the "
            "motion.",
            _invariance,
        ),
        "threads": (TITLE, BOUND, _threads),
    }
    if not any(_takes(method, scene) for method in FIXED_STEP):
        del made["step-size"]

    def trial(name: str, title: str, bound: str, attempts: Attempting) -> Trial:
        own = named(name, scene=scene, options=options)
        return Trial(name, title, bound, lambda only: attempts(scene, own))

    return {name: trial(name, *told) for name, told in made.items()}


def _last(scene: Scene) -> float:
    return scene.step_size * scene.steps


def _tried(scene: Scene) -> Iterator[tuple[str, float]]:
    for method in (*_METHODS, *(["closed-form"] if closed_form(scene) else [])):
        if _takes(method, scene):
            yield method, max(MIDDLING, METHODS[method].finest)
            if method in _FINE:
                yield method, METHODS[method].finest


def _takes(method: str, scene: Scene) -> bool:
    try:
        check_torque(scene, method, attitude=True)
        if scene.attitude is not None:
            check_attitude(method)
    except InputError:
        return False
    return True


def _length(scene: Scene, name: Name) -> Iterator[Attempt]:
    for part in _PARTS:
        times = (part * _last(scene),)
        truth = cache(partial(reference_truth, scene, times, 1.0))
        for method, tolerance in _tried(scene):
            setting = f"{tolerance:.0e}"
            own = replace(name, subject=method, circumstance=f"{part:g}", setting=setting)
            run = partial(by_rows, method, tolerance, scene, times)
            yield Attempt(own, partial(_errors, run, truth))


def _errors(tried: Callable[[], MethodRun], truth: Callable[[], Truth], name: Name) -> list[Check]:
    run, exact = tried(), truth()
    truths = {"omega": replace(exact, attitude=None)}
    truths |= {} if exact.attitude is None else {"angle": exact}
    return [judge(name.with_quantity(x), run, y, TORQUE_POLICY) for x, y in truths.items()]


def _step_size(scene: Scene, name: Name) -> Iterator[Attempt]:
    coarse = in_few_steps(scene, _last(scene))
    truth = cache(partial(reference, coarse, coarse.times()))
    for method in FIXED_STEP:
        yield Attempt(replace(name, subject=method), partial(order_if_seen, coarse, truth))


def _invariance(scene: Scene, name: Name) -> Iterator[Attempt]:
    ways = {"axes": _permuted, "back": _back, "split": _split}
    for method, tolerance in _tried(scene):
        for way, make in ways.items():
            own = replace(name, subject=method, circumstance=way, setting=f"{tolerance:.0e}")
            yield Attempt(own, partial(_compared, scene, tolerance, make))


# Returns, from a scene, a method and a tolerance, two states that must agree, and a bound on their
# relative difference.
Way = Callable[[Scene, str, float], tuple[State, State, float]]


def _compared(scene: Scene, tolerance: float, make: Way, name: Name) -> Check:
    try:
        first, second, limit = make(scene, name.subject, tolerance)
    except InputError as refusal:
        is_slow = name.subject in (*SCIPY_METHODS, *GAUSS)
        return name.judged(is_slow, f"{REFUSED}{refusal}")
    scale = max(float(np.abs(x).max()) for x in (first[0], second[0], scene.omega)) or 1.0
    apart = float(np.abs(first[0] - second[0]).max()) / scale
    if first[1] is not None and second[1] is not None:
        apart = max(apart, float(angle_between(first[1][None, :], second[1][None, :]).max()))
    return name.bounded(apart, limit, FLOW)


def _end(scene: Scene, time: float, method: str, tolerance: float) -> State:
    found = solve(scene, time, method, tolerance, attitude=scene.attitude is not None)
    if not found.has_all_rows:
        raise InputError(f"{method}: {found.ended} before t = {time:g} s")
    return found.omega[0], None if found.attitude is None else found.attitude[0]


def _from(scene: Scene, state: State, time: float) -> Scene:
    omega, attitude = state
    return restarted_at(scene, omega, time, None if attitude is None else attitude.tolist())


def _permuted(scene: Scene, method: str, tolerance: float) -> tuple[State, State, float]:
    def turn(v: Triple) -> Triple:
        return v[1], v[2], v[0]

    time, axes = _last(scene), axes_of(turn)
    w, x, y, z = quaternion_of_axes(axes)
    other = rotated(scene, turn, body=True)
    if scene.coefficients is not None:
        other = replace(other, coefficients=turn(scene.coefficients))
    if scene.attitude is not None:
        other = replace(other, attitude=product(scene.attitude, (w, x, y, z)))
    omega, attitude = _end(other, time, method, tolerance)
    if attitude is not None:
        attitude = np.array(product(attitude.tolist(), (w, -x, -y, -z)))
    limit = 2.0 * conditioning_at(scene, [time]).limit(tolerance)
    return _end(scene, time, method, tolerance), (axes @ omega, attitude), limit


def _back(scene: Scene, method: str, tolerance: float) -> tuple[State, State, float]:
    time = _last(scene)
    there = _end(scene, time, method, tolerance)
    start = _from(scene, there, time)
    again = _end(start, -time, method, tolerance)
    back = conditioning_at(start, [-time])
    # The forward run's error is an initial error of the backward run.
    limit = conditioning_at(scene, [time]).limit(tolerance) * back.amplification
    limit += back.limit(tolerance)
    attitude = None if scene.attitude is None else np.array(scene.attitude)
    return (np.array(scene.omega), attitude), again, limit


def _split(scene: Scene, method: str, tolerance: float) -> tuple[State, State, float]:
    time = _last(scene)
    cut = _CUT * time
    middle = _from(scene, _end(scene, cut, method, tolerance), cut)
    rest = conditioning_at(middle, [time - cut])
    limit = conditioning_at(scene, [time]).limit(tolerance) + rest.limit(tolerance)
    limit += conditioning_at(scene, [cut]).limit(tolerance) * rest.amplification
    whole = _end(scene, time, method, tolerance)
    return whole, _end(middle, time - cut, method, tolerance), limit


def _threads(scene: Scene, name: Name) -> Iterator[Attempt]:
    for method in dict.fromkeys(method for method, _ in _tried(scene)):
        job = Job(method, scene, partial(_bits, scene, method))
        yield Attempt(replace(name, subject=method), partial(_same, job))


def _bits(scene: Scene, method: str) -> bytes:
    tolerance = max(MIDDLING, METHODS[method].finest)
    omega, attitude = _end(scene, _last(scene), method, tolerance)
    return omega.tobytes() + (b"" if attitude is None else attitude.tobytes())


def _same(job: Job, name: Name) -> Check:
    wrong = different([job], repeats=_REPEATS)
    return name.bounded(len(wrong), 0.0, BITS, f"{_REPEATS} calls in {THREADS} threads")
