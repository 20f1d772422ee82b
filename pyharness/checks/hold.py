"""Methods and programs against the truth on one scene, each within a bound derived beforehand."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, partial

import numpy as np

from pyharness.checks.check import Check
from pyharness.checks.stress import LISTINGS, Attempt, bounded, described, replay
from pyharness.compare.candidates import Candidate, End, called, solved, unstopped
from pyharness.methods.plan import FEW_DIGITS
from pyharness.methods.problem import closed_form
from pyharness.methods.registry import FIXED_STEP, GAUSS, METHODS
from pyharness.model.errors import InputError
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.theory import promises
from pyharness.theory.conditioning import ROUNDING, Conditioning, conditioning
from pyharness.theory.promises import may_refuse
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import reference

# Ours at two tolerances: near the finest, where rounding shows, and a middling one.
OURS = ("closed-form", "taylor", "gauss-2", "gauss-4", "gauss-8")
ALL = promises.METHODS
MIDDLING = 1e-6
# At their finest these take minutes for what the others do in seconds.
_ONLY_MIDDLING = ("quick", "rk45", "radau")

# Beyond it the linearised flow says little: only what the motion conserves is held.
LINEAR = 0.01
_ROWS = 10  # of a program's run that are held against the truth


@dataclass(frozen=True, eq=False)
class Truth:
    """The solution of a scene at one time (s), and what the flow makes of small errors until then.

    Attributes
    ----------
    omega, error : ndarray of shape (3,), float
        And of any omega (rad/s).
    data : float
        What the rounding of A, B and C changes, over the largest abs(omega) on the way.
    exact : bool
        Whether there is no torque, so that `data` and what the motion conserves are known.
    """

    time: float
    omega: np.ndarray
    error: float
    flow: Conditioning
    data: float = 0.0
    exact: bool = False

    def wrong(self, end: End) -> float:
        """Return the error of an end, over the largest omega; infinite of one without a result."""
        if not end.has_result:
            return math.inf
        return float(np.abs(end.omega - self.omega).max()) / self.flow.largest


def truth_of(scene: Scene, time: float, flow: Conditioning | None = None) -> Truth:
    """Return the truth at `time` (s); the flow's conditioning, where it is known, as given."""
    flow = flow or conditioning(scene, time)
    if _is_free(scene):
        exact = torque_free(scene, time)
        held = torque_free(scene, time, rounded=True)
        data = max(float(abs(x - y)) for x, y in zip(exact, held, strict=True)) / flow.largest
        omega = np.array([float(x) for x in exact])
        return Truth(time, omega, ROUNDING * float(np.abs(omega).max()), flow, data, True)
    # The reference's steps have 1e-22 each: where the flow amplifies more, more digits.
    known = reference(scene, [time], precise=flow.amplification > 1e3)
    return Truth(time, known.omega[-1], known.error, flow)


def _is_free(scene: Scene) -> bool:
    return scene.torque.is_zero and scene.moments is not None


# What makes checks of one method: id, scene, truth, name, tolerance (None in the scene's steps).
Held = Callable[[Scene, Truth, str, float | None, str], Iterable[Check]]
Circumstances = Iterable[tuple[str, Scene, float]]


def hold_all(circumstances: Circumstances) -> Iterator[Attempt]:
    """Hold all methods against the truth in each circumstance, and describe the programs."""
    for circumstance, scene, time in circumstances:
        yield from hold(circumstance, scene, time)
        yield from describe_programs(circumstance, scene)


def hold(
    circumstance: str,
    scene: Scene,
    time: float,
    methods: Sequence[str] = ALL,
    truth: Callable[[Scene, float], Truth] = truth_of,
    tolerances: Callable[[str, Scene, Truth], Sequence[float | None]] | None = None,
    held: Held | None = None,
) -> Iterator[Attempt]:
    """Hold each method against the truth at `time`: by default at two tolerances, fine and coarse.

    The limit is what the method promises to be wrong by on the way, amplified by the flow;
    rounding amplified likewise; and what the truth itself may be wrong by. Where no more than two
    digits are left it says nothing. What a torque-free motion conserves is held always: the flow
    does not amplify it. A method that refuses a scene which it has to take fails.
    """
    known = cache(partial(truth, scene, time))

    def settings(name: str, id: str) -> Iterator[Attempt]:
        for tolerance in (tolerances or _tolerances)(name, scene, known()):
            setting = "steps" if tolerance is None else f"{tolerance:.0e}"
            make = partial(held or _held, scene, known(), name, tolerance)
            yield Attempt(setting, make, scene)

    for name in methods:
        yield Attempt(f"{name}/{circumstance}", partial(settings, name))


def attempt(id: str, name: str, scene: Scene, time: float, run: Callable[[], End]) -> End | Check:
    """Return what a method made of a scene, or the check of its refusal.

    It may refuse no more than `may_refuse` tells.
    """
    try:
        end = run()
    except InputError as refusal:
        why = str(refusal)
    else:
        if not end.is_refused:
            return end
        why = f"{name}: {end.ended}"
    return Check(id, may_refuse(name, scene, time), None, None, replay(id), f"refused: {why}")


def finest_and_middling(name: str, scene: Scene, time: float) -> list[float]:
    """Return the tolerances at which a method is tried: its finest, and one in the middle."""
    if name in _ONLY_MIDDLING:
        return [MIDDLING]
    finest = promises.finest(name, scene, time)
    return sorted({finest, max(finest, MIDDLING)})


def _tolerances(name: str, scene: Scene, truth: Truth) -> list[float | None]:
    """Return the tolerances at which a method is tried, None for the scene's own steps."""
    if name in FIXED_STEP:
        return [None]
    if name == "closed-form" or (name == "auto" and closed_form(scene)):
        return [METHODS["closed-form"].finest]
    flow = truth.flow
    least = FEW_DIGITS if name == "quick" else promises.finest(name, scene, truth.time)
    if name in GAUSS:
        # Two solutions that are to agree can't where rounding parts them: the next of the ladder.
        meetable = [each for each in promises.LADDER if each >= 4.0 * flow.rounding]
        least = max(least, min(meetable, default=math.inf))
    radians = promises.speed(scene, flow.largest) * abs(truth.time)
    found = promises.tolerances(name, least, radians, flow.amplification)
    return [*found, None] if name in GAUSS else [*found]


def run_method(name: str, scene: Scene, time: float, tolerance: float | None) -> End:
    """Run a method; in the scene's steps where the tolerance is None; InputError on refusal."""
    if name in ("auto", "quick") or tolerance is None:
        return called(name, tolerance or 1.0).end(scene, time)
    return solved(name, tolerance).end(scene, time)


def _steps(scene: Scene, time: float) -> int:
    return max(1, math.ceil(abs(time) / scene.step_size * (1.0 - 1e-6)))


def _held(
    scene: Scene, truth: Truth, name: str, tolerance: float | None, id: str
) -> Iterator[Check]:
    flow = truth.flow
    error_id = f"{id}/error"
    run = attempt(
        error_id, name, scene, truth.time, partial(run_method, name, scene, truth.time, tolerance)
    )
    if isinstance(run, Check):
        yield run
        return
    complete = run.has_result
    # The steps after which the method rounds omega and forgets what it took off.
    if tolerance is None:
        rounded = 0.0 if name in GAUSS else float(_steps(scene, truth.time))
    elif name == "auto":
        rounded = float(run.steps)
    else:
        rounded = promises.steps_of(name, run.steps, run.evaluations or 0)
    error = truth.wrong(run)
    note = "" if complete else run.ended
    made = made_on_the_way(name, scene, truth, tolerance)
    if truth.exact and (name == "closed-form" or name == "auto"):
        # It makes no errors on the way: beside its own there is the rounding of A, B and C.
        limit = (made or 0.0) + truth.data + truth.error / flow.largest
    elif made is None:
        # It claims no error in steps of this size, only that it conserves.
        limit = math.inf
    else:
        limit = flow.limit(made, rounded) + truth.error / flow.largest
        if limit > LINEAR:
            limit, note = math.inf, note or "the flow leaves no two digits"
    if limit < math.inf or math.isnan(error) or not complete:
        yield bounded(error_id, error, min(2.0, limit), note)
    else:
        yield described(error_id, error, note)
    if truth.exact and complete:
        lost = flow.unamplified + rounded * ROUNDING
        if made is None:
            # Each step rounds omega, its sums, and the last iteration.
            lost += 4.0 * ROUNDING * _steps(scene, truth.time)
        total = (made or 0.0) + lost
        # An error of omega changes what is conserved by no more than itself.
        most = min(limit, total + total * total)
        yield bounded(f"{id}/drift", conserved(scene, run.omega, flow.largest), most)


def made_on_the_way(name: str, scene: Scene, truth: Truth, tolerance: float | None) -> float | None:
    """Return the sum of the errors that a method promises to make, over the largest omega.

    None where it promises none.
    """
    if name in FIXED_STEP and truth.exact:
        radians = promises.speed(scene, truth.flow.largest) * abs(truth.time)
        steps = _steps(scene, truth.time)
        return promises.fixed_step_sum(name, radians / steps, steps)
    return tolerance


def conserved(scene: Scene, omega: np.ndarray, largest: float) -> float:
    """Return how wrong omega must be, over `largest`, for energy and momentum to be as they are.

    An error e of every omega changes sum q w**2 by at most 2 e sum q abs(w): no less than e is
    needed to change it by as much as was found.
    """
    assert scene.moments is not None
    if not np.isfinite(omega).all():
        return math.inf
    worst = Fraction(0)
    big = Fraction(largest)
    for power in (1, 2):
        weights = np.array([Fraction(moment) ** power for moment in scene.moments])
        before, after = (
            np.array([Fraction(float(w)) for w in each]) for each in (scene.omega, omega)
        )
        change = abs(weights @ after**2 - weights @ before**2)
        slope = max(weights @ abs(before), weights @ abs(after))
        if change:
            worst = max(worst, change / (2 * slope * big))
    return float(worst)


def describe_programs(circumstance: str, scene: Scene) -> Iterator[Attempt]:
    """Say how far the programs, original and corrected, are from the truth over their steps."""
    every = max(1, scene.steps // _ROWS)
    rows = slice(every - 1, None, every)

    @cache
    def wanted() -> Array:
        times = scene.times()[rows]
        if _is_free(scene):
            return np.array([[float(x) for x in torque_free(scene, t)] for t in times])
        return reference(scene, times).omega

    def describe(candidate: Candidate, id: str) -> Iterator[Check]:
        run = candidate.rows(scene)
        scale = float(np.abs(wanted()).max(initial=max(map(abs, scene.omega)))) or 1.0
        error = apart(run.omega[rows], wanted()) / scale if len(run.omega[rows]) else None
        note = "" if run.ended == "complete" else f"{run.ended} after {run.steps} steps"
        yield described(id, error, note)

    for listing in LISTINGS:
        name = f"{listing.program}/{circumstance}/{listing.label}"
        yield Attempt(name, partial(describe, unstopped(listing)), scene)


def apart(found: Array, wanted: Array) -> float:
    """Return the largest difference of the rows that both have."""
    n = min(len(found), len(wanted))
    return float(np.abs(found[:n] - wanted[:n]).max(initial=0.0))


def in_steps(scene: Scene, time: float) -> Scene:
    """Return the scene with equal steps until `time` (s), each of .002 radians if not too many."""
    rate = promises.speed(scene, max(map(abs, scene.omega)))
    count = max(10, min(20_000, math.ceil(rate * abs(time) / 0.002)))
    return replace(scene, step_size=abs(time) / count, steps=count)
