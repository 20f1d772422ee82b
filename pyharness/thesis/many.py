"""Runs of a compiled program for many bodies in one call."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyharness.model.arrays import (
    ABOVE_ZERO,
    FINITE,
    FROM_ZERO,
    count_bodies,
    only_one,
    rows_of,
    spread,
    threads_of,
)
from pyharness.model.codes import Blocks
from pyharness.model.effort import check_bodies
from pyharness.model.errors import InputError
from pyharness.model.extension import columns, extension
from pyharness.model.listing import PROGRAMS, Listing, checked_listing
from pyharness.model.progress import bar_of_bodies, expect_bodies, for_each_piece
from pyharness.model.scene import SPACE_TORQUE, Scene, checked_scene, most_steps
from pyharness.model.trajectory import Array, BatchResult
from pyharness.model.values import Number, boolean, integer, number_list
from pyharness.thesis.compiled import stop_reads_velocity
from pyharness.thesis.equations import card_torque

_LEAST_WORK = 100_000  # fewest steps, over all bodies, that are worth a thread
_PIECES = 8  # number of kernel calls for each thread, because some runs may end early
_NOT_REACHED = -1


@dataclass(frozen=True, eq=False, repr=False)
class ProgramEnsemble(BatchResult):
    """The results of a program of the thesis for n bodies at m requested steps.

    After the end of a body's run, its values are NaN, and -1 in `ier`.

    Attributes
    ----------
    omega : ndarray, shape (n, m, 3)
        Angular velocity about the body axes, rad/s.
    status : ndarray of int8, shape (n,)
        How each run ended: COMPLETE, STOPPED or OVERFLOW of `pyharness.model.codes.Statuses`.
    at : ndarray of int, shape (m,)
        The requested steps, from 1.
    velocity : ndarray, shape (n, m, 3), or None
        Translational velocity along the body axes, m/s; None if not requested.
    recorded_time : ndarray, shape (m,), or (n, m) if the bodies have different step sizes
        The program's variable TIME, s. With shape (m,), it is NaN at a step that no body reached.
    n_rows : ndarray of int32, shape (n,)
        Number of steps with a result in each run, requested or not.
    stop_variable : ndarray of int8, shape (n,)
        The variable that failed the stop test, or 0: 1-3 for U1-U3 (omega), 4-6 for V1-V3
        (velocity), 7 for the norm of U, 8 for the norm of U and V.
    stop_quotient : ndarray, shape (n,)
        Change of the right-hand side over change of the variable (1/s); infinite if the variable
        did not change, NaN without a stop.
    ier : ndarray of int32, shape (n, m), or None
        Error code of the linear solver in the collocation programs; None for Runge-Kutta.
    """

    at: NDArray[np.int32]
    velocity: Array | None
    recorded_time: Array
    n_rows: NDArray[np.int32]
    stop_variable: NDArray[np.int8]
    stop_quotient: Array
    ier: NDArray[np.int32] | None


# ArrayLike as text, because the signature would repeat its 300 characters.
def run_many(
    scene: Scene,
    listing: Listing,
    *,
    omega: "ArrayLike | None" = None,
    moments: "ArrayLike | None" = None,
    coefficients: "ArrayLike | None" = None,
    torque_constant: "ArrayLike | None" = None,
    step_size: "ArrayLike | None" = None,
    lipschitz: "ArrayLike" = 500.0,
    may_stop: bool = True,
    velocity: bool = False,
    at: Sequence[SupportsIndex] | None = None,
    threads: SupportsIndex = 1,
    effort: Number = 1.0,
    progress: bool = False,
) -> ProgramEnsemble:
    """Run a compiled program of the thesis for n bodies in one call.

    Each result is bit-for-bit that of `run_program`.

    Parameters
    ----------
    scene : Scene
        The source of each value for which no array is specified.
    listing : Listing
        The program with its active defects, readings and conjectures.
    omega, moments, coefficients, torque_constant : array_like, shape (n, 3) or (3,), optional
        Initial angular velocities (rad/s), moments of inertia (kg m2) or Euler coefficients A, B,
        C, and constant torques (N m; rad/s2 for bodies specified by coefficients). At most one of
        `moments` and `coefficients` may be specified.
    step_size, lipschitz : array_like, shape (n,) or one number, optional
        Step sizes (s) and Lipschitz constants of the stop test (1/s).
    may_stop : bool
        Whether the stop test, which only the Runge-Kutta program has, may end runs.
    velocity : bool
        Whether to return the translational velocities.
    at : sequence of int, optional
        The steps whose results are returned, from 1, in any order; by default only the last.
    threads : int
        Number of threads; the results do not depend on it.
    effort : float
        Factor on the work limit. The work is bodies times steps times (1 + the number of sines and
        cosines in the torque).
    progress : bool
        Whether to show a progress bar in a terminal or notebook.

    Returns
    -------
    ProgramEnsemble
        The results of n bodies, n the number of rows in the longest array. An array with one row
        applies to all bodies.

    Raises
    ------
    InputError
        If `run_program` would reject a body (the message names its row), the arrays differ in
        their numbers of rows, the results do not fit in memory, or the work limit is exceeded.
    NotBuiltError
        If the extension is not built.

    Examples
    --------
    >>> import numpy as np
    >>> from pyharness import case_scene, run_many, subset
    >>> starts = np.array([[0.0, 1.0, 10.0], [0.0, 2.0, 5.0]])
    >>> found = run_many(case_scene(2), subset("runge-kutta", "corrected"), omega=starts)
    >>> np.round(found.omega[:, -1], 6) + 0.0
    array([[-0.958924,  0.283662, 10.      ],
           [ 1.196944, -1.602287,  5.      ]])
    """
    kind = only_one({"moments": moments, "coefficients": coefficients})
    checked_scene(scene, any_axes=bool(kind))
    checked_listing(listing)
    may_stop, velocity = boolean("may_stop", may_stop), boolean("velocity", velocity)
    threads = threads_of(threads)
    law = scene.law
    if not kind:
        moments, coefficients = scene.moments, scene.coefficients
        kind = "coefficients" if moments is None else "moments"
    by_moments = kind == "moments"
    bodies, rule = (moments, ABOVE_ZERO) if by_moments else (coefficients, FINITE)
    omega = scene.omega if omega is None else omega
    torque_constant = law.constant if torque_constant is None else torque_constant
    step_size = scene.step_size if step_size is None else step_size
    inputs = {
        kind: rows_of(kind, bodies, 3, rule=rule),
        "omega": rows_of("omega", omega, 3, rule=FINITE),
        "torque_constant": rows_of("torque_constant", torque_constant, 3, rule=FINITE),
        "step_size": rows_of("step_size", step_size, rule=ABOVE_ZERO),
        "lipschitz": rows_of("lipschitz", lipschitz, rule=FROM_ZERO),
    }
    n = count_bodies(inputs)
    inputs["body"] = inputs.pop(kind)
    if law.frame == "space" and inputs["torque_constant"].any():
        raise InputError(SPACE_TORQUE)
    with np.errstate(over="ignore"):
        ends = np.isfinite(inputs["step_size"] * scene.steps)
    if not ends.all():
        raise InputError(
            f"step_size[{int(np.argmin(ends))}] times steps is not finite; use fewer or "
            "smaller steps"
        )
    check_bodies(scene, listing.program, n, effort)
    wanted = _steps(at, scene.steps)
    if n * len(wanted) > most_steps():
        raise InputError(
            f"at: {len(wanted)} rows for each of {n} bodies; allowed: {most_steps()} rows in "
            "all, which this machine's memory can hold"
        )
    first = np.zeros((1, 3))
    if listing.has("initial-torque"):
        cards = card_torque(scene) if by_moments else None
        if cards is None:
            listing = replace(listing, conjectures=listing.conjectures - {"initial-torque"})
        else:
            with np.errstate(over="ignore"):
                first = np.array(cards) / inputs["body"]
    inputs["first"] = first
    with bar_of_bodies(boolean("progress", progress)):
        expect_bodies(n)
        return _run(scene, listing, by_moments, inputs, n, wanted, may_stop, velocity, threads)


def _run(
    scene: Scene, listing: Listing, by_moments: bool, inputs: dict[str, Array], n: int,
    wanted: NDArray[np.int32], may_stop: bool, velocity: bool, threads: int,
) -> ProgramEnsemble:  # fmt: skip
    """Run a program; `inputs` has arrays by name, with "body" for moments or coefficients."""
    program = extension().run_programs
    one_step_size = bool((inputs["step_size"] == inputs["step_size"].flat[:1]).all())
    rows = (spread(each, n) for each in inputs.values())
    omega, constant, step_size, lipschitz, body, first = rows
    computes_velocity = velocity or stop_reads_velocity(listing, may_stop)
    prints_ier = listing.program != "runge-kutta"
    # The kernel needs at least one requested step.
    at = np.unique(wanted) if wanted.size else np.full(1, scene.steps, dtype=np.int32)
    back = np.searchsorted(at, wanted)
    # Bodies are the first axis, so that transposes are the kernel's column-major arrays.
    omega_rows = np.full((n, at.size, 3), np.nan)
    velocity_rows = np.full((n * velocity, at.size, 3), np.nan)
    times = np.full((1 if one_step_size else n, at.size), np.nan)
    ier = np.full((n * prints_ier, at.size), _NOT_REACHED, dtype=np.int32)
    n_rows, status, stop_variable = (np.zeros(n, dtype=np.int32) for _ in range(3))
    quotient = np.full(n, np.nan)
    law = scene.law
    waves = columns(law.sines), columns(law.cosines)

    def some(part: slice, given_up: NDArray[np.int32]) -> None:
        program(
            PROGRAMS.index(listing.program) + 1, listing.flags, by_moments, body[part].T,
            omega[part].T, scene.masses, scene.forces, constant[part].T, law.rate, first[part].T,
            law.varies, *waves, step_size[part], scene.steps, lipschitz[part], may_stop,
            computes_velocity, given_up, at, omega_rows[part].T,
            velocity_rows[part if velocity else slice(0)].T,
            times[slice(None) if one_step_size else part].T,
            ier[part if prints_ier else slice(0)].T, n_rows[part], status[part],
            stop_variable[part], quotient[part],
        )  # fmt: skip

    for_each_piece(some, n, threads, list(_pieces(n, scene.steps, threads)))
    return ProgramEnsemble(
        at=wanted,
        omega=omega_rows[:, back],
        velocity=velocity_rows[:, back] if velocity else None,
        recorded_time=times[0, back] if one_step_size else times[:, back],
        n_rows=n_rows,
        status=status.astype(np.int8),
        stop_variable=stop_variable.astype(np.int8),
        stop_quotient=quotient,
        ier=ier[:, back] if prints_ier else None,
    )


def _pieces(n: int, steps: int, threads: int) -> Iterator[slice]:
    size = n
    if threads > 1:
        fair = -(-n // (_PIECES * threads))
        size = max(fair, _LEAST_WORK // steps, 1)
        # A multiple of LANE_COUNT, the number of bodies that the kernel integrates at once.
        size = -(-size // Blocks.LANE_COUNT) * Blocks.LANE_COUNT
    for begin in range(0, n, max(1, size)):
        yield slice(begin, min(n, begin + size))


def _steps(at: Sequence[SupportsIndex] | None, steps: int) -> NDArray[np.int32]:
    if at is None:
        return np.array([steps], dtype=np.int32)
    found = [integer("at", each) for each in number_list("at", at, "allowed: a list of steps")]
    for each in found:
        if not 1 <= each <= steps:
            raise InputError(f"at: {each}; allowed: steps from 1 to {steps}")
    return np.array(found, dtype=np.int32)
