"""Comparison of methods with the true solution, and limits of their errors.

Errors and limits of omega are relative to its largest component; of the attitude, they are angles
(rad).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pyharness.checks.check import REFUSED, Check, Name
from pyharness.checks.compare.candidates import Candidate, End, method_candidate
from pyharness.checks.theory.conditioning import FLOW, LIVELY, Conditioning, conditioning_at
from pyharness.engine.system.kernel_input import closed_form
from pyharness.model.attitude import angle_between
from pyharness.model.basis import Basis
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.bounded import ErrorBound, bound_of
from pyharness.truth.reference import Reference, reference

# Relative error above which the linearised flow does not predict the error.
LINEAR = 0.01
# Largest possible difference of two vectors, relative to the largest omega.
MOST = 2.0


@dataclass(frozen=True, eq=False)
class Answer:
    """A method's results at all times or at the last time, or its refusal."""

    omega: Array = field(default_factory=lambda: np.empty((0, 3)))  # shape (n, 3), rad/s
    attitude: Array | None = None  # quaternions, shape (n, 4), if requested
    ended: str = "complete"
    steps: int = 0
    evaluations: int | None = None  # of right-hand sides, if counted
    refusal: str = ""  # why the method refused the scene, if it did
    is_whole: bool = True  # reached the last time, with all results


def of_end(method: str, end: End) -> Answer:
    if end.is_refused:
        return Answer(refusal=f"{method}: {end.ended}")
    attitude = None if end.attitude is None else end.attitude[None, :]
    found = end.omega[None, :], attitude, end.ended, end.steps, end.evaluations
    return Answer(*found, is_whole=end.has_result)


@dataclass(frozen=True, eq=False)
class MethodRun:
    """A deferred run of a method on a scene."""

    method: str
    tolerance: float | None  # None for a fixed step
    scene: Scene
    ask: Callable[[], Answer]

    @cached_property
    def answer(self) -> Answer:
        try:
            return self.ask()
        except InputError as refusal:
            return Answer(refusal=str(refusal))


def by_rows(method: str, tolerance: float, scene: Scene, times: Sequence[float]) -> MethodRun:
    """Return a deferred run of a method that returns its results at all `times` (s)."""
    candidate = method_candidate(method, tolerance)

    def ask() -> Answer:
        run = candidate.rows(scene, list(times))
        has_rows = run.has_all_rows and run.time.tolist() == list(times)
        if has_rows and (run.attitude is None) == (scene.attitude is None):
            return Answer(run.omega, run.attitude, run.ended)
        return Answer(ended=f"{run.ended}, other rows than requested", is_whole=False)

    return MethodRun(method, tolerance, scene, ask)


def by_end(
    method: str, candidate: Candidate, tolerance: float, scene: Scene, time: float
) -> MethodRun:
    """Return a deferred run of a candidate to `time` (s), with limits as for `method`."""
    return MethodRun(method, tolerance, scene, lambda: of_end(method, candidate.end(scene, time)))


@dataclass(frozen=True, eq=False)
class Truth:
    """The true solution of a scene at some times, and the error amplification until the last."""

    time: Array  # shape (n,), s
    omega: Array  # shape (n, 3), rad/s
    error: float  # bound on the error of each component of omega, rad/s
    flow: Conditioning
    attitude: Array | None = None  # shape (n, 4), quaternions to compare instead of omega
    angle_error: float = 0.0  # bound on the error of the attitude, rad
    is_signed: bool = False  # whether the sign of a quaternion counts
    data: float = 0.0  # change of omega by rounding A, B and C, relative to the largest omega
    exact: bool = False  # whether `omega` is from the torque-free closed form, with known `data`
    # Scene, solution and factor on the work limit, if `omega` is from the reference.
    scene: Scene | None = None
    reference: Reference | None = None
    effort: float | None = None

    @cached_property
    def bound(self) -> ErrorBound | None:
        """The error bound of the reference, relative or in rad; None without a reference."""
        if self.scene is None or self.reference is None:
            return None
        bound = bound_of(self.scene, self.reference, any_torque=True, effort=self.effort)
        return bound.turned or bound.over(self.flow.largest)

    @property
    def end(self) -> float:
        return float(self.time[-1])

    @property
    def relative_error(self) -> float:
        return self.error / (self.flow.largest or 1.0)

    def error_of(self, answer: Answer) -> float:
        """Return an answer's largest error: attitude's (rad) if known, else omega's (relative)."""
        if self.attitude is None:
            difference = float(np.abs(answer.omega - self.omega[-len(answer.omega) :]).max())
            if self.flow.largest == 0.0:
                return 0.0 if difference == 0.0 else math.inf
            return difference / self.flow.largest
        assert answer.attitude is not None
        wanted = self.attitude[-len(answer.attitude) :]
        if self.is_signed:
            return 2.0 * max(float(np.linalg.norm(row)) for row in answer.attitude - wanted)
        return float(angle_between(answer.attitude, wanted).max())


def unknown_flow(largest: float) -> Conditioning:
    """Return a conditioning of unknown, so infinite, amplification; `largest` is in rad/s."""
    return Conditioning(math.inf, MOST, MOST, MOST, largest)


def reference_truth(
    scene: Scene,
    times: Sequence[float],
    effort: float | None = None,
    flow: Conditioning | None = None,
) -> Truth:
    flow = flow or conditioning_at(scene, times)
    # For an amplification above 1e3, the usual reference's step errors of 1e-22 are too large.
    known = reference(scene, times, precise=flow.amplification > 1e3, effort=effort)
    if len(known.time) < len(times):
        raise InputError("the solution grows without bound")
    return Truth(
        known.time, known.omega, known.error, flow, known.attitude, known.angle_error,
        scene=scene, reference=known, effort=effort,
    )  # fmt: skip


@dataclass(frozen=True)
class Policy:
    """A rule for judging methods: their error limits and permitted refusals."""

    limit: Callable[[Truth, MethodRun], float | None]
    basis: Basis
    may_refuse: Callable[[MethodRun, Truth, str], bool] = lambda *_: False


def allowed(truth: Truth, made: float, growth: float, steps: float = 0.0) -> float:
    """Return a limit: the steps' errors `made` times `growth`, plus rounding and the truth's error.

    `steps` counts uncompensated roundings of omega.
    """
    if truth.attitude is not None:
        return truth.flow.angle_limit(made * growth, truth.end) + truth.angle_error
    return replace(truth.flow, amplification=growth).limit(made, steps) + truth.relative_error


def lively(growth: float) -> float:
    """Return the error amplification `growth` if it exceeds LIVELY, else 1."""
    return growth if growth > LIVELY else 1.0


def linear(limit: float) -> float:
    """Return `limit`, or infinity if it exceeds 0.01, where linearised equations fail."""
    return limit if limit <= LINEAR else math.inf


def tolerance_of(tried: MethodRun) -> float:
    assert tried.tolerance is not None
    return tried.tolerance


def has_no_form(tried: MethodRun, truth: Truth, why: str) -> bool:
    """Return whether `closed-form` or `quick` refused a scene for which it has no formula."""
    if tried.method == "quick":
        return why == "quick: refused" and not all(tried.scene.euler_coefficients)
    return tried.method == "closed-form" and closed_form(tried.scene) is None


def _granting(factor: Callable[[float], float]) -> Callable[[Truth, MethodRun], float]:
    def limit(truth: Truth, tried: MethodRun) -> float:
        return allowed(truth, tolerance_of(tried), factor(truth.flow.amplification))

    return limit


AS_STATED = Policy(_granting(lambda growth: 1.0), FLOW, has_no_form)
"""Policy whose limit is the tolerance, plus rounding amplified by the flow."""
IF_CALM = Policy(_granting(lively), FLOW)
"""Policy whose limit is the tolerance, plus rounding amplified by the flow.

The tolerance is amplified too if the error amplification exceeds `LIVELY`.
"""
AMPLIFIED = Policy(_granting(lambda growth: growth), FLOW)
"""Policy whose limit is the tolerance plus rounding, both amplified by the flow."""


def judge(name: Name, tried: MethodRun, truth: Truth, policy: Policy) -> Check:
    """Return the check that a method's error is within its limit, or its refusal permitted."""
    answer = tried.answer
    if why := answer.refusal:
        return name.judged(policy.may_refuse(tried, truth, why), f"{REFUSED}{why}")
    if tried.method == "closed-form" and closed_form(tried.scene) is None:
        return name.judged(False, "solved what has no closed form")
    limit = policy.limit(truth, tried)
    error, note = (truth.error_of(answer), "") if answer.is_whole else (math.inf, answer.ended)
    bound = None if limit is None or math.isinf(limit) else limit
    if bound is None and math.isfinite(error):
        check = name.described(error, "" if limit is None else "the flow leaves no two digits")
    else:
        check = name.bounded(error, MOST if bound is None else bound, policy.basis, note)
    return replace(check, reference_bound=lambda: truth.bound)
