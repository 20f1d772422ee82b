"""Trial of length: energy, momentum and phase over a million revolutions, by Brouwer's law.

The phase is the position along the curve of omega; `theory.brouwer` states the law.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from pyharness.checks.check import BITS, Attempt, Check, Name
from pyharness.checks.compare.candidates import method_candidate, prepared_candidate, unstopped
from pyharness.checks.hold import scene_of
from pyharness.checks.scenes.extreme import speed
from pyharness.checks.stress import LISTINGS, Trial, named
from pyharness.checks.theory import brouwer
from pyharness.checks.theory.brouwer import LAWS, POWER, WALK, Noise, Orbit
from pyharness.checks.tolerances import finest
from pyharness.engine.plan.registry import METHODS
from pyharness.engine.solve import solve
from pyharness.engine.system.kernel_input import normalized
from pyharness.model.basis import Basis
from pyharness.model.codes import Series
from pyharness.model.errors import InputError
from pyharness.model.extension import COMPLETE, extension
from pyharness.model.listing import Listing
from pyharness.model.scene import Scene
from pyharness.model.trajectory import Array
from pyharness.truth.elliptic import torque_free

# A revolution takes 2 pi divided by the largest component of omega.
REVOLUTIONS = tuple(10.0 ** (k / 2.0) for k in range(2, 13))
MOTIONS = {
    # Case 4: fast precession about the axis of the spin.
    "case-4": Scene("case-4", (0.0, 1.0, 10.0), moments=(40.0, 30.0, 20.0)),
    # All three components vary, and the elliptic modulus is large.
    "tumbling": Scene("tumbling", (0.25, 1.0, 0.5), moments=(40.0, 30.0, 20.0)),
}
# Number of initial conditions of each motion. With so many, over two decades of steps, a random
# walk is mistaken for a drift with a probability below one in a thousand.
STARTS = 12
_EFFORT = 10.0  # factor on the work limit of the Taylor series
# Fewest revolutions for which the rounding of the result is negligible.
_FIT_FROM = 10**2.5
# Half the difference between the powers for random and for biased rounding.
_HALFWAY = 0.25
# Largest phase error (rad) that can be measured accurately.
_LOST = 0.1

# Bound on the last two terms of the Taylor series at the finest tolerance, relative to omega.
_LEFT_OUT = Series.SLACK * Series.LEAST_LOCAL_TOLERANCE
# Step size by number of stages, in radians of the fastest rate. With 8 stages the truncation error
# is far below rounding; with 4 it dominates the phase error, but must not change the energy.
_PARTS = {8: 1.0, 4: 0.25}
_CLOSED_FORM = 16.0 * brouwer.ROUNDING  # error of the closed form at any time
CLOSED_FORM = Basis(
    "measured",
    "errors that follow from 16 rounding errors of omega by a closed form",
    "`pytest tests/engine/test_closed_form.py`",
)
"""Basis of limits that assume at most 16 rounding errors of a closed form."""

# Returns omega, shape (n, 3), and the number of steps until each of n times (s).
Runner = Callable[[Scene, Sequence[float]], tuple[Array, Array]]


@dataclass(frozen=True)
class Integrator:
    """A method whose error growth is measured."""

    run: Runner
    noise: Callable[[Orbit, Scene, float], Noise]  # returns bounds on the errors of a step (s)
    revolutions: float  # length of the run from the first initial condition
    others: float  # length, in revolutions, of the runs from other initial conditions
    preference: bool = False  # whether rounding is biased


def _taylor(scene: Scene, times: Sequence[float]) -> tuple[Array, Array]:
    found = solve(scene, times, "taylor", METHODS["taylor"].finest, effort=_EFFORT)
    return found.omega, found.steps * np.array(times) / times[-1]


_taylor_noise = partial(brouwer.taylor_noise, order=Series.MOST_ORDER, left_out=_LEFT_OUT)


def _gauss(stages: int) -> Runner:
    def run(scene: Scene, times: Sequence[float]) -> tuple[Array, Array]:
        step = _PARTS[stages] / _rate(scene)
        given = scene.euler_coefficients, *normalized(scene)[1:], scene.omega, times, stages, step
        rows, _, n_rows, status, evaluations = extension().gauss_solution(*given)
        if (n_rows, status) != (len(times), COMPLETE):
            raise InputError(
                f"gauss-{stages} exceeded its work limit after {evaluations} right-hand sides"
            )
        lengths = np.diff([0.0, *times])
        return rows.T, np.cumsum(np.ceil(lengths / step - 1e-6))

    return run


def _rate(scene: Scene) -> float:
    return speed(scene, max(map(abs, scene.omega)))


INTEGRATORS = {
    # Rounding is biased, because steps lock to the periodic motion, so that rounding errors recur
    # in every revolution.
    "taylor": Integrator(_taylor, _taylor_noise, 1e6, 10**5.5, preference=True),
    # Shorter runs, because a step takes ten times as long as a Taylor step.
    "gauss-8": Integrator(_gauss(8), partial(brouwer.gauss_noise, stages=8), 1e6, 1e5),
    "gauss-4": Integrator(_gauss(4), partial(brouwer.gauss_noise, stages=4), 1e5, 10**4.5),
}


def _attempts() -> Iterator[Attempt]:
    for motion, scene in MOTIONS.items():
        name = named("length", "", motion, scene=scene)
        for method, integrator in INTEGRATORS.items():
            own = replace(name, subject=method)
            yield Attempt(own, partial(check_growth, integrator))
            if method != "gauss-4":
                yield Attempt(replace(own, setting="prepared"), _prepared)
        yield Attempt(replace(name, subject="closed-form"), _closed_form)
        for method in ("dop853", "lsoda"):
            yield Attempt(replace(name, subject=method, setting="100"), _scipy)
        step = 2.0 * math.pi / orbit_of(motion).largest / 100.0
        stepped = replace(scene, step_size=step, steps=1_000_000)
        for listing in LISTINGS:
            own = named("length", listing.program, motion, listing.label, scene=stepped)
            yield Attempt(own, partial(_program, listing))


def check_growth(integrator: Integrator, name: Name) -> Iterator[Check]:
    """Yield checks of errors after each number of revolutions, and of their powers of growth."""
    motion = name.circumstance
    for what, found, steps, limits in measured(integrator, MOTIONS[motion], orbit_of(motion)):
        horizons = np.array(REVOLUTIONS[: len(steps)])
        for k, revolutions in enumerate(horizons):
            value = float(np.nanmax(np.abs(found[:, k])))
            note = f"{steps[k]:.0f} steps, {steps[k] ** LAWS[what]:.1e} to the power {LAWS[what]}"
            own = name.with_quantity(f"{what}/{revolutions:.0f}")
            yield own.bounded(value, limits[k], WALK, note)
        fitted = (horizons >= 0.99 * _FIT_FROM) & ~np.isnan(found).any(axis=0)
        power = brouwer.exponent(steps[fitted], found[:, fitted])
        due = LAWS[what] + (0.5 if integrator.preference else 0.0)
        own = name.with_quantity(f"{what}/power")
        yield own.bounded(power, due + _HALFWAY, POWER, f"due {due}")


@dataclass(frozen=True, eq=False)
class Drift:
    """The errors of the quantity `what` after each of n numbers of steps."""

    motion: str
    method: str
    what: str
    steps: Array
    error: Array  # root mean square over the initial conditions
    limits: Array  # bounds on `error` by Brouwer's law
    starts: Array  # number of initial conditions


def curves() -> Iterator[Drift]:
    for motion, scene in MOTIONS.items():
        for method, integrator in INTEGRATORS.items():
            for what, found, steps, limits in measured(integrator, scene, orbit_of(motion)):
                starts = (~np.isnan(found)).sum(axis=0)
                error = brouwer.root_mean_square(found)
                yield Drift(motion, method, what, steps, error, np.array(limits), starts)


def measured(
    integrator: Integrator, scene: Scene, body: Orbit
) -> Iterator[tuple[str, Array, Array, list[float]]]:
    """Yield each quantity's name, errors, numbers of steps and error bounds.

    Errors have the shape (initial conditions, times), and are NaN after a run's end.
    """
    turn = 2.0 * math.pi / body.largest
    reached = [r for r in REVOLUTIONS if r <= 1.01 * integrator.revolutions]
    found = {what: np.full((STARTS, len(reached)), math.nan) for what in LAWS}
    steps = np.zeros(len(reached))
    for number, start in enumerate(starts(scene, body)):
        most = integrator.others if number else integrator.revolutions
        times = [r * turn for r in reached if r <= 1.01 * most]
        rows, counted = integrator.run(start, times)
        steps[: len(times)] = np.maximum(steps[: len(times)], counted)
        for k, (time, row) in enumerate(zip(times, rows, strict=True)):
            for what, error in brouwer.errors(start, body, time, row).items():
                found[what][number, k] = error
    noise = integrator.noise(body, scene, reached[-1] * turn / steps[-1])
    limits = [body.limits(noise, count) for count in steps]
    for what in LAWS:
        yield what, found[what], steps, [each[what] for each in limits]


@cache
def orbit_of(motion: str) -> Orbit:
    return brouwer.orbit(MOTIONS[motion])


def starts(scene: Scene, body: Orbit) -> list[Scene]:
    """Return scenes with different initial phases of one motion."""
    times = [0.37 * k / body.frequency for k in range(STARTS)]
    rows = brouwer.floats([torque_free(scene, t, rounded=True) for t in times])
    return [replace(scene, omega=row) for row in rows]


def _prepared(name: Name) -> Check:
    method, scene = name.subject, MOTIONS[name.circumstance]
    time = 1e4 * 2.0 * math.pi / orbit_of(name.circumstance).largest
    rows, _ = INTEGRATORS[method].run(scene, [time])
    stepped = replace(scene, step_size=_PARTS[8] / _rate(scene))
    found = prepared_candidate(method, METHODS[method].finest).end(stepped, time).omega
    return name.bounded(float(np.count_nonzero(rows[-1] != found)), 0.0, BITS)


def _closed_form(name: Name) -> Iterator[Check]:
    scene, body = MOTIONS[name.circumstance], orbit_of(name.circumstance)
    times = [r * 2.0 * math.pi / body.largest for r in REVOLUTIONS]
    rows = method_candidate("closed-form", METHODS["closed-form"].finest).rows(scene, times).omega
    found = [brouwer.errors(scene, body, t, row, False) for t, row in zip(times, rows, strict=True)]
    for what in LAWS:
        gain = body.turn if what == "phase" else body.gains[what]
        limit = _CLOSED_FORM * gain + (0.0 if what == "phase" else 4.0 * brouwer.ROUNDING)
        largest = max(abs(each[what]) for each in found)
        yield name.with_quantity(what).bounded(largest, limit, CLOSED_FORM, "at any time")


def _scipy(name: Name) -> Iterator[Check]:
    scene = MOTIONS[name.circumstance]
    time = 1e2 * 2.0 * math.pi / orbit_of(name.circumstance).largest
    found = method_candidate(name.subject, finest(name.subject, scene, time)).end(scene, time)
    yield from _described(name, scene, time, found.omega)


def _program(listing: Listing, name: Name) -> Iterator[Check]:
    scene = scene_of(name)
    found = unstopped(listing).rows(scene)
    for count in (1_000, 1_000_000):
        own = replace(name, setting=f"{name.setting}/{count // 100}")
        if len(found.omega) < count:
            yield own.described(None, f"{found.ended} after {found.steps} steps")
        else:
            row = found.omega[count - 1]
            yield from _described(own, scene, count * scene.step_size, row)


def _described(name: Name, scene: Scene, time: float, row: Array) -> Iterator[Check]:
    for what, error in brouwer.errors(scene, orbit_of(name.circumstance), time, row).items():
        lost = what == "phase" and abs(error) > _LOST
        yield name.with_quantity(what).described(error, "lost" if lost else "")


TRIAL = Trial(
    "length",
    "a million revolutions without torque: errors of energy, momentum and phase",
    "Brouwer's law: n independent rounding errors of mean 0 and at most c add up to 4 c sqrt(n) "
    "(Hoeffding 1963), where c is from a running error analysis of a step. The phase error grows "
    "like n**1.5. Truncation errors add n times their bound. The fitted power of n must be "
    "nearer to the expected one (1/2 and 3/2 for random errors, 1 and 2 for biased errors) than "
    "to the other.",
    lambda only: _attempts(),
)
