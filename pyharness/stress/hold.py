"""Methods and programs against the truth on one scene, each within a bound derived beforehand."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial

import numpy as np

from pyharness.compare.candidates import End, called, solved, unstopped
from pyharness.compare.checks import Check, bounded, described, may_hold, selected
from pyharness.methods.plan import FEW_DIGITS, closed_form
from pyharness.methods.registry import FIXED_STEP, GAUSS, METHODS
from pyharness.model.errors import InputError
from pyharness.model.listing import PROGRAMS, corrected, original
from pyharness.model.scene import Scene
from pyharness.stress.run import Outcome, replay
from pyharness.theory import promises
from pyharness.theory.conditioning import ROUNDING, Conditioning, conditioning
from pyharness.theory.promises import may_refuse
from pyharness.truth.elliptic import torque_free
from pyharness.truth.reference import Reference, reference

# Ours at two tolerances: near the finest, where rounding shows, and a middling one.
OURS = ("closed-form", "taylor", "gauss-2", "gauss-4", "gauss-8")
SCIPY = ("dop853", "lsoda")
ALL = promises.METHODS

# Beyond it the linearised flow says little: only what the motion conserves is held.
LINEAR = 0.01
_ROWS = 10  # of a program's run that are held against the truth


@dataclass(frozen=True, eq=False)
class Truth:
    """The solution of a scene at one time, and what the flow makes of small errors until then.

    Attributes
    ----------
    time : float
        s.
    omega : ndarray, shape (3,)
        rad/s.
    error : float
        Of any omega (rad/s).
    flow : Conditioning
        Until then.
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


def truth_of(scene: Scene, time: float, flow: Conditioning | None = None) -> Truth:
    """Return the truth at `time` (s); the flow's conditioning, where it is known, as given."""
    flow = flow or conditioning(scene, time)
    if scene.torque.is_zero and scene.moments is not None:
        exact = torque_free(scene, time)
        held = torque_free(scene, time, rounded=True)
        data = max(float(abs(x - y)) for x, y in zip(exact, held, strict=True)) / flow.largest
        omega = np.array([float(x) for x in exact])
        return Truth(time, omega, ROUNDING * float(np.abs(omega).max()), flow, data, True)
    # The reference's steps have 1e-22 each: where the flow amplifies more, more digits.
    known: Reference = reference(scene, [time], precise=flow.amplification > 1e3)
    return Truth(time, known.omega[-1], known.error, flow)


# What makes checks of one method: id, scene, truth, name, tolerance (None in the scene's steps).
Held = Callable[[str, Scene, Truth, str, float | None], Iterable[Check]]


def hold(
    trial: str,
    circumstance: str,
    scene: Scene,
    time: float,
    only: Sequence[str] = (),
    methods: Sequence[str] = (*OURS, *SCIPY),
    truth: Callable[[Scene, float], Truth] = truth_of,
    tolerances: Callable[[str, Scene, Truth], Sequence[float | None]] | None = None,
    held: Held | None = None,
) -> Iterator[Outcome]:
    """Hold each method against the truth at `time`: by default at two tolerances, fine and coarse.

    The limit is what the method promises to be wrong by on the way, amplified by the flow;
    rounding amplified likewise; and what the truth itself may be wrong by. Where no more than two
    digits are left it says nothing. What a torque-free motion conserves is held always: the flow
    does not amplify it. A method that refuses a scene which it has to take fails.
    """
    names = [m for m in methods if may_hold(f"{trial}/{m}/{circumstance}", only)]
    if not names:
        return
    known = truth(scene, time)
    for name in names:
        for tolerance in (tolerances or _tolerances)(name, scene, known):
            setting = "steps" if tolerance is None else f"{tolerance:.0e}"
            id = f"{trial}/{name}/{circumstance}/{setting}"
            if may_hold(id, only):
                for check in (held or _held)(id, scene, known, name, tolerance):
                    if selected(check.id, only):
                        yield Outcome(check, scene)


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


def _tolerances(name: str, scene: Scene, truth: Truth) -> list[float | None]:
    """Return the tolerances at which a method is tried, None for the scene's own steps."""
    if name in FIXED_STEP:
        return [None]
    if name == "closed-form" or (name == "auto" and closed_form(scene)):
        return [METHODS["closed-form"].finest]
    flow = truth.flow
    least = FEW_DIGITS if name == "quick" else promises.finest(name, scene, truth.time)
    if name in GAUSS:
        # Two solutions that are to agree can't where rounding parts them.
        least = max(least, _ceiling(4.0 * flow.rounding))
    radians = promises.speed(scene, flow.largest) * abs(truth.time)
    found = promises.tolerances(name, least, radians, flow.amplification)
    return [*found, None] if name in GAUSS else [*found]


def _ceiling(tolerance: float) -> float:
    """Return the tolerance of the ladder next above; infinite where there is none."""
    return min((each for each in promises.LADDER if each >= tolerance), default=math.inf)


def run_method(name: str, scene: Scene, time: float, tolerance: float | None) -> End:
    """Run a method; in the scene's steps where the tolerance is None; InputError on refusal."""
    if name in ("auto", "quick") or tolerance is None:
        return called(name, tolerance or 1.0).end(scene, time)
    return solved(name, tolerance).end(scene, time)


def _rounded(name: str, scene: Scene, time: float, tolerance: float | None, end: End) -> float:
    """Return the steps after which a method rounds omega and forgets what it took off."""
    if tolerance is None:
        return 0.0 if name in GAUSS else float(_steps(scene, time))
    if name == "auto":
        return float(end.steps)
    return promises.steps_of(name, end.steps, end.evaluations or 0)


def _steps(scene: Scene, time: float) -> int:
    return max(1, math.ceil(abs(time) / scene.step_size * (1.0 - 1e-6)))


def _held(
    id: str, scene: Scene, truth: Truth, name: str, tolerance: float | None
) -> Iterator[Check]:
    flow = truth.flow
    error_id, drift_id = f"{id}/error", f"{id}/drift"
    run = attempt(
        error_id, name, scene, truth.time, partial(run_method, name, scene, truth.time, tolerance)
    )
    if isinstance(run, Check):
        yield run
        return
    complete = run.ended == "complete"
    rounded = _rounded(name, scene, truth.time, tolerance, run)
    error = float(np.abs(run.omega - truth.omega).max()) / flow.largest if complete else math.inf
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
        yield bounded(error_id, error, min(2.0, limit), replay(error_id), note)
    else:
        yield described(error_id, error, replay(error_id), note)
    if truth.exact and complete:
        lost = flow.unamplified + rounded * ROUNDING
        if made is None:
            # Each step rounds omega, its sums, and the last iteration.
            lost += 4.0 * ROUNDING * _steps(scene, truth.time)
        total = (made or 0.0) + lost
        # An error of omega changes what is conserved by no more than itself.
        most = min(limit, total + total * total)
        drift = conserved(scene, run.omega, flow.largest)
        yield bounded(drift_id, drift, most, replay(drift_id))


def made_on_the_way(name: str, scene: Scene, truth: Truth, tolerance: float | None) -> float | None:
    """Return the sum of the errors that a method promises to make, over the largest omega.

    None where it promises none.
    """
    radians = promises.speed(scene, truth.flow.largest) * abs(truth.time)
    if name in FIXED_STEP and truth.exact:
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
        weights = [Fraction(moment) ** power for moment in scene.moments]
        before, after = (
            [(q * abs(Fraction(float(w))), q * Fraction(float(w)) ** 2) for q, w in pairs]
            for pairs in (zip(weights, scene.omega, strict=True), zip(weights, omega, strict=True))
        )
        zero = Fraction(0)
        change = abs(sum((s for _, s in after), zero) - sum((s for _, s in before), zero))
        slope = max(sum((f for f, _ in before), zero), sum((f for f, _ in after), zero))
        if change:
            worst = max(worst, change / (2 * slope * big))
    return float(worst)


def describe_programs(
    trial: str, circumstance: str, scene: Scene, only: Sequence[str] = ()
) -> Iterator[Outcome]:
    """Say how far the programs, original and corrected, are from the truth over their steps."""
    asked = [p for p in PROGRAMS if may_hold(f"{trial}/{p}/{circumstance}", only)]
    if not asked:
        return
    every = max(1, scene.steps // _ROWS)
    times = scene.times()[every - 1 :: every]
    if scene.torque.is_zero and scene.moments is not None:
        rows = [[float(x) for x in torque_free(scene, t)] for t in times]
        wanted = np.array(rows)
    else:
        wanted = reference(scene, times).omega
    scale = float(np.abs(wanted).max(initial=max(map(abs, scene.omega)))) or 1.0
    for program in asked:
        for listing in (original(program), corrected(program)):
            id = f"{trial}/{program}/{circumstance}/{listing.label}"
            if not selected(id, only):
                continue
            run = unstopped(listing).rows(scene)
            found = run.omega[every - 1 :: every]
            n = min(len(found), len(wanted))
            error = float(np.abs(found[:n] - wanted[:n]).max()) / scale if n else None
            note = "" if run.ended == "complete" else f"{run.ended} after {run.steps} steps"
            yield Outcome(described(id, error, replay(id), note), scene)


def in_steps(scene: Scene, time: float, angle: float = 0.002, most: int = 20_000) -> Scene:
    """Return the scene with equal steps until `time` (s), each of a small angle."""
    rate = promises.speed(scene, max(map(abs, scene.omega)))
    count = max(10, min(most, math.ceil(rate * abs(time) / angle)))
    return replace(scene, step_size=abs(time) / count, steps=count)
