"""Checks of the programs' steps and stops, by recomputing every step from its scheme.

Each step of the corrected programs is recomputed from the previous state, and must agree within
rounding errors. This detects even small faults that Fortran and Python share.

The stop test of the Runge-Kutta program (equation 19 of the thesis) divides the change of K
(right-hand side) in a step by the change of U (state). A quotient above the stop constant ends the
run. The quotients are recomputed, and the program is run with constants just below and above each
new maximum of the quotients.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name, Selection
from pyharness.checks.methods import cases
from pyharness.checks.theory.collocation_matrices import PARTS
from pyharness.checks.theory.conditioning import ROUNDING, magnitudes
from pyharness.model.basis import Basis
from pyharness.model.listing import PROGRAMS, Listing, names_of
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import STOP_VARIABLES, Array, Stop, Trajectory
from pyharness.thesis.cells import listing_name, subsets
from pyharness.thesis.programs import PROGRAM_REGISTRY

# Number of roundings of a rate with its stages, and of the sum to which it is added.
_ROUNDINGS = 32.0
_ONE_STEP = Basis(
    "derived",
    "difference of a step from its scheme",
    "a count of the rounding errors of one step, to first order (`checks/schemes.py`)",
)


@dataclass(frozen=True, eq=False)
class _Stage:
    """Omega and velocity at a stage or collocation point of each of n steps."""

    # shape (n, 6): arguments (rad/s, m/s) and values (rad/s2, m/s2) of the right-hand sides
    state: Array
    rate: Array
    rounding: Array  # shape (n, 6): bound on the difference of two computations of the rate


_Stages = tuple[_Stage, _Stage, _Stage, _Stage]


def schemes(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks of the programs' steps.

    A value is the largest difference from the recomputed step, divided by its rounding bound.
    """
    for case in cases(chosen, (7,)):
        compare = partial(_compare_steps, case_scene(case))
        for program in PROGRAMS:
            yield Attempt(Name("schemes", program, f"case-{case}"), compare)


def _compare_steps(scene: Scene, name: Name) -> Check:
    program = name.subject
    run = PROGRAM_REGISTRY[program].run(scene, Listing.corrected(program), may_stop=False)
    if not _is_whole(scene, run):
        return name.judged(False, f"{run.ended}, or no velocity", limit=1.0, basis=_ONE_STEP)
    due, rounding = _scheme(program, scene, run)
    off = np.abs(_rows(run) - due)
    share = np.divide(off, rounding, out=np.zeros_like(off), where=off != 0.0)
    step, column = divmod(int(share.argmax()), 6)
    note = f"most at step {step + 1}, {'UV'[column // 3]}{column % 3 + 1}"
    return name.bounded(float(share.max()), 1.0, _ONE_STEP, note)


def _is_whole(scene: Scene, run: Trajectory) -> bool:
    return run.velocity is not None and len(run.omega) == len(run.velocity) == scene.steps


def _rows(run: Trajectory) -> Array:
    assert run.velocity is not None
    return np.hstack([run.omega, run.velocity])


def _stages(scene: Scene, run: Trajectory) -> _Stages:
    """Return the four stages of W. Kutta's scheme (1901) in every step of a complete run."""
    h = scene.step_size
    first = _beginning(scene, run)
    second = _stage(scene, 0.5, first.state + 0.5 * h * first.rate)
    third = _stage(scene, 0.5, first.state + 0.5 * h * second.rate)
    fourth = _stage(scene, 1.0, first.state + h * third.rate)
    return first, second, third, fourth


def _scheme(name: str, scene: Scene, run: Trajectory) -> tuple[Array, Array]:
    h = scene.step_size
    points: Sequence[_Stage]
    if name in PARTS:
        first = _beginning(scene, run)
        parts = np.array([float(part) for part in PARTS[name]])
        powers = np.arange(1, len(parts) + 1)
        matrix = np.power.outer(parts, powers - 1)
        # The programs integrate the polynomial through the rates at the collocation points.
        weights = np.linalg.solve(matrix.T, 1.0 / powers)
        points = [_stage(scene, part, first.state + part * h * first.rate) for part in parts]
        # The programs solve for the coefficients of t, t**2, ... with this matrix.
        condition = float(np.linalg.cond(powers * matrix, np.inf))
    else:
        points = _stages(scene, run)
        first, weights, condition = points[0], np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6]), 1.0
    rates = sum(weight * point.rate for weight, point in zip(weights, points, strict=True))
    after = first.state + h * rates
    sizes = np.max([point.rounding for point in points], axis=0)
    return after, 4.0 * ROUNDING * (np.abs(first.state) + np.abs(after)) + h * condition * sizes


def _beginning(scene: Scene, run: Trajectory) -> _Stage:
    before = np.vstack([[*scene.omega, 0.0, 0.0, 0.0], _rows(run)[:-1]])
    return _stage(scene, 0.0, before)


def _stage(scene: Scene, part: float, state: Array) -> _Stage:
    """Return the rates, with rounding error bounds, at the fraction `part` of every step."""
    # Equations 16-18 of the thesis, and dV/dt = F/m - omega x V.
    omega, velocity = state[:, :3], state[:, 3:]
    times = scene.step_size * (np.arange(len(state), dtype=np.float64) + part)
    torque = np.array([scene.normalized_torque(time) for time in times.tolist()])
    products = scene.euler_coefficients * np.roll(omega, -1, axis=1) * np.roll(omega, -2, axis=1)
    pull = np.divide(scene.forces, scene.masses[0])  # as in the corrected programs
    rate = np.hstack([torque + products, pull + np.cross(velocity, omega)])
    u, v = np.abs(omega), np.abs(velocity)
    crossed = np.roll(v, -1, axis=1) * np.roll(u, -2, axis=1)
    crossed += np.roll(v, -2, axis=1) * np.roll(u, -1, axis=1)
    size = np.hstack([magnitudes(scene, times, omega), np.abs(pull) + crossed])
    return _Stage(state, rate, _ROUNDINGS * ROUNDING * size)


_PROGRAM = "runge-kutta"
_QUOTIENT = Basis(
    "derived",
    "difference of a quotient of the stop test from equation 19",
    "rounding errors of one step, propagated to first order (`checks/schemes.py`)",
)


@dataclass(frozen=True, eq=False)
class _Quotients:
    """The quotients that the program compares with its stop constant."""

    values: Array  # shape (n, m) for n steps, 1/s
    rounding: Array  # shape (n, m): bound on a quotient's difference in two computations, 1/s
    names: list[str]  # names of the m quotients


def stops(chosen: Selection) -> Iterator[Attempt]:
    """Yield checks of stops for every combination of the stop test's defects.

    A value is the difference from the recomputed quotient, divided by its rounding bound.
    """
    ways = tuple(name for name in names_of("defect", _PROGRAM) if name.startswith("lipschitz"))
    for case in cases(chosen, (3,)):
        known = cache(partial(_run, case_scene(case)))
        for defects in subsets(ways):
            listing = Listing(_PROGRAM, defects)
            name = Name("stops", "", f"case-{case}", listing_name(listing))
            yield Attempt(name, partial(_compare_stops, case_scene(case), listing, known))


_Known = tuple[Trajectory, _Stages | None]


def _run(scene: Scene) -> _Known:
    run = PROGRAM_REGISTRY[_PROGRAM].run(scene, Listing.corrected(_PROGRAM), may_stop=False)
    return run, _stages(scene, run) if _is_whole(scene, run) else None


def _compare_stops(
    scene: Scene, listing: Listing, run_once: Callable[[], _Known], name: Name
) -> Check:
    run, kutta = run_once()
    if kutta is None:
        return name.judged(False, f"{run.ended}, or no velocity", limit=1.0, basis=_QUOTIENT)
    quotients = _quotients(scene, run, kutta, listing)
    largest = 0.0
    constants = _constants(quotients)
    for constant in constants:
        found = PROGRAM_REGISTRY[_PROGRAM].run(scene, listing, lipschitz=constant)
        due = _due(quotients, constant)
        seen = found.stop and (found.steps, found.stop.step, found.stop.variable)
        if seen != (due and (due.step, due.step, due.variable)):
            note = f"with {constant!r}: {found.stop or found.ended}, due {due or 'complete'}"
            return name.judged(False, note, limit=1.0, basis=_QUOTIENT)
        if found.stop and due:
            granted = quotients.rounding[due.step - 1, quotients.names.index(due.variable)]
            largest = max(largest, abs(found.stop.quotient - due.quotient) / granted)
    return name.bounded(largest, 1.0, _QUOTIENT, f"{len(constants)} constants")


def _quotients(scene: Scene, run: Trajectory, kutta: _Stages, listing: Listing) -> _Quotients:
    first, _, _, fourth = kutta
    after = _rows(run) if listing.has("lipschitz-mismatched-pairs") else fourth.state
    velocity = listing.has("lipschitz-tests-velocity")
    columns = [3, 4, 5, 0, 1, 2] if velocity else [0, 1, 2]
    k, u = np.abs(fourth.rate - first.rate)[:, columns], np.abs(after - first.state)[:, columns]
    k_rounding = (first.rounding + fourth.rounding)[:, columns]
    # Rounding errors of the previous state and of its sum with an increment.
    stored = 2.0 * ROUNDING * (np.abs(first.state) + np.abs(after))
    u_rounding = (stored + scene.step_size * (first.rounding + fourth.rounding))[:, columns]
    names = [STOP_VARIABLES[column] for column in columns]
    if not listing.has("lipschitz-per-component"):
        names = ["UV" if velocity else "U"]
        k, u, k_rounding, u_rounding = (
            np.linalg.norm(each, axis=1, keepdims=True) for each in (k, u, k_rounding, u_rounding)
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        # A quotient 0 / 0 never stops a run.
        values = np.where(k > 0.0, k / u, 0.0)
        relative = np.where(k > 0.0, k_rounding / k + u_rounding / u, 0.0)
    return _Quotients(values, values * relative, names)


def _constants(quotients: _Quotients) -> list[float]:
    """Return stop constants (1/s) just below and above each new largest quotient."""
    constants = []
    below = 0.0
    for values, rounding in zip(quotients.values, quotients.rounding, strict=True):
        beside = np.concatenate([values - 2.0 * rounding, values + 2.0 * rounding])
        is_clear = (np.abs(beside[:, np.newaxis] - values) > rounding).all(axis=1)
        constants += beside[is_clear & (beside > below)].tolist()
        below = max(below, float(beside.max()))
    return constants or [below]


def _due(quotients: _Quotients, constant: float) -> Stop | None:
    above = np.argwhere(quotients.values > constant)
    if not len(above):
        return None
    row, column = above[0].tolist()
    return Stop(row + 1, quotients.names[column], float(quotients.values[row, column]))
