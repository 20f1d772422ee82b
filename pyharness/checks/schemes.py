"""Checks of the corrected programs against their schemes, by recomputing every step.

Fortran and twin could share a fault too small to change the order. Each step is therefore
recomputed from the program's previous state; only its rounding errors may differ.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pyharness.checks.check import Attempt, Check, Name
from pyharness.checks.methods import cases
from pyharness.checks.selection import Selection
from pyharness.checks.theory.collocation_matrices import PARTS
from pyharness.checks.theory.conditioning import ROUNDING, magnitudes
from pyharness.model.basis import Basis
from pyharness.model.listing import PROGRAMS, Listing
from pyharness.model.scene import Scene
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.thesis.programs import PROGRAM_REGISTRY

# Roundings of a rate with its stages, and of the sum to which it is added.
_ROUNDINGS = 32.0
_ONE_STEP = Basis(
    "derived",
    "difference of a step from its scheme",
    "a count of the rounding errors of one step, to first order (`checks/schemes.py`)",
)


@dataclass(frozen=True, eq=False)
class Stage:
    """Omega and velocity at a stage, or collocation point, of every step."""

    # shape (n, 6); arguments (rad/s, m/s) and values (rad/s2, m/s2) of the right-hand sides
    state: Array
    rate: Array
    rounding: Array  # shape (n, 6); bound on the difference of two computations of the rate


def schemes(chosen: Selection) -> Iterator[Attempt]:
    """Yield deferred checks of steps; the value is the largest ratio of difference to bound."""
    for case in cases(chosen, (7,)):
        for program in PROGRAMS:
            yield Attempt(
                Name("schemes", program, f"case-{case}"), partial(_compared, case_scene(case))
            )


def _compared(scene: Scene, name: Name) -> Check:
    program = name.subject
    run = PROGRAM_REGISTRY[program].run(scene, Listing.corrected(program), may_stop=False)
    if not is_whole(scene, run):
        return name.judged(False, f"{run.ended}, or no velocity", limit=1.0, basis=_ONE_STEP)
    due, rounding = _scheme(program, scene, run)
    off = np.abs(rows(run) - due)
    share = np.divide(off, rounding, out=np.zeros_like(off), where=off != 0.0)
    step, column = divmod(int(share.argmax()), 6)
    note = f"most at step {step + 1}, {'UV'[column // 3]}{column % 3 + 1}"
    return name.bounded(float(share.max()), 1.0, _ONE_STEP, note)


def is_whole(scene: Scene, run: Trajectory) -> bool:
    """Return whether a run has omega and velocity for every step of the scene."""
    return run.velocity is not None and len(run.omega) == len(run.velocity) == scene.steps


def rows(run: Trajectory) -> Array:
    """Return omega (rad/s) and velocity (m/s) after every step, shape (n, 6)."""
    assert run.velocity is not None
    return np.hstack([run.omega, run.velocity])


def stages(scene: Scene, run: Trajectory) -> tuple[Stage, Stage, Stage, Stage]:
    """Return the four stages of W. Kutta's scheme (1901) in every step of a complete run."""
    h = scene.step_size
    first = _beginning(scene, run)
    second = _stage(scene, 0.5, first.state + 0.5 * h * first.rate)
    third = _stage(scene, 0.5, first.state + 0.5 * h * second.rate)
    fourth = _stage(scene, 1.0, first.state + h * third.rate)
    return first, second, third, fourth


def _scheme(name: str, scene: Scene, run: Trajectory) -> tuple[Array, Array]:
    if name not in PARTS:
        kutta = stages(scene, run)
        return _put_together(scene, kutta[0], kutta, (1 / 6, 1 / 3, 1 / 3, 1 / 6), 1.0)
    first = _beginning(scene, run)
    parts = np.array([float(part) for part in PARTS[name]])
    powers = np.arange(1, len(parts) + 1)
    matrix = np.power.outer(parts, powers - 1)
    # The weights integrate the polynomial through the rates at the collocation points.
    weights = np.linalg.solve(matrix.T, 1.0 / powers)
    points = [
        _stage(scene, part, first.state + part * scene.step_size * first.rate) for part in parts
    ]
    # This matrix is the programs': they solve for the coefficients of t, t**2, ...
    condition = float(np.linalg.cond(powers * matrix, np.inf))
    return _put_together(scene, first, points, weights, condition)


def _put_together(
    scene: Scene,
    first: Stage,
    points: Sequence[Stage],
    weights: Sequence[float] | Array,
    condition: float,
) -> tuple[Array, Array]:
    h = scene.step_size
    rates = sum(weight * point.rate for weight, point in zip(weights, points, strict=True))
    after = first.state + h * rates
    sizes = np.max([point.rounding for point in points], axis=0)
    return after, 4.0 * ROUNDING * (np.abs(first.state) + np.abs(after)) + h * condition * sizes


def _beginning(scene: Scene, run: Trajectory) -> Stage:
    before = np.vstack([[*scene.omega, 0.0, 0.0, 0.0], rows(run)[:-1]])
    return _stage(scene, 0.0, before)


def _stage(scene: Scene, part: float, state: Array) -> Stage:
    """Return rates at the fraction `part` of every step, with bounds on their rounding errors.

    They follow from equations 16-18 of the thesis and dV/dt = F/m - omega x V.
    """
    omega, velocity = state[:, :3], state[:, 3:]
    times = scene.step_size * (np.arange(len(state), dtype=np.float64) + part)
    torque = np.array([scene.normalized_torque(time) for time in times.tolist()])
    products = scene.euler_coefficients * np.roll(omega, -1, axis=1) * np.roll(omega, -2, axis=1)
    pull = np.divide(scene.forces, scene.masses[0])  # one mass, as in the corrected programs
    rate = np.hstack([torque + products, pull + np.cross(velocity, omega)])
    u, v = np.abs(omega), np.abs(velocity)
    crossed = np.roll(v, -1, axis=1) * np.roll(u, -2, axis=1)
    crossed += np.roll(v, -2, axis=1) * np.roll(u, -1, axis=1)
    size = np.hstack([magnitudes(scene, times, omega), np.abs(pull) + crossed])
    return Stage(state, rate, _ROUNDINGS * ROUNDING * size)
