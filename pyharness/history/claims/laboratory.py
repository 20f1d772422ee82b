"""Cached runs of the programs under assumptions, for the tests of claims."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from pyharness.history.claims.rules import Runs, largest_error, largest_of
from pyharness.model.assumptions import open_starts
from pyharness.model.facts import facts
from pyharness.model.listing import Listing, names_of, subset, switchable
from pyharness.model.scene import Scene, Triple
from pyharness.model.scene_file import case_scene
from pyharness.model.trajectory import Array, Trajectory
from pyharness.thesis.collocation import interval
from pyharness.thesis.equations import Vector, omega_rate
from pyharness.thesis.in_word import WORDS, scene_in
from pyharness.thesis.programs import BINARY64, run_program
from pyharness.truth.reference import Reference, reference


@dataclass(frozen=True)
class Assumptions:
    """A value for each choice that the thesis leaves open."""

    # omega(0) (rad/s) in all cases for which the thesis gives none; None: our values in cases.toml.
    start: Triple | None = None
    readings: frozenset[str] = frozenset()  # readings other than those that we adopt
    steps: int = 100
    conjectures: frozenset[str] | None = None  # None: as in the original listing
    word: str = BINARY64  # arithmetic of the programs


@dataclass(frozen=True)
class Laboratory:
    """The three programs on the cases of Table 1; `parts` divides a run's step size."""

    is_original: bool
    assumptions: Assumptions = field(default_factory=Assumptions)
    fixed: frozenset[str] = frozenset()  # defects that the original programs lack

    def listing(self, program: str) -> Listing:
        if not self.is_original:
            return Listing.corrected(program)
        readings = self.assumptions.readings & set(names_of("reading", program))
        assumed = self.assumptions.conjectures
        fixed = self.fixed & set(switchable(program))
        return subset(program, "original", fixed, readings=readings, conjectures=assumed)

    def scene(self, case: int, parts: int = 1) -> Scene:
        scene, given = case_scene(case), self.assumptions
        is_open = case in open_starts()
        start = scene.omega if given.start is None or not is_open else given.start
        h, steps = scene.step_size / parts, given.steps * parts
        return replace(scene, omega=start, step_size=h, steps=steps)

    def run(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> Trajectory:
        return self.run_on(self.scene(case, parts), self.listing(program), may_stop)

    def run_on(
        self, scene: Scene, listing: Listing, may_stop: bool = True, lipschitz: float = 500.0
    ) -> Trajectory:
        return _run(listing, scene, may_stop, lipschitz, self.assumptions.word)

    def truth(self, case: int) -> Reference:
        return _truth(self.scene(case))

    def runs(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> Runs:
        run = self.run(program, case, may_stop, parts)
        reached = run.omega[parts - 1 :: parts]  # at the ends of the undivided steps
        omega = np.full((self.assumptions.steps, 3), np.nan)
        omega[: len(reached)] = reached
        complete, overflow = (np.bool_(run.ended == each) for each in ("complete", "overflow"))
        return Runs(omega, np.asarray(len(reached)), complete, overflow)

    def solution(self, case: int) -> Array:
        return self.truth(case).omega

    def error(self, program: str, case: int, may_stop: bool = True, parts: int = 1) -> float:
        return float(largest_error(self, program, case, may_stop, parts))

    def models(self, case: int, terms: int) -> Array:
        """Return omega (rad/s) by collocation at `terms` evenly spaced points, shape (steps, 3).

        For original programs the torque must be constant.
        """
        accumulates = self.is_original and "dt-accumulates" not in self.fixed
        return _model(self.scene(case), terms, accumulates, self.assumptions.word)

    def required_constant(self, case: int) -> float:
        """Return the least stop constant (1/s) with which a run does not stop, or infinity."""
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
    """Return all initial omegas (rad/s) of the thesis, and one that we add."""
    given = (each["omega"] for each in facts("claims")["start"])
    return [(float(a), float(b), float(c)) for a, b, c in given]


def start_text(start: Triple) -> str:
    return ", ".join(f"{x:g}" for x in start)


def distance(first: Array, second: Array) -> float:
    """Return the largest difference (rad/s) of any component of omega over the common steps."""
    n = min(len(first), len(second))
    with np.errstate(all="ignore"):
        return float(np.abs(first[:n] - second[:n]).max(initial=0.0))


def largest(truth: Reference) -> float:
    return float(largest_of(truth.omega))


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
        # In the original programs, DT grows by the step size in every step.
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
"""Statements of the collocation decks in which the step size is a literal number.

``DT=`` sets the interval's length DT before the loop, ``T=`` sets the interval's end, and ``DT+``
adds to DT in every step.
"""


@cache
def by_literals(
    scenes: tuple[Scene, ...], terms: int, changed: frozenset[str], parts: int
) -> Array:
    """Return an original collocation program's omega (rad/s), shape (scenes, steps, 3).

    `parts` divides the literal step sizes in `changed`; the torque must be constant.
    """
    h, steps = scenes[0].step_size, scenes[0].steps
    dt, end, growth = (h / parts if name in changed else h for name in LITERALS)
    omega = np.array([each.omega for each in scenes])
    bodies = np.array([each.euler_coefficients for each in scenes])
    torque = np.array([each.normalized_torque(0.0) for each in scenes])
    rows = integrate_models(omega, bodies, torque, terms, dt, end, growth, round(steps * h / end))
    every = round(h / end)  # return omega at the ends of the undivided steps
    return rows[:, every - 1 :: every]


def integrate_models(
    omega: Array, coefficients: Array, torque: Array, terms: int,
    dt: float, end: float, growth: float, steps: int,
) -> Array:  # fmt: skip
    """Return omega (rad/s) of n bodies by collocation, shape (n, steps, 3).

    `torque` is divided by the moments (rad/s2); times are in s.
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
            # The collocation points divide (0, dt) evenly, but the step has the length `end`.
            points = dt * inside
            at_points = np.array([rates(state + t * first) for t in points])
            matrix = powers * points[:, None] ** (powers - 1)
            weights = end**powers @ np.linalg.inv(matrix)
            state = state + np.tensordot(weights, at_points, 1)
            found[:, step] = state
            dt += growth
    return found
