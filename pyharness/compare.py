"""Original against corrected, Fortran against twin, everything against the reference.

Two notions of agreement, never mixed: bits between languages (in units in the last place), and
error against the truth (in rad/s, never below what the reference itself may be wrong by).
"""

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pyharness.agreement import Accuracy, accuracy, differences, distance
from pyharness.errors import InputError, unknown
from pyharness.listing import PROGRAMS, Listing, names_of, subset
from pyharness.methods import PROGRAM_REGISTRY, SCIPY_METHODS, Program, solve
from pyharness.reference import Reference, reference
from pyharness.scene import Scene
from pyharness.trajectory import Array, Trajectory

# The order is measured where halving the step moves the result by less than this (relative to
# the largest |omega|), and must come within half an order of the program's own.
_SMALL_CHANGE = 1e-3
_MOST_HALVINGS = 8
ORDER_SLACK = 0.5
# Rounding: so many units in the last place of the largest |omega| per step.
_ROUNDING = 8.0 * 2.0**-53
_TIMING_BATCHES = 3
_TIMING_SECONDS = 3e-4


@dataclass(frozen=True, eq=False)
class ProgramFinding:
    """One program with one listing."""

    listing: Listing
    trajectory: Trajectory
    accuracy: Accuracy
    ulps: float
    differences: tuple[str, ...]
    order: float | None
    misses_order: bool
    seconds_per_step: float


@dataclass(frozen=True, eq=False)
class MethodFinding:
    """One method of `solve_ivp`; `failure` says why there is no trajectory."""

    method: str
    tolerance: float
    trajectory: Trajectory | None
    accuracy: Accuracy | None
    seconds: float
    failure: str = ""


@dataclass(frozen=True, eq=False)
class Comparison:
    """All that was found about one scene."""

    scene: Scene
    lipschitz: float
    reference: Reference
    programs: tuple[ProgramFinding, ...]
    methods: tuple[MethodFinding, ...]

    @property
    def unexpected(self) -> tuple[str, ...]:
        """What is not as it should be, one sentence each; empty if all is well."""
        found = []
        for each in self.programs:
            who = f"{each.listing.program} {each.listing.label}"
            if each.differences:
                found.append(f"{who}: Fortran and twin differ in {', '.join(each.differences)}")
            if each.misses_order:
                order = PROGRAM_REGISTRY[each.listing.program].order
                seen = "does not settle" if each.order is None else f"order {each.order:.1f}"
                found.append(
                    f"{who}: misses the reference as the step is halved: {seen}, due {order}"
                )
        return tuple(found)


def compare(
    scene: Scene,
    listings: Sequence[Listing],
    lipschitz: float = 500.0,
    may_stop: bool = True,
    tolerance: float = 1e-8,
) -> Comparison:
    """Compare programs and methods on one scene.

    Parameters
    ----------
    scene : Scene
        What to integrate.
    listings : sequence of Listing
        The programs to run, each with its active defects (see `listings_for`).
    lipschitz : float
        Constant of the stop test (1/s).
    may_stop : bool
        Whether the stop test may end a run.
    tolerance : float
        What `solve_ivp` is asked for, relative to the largest angular velocity.

    Returns
    -------
    Comparison
        `unexpected` is empty where all is as it should be.

    Raises
    ------
    NotBuiltError
        Where the extension is not built.
    InputError
        Where the reference would need too many steps.
    """
    truth = reference(scene, scene.times(), velocity=True)
    programs = []
    for listing in listings:
        program = PROGRAM_REGISTRY[listing.program]
        compiled = program.run(scene, listing, "fortran", lipschitz, may_stop)
        twin = program.run(scene, listing, "python", lipschitz, may_stop)
        judged = not listing.defects and not listing.readings
        order, misses = measured_order(scene, program, listing, truth) if judged else (None, False)
        programs.append(
            ProgramFinding(
                listing=listing,
                trajectory=compiled,
                accuracy=accuracy(scene, compiled, truth),
                ulps=distance(compiled, twin),
                differences=tuple(differences(compiled, twin)),
                order=order,
                misses_order=misses,
                seconds_per_step=_seconds(
                    partial(program.run, scene, listing, "fortran", lipschitz, may_stop)
                )
                / max(compiled.steps, 1),
            )
        )
    import scipy.integrate  # noqa: F401  (not to be timed with the first method)

    methods = [_method(scene, name, tolerance, truth) for name in SCIPY_METHODS]
    return Comparison(scene, lipschitz, truth, tuple(programs), tuple(methods))


def listings_for(
    programs: Iterable[str] = PROGRAMS,
    base: str | None = None,
    fix: Sequence[str] = (),
    keep: Sequence[str] = (),
    readings: Sequence[str] = (),
) -> list[Listing]:
    """Return what to compare: original and corrected, and the subset asked for between them.

    A defect or reading applies to the programs that have it; one that no program has is a
    mistake. With `base` and nothing else, only that listing is shown.
    """
    chosen = list(programs)
    for option, kind, names in (
        ("--fix", "defect", fix),
        ("--keep", "defect", keep),
        ("--reading", "reading", readings),
    ):
        allowed = {name for program in chosen for name in names_of(kind, program)}
        for name in names:
            if name not in allowed:
                raise unknown(kind, name, sorted(allowed), option)
    for name in sorted(set(fix) & set(keep)):
        raise InputError(f"'{name}' is given to both --fix and --keep; give it to one")
    result = []
    for program in chosen:
        defects, own_readings = names_of("defect", program), names_of("reading", program)
        mended = [name for name in fix if name in defects]
        kept = [name for name in keep if name in defects]
        selected = [name for name in readings if name in own_readings]
        bases = [base] if base and not (fix or keep) else ["original", "corrected"]
        rows = [subset(program, each, readings=selected) for each in bases]
        if mended or kept:
            rows.insert(1, subset(program, base, mended, kept, selected))
        result += rows
    return result


def measured_order(
    scene: Scene, program: Program, listing: Listing, truth: Reference
) -> tuple[float | None, bool]:
    """Halve the step until it is small, and measure the power with which the error falls.

    Returns
    -------
    float or None
        The order; None where the error is that of rounding from the start, or where the
        program does not settle however small the step.
    bool
        Whether the program misses the reference by more than its order allows.
    """

    def omega(finer: Scene) -> Array:
        return program.run(finer, listing, may_stop=False, velocity=False).omega

    return order_of(scene, omega, program.order, truth)


def order_of(
    scene: Scene, solution: Callable[[Scene], Array], due: int, truth: Reference
) -> tuple[float | None, bool]:
    """Measure the order of anything that solves a scene in its own steps; see `measured_order`."""
    n = len(truth.time)
    if n < scene.steps:
        return None, False  # the solution itself leaves every bound
    scale = float(np.abs(truth.omega).max(initial=max(map(abs, scene.omega))))
    previous: Array | None = None
    previous_error = math.inf
    for halvings in range(_MOST_HALVINGS + 1):
        parts = 2**halvings
        try:
            finer = replace(scene, step_size=scene.step_size / parts, steps=scene.steps * parts)
        except InputError:
            return None, False  # does not fit in memory
        omega = solution(finer)[parts - 1 :: parts]
        if len(omega) < n:
            continue  # overflow: the step is far too large
        error = float(np.abs(omega - truth.omega).max())
        if error <= _ROUNDING * scale * finer.steps + truth.error:
            return None, False
        if previous is not None and np.abs(omega - previous).max() < _SMALL_CHANGE * scale:
            order = math.log2(previous_error / error)
            return order, order < due - ORDER_SLACK
        previous, previous_error = omega, error
    return None, True


def _method(scene: Scene, name: str, tolerance: float, truth: Reference) -> MethodFinding:
    start = time.perf_counter()
    try:
        trajectory = solve(scene, scene.times(), name, tolerance)
    except InputError as error:
        return MethodFinding(name, tolerance, None, None, math.nan, str(error))
    seconds = time.perf_counter() - start
    return MethodFinding(name, tolerance, trajectory, accuracy(scene, trajectory, truth), seconds)


def _seconds(run: Callable[[], object]) -> float:
    """Return the median time of a call, over batches long enough for the clock."""
    start = time.perf_counter()
    run()
    calls = max(1, round(_TIMING_SECONDS / max(time.perf_counter() - start, 1e-7)))
    batches = []
    for _ in range(_TIMING_BATCHES):
        start = time.perf_counter()
        for _ in range(calls):
            run()
        batches.append((time.perf_counter() - start) / calls)
    return sorted(batches)[_TIMING_BATCHES // 2]
