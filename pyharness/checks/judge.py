"""The one judgement: what a method makes of a scene, against the truth, by a named limit policy."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pyharness.checks.check import REFUSED, Check, Name
from pyharness.compare.candidates import Candidate, End, method_candidate
from pyharness.methods.problem import closed_form
from pyharness.model.attitude import angle_between
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.theory.conditioning import LIVELY, Conditioning, conditioning
from pyharness.truth.reference import reference

# Beyond it the linearised flow says little.
LINEAR = 0.01
# An error relative to the largest omega that says nothing.
MOST = 2.0


@dataclass(frozen=True, eq=False)
class Answer:
    """What a method made of a scene: rows for the last of the times, or why there are none."""

    omega: Array = field(default_factory=lambda: np.empty((0, 3)))  # shape (n, 3), rad/s
    attitude: Array | None = None  # shape (n, 4), where it was requested
    ended: str = "complete"
    steps: int = 0
    evaluations: int | None = None
    refusal: str = ""  # why the method would not solve the scene
    is_whole: bool = True  # whether it has every row


def of_end(method: str, end: End) -> Answer:
    """Return the answer of a call to one time; a prepared solver may refuse by its status."""
    if end.is_refused:
        return Answer(refusal=f"{method}: {end.ended}")
    attitude = None if end.attitude is None else end.attitude[None, :]
    rows, counts = end.omega[None, :], (end.steps, end.evaluations)
    return Answer(rows, attitude, end.ended, *counts, is_whole=end.has_result)


def of_rows(candidate: Candidate, scene: Scene, times: Sequence[float]) -> Answer:
    """Return the answer at all times; attitude too, where the scene has one."""
    run = candidate.rows(scene, list(times))
    has_rows = run.has_all_rows and run.time.tolist() == list(times)
    if has_rows and (run.attitude is None) == (scene.attitude is None):
        return Answer(run.omega, run.attitude, run.ended)
    return Answer(ended=f"{run.ended}, other rows than requested", is_whole=False)


@dataclass(frozen=True, eq=False)
class Tried:
    """A method that is tried on a scene; `tolerance` is None in the scene's own steps."""

    method: str
    tolerance: float | None
    scene: Scene
    ask: Callable[[], Answer]

    @cached_property
    def answer(self) -> Answer:
        """The answer, computed once; a refusal where the method refused by InputError."""
        try:
            return self.ask()
        except InputError as refusal:
            return Answer(refusal=str(refusal))


def by_rows(method: str, tolerance: float, scene: Scene, times: Sequence[float]) -> Tried:
    """Try a method of the registry at all times."""
    ask = method_candidate(method, tolerance)
    return Tried(method, tolerance, scene, lambda: of_rows(ask, scene, times))


def by_end(method: str, candidate: Candidate, tolerance: float, scene: Scene, time: float) -> Tried:
    """Try a candidate at one time (s)."""
    return Tried(method, tolerance, scene, lambda: of_end(method, candidate.end(scene, time)))


@dataclass(frozen=True, eq=False)
class Truth:
    """The solution of a scene at some times, and what the flow makes of small errors until then.

    Attributes
    ----------
    time, omega : ndarray of shape (n,) and (n, 3)
        s and rad/s.
    error : float
        Of any omega (rad/s).
    attitude, angle_error : ndarray of shape (n, 4) or None, float
        Where the attitude is judged, and its error (rad).
    is_signed : bool
        Whether the sign of a quaternion counts, which a rotation does not show.
    data : float
        What the rounding of A, B and C changes, over the largest abs(omega).
    exact : bool
        Whether there is no torque, so that `data` and what the motion conserves are known.
    """

    time: Array
    omega: Array
    error: float
    flow: Conditioning
    attitude: Array | None = None
    angle_error: float = 0.0
    is_signed: bool = False
    data: float = 0.0
    exact: bool = False

    @property
    def end(self) -> float:
        """The last time (s)."""
        return float(self.time[-1])

    @property
    def relative_error(self) -> float:
        """The error of any omega, over the largest."""
        return self.error / (self.flow.largest or 1.0)

    def error_of(self, answer: Answer) -> float:
        """Return the largest error of the rows: of the angle (rad), or of omega over the largest.

        NaN where one is.
        """
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
    """Return a flow that grants nothing of use, for closed forms: they need none."""
    return Conditioning(math.inf, MOST, MOST, MOST, largest)


def reference_truth(
    scene: Scene,
    times: Sequence[float],
    effort: float | None = None,
    flow: Conditioning | None = None,
) -> Truth:
    """Return the truth of the reference; InputError where there is none at all times."""
    flow = flow or conditioning(scene, times[-1])
    # The reference's steps are good to 1e-22: where the flow amplifies more, more is requested.
    known = reference(scene, times, precise=flow.amplification > 1e3, effort=effort)
    if len(known.time) < len(times):
        raise InputError("the solution leaves every bound")
    return Truth(known.time, known.omega, known.error, flow, known.attitude, known.angle_error)


@dataclass(frozen=True)
class Policy:
    """A limit policy: which error of an answer passes, and which refusal.

    Attributes
    ----------
    limit : callable
        The largest error of an answer, relative to the largest omega, or as an angle (rad).
        None where the method claims no error, infinite where the flow leaves no digits: then an
        error is described and not judged.
    may_refuse : callable
        Whether a refusal for a reason passes.
    """

    limit: Callable[[Truth, Tried], float | None]
    may_refuse: Callable[[Tried, Truth, str], bool] = lambda *_: False


def allowed(truth: Truth, made: float, growth: float, steps: float = 0.0) -> float:
    """Return the error that a policy allows, with the rounding of the flow and of the truth.

    `made` are the errors that a method makes in its steps, `growth` the factor granted to them,
    `steps` after how many omega is rounded.
    """
    if truth.attitude is not None:
        return truth.flow.angle_limit(made * growth, truth.end) + truth.angle_error
    return replace(truth.flow, amplification=growth).limit(made, steps) + truth.relative_error


def lively(growth: float) -> float:
    """Return the factor that is granted to a tolerance: none up to a growth of `LIVELY`."""
    return growth if growth > LIVELY else 1.0


def linear(limit: float) -> float:
    """Return a limit, infinite where the linearised flow leaves less than two digits."""
    return limit if limit <= LINEAR else math.inf


def tolerance_of(tried: Tried) -> float:
    """Return the tolerance of a method that has one."""
    assert tried.tolerance is not None
    return tried.tolerance


def has_no_form(tried: Tried, truth: Truth, why: str) -> bool:
    """Let a closed form refuse where there is none, and `quick` where a coefficient is 0."""
    if tried.method == "quick":
        # Its unknowns need three products.
        return why == "quick: refused" and not all(tried.scene.euler_coefficients)
    return tried.method == "closed-form" and closed_form(tried.scene) is None


def _granting(factor: Callable[[float], float]) -> Callable[[Truth, Tried], float]:
    """Return the limit that grants a tolerance a factor, from the amplification of the flow."""
    return lambda truth, tried: allowed(
        truth, tolerance_of(tried), factor(truth.flow.amplification)
    )


AS_STATED = Policy(_granting(lambda growth: 1.0), has_no_form)
"""The tolerance as it stands, and rounding amplified by the flow."""
IF_CALM = Policy(_granting(lively))
"""The tolerance, amplified where perturbations grow a thousandfold, and rounding."""
AMPLIFIED = Policy(_granting(lambda growth: growth))
"""The tolerance and rounding, both amplified by the flow."""


def judge(name: Name, tried: Tried, truth: Truth, policy: Policy) -> Check:
    """Return the check that a method's answer is as near to the truth as a policy wants.

    A closed form that solves what has none fails.
    """
    answer = tried.answer
    if answer.refusal:
        may = policy.may_refuse(tried, truth, answer.refusal)
        return name.judged(may, f"{REFUSED}{answer.refusal}")
    if tried.method == "closed-form" and closed_form(tried.scene) is None:
        return name.judged(False, "solved what has no closed form")
    limit = policy.limit(truth, tried)
    error = truth.error_of(answer) if answer.is_whole else math.inf
    note = "" if answer.is_whole else answer.ended
    bound = None if limit is None or math.isinf(limit) else limit
    if bound is None and math.isfinite(error):
        return name.described(error, "" if limit is None else "the flow leaves no two digits")
    return name.bounded(error, MOST if bound is None else bound, note)
