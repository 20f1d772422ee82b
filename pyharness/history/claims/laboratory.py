"""The laboratory that tests claims: it runs the programs under given assumptions, each run once."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from pyharness.history.claims.rules import Runs, largest_error, largest_of, spread_of
from pyharness.model.facts import facts
from pyharness.model.listing import Listing, names_of, subset, switchable
from pyharness.model.scene import Scene, Triple
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.original.collocation import interval
from pyharness.original.equations import Vector, omega_rate
from pyharness.original.in_word import WORDS, scene_in
from pyharness.original.programs import BINARY64, run_program
from pyharness.truth.reference import Reference, reference


@dataclass(frozen=True)
class Assumptions:
    """One value for each choice that the thesis leaves open.

    `start` is omega(0) (rad/s) of the cases in which the thesis gives none; None takes the values
    in `cases.toml`. `readings` are the names of interpretations of doubtful cards that this edition
    does not adopt, but that are used here. `steps` is the number of steps of every run.
    `conjectures` are the names of assumptions about statements for which no card exists; None takes
    those of the original listing. `word` is the name of the floating-point arithmetic of the
    programs.
    """

    start: Triple | None = None
    readings: frozenset[str] = frozenset()
    steps: int = 100
    conjectures: frozenset[str] | None = None
    word: str = BINARY64


@dataclass(frozen=True)
class Laboratory:
    """The three programs, original or corrected, which run the cases under given assumptions.

    A laboratory serves to test claims of the thesis. The original programs have all their defects
    except those named in `fixed`.
    """

    is_original: bool
    assumptions: Assumptions = field(default_factory=Assumptions)
    fixed: frozenset[str] = frozenset()

    def listing(self, program: str) -> Listing:
        """Return the listing of a program: the program with a choice of its defects.

        The original listing has the assumed readings (interpretations of doubtful cards) and
        conjectures (assumptions where no card exists). The corrected listing depends on no
        assumption.
        """
        if not self.is_original:
            return Listing.corrected(program)
        readings = self.assumptions.readings & set(names_of("reading", program))
        assumed = self.assumptions.conjectures
        fixed = self.fixed & set(switchable(program))
        return subset(program, "original", fixed, readings=readings, conjectures=assumed)

    def scene(self, case: int, parts: int = 1) -> Scene:
        """Return the scene of a case under the assumptions, its step size divided by `parts`.

        A scene is a body with its initial omega, torque, step size and number of steps. The number
        of steps is multiplied by `parts`, so that the end time does not depend on `parts`.
        """
        scene = _scene(case, self.assumptions.start, self.assumptions.steps)
        return replace(scene, step_size=scene.step_size / parts, steps=scene.steps * parts)

    def run(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> Trajectory:
        """Run a program on a case of the thesis, with the case's step size divided by `parts`.

        Without `may_stop` the stop test of the Runge-Kutta program is skipped.
        """
        return self.run_on(self.scene(case, parts), self.listing(program), may_stop)

    def run_on(
        self, scene: Scene, listing: Listing, may_stop: bool = True, lipschitz: float = 500.0
    ) -> Trajectory:
        """Run a listing (a program with a choice of its defects) on a scene.

        The floating-point arithmetic is the one that the laboratory's assumptions name. `lipschitz`
        is the limit (1/s) of the stop test of the Runge-Kutta program; without `may_stop` the test
        is skipped.
        """
        return _run(listing, scene, may_stop, lipschitz, self.assumptions.word)

    def truth(self, case: int) -> Reference:
        """Return the reference solution of a case at the end of each of its steps.

        The laboratory's assumptions determine the number of steps of the case. They also determine
        the initial omega if the thesis gives none.
        """
        return _truth(self.scene(case))

    def runs(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> Runs:
        """Run a program as the method `run` does, and return omega with the outcome of the run.

        Omega has the rows at the steps of the case only, even if `parts` divides the step size.
        Omega is NaN after the end of the run.
        """
        run = self.run(program, case, may_stop, parts)
        reached = run.omega[parts - 1 :: parts]
        omega = np.full((self.assumptions.steps, 3), np.nan)
        omega[: len(reached)] = reached
        complete, overflow = (np.bool_(run.ended == each) for each in ("complete", "overflow"))
        return Runs(omega, np.asarray(len(reached)), complete, overflow)

    def solution(self, case: int) -> Array:
        """Return the reference omega (rad/s) of a case at its steps, shape (steps, 3).

        The row of a step is omega at the end of the step.
        """
        return self.truth(case).omega

    def error(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> float:
        """Return the largest error of any omega component (rad/s) when a program runs a case.

        The errors are against the reference solution, at the steps of the case that the program
        ran. The result is infinite after an overflow. `parts` divides the step size. Without
        `may_stop` the stop test of the Runge-Kutta program is skipped.
        """
        return float(largest_error(self, program, case, may_stop, parts))

    def models(self, case: int, terms: int) -> Array:
        """Return omega (rad/s) of the collocation model with n = `terms` terms, shape (steps, 3).

        The model's collocation points are at k/(n+1) of the interval length DT, k = 1 ... n. In the
        corrected programs DT is the step size. In the original programs DT grows by the step size
        in every step, so that the points move out of the step. The torque must then be constant.
        """
        accumulates = self.is_original and "dt-accumulates" not in self.fixed
        return _model(self.scene(case), terms, accumulates, self.assumptions.word)

    def required_constant(self, case: int) -> float:
        """Return the least Lipschitz constant (1/s) with which every step passes the stop test.

        The stop test of the Runge-Kutta program ends a run if a Lipschitz quotient exceeds the
        constant. The program runs the case `case`. The result is infinite if no constant is large
        enough.
        """
        scene, listing = self.scene(case), self.listing("runge-kutta")
        constant = 0.0
        for _ in range(6 * scene.steps):
            stop = self.run_on(scene, listing, lipschitz=constant or 1e-300).stop
            if stop is None:
                break
            constant = stop.quotient * (1.0 + 1e-12)
            if math.isinf(constant):
                break
        return constant


def starts() -> list[Triple]:
    """Return all initial omegas (rad/s) that the thesis shows, and one of our own.

    These initial omegas are tried in the cases for which the thesis gives no initial omega.
    """
    return [
        (float(a), float(b), float(c)) for a, b, c in (s["omega"] for s in facts("claims")["start"])
    ]


def distance(first: Array, second: Array) -> float:
    """Return the largest difference (rad/s) of any omega component between two solutions.

    The arrays `first` and `second` have the shape (rows, 3). If one of them is longer, its
    additional rows do not count.
    """
    n = min(len(first), len(second))
    with np.errstate(all="ignore"):
        return float(np.abs(first[:n] - second[:n]).max(initial=0.0))


def ranges(truth: Reference) -> Array:
    """Return the range of each omega component of a reference solution (rad/s), shape (3,).

    A range is the largest minus the smallest value.
    """
    return spread_of(truth.omega)


def largest(truth: Reference) -> float:
    """Return the largest magnitude of any omega component of a reference solution (rad/s)."""
    return float(largest_of(truth.omega))


@cache
def _scene(case: int, start: Triple | None, steps: int) -> Scene:
    scene = replace(case_scene(case), steps=steps)
    if start is None or case not in facts("claims")["assumed"]["cases"]:
        return scene
    return replace(scene, omega=start)


@cache
def _run(listing: Listing, scene: Scene, may_stop: bool, lipschitz: float, word: str) -> Trajectory:
    implementation = "fortran" if word == BINARY64 else "python"
    return run_program(
        scene, listing, implementation, lipschitz=lipschitz, may_stop=may_stop, word=word
    )


@cache
def _truth(scene: Scene) -> Reference:
    return reference(scene, scene.times())


@cache
def _model(scene: Scene, terms: int, accumulates: bool, word: str) -> Array:
    if word != BINARY64:
        scene = scene_in(scene, WORDS[word])
    h = scene.step_size
    state = list(scene.omega)
    rows = []
    for step in range(scene.steps):
        dt = h * (step + 1) if accumulates else h
        points = [dt * k / (terms + 1) for k in range(1, terms + 1)]
        begin = step * h
        torques = [scene.normalized_torque(begin + t) for t in (0.0, *points)]

        def rates(k: int, x: Vector, torques: Sequence[Vector] = torques) -> list[float]:
            return omega_rate(scene.euler_coefficients, torques[k], x)

        state, _ = interval(state, points, h, rates)
        rows.append(state)
    return np.array(rows, dtype=float)


LITERALS = ("DT=", "T=", "DT+")
"""The statements in which the collocation decks have the step size as a literal number.

``DT=`` sets the interval length DT before the loop, ``T=`` sets the end of the interval, and
``DT+`` adds to DT in every step.
"""


@cache
def by_literals(
    scenes: tuple[Scene, ...], terms: int, changed: frozenset[str], parts: int
) -> Array:
    """Return omega as an original collocation program with changed step literals computes it.

    A step literal is a place on the program's cards where the step size is a literal number.
    `changed` has the names, from `LITERALS`, of the literals that are divided by `parts`. `terms`
    is 2 for the two-term program and 4 for the four-term program. The cards themselves do not run:
    an equivalent model, which differs only in rounding errors, integrates all scenes at once. The
    scenes must have constant torque. The result (rad/s) has every scene at the steps of the
    unchanged program, shape (scenes, steps, 3), and is NaN from an overflow on.
    """
    h, steps = scenes[0].step_size, scenes[0].steps
    dt, end, growth = (h / parts if name in changed else h for name in LITERALS)
    omega = np.array([each.omega for each in scenes])
    bodies = np.array([each.euler_coefficients for each in scenes])
    torque = np.array([each.normalized_torque(0.0) for each in scenes])
    rows = integrate_models(omega, bodies, torque, terms, dt, end, growth, round(steps * h / end))
    every = round(h / end)
    return rows[:, every - 1 :: every]


def integrate_models(
    omega: Array, coefficients: Array, torque: Array, terms: int,
    dt: float, end: float, growth: float, steps: int,
) -> Array:  # fmt: skip
    """Integrate the collocation model of bodies with constant torque from n initial omegas at once.

    `omega`, shape (n, 3), has the initial omegas (rad/s). `coefficients` has A, B and C of Euler's
    equations in its last axis, and `torque` is the constant torque divided by the moments (rad/s2).
    `terms` is the number of terms of the trial functions. The collocation points divide the
    interval (0, dt) evenly, where dt (s) grows by `growth` (s) with every step. Each of the `steps`
    steps is `end` (s) long. Return omega (rad/s), shape (n, steps, 3), which equals the omega of
    the programs but for rounding error. From an overflow on, omega is NaN.
    """
    a, b, c = coefficients.T

    def rates(x: Array) -> Array:
        u1, u2, u3 = x.T
        products = np.column_stack([a * u2 * u3, b * u1 * u3, c * u1 * u2])
        return np.asarray(torque + products)

    inside = np.arange(1, terms + 1) / (terms + 1)
    powers = np.arange(1, terms + 1)
    found: Array = np.empty((len(omega), steps, 3))
    state = omega
    with np.errstate(all="ignore"):
        for step in range(steps):
            first = rates(state)
            points = dt * inside
            at_points = np.array([rates(state + t * first) for t in points])
            matrix = powers * points[:, None] ** (powers - 1)
            weights = end**powers @ np.linalg.inv(matrix)
            state = state + np.tensordot(weights, at_points, 1)
            found[:, step] = state
            dt += growth
    return found
